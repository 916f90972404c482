"""What Hydra composes from: the schema of a command, the user's folder, and `conf/`.

The user's folder (`--config-dir`) is searched before the program's, so that a file of the user's wins over ours of the
same name.
"""

import functools
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from hydra import compose, initialize_config_dir
from hydra.core.config_search_path import ConfigSearchPath, SearchPathQuery
from hydra.core.config_store import ConfigStore
from hydra.core.global_hydra import GlobalHydra
from hydra.core.plugins import Plugins
from hydra.plugins.search_path_plugin import SearchPathPlugin
from omegaconf import DictConfig, OmegaConf

from epuckhebb.config.errors import explain, wrong_of
from epuckhebb.config.schema import SCHEMAS, structured
from epuckhebb.config.source import Choices
from epuckhebb.runtime import ConfigError, data_folder

VERSION_BASE = "1.3"  # of Hydra
SEARCH_PATH = "hydra.searchpath="
USERS = "command-line"  # who brings the user's folder, as Hydra names it for its own --config-dir
NULL = "None"  # the choice of a group of which none was made
BRIGHT, DIM = 1.0, 0.1  # the light of the two experiments


class _SearchPath(SearchPathPlugin):
    """Lets Hydra look into its ConfigStore and the user's folder before `conf/`, and read both by `Choices`."""

    folder: Path | None = None

    def manipulate_search_path(self, search_path: ConfigSearchPath) -> None:
        """Change where Hydra looks."""
        for place in search_path.get_path():
            if place.path == str(data_folder("conf")):
                place.path = f"{Choices.scheme()}://{place.path}"
        if self.folder is not None:
            search_path.prepend(USERS, f"{Choices.scheme()}://{self.folder}", SearchPathQuery(provider="main"))
        search_path.prepend("schema", "structured://")  # under the name that Hydra gives it at the end


class Composed(NamedTuple):
    """A configuration as Hydra composes it, what Hydra keeps for itself, and the choice of each group."""

    cfg: DictConfig
    hydra: DictConfig
    choices: dict[str, str]


def hydra_composition(command: str, words: Sequence[str], config_dir: str | None = None) -> Composed:
    """A configuration as Hydra composes it, which may be changed; one without files of the user's is composed once.

    command, words: as of `hydra_arguments`.
    """
    if config_dir is not None or any(SEARCH_PATH in word for word in words):
        return _composed(command, tuple(words), config_dir)
    found = _composed_once(command, tuple(words), None)
    return found._replace(cfg=found.cfg.copy())


def _composed(command: str, words: tuple[str, ...], config_dir: str | None) -> Composed:
    try:
        with catalogue(command, config_dir), initialize_config_dir(str(data_folder("conf")), version_base=VERSION_BASE):
            cfg = compose(command, list(words), return_hydra_config=True)
    except ConfigError:
        raise
    except Exception as error:  # what damaged files may raise has no end
        raise ConfigError(f"{' '.join(wrong_of(words, error))}{': ' if words else ''}{explain(error)}") from error
    OmegaConf.set_struct(cfg, False)
    hydra = cfg.pop("hydra")
    return Composed(cfg, hydra, group_choices(hydra.runtime))


_composed_once = functools.lru_cache(maxsize=32)(_composed)


def group_choices(runtime: Any) -> dict[str, str]:
    """The choice of each group, from what Hydra notes of a composition."""
    return {str(group): str(choice) for group, choice in runtime.choices.items()}


@contextmanager
def catalogue(command: str, config_dir: str | None) -> Iterator[None]:
    """Time in which Hydra knows the schema of a command, the rows of tables, and the user's folder."""
    if config_dir is not None and not Path(config_dir).is_dir():
        raise ConfigError(f"--config-dir={config_dir} is no folder; give one with files such as scenario/mine.yaml")
    before = _SearchPath.folder
    composing = GlobalHydra.instance().hydra  # of a caller who composes with Hydra, or of the job at work
    _SearchPath.folder = None if config_dir is None else Path(config_dir).absolute()
    Plugins.instance().register(_SearchPath)
    Plugins.instance().register(Choices)
    if command in SCHEMAS:
        ConfigStore.instance().store(f"schema_{command}", structured(command))
    GlobalHydra.instance().clear()
    try:
        yield
    finally:
        _SearchPath.folder = before
        GlobalHydra.instance().clear()  # which is another instance now
        if composing is not None:
            GlobalHydra.instance().initialize(composing)


def _all_trials_s(*, _root_: Any) -> float:
    """The longest that the trials of a task can last [s]; that of ten usual ones if the task has no such numbers."""
    trials, *parts_s = (_root_.task.get(key) for key in ("trials", "time_out_s", "reward_s"))
    can_be = all(isinstance(value, int | float) and 0 < value < 1e5 for value in (trials, *parts_s))
    return trials * sum(parts_s) if can_be else 310.0  # the task refuses what cannot be


def _refuse_environment(*_: Any, _node_: Any) -> None:
    key = _node_._get_full_key(None)
    raise ConfigError(f"{key}: environment variables are not read by a configuration; write the value itself")


OmegaConf.register_new_resolver(
    "epuckhebb.by_experiment", lambda values, *, _root_: values[_root_.scenario.experiment], replace=True
)
OmegaConf.register_new_resolver(
    "epuckhebb.other_light", lambda light: DIM if light > (BRIGHT + DIM) / 2 else BRIGHT, replace=True
)
OmegaConf.register_new_resolver("epuckhebb.all_trials_s", _all_trials_s, replace=True)
# What is written down of a run would tell of its surroundings.
OmegaConf.register_new_resolver("oc.env", _refuse_environment, replace=True)
