"""A user's own Python: `FILE.py:NAME` in a configuration, all files that this file imports, and copies of them.

A file is loaded as part of a package of its own, together with the user's files that it imports. So files in different
folders may import helpers of one name, and neither finds the other's. Which files are the user's is decided by where
they are: all but those of Python, of installed packages and of this program.
"""

import builtins
import hashlib
import importlib
import importlib.util
import re
import sys
import traceback
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from types import CodeType, ModuleType
from typing import Any, TypeVar

from epuckhebb.config import hand
from epuckhebb.controller.compiling.sources import OWN_PACKAGE, is_installed
from epuckhebb.runtime import ConfigError, did_you_mean, path_of

# Keys whose value may be FILE.py:NAME.
OWN_CODE_KEYS = (
    "hebbian.rule",
    "fitness.function",
    "network.wiring",
    "optimizer.algorithm",
    "flock.coupling",
)  # FILE.py:NAME
OWN_CODE = "own_code"  # of the copies in a run folder
_NAMED = re.compile(r"(.+\.py):([^\W\d]\w*)", re.DOTALL)
_US = __name__.partition(".")[0]
Base = TypeVar("Base")


@dataclass(frozen=True)
class OwnFile:
    """A user's file that a configuration names.

    Attributes:
        file: The file.
        package: The name of the package that it is loaded in.
        sources: For it and each of the user's files that it imports: its place in a folder from which all can be loaded
            again, where it is, and its content.
    """

    file: Path
    package: str
    sources: dict[str, tuple[Path, bytes]] = field(default_factory=dict)

    @property
    def module(self) -> ModuleType:
        """The module of the file."""
        return sys.modules[f"{self.package}.{_stem(self.file)}"]

    @property
    def digest(self) -> str:
        """Twelve hexadecimal digits that name the content of all files, wherever they are."""
        parts = sorted((place, _sha256(content)) for place, (_, content) in self.sources.items())
        return _sha256(repr(parts).encode())[:12]

    @property
    def copy(self) -> str:
        """The place of the file's copy in a run folder."""
        return f"{OWN_CODE}/{self.digest}/{self.file.name}"

    @property
    def copies(self) -> dict[str, bytes]:
        """The content of all copies by their place in a run folder."""
        return {f"{OWN_CODE}/{self.digest}/{place}": content for place, (_, content) in self.sources.items()}

    @property
    def sha256(self) -> dict[str, str]:
        """The SHA-256 of each file by its path."""
        return {str(path): _sha256(content) for path, content in self.sources.values()}

    @property
    def is_unchanged(self) -> bool:
        """Whether all files are as they were loaded."""
        with suppress(OSError):
            return all(path.read_bytes() == content for path, content in self.sources.values())
        return False


_loaded: dict[Path, OwnFile] = {}  # by where the named file is
_packages: dict[str, OwnFile] = {}  # by the name of the package


def own_references(config: Any) -> Iterator[tuple[Any, str, Path, str]]:
    """All `FILE.py:NAME` in a configuration: the mapping that holds it, its key there, the file and the name."""
    for key, value in config.items():
        several = value if isinstance(value, Sequence) and not isinstance(value, str) else [value]
        for part in several:
            if isinstance(part, Mapping):
                yield from own_references(part)
        if several is value:
            continue
        if isinstance(value, str) and (found := _NAMED.fullmatch(value)):
            yield config, str(key), path_of(found[1], str(key)), found[2]


def own_files(config: Any) -> dict[Path, OwnFile]:
    """The user's files that a configuration names, as they are now, by their paths as they stand there."""
    loaded = {file: load(file, str(file)) for _, _, file, _ in own_references(config)}
    return {file: replace(own, sources=dict(own.sources)) for file, own in loaded.items()}


def own_sources(config: Any) -> dict[str, str]:
    """The SHA-256, by path, of all the user's files that results of a configuration depend on."""
    own = {path: sha256 for own in own_files(config).values() for path, sha256 in own.sha256.items()}
    return own | hand.source(config)


def class_named(text: str, base: type[Base], key: str) -> type[Base]:
    """The subclass of a base class (one that `epuckhebb` has) that `FILE.py:NAME` names. key: whose value that is."""
    file, _, name = text.rpartition(":")
    module = load(path_of(file, key), f"{key}={text}").module
    kind = getattr(module, name, None)
    if isinstance(kind, type) and issubclass(kind, base):
        return kind
    what = base.__name__.lower()
    there = [n for n, v in vars(module).items() if isinstance(v, type) and issubclass(v, base) and v is not base]
    raise ConfigError(
        f"{key}={text}: {file} has no {what} {name}, that is a subclass of epuckhebb.{base.__name__}; "
        + (f"it has {', '.join(there)}" if there else "it has none at all")
        + did_you_mean(name, there)
    )


def load(file: Path, key: str) -> OwnFile:
    """Load a user's file, unless it and all of the user's that it imports are loaded as they are now."""
    place = file.resolve()
    if place in _loaded and _loaded[place].is_unchanged:
        return _loaded[place]
    if not file.is_file():
        raise ConfigError(f"{key}: there is no file {file}")
    if file.suffix != ".py":
        raise ConfigError(f"{key}: {file} is no Python file; its name must end in .py")
    try:
        content = place.read_bytes()
    except OSError as error:
        raise ConfigError(f"{key}: {file} cannot be read: {error.strerror}") from error
    own = OwnFile(place, OWN_PACKAGE + _sha256(str(place).encode() + content)[:16])
    _unload(own.package)
    _packages[own.package] = own
    importlib.invalidate_caches()
    try:
        importlib.import_module(f"{own.package}.{_stem(place)}")
    except Exception as error:
        _unload(own.package)
        where = _where(error, own) or str(file)
        why = str(error).replace(f"{own.package}.", "")
        raise ConfigError(f"{key}: {where} cannot be imported: {type(error).__name__}: {why}") from error
    _loaded[place] = own
    return own


def _unload(package: str) -> None:
    _packages.pop(package, None)
    for name in [name for name in sys.modules if name.partition(".")[0] == package]:
        del sys.modules[name]


def _where(error: BaseException, own: OwnFile) -> str:
    """The user's file and the line in which an error arose; nothing if it is in none."""
    if isinstance(error, SyntaxError) and error.filename and error.lineno:
        return f"{error.filename}, line {error.lineno},"
    files = {str(path) for path, _ in own.sources.values()}
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if frame.filename in files]
    return f"{frames[-1].filename}, line {frames[-1].lineno}," if frames else ""


class _Finder(MetaPathFinder):
    """Finds the modules of the packages in which users' files are loaded."""

    def find_spec(self, name: str, path: Sequence[str] | None, _target: Any = None) -> ModuleSpec | None:
        """Where a module of such a package is."""
        package, _, inner = name.partition(".")
        if not package.startswith(OWN_PACKAGE):
            return None
        own = _packages.get(package)
        if own is None or not inner:  # numba names modules of kernels on disk; it needs nothing of them
            return ModuleSpec(name, None, is_package=True)
        if inner == _stem(own.file):
            return importlib.util.spec_from_file_location(name, own.file, loader=_Source(name, str(own.file)))
        found = PathFinder.find_spec(name, path) if "." in inner else _find(inner, own)
        if found is None:
            return None
        if not found.has_location or found.origin is None:  # a folder without code
            spec = ModuleSpec(name, None, is_package=True)
            spec.submodule_search_locations = list(found.submodule_search_locations or [])
            return spec
        if isinstance(found.loader, SourceFileLoader):
            found.loader = _Source(name, found.origin)
        else:  # a compiled file
            own.sources[_place(name, found.origin)] = Path(found.origin), Path(found.origin).read_bytes()
        return importlib.util.spec_from_file_location(
            name, found.origin, loader=found.loader, submodule_search_locations=found.submodule_search_locations
        )


class _Source(SourceFileLoader):
    """Loads a user's file from its text, which is kept, and lets it import other files of the user's."""

    def get_code(self, fullname: str) -> CodeType:
        """The code of the file as it is now; a compiled copy may be older."""
        self.content = content = self.get_data(self.path)  # by which kernels are named
        _packages[fullname.partition(".")[0]].sources[_place(fullname, self.path)] = Path(self.path), content
        code: CodeType = self.source_to_code(content, self.path)
        return code

    def exec_module(self, module: ModuleType) -> None:
        """Run it."""
        package = module.__name__.partition(".")[0]

        def import_(
            name: str, given: Any = None, local: Any = None, fromlist: Sequence[str] | None = (), level: int = 0
        ) -> ModuleType:
            own, top = _packages.get(package), name.partition(".")[0]
            if level or own is None or not (f"{package}.{top}" in sys.modules or _find(top, own)):
                return builtins.__import__(name, given, local, fromlist or (), level)
            if fromlist:
                return builtins.__import__(f"{package}.{name}", given, local, fromlist)
            importlib.import_module(f"{package}.{name}")
            return sys.modules[f"{package}.{top}"]

        vars(module)["__builtins__"] = {**vars(builtins), "__import__": import_}
        super().exec_module(module)


def _find(name: str, own: OwnFile) -> ModuleSpec | None:
    """Where a module of the user's is that a user's file imports: beside it first; None for one of a library."""
    if name == _US or name in sys.builtin_module_names:
        return None
    found = PathFinder.find_spec(name, [str(own.file.parent)])
    if found is None or not found.has_location:
        with suppress(ValueError):  # of a module that says nothing of itself
            found = importlib.util.find_spec(name) or found
    if found is None:
        return None
    folders = found.submodule_search_locations or ([found.origin] if found.origin and found.has_location else [])
    is_users = folders and not any(is_installed(Path(folder)) for folder in folders)
    return found if is_users else None


def _stem(file: Path) -> str:
    """The name of a file's module."""
    return file.stem.replace(".", "_")


def _place(module: str, path: str) -> str:
    """Where the copy of a module's file belongs, so that it is found there under the same name."""
    _, *folders, last = module.split(".")
    file = Path(path)
    if file.stem == "__init__":
        return "/".join([*folders, last, file.name])
    return "/".join([*folders, file.name])


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


sys.meta_path.insert(0, _Finder())
