"""How Hydra finds files, and how it keeps what it has composed of them.

The user's folder (`--config-dir`) comes before the program's, so a file of the user's wins over ours of the same name.
Schemas, rows of tables, and scenarios that are named with their changes are no files; Hydra is given them like files.

A composition takes Hydra a tenth of a second and more, most of it for files that seldom change. So it is made without
the values that are given to single keys, kept, and given the values then, as Hydra would give them. What is kept is
found by the other overrides, by the content of every file on the search path, and by all versions.
"""

import copy
import functools
import hashlib
import itertools
import os
import pickle
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from secrets import token_hex
from typing import Any, cast

import hydra
from hydra._internal.config_loader_impl import ConfigLoaderImpl
from hydra._internal.core_plugins.file_config_source import FileConfigSource
from hydra._internal.sources_registry import SourcesRegistry
from hydra.core.config_search_path import ConfigSearchPath, SearchPathQuery
from hydra.core.object_type import ObjectType
from hydra.core.override_parser.types import Override
from hydra.core.plugins import Plugins
from hydra.plugins.config_source import ConfigResult
from hydra.plugins.search_path_plugin import SearchPathPlugin
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from epuckhebb.config import yaml_file
from epuckhebb.config.choices import OURS, choice_names, choice_of, found_by_hydra
from epuckhebb.config.overrides import parsed
from epuckhebb.config.schema import SCHEMAS, structured
from epuckhebb.config.words import known_keys
from epuckhebb.controller.compiling.kernel import cache_root
from epuckhebb.runtime import ConfigError, conf

USERS = "command-line"  # who brings the user's folder, as Hydra names it for its own --config-dir
OWN_SCHEME = "epuckhebb"  # of that folder, and of what is no file
_SCHEMA = "schema_"  # before the command, where a file of `conf/` names its schema
_OF_ROWS = ("adaptation", "change")  # groups of which the choices are rows of a table; each changes other groups, too
_VALUES_OF_HYDRA = ("hydra.run.dir", "hydra.sweep.dir")
_APART = re.compile(r"[+~]")  # of these the order counts
_MOST_FILES = 1000  # of a user's folder; of more, nothing is kept
_MOST_KEPT = 300  # files; all are removed then
_CHECKSUM = 32  # bytes


class _UsersFirst(SearchPathPlugin):
    """Puts the user's folder, and what is no file, before the program's."""

    folder: Path | None = None

    def manipulate_search_path(self, search_path: ConfigSearchPath) -> None:
        """See Hydra."""
        search_path.prepend(USERS, f"{OWN_SCHEME}://{self.folder or ''}", SearchPathQuery(provider="main"))


class _Users(FileConfigSource):
    """Has for Hydra the user's files, which are checked, schemas, rows of tables, and scenarios with changes."""

    @staticmethod
    def scheme() -> str:
        """See Hydra."""
        return OWN_SCHEME

    @property
    def _folders(self) -> list[Path]:
        return [*([Path(self.path)] if self.path else []), *OURS]

    def _found(self, config_path: str) -> DictConfig | None:
        group, _, choice = config_path.removesuffix(".yaml").partition("/")
        if group.startswith(_SCHEMA):
            return structured(group.removeprefix(_SCHEMA))
        return found_by_hydra(group, choice, self._folders)

    def load_config(self, config_path: str) -> ConfigResult:
        """See Hydra."""
        found = self._found(config_path)
        if found is not None:
            header = {"package": "_global_" if config_path.partition("/")[0] in _OF_ROWS else None}
            return ConfigResult(self.provider, self.path, found, header)
        file = Path(self.path, self._normalize_file_name(config_path))
        yaml_file.check(file, Path(self.path))
        group, _, choice = config_path.removesuffix(".yaml").partition("/")
        with suppress(OmegaConfBaseException):  # of what only Hydra can resolve
            choice_of(group, choice, self._folders)  # refuses a circle through choices of ours
        try:
            return super().load_config(config_path)
        except Exception as error:  # of a `# @package` that is none, for example
            raise ConfigError(f"{yaml_file.shown(file)}: {type(error).__name__}: {error}") from error

    def available(self) -> bool:
        """See Hydra."""
        return True

    def is_group(self, config_path: str) -> bool:
        """See Hydra."""
        return config_path in _OF_ROWS or bool(self.path and super().is_group(config_path))

    def is_config(self, config_path: str) -> bool:
        """See Hydra."""
        if config_path.startswith(_SCHEMA):  # which takes long to make
            return True
        return self._found(config_path) is not None or bool(self.path and super().is_config(config_path))

    def list(self, config_path: str, results_filter: ObjectType | None) -> list[str]:
        """See Hydra."""
        if config_path in _OF_ROWS and results_filter is not ObjectType.GROUP:
            return choice_names(config_path, self._folders)
        return super().list(config_path, results_filter) if self.path and super().is_group(config_path) else []


@contextmanager
def users_first(folder: str | None) -> Iterator[None]:
    """Time in which Hydra looks for files in this folder first."""
    for plugin in (_Users, _UsersFirst):
        Plugins.instance().register(plugin)
    _parse_files_once()
    before, _UsersFirst.folder = _UsersFirst.folder, None if folder is None else Path(folder).absolute()
    try:
        yield
    finally:
        _UsersFirst.folder = before


@functools.cache
def _parse_files_once() -> None:
    """From now on, let Hydra parse a file again only if its content has changed; it takes a third of a composition."""
    source_of_files: Any = SourcesRegistry.instance().resolve("file")  # Hydra has loaded this class twice
    read = source_of_files.load_config
    known: dict[tuple[str, str], tuple[bytes, ConfigResult]] = {}

    @functools.wraps(read)
    def load_config(source: FileConfigSource, config_path: str) -> ConfigResult:
        file = Path(source.path, source._normalize_file_name(config_path))
        try:
            content = file.read_bytes()
        except OSError:  # Hydra says so
            return cast(ConfigResult, read(source, config_path))
        place = (source.provider, str(file))
        if place not in known or known[place][0] != content:
            if len(known) >= _MOST_KEPT:
                known.clear()
            known[place] = content, read(source, config_path)
        return copy.deepcopy(known[place][1])

    source_of_files.load_config = load_config


def keep_compositions() -> None:
    """From now on, let Hydra 1.3 keep what it composes."""
    from hydra._internal.config_loader_impl import get_overrides_dirname  # Hydra 1.4 has none

    compose = ConfigLoaderImpl.load_configuration

    @functools.wraps(compose)
    def load_configuration(
        loader: ConfigLoaderImpl, config_name: str, overrides: list[str], run_mode: RunMode, *more: Any, **options: Any
    ) -> DictConfig:
        def whole(words: list[str]) -> DictConfig:
            return compose(loader, config_name, words, run_mode, *more, **options)

        state = _state(loader) if run_mode is RunMode.RUN and config_name in SCHEMAS else None
        if state is None or any(_APART.match(word) for word in overrides):
            return whole(overrides)
        words = parsed(overrides)
        values = [word for word in words if _is_value(config_name, word)]
        others = [str(word.input_line) for word in words if word not in values]  # in order: the last of a group counts
        cfg = _kept(hashlib.sha256(repr((state, config_name, others)).encode()).hexdigest(), lambda: whole(others))
        try:
            for word in values:
                OmegaConf.update(cfg, word.key_or_group, word.value())
        except OmegaConfBaseException:  # Hydra says why it cannot
            return whole(overrides)
        task, names = [word for word in words if not word.is_hydra_override()], cfg.hydra.job.config.override_dirname
        cfg.hydra.overrides.hydra = [word.input_line for word in words if word.is_hydra_override()]
        cfg.hydra.overrides.task = [word.input_line for word in task]
        cfg.hydra.job.override_dirname = get_overrides_dirname(task, names.exclude_keys, names.item_sep, names.kv_sep)
        cfg.hydra.runtime.cwd = str(Path.cwd())
        return cfg

    setattr(ConfigLoaderImpl, compose.__name__, load_configuration)


def _is_value(command: str, word: Override) -> bool:
    """Whether an override gives a value to one key, on which no choice of a file depends."""
    key = word.key_or_group
    plain = str(word.input_line).startswith(f"{key}=") and word.package is None and not word.is_sweep_override()
    if key.partition(".")[0] == "hydra":
        return plain and key in _VALUES_OF_HYDRA
    of_keys = "." in key or isinstance(word.value(), dict)  # a group is given settings, not a choice
    return plain and (of_keys or (key in known_keys(command) and key not in conf.groups(command)))


def _state(loader: ConfigLoaderImpl) -> str | None:
    """A digest of what any composition depends on besides its words; None where nothing can be kept."""
    state = hashlib.sha256(_versions())
    for source in loader.repository.get_sources():
        state.update(repr((source.scheme(), source.provider, source.path)).encode())
        if source.scheme() == "file" or (source.scheme() == OWN_SCHEME and source.path):
            walked = os.walk(source.path, followlinks=True)
            found = (Path(folder, name) for folder, _, names in walked for name in names if name.endswith(".yaml"))
            files = list(itertools.islice(found, _MOST_FILES + 1))
            if len(files) > _MOST_FILES:
                return None
            for file in sorted(files):
                state.update(str(file).encode())
                with suppress(OSError):  # of a file that nobody may need
                    state.update(hashlib.sha256(file.read_bytes()).digest())
    return state.hexdigest()


@functools.cache
def _versions() -> bytes:
    """What the program, Hydra and its plug-ins are in this process."""
    installed = sorted(file.name for file in Path(hydra.__file__).parents[1].glob("*.dist-info"))
    files = ((file, file.stat()) for file in sorted(Path(__file__).parents[1].rglob("*.py")))
    ours = [(str(file), known.st_size, known.st_mtime_ns) for file, known in files]
    return repr((sys.version, sys.platform, installed, ours)).encode()


def _kept(key: str, make: Callable[[], DictConfig]) -> DictConfig:
    """What is kept under this key; it is made, and kept, if there is nothing, or nothing whole."""
    try:
        folder = cache_root() / "composed"
        content = (folder / key).read_bytes()
        if hashlib.sha256(content[:-_CHECKSUM]).digest() == content[-_CHECKSUM:]:
            found: DictConfig = pickle.loads(content)
            return found
    except FileNotFoundError:
        pass
    except (OSError, RuntimeError):  # RuntimeError: no folder of the user is known
        return make()
    made = make()
    if made.hydra.searchpath or made.hydra.job.env_copy:  # it depends on other files, or on the environment
        return made
    with suppress(OSError, pickle.PicklingError):  # in such a worker, where a class is not what its name says
        content = pickle.dumps(made)
        folder.mkdir(parents=True, exist_ok=True)
        known = list(folder.iterdir())
        for file in known if len(known) >= _MOST_KEPT else ():
            file.unlink(missing_ok=True)
        beside = folder / f"{key}.{token_hex(4)}"
        beside.write_bytes(content + hashlib.sha256(content).digest())
        beside.replace(folder / key)
    return made
