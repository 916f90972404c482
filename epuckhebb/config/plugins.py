"""A user's own Python: `FILE.py:NAME` in a configuration, what the file imports from its folder, and copies of all.

A file is loaded into a package of its own, whose folder is that of the file. So files in different folders may import
helpers of one name, and neither gets the other's.
"""

import builtins
import copy
import hashlib
import importlib
import importlib.util
import re
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any, TypeVar

from epuckhebb.config import hand
from epuckhebb.controller.compiling.sources import OWN_PACKAGE, sources_elsewhere
from epuckhebb.runtime import ConfigError, did_you_mean, path_of

OWN_CODE = "own_code"  # the folder of the copies in a run folder
_NAMED = re.compile(r"(.+\.py):([^\W\d]\w*)", re.DOTALL)
Base = TypeVar("Base")


@dataclass(frozen=True)
class OwnFile:
    """A user's file that a configuration names.

    Attributes:
        path: The file.
        package: The name of the package that it is loaded into.
        sources: The content of it and of each file that it imports from its folder, by its place there.
        elsewhere: The content of the user's files that these use from other folders, by their paths. A run has no copy.
    """

    path: Path
    package: str
    sources: dict[str, bytes] = field(default_factory=dict)
    elsewhere: dict[str, bytes] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """The name of the file's module, in which a dot of the file's name would mean a package."""
        return f"{self.package}.{self.path.stem.replace('.', '_')}"

    @property
    def module(self) -> ModuleType:
        """The module of the file."""
        return sys.modules[self.name]

    @property
    def digest(self) -> str:
        """Twelve hexadecimal digits that name the content of all files, wherever they are."""
        return _sha256(repr(sorted((place, _sha256(source)) for place, source in self.sources.items())).encode())[:12]

    @property
    def copy(self) -> str:
        """The place of the file's copy in a run folder."""
        return f"{OWN_CODE}/{self.digest}/{self.path.name}"

    @property
    def copies(self) -> dict[str, bytes]:
        """The content of all copies by their place in a run folder."""
        return {f"{OWN_CODE}/{self.digest}/{place}": source for place, source in self.sources.items()}

    @property
    def sha256(self) -> dict[str, str]:
        """The SHA-256 of each file by its path."""
        beside = {str(self.path.parent / place): source for place, source in self.sources.items()}
        return {path: _sha256(source) for path, source in {**beside, **self.elsewhere}.items()}

    @property
    def is_unchanged(self) -> bool:
        """Whether all files are as they were loaded."""
        with suppress(OSError):
            return all((self.path.parent / place).read_bytes() == source for place, source in self.sources.items())
        return False


_loaded: dict[Path, OwnFile] = {}
_packages: dict[str, OwnFile] = {}


def own_references(config: Any) -> Iterator[tuple[Any, str, Path, str]]:
    """All `FILE.py:NAME` in a configuration: the mapping that holds it, its key there, the file and the name."""
    for key, value in config.items():
        for part in value if isinstance(value, Sequence) and not isinstance(value, str) else [value]:
            if isinstance(part, Mapping):
                yield from own_references(part)
        if isinstance(value, str) and (match := _NAMED.fullmatch(value)):
            yield config, str(key), path_of(match[1], str(key)), match[2]


def own_files(config: Any) -> dict[Path, OwnFile]:
    """The user's files that a configuration names, as they are now, by their paths as they stand there."""
    files = {path: load(path, str(path)) for _, _, path, _ in own_references(config)}
    return {path: replace(own, sources=dict(own.sources)) for path, own in files.items()}


def own_sources(config: Any) -> dict[str, str]:
    """The SHA-256, by path, of all the user's files that results of a configuration depend on."""
    own = {path: sha256 for own in own_files(config).values() for path, sha256 in own.sha256.items()}
    by_hand = (config.get("scenario") or {}).get("hand")
    return own if by_hand is None else {**own, str(by_hand): _sha256(hand.content(by_hand))}


def with_own_copies(values: dict[str, Any], run: Path, own_code: Mapping[str, Any]) -> dict[str, Any]:
    """Plain values of a run with its own copies in place of the user's files. own_code: of its provenance."""
    values = copy.deepcopy(values)
    for part, key, file, name in own_references(values):
        part[key] = f"{(run / own_code[str(file)]['copy']).absolute()}:{name}"
    scenario = values.get("scenario")
    if isinstance(scenario, dict) and scenario.get("hand") is not None:
        scenario["hand"] = str((run / hand.NAME).absolute())
    return values


def class_named(text: str, base: type[Base], key: str) -> type[Base]:
    """The subclass of a base class that `FILE.py:NAME` names. key: whose value that is, for messages."""
    file, _, name = text.rpartition(":")
    module = load(path_of(file, key), f"{key}={text}").module
    kind = getattr(module, name, None)
    if isinstance(kind, type) and issubclass(kind, base):
        return kind
    known = [n for n, v in vars(module).items() if isinstance(v, type) and issubclass(v, base) and v is not base]
    hint = f"{', '.join(known) or 'none'}{did_you_mean(name, known)}"
    raise ConfigError(f"{key}={text}: it has no subclass {name} of {base.__name__}, but {hint}")


def load(file: Path, key: str) -> OwnFile:
    """Load a user's file, unless it and all that it imports from its folder are loaded as they are now."""
    path = file.resolve()
    if path in _loaded and _loaded[path].is_unchanged:
        return _loaded[path]
    if path.suffix != ".py" or not path.is_file():
        raise ConfigError(f"{key}: there is no Python file, FILE.py, at {file}")
    own = OwnFile(path, "")
    try:
        own = OwnFile(path, OWN_PACKAGE + _sha256(str(path).encode() + path.read_bytes())[:16])
        _unload(own.package)
        _packages[own.package] = own
        importlib.invalidate_caches()
        importlib.import_module(own.name)
        for name, module in list(sys.modules.items()):
            if name.startswith(f"{own.package}."):
                own.elsewhere.update(sources_elsewhere(module))
    except (Exception, SystemExit) as error:  # a file may even leave Python
        _unload(own.package)
        why = f"{type(error).__name__}: {error}".replace(f"{own.package}.", "")
        where = f"{place}," if (place := own_place(error)) else path
        raise ConfigError(f"{key}: {where} cannot be imported: {why}") from error
    _loaded[path] = own
    return own


def _unload(package: str) -> None:
    for name in [name for name in sys.modules if name.partition(".")[0] == package]:
        del sys.modules[name]


def own_place(error: BaseException) -> str:
    """The file of a user's and its line in which an error arose; "" if it arose elsewhere."""
    if isinstance(error, SyntaxError) and error.filename and error.lineno:
        return f"{error.filename}, line {error.lineno}"
    places = list(traceback.walk_tb(error.__traceback__))
    own = [place for place in places if str(place[0].f_globals.get("__name__")).startswith(OWN_PACKAGE)]
    return f"{own[-1][0].f_code.co_filename}, line {own[-1][1]}" if own else ""


class _Finder(MetaPathFinder):
    """Finds the modules of the packages into which users' files are loaded, and notes their content."""

    def find_spec(self, name: str, path: Sequence[str] | None, _target: Any = None) -> ModuleSpec | None:
        """Where a module of such a package is."""
        package, _, inner = name.partition(".")
        if not package.startswith(OWN_PACKAGE):
            return None
        own = _packages.get(package)
        if own is None or not inner:  # numba names packages that were loaded when it compiled; it needs nothing of them
            spec = ModuleSpec(name, None, is_package=True)
            spec.submodule_search_locations = [str(own.path.parent)] if own else []
            return spec
        is_named = name == own.name
        found = importlib.util.spec_from_file_location(name, own.path) if is_named else PathFinder.find_spec(name, path)
        if found is not None and found.has_location:
            file = Path(str(found.origin))
            own.sources[file.relative_to(own.path.parent).as_posix()] = file.read_bytes()
            if isinstance(found.loader, SourceFileLoader):
                found.loader = _Loader(name, str(file))
        return found


class _Loader(SourceFileLoader):
    """Loads a user's file from the content that was noted, and lets it import other files of its folder."""

    def get_code(self, fullname: str) -> CodeType:
        """The code of the file as it is now; a compiled copy may be older."""
        own = _packages[fullname.partition(".")[0]]
        self.content = own.sources[Path(self.path).relative_to(own.path.parent).as_posix()]  # it names kernels
        code: CodeType = self.source_to_code(self.content, self.path)
        return code

    def exec_module(self, module: ModuleType) -> None:
        """Run it."""
        vars(module)["__builtins__"] = {**vars(builtins), "__import__": _import_in(module.__name__.partition(".")[0])}
        super().exec_module(module)


def _import_in(package: str) -> Callable[..., ModuleType]:
    """The `import` of a package's modules, which looks into its folder first."""

    def import_(
        name: str, given: Any = None, local: Any = None, fromlist: Sequence[str] | None = (), level: int = 0
    ) -> ModuleType:
        top = name.partition(".")[0]
        if level or not _is_beside(top, package):
            return builtins.__import__(name, given, local, fromlist or (), level)
        module = importlib.import_module(f"{package}.{name}")
        if not fromlist:
            return sys.modules[f"{package}.{top}"]
        return builtins.__import__(module.__name__, given, local, fromlist)

    return import_


def _is_beside(module: str, package: str) -> bool:
    """Whether a module is in the folder of a package; a folder without code is one only if no library has its name."""
    if module == __name__.partition(".")[0]:
        return False
    found = PathFinder.find_spec(module, [str(_packages[package].path.parent)])
    return found is not None and (found.has_location or importlib.util.find_spec(module) is None)


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


sys.meta_path.insert(0, _Finder())
