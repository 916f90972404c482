"""Composes a configuration with Hydra from the files of `conf/` and overrides, once or for many combinations."""

import functools
import itertools
import os
import re
from collections.abc import Callable, Iterator
from importlib.metadata import version
from pathlib import Path
from typing import Any

from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf, flag_override
from omegaconf.errors import OmegaConfBaseException

from epuckhebb.config.hydra_cache import OWN_SCHEME, keep_compositions, users_first
from epuckhebb.config.names import resolve_names, world_name
from epuckhebb.config.overrides import parsed, with_names_compared
from epuckhebb.config.schema import SCHEMAS, Config, Plain, plain, typed
from epuckhebb.config.stored import value_as_declared
from epuckhebb.config.words import check_words, explain
from epuckhebb.runtime import ConfigError, data_folder

IS_HYDRA_1_4 = int(version("hydra-core").split(".")[1]) >= 4
BRIGHT, DIM = 1.0, 0.1  # the light of the two experiments
STAMP = "EPUCKHEBB_STAMP"  # environment variable that conf/ names run folders with
_ALONE = ("genome", "seed", "repeats", "threads")  # keys on which nothing else in a configuration depends, unless:
_REFERENCE = re.compile(rf"\$\{{[^}}]*\b({'|'.join(_ALONE)})\b")
VERSION_BASE: dict[str, Any] = {} if IS_HYDRA_1_4 else {"version_base": "1.3"}  # from 1.4 on it is warned about
if not IS_HYDRA_1_4:  # of which the inside still changes: it composes anew each time
    keep_compositions()


def load(schema: type[Config], overrides: list[str], config_dir: str | None = None) -> Config:
    """The checked configuration of a command, that of the schema: `conf/`, the user's folder and overrides as typed."""
    return typed(composed(schema.command, overrides, config_dir), schema)


def swept_values(overrides: list[str], config_dir: str | None = None) -> dict[str, str]:
    """For each key the values that a named sweep of `evaluate` gives it; empty if the overrides name none."""
    params = _composed("evaluate", overrides, config_dir)[1].sweeper.params
    return {str(key): str(values) for key, values in (params or {}).items()}


def composed(command: str, overrides: list[str], config_dir: str | None = None) -> DictConfig:
    """The configuration that a command would run with these overrides, all names in it."""
    cfg, hydras, folders = _composed(command, overrides, config_dir)
    return resolve_names(cfg, hydras.runtime.choices, folders)


def _composed(command: str, overrides: list[str], config_dir: str | None) -> tuple[DictConfig, DictConfig, list[Path]]:
    """A configuration as Hydra composes it, what Hydra keeps for itself, and where it looked for files."""
    check_words(command, overrides, config_dir)
    overrides = list(map(with_names_compared, overrides))
    GlobalHydra.instance().clear()
    try:
        with users_first(config_dir), initialize_config_dir(str(data_folder("conf")), **VERSION_BASE):
            cfg = compose(command, overrides, return_hydra_config=True)
    except (HydraException, OmegaConfBaseException) as error:
        raise ConfigError(explain(error)) from error
    with flag_override(cfg, ["struct", "readonly"], [False, False]):
        hydras = cfg.pop("hydra")
    return cfg, hydras, _folders_of(hydras.runtime)


def of_job(command: str, cfg: DictConfig, runtime: Any) -> Any:
    """The checked configuration of a job, with all names in it. cfg, runtime: what Hydra composed, and notes of it."""
    return typed(resolve_names(cfg, runtime.choices, _folders_of(runtime)), SCHEMAS[command])


def _folders_of(runtime: Any) -> list[Path]:
    """Where Hydra looks for files."""
    sources = unresolved(runtime.config_sources)
    return [Path(source["path"]) for source in sources if source["schema"] in ("file", OWN_SCHEME) and source["path"]]


def unresolved(node: Any) -> Any:
    """What Hydra notes, to the letter: a `${...}` in a folder's name refers to nothing."""
    return OmegaConf.to_container(node, resolve=False)


def _world(*, _root_: DictConfig) -> str:
    """The world of a run, for the name of its folder."""
    runtime = _root_.hydra.runtime
    own = OmegaConf.create({key: _root_._get_node(key) for key in _root_ if key != "hydra"})
    return world_name(own, runtime.choices, _folders_of(runtime))


def _environment(*_: Any, _node_: Any) -> None:
    key = _node_._get_full_key(None)
    raise ConfigError(f"{key}: environment variables are not read by a configuration; write the value itself")


_register: Any = OmegaConf.register_resolver if IS_HYDRA_1_4 else OmegaConf.register_new_resolver  # its name changed
_register("epuckhebb.world", _world, replace=True)
_register("epuckhebb.stamp", lambda: os.environ[STAMP], replace=True)
_register("epuckhebb.by_experiment", lambda values, *, _root_: values[_root_.scenario.experiment], replace=True)
_register("epuckhebb.other_light", lambda light: DIM if light > (BRIGHT + DIM) / 2 else BRIGHT, replace=True)
_register("oc.env", _environment, replace=True)  # what is written down of a run would tell what its environment holds


def combinations(
    command: str,
    fixed: list[str],
    choices: dict[str, list[str]],
    config_dir: str | None,
    validate_shared: Callable[[Plain, Callable[[], Any]], object] = lambda _values, _load: None,
) -> Iterator[tuple[list[str], Plain]]:
    """Every combination of the choices (as from `alternatives`), as overrides and as a configuration of plain values.

    A genome, a seed and the like are put into the plain values of what differs in nothing else. validate_shared: is
    given these values of each configuration, and a function that makes the checked configuration of them. fixed: the
    overrides that all have.
    """

    @functools.cache
    def shared(words: tuple[str, ...]) -> tuple[Plain, bool]:
        """A configuration, and whether something in it refers to a genome, a seed or the like."""
        cfg = composed(command, [*fixed, *words], config_dir)
        config = plain(cfg)
        validate_shared(config, functools.partial(typed, cfg, SCHEMAS[command]))
        return config, bool(_REFERENCE.search(str(unresolved(cfg))))

    @functools.cache
    def of_type(override: str) -> Plain:
        """A key and its value, of the type that the schema declares."""
        (word,) = parsed([override])
        key = word.key_or_group
        try:
            return {key: value_as_declared(key, word.value(), command)}
        except OmegaConfBaseException as error:
            raise ConfigError(explain(error)) from error

    for overrides in itertools.product(*choices.values()):
        alone = [word for word in overrides if word.partition("=")[0] in _ALONE and "${" not in word]
        config, refers = shared(tuple(word for word in overrides if word not in alone))
        if refers:
            config = shared(overrides)[0]
        else:
            for override in alone:
                config = {**config, **of_type(override)}
        yield list(overrides), config
