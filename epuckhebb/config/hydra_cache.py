"""How Hydra reads files: the user's are checked first and win, and what it does again to the same result is done once.

For each job of a multirun Hydra parses some fifteen small YAML files, and for each of them it lists all choices, which
only an interpolation in a list of defaults needs. That is nearly half of the time that a composition takes. Here a text
is parsed once by a process, and the list is made where it is needed. A Hydra whose insides are others is left as it is.

The user's folder (`--config-dir`) comes before the program's, so a file of the user's wins over ours of the same name.
Before both comes what is no file for Hydra: changes of the world, and scenarios that are named with their changes.
"""

import copy
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from hydra._internal import config_repository, defaults_list
from hydra.core.config_search_path import ConfigSearchPath, SearchPathQuery
from hydra.core.object_type import ObjectType
from hydra.core.plugins import Plugins
from hydra.plugins.config_source import ConfigResult, ConfigSource
from hydra.plugins.search_path_plugin import SearchPathPlugin
from omegaconf import DictConfig, OmegaConf

from epuckhebb.config import yaml_file
from epuckhebb.config.choices import OURS, choice_names, found_by_hydra
from epuckhebb.runtime.errors import ConfigError

_FILE, _PACKAGE = "file", "pkg"  # where files are: in a folder, or in an installed package, whose files do not change
_CHANGES = "change"  # the scheme of what is no file for Hydra, and the group of changes
_OURS = "main"  # who brings the program's folder
USERS = "command-line"  # who brings the user's folder, as Hydra names it for its own --config-dir
_parsed: dict[tuple[object, ...], Any] = {}

Load = Callable[[Any, str], Any]
Choices = Callable[[Any, Any, bool], Any]


class _UsersFirst(SearchPathPlugin):
    """Puts the user's folder before the program's, and what is no file before both."""

    folder: Path | None = None

    def manipulate_search_path(self, search_path: ConfigSearchPath) -> None:
        """See Hydra."""
        if self.folder is not None:
            search_path.prepend(USERS, f"file://{self.folder}", SearchPathQuery(provider=_OURS))
        search_path.prepend(_OURS, f"{_CHANGES}://{self.folder or ''}")


class _Changes(ConfigSource):
    """Has for Hydra the changes of the world, and the scenarios with changes; its path is the user's folder."""

    @staticmethod
    def scheme() -> str:
        """See Hydra."""
        return _CHANGES

    @property
    def _folders(self) -> list[Path]:
        return [*([Path(self.path)] if self.path else []), *OURS]

    def _found(self, config_path: str) -> DictConfig | None:
        group, _, choice = config_path.removesuffix(".yaml").partition("/")
        return found_by_hydra(group, choice, self._folders)

    def load_config(self, config_path: str) -> ConfigResult:
        """See Hydra."""
        header = {"package": "_global_" if config_path.startswith(f"{_CHANGES}/") else None}
        found = self._found(config_path)
        assert found is not None  # Hydra asked `is_config`
        return ConfigResult(self.provider, self.path, found, header)

    def available(self) -> bool:
        """See Hydra."""
        return True

    def is_group(self, config_path: str) -> bool:
        """See Hydra."""
        return config_path == _CHANGES

    def is_config(self, config_path: str) -> bool:
        """See Hydra."""
        return self._found(config_path) is not None

    def list(self, config_path: str, results_filter: ObjectType | None) -> list[str]:
        """See Hydra."""
        is_here = config_path == _CHANGES and results_filter is not ObjectType.GROUP
        return choice_names(_CHANGES, self._folders) if is_here else []


@contextmanager
def users_first(folder: str | None) -> Iterator[None]:
    """Time in which Hydra looks for files in this folder first."""
    for plugin in (_Changes, _UsersFirst):
        Plugins.instance().register(plugin)
    before, _UsersFirst.folder = _UsersFirst.folder, None if folder is None else Path(folder).absolute()
    try:
        yield
    finally:
        _UsersFirst.folder = before


def parse_once() -> None:
    """From now on, let Hydra compose without doing its work twice."""
    repository: Any = config_repository.ConfigRepository
    lists: Any = defaults_list
    if hasattr(repository, "load_config") and hasattr(repository, "_find_object_source"):
        repository.load_config = _remembering(repository.load_config)
    if hasattr(lists, "_create_interpolation_map"):
        lists._create_interpolation_map = _where_needed(lists._create_interpolation_map)


def _remembering(load: Load) -> Load:
    def load_config(repository: Any, config_path: str) -> Any:
        source = repository._find_object_source(config_path=config_path, object_type=ObjectType.CONFIG)
        if source is None or source.scheme() not in (_FILE, _PACKAGE):
            return load(repository, config_path)
        key: tuple[object, ...] = (source.scheme(), source.provider, source.path, config_path)
        file = Path(source.path, source._normalize_file_name(config_path))
        if source.scheme() == _FILE:  # a user may change it at any time
            key = (*key, file.read_bytes())
        if key not in _parsed:
            _parsed[key] = _checked(load, repository, config_path, source, file)
        return copy.deepcopy(_parsed[key])  # Hydra may put it as it is into what it composes, and change that

    return load_config


def _checked(load: Load, repository: Any, config_path: str, source: Any, file: Path) -> Any:
    """What Hydra makes of a file, which is checked before if it is not the program's."""
    if source.scheme() != _FILE or source.provider == _OURS:
        return load(repository, config_path)
    yaml_file.check(file, Path(source.path))
    try:
        return load(repository, config_path)
    except Exception as error:  # of a `# @package` that is none, for example
        raise ConfigError(f"{yaml_file.shown(file)}: {type(error).__name__}: {error}") from error


def _where_needed(choices: Choices) -> Choices:
    def create_interpolation_map(overrides: Any, entries: Any, self_added: bool) -> Any:
        if any(entry.is_interpolation() for entry in entries):
            return choices(overrides, entries, self_added)
        return OmegaConf.create()

    return create_interpolation_map
