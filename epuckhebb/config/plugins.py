"""A user's own Python: `FILE.py:NAME` in a configuration, what the file imports from its folder, and copies of all.

A file is loaded into a package of its own, whose folder is that of the file: it imports `helper.py` beside it by `from
. import helper`. So files in different folders may import helpers of one name, and neither gets the other's.
"""

import copy
import functools
import hashlib
import importlib
import itertools
import re
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

from epuckhebb.config import hand
from epuckhebb.controller.compiling.sources import (
    OWN_PACKAGE,
    is_installed,
    loaded_modules,
    loaded_sources,
    module_file,
    sources_elsewhere,
)
from epuckhebb.runtime import ConfigError, did_you_mean, user_path

OWN_CODE = "own_code"  # the folder of the copies in a run folder
_NAMED = re.compile(r"(.+\.py):([^\W\d]\w*)", re.DOTALL)
Base = TypeVar("Base")
_objects: dict[str, Any] = {}  # classes and functions that Python gave, by the text that stands for each


@dataclass(frozen=True)
class OwnFile:
    """A user's file that a configuration names.

    Attributes:
        path: The file.
        sources: The content of it and of each file that it imports from its folder, by its place there.
        elsewhere: The content of the user's files that these use from other folders, by their paths. A run has no copy.
    """

    path: Path
    sources: dict[str, bytes]
    elsewhere: dict[str, bytes]

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


def user_references(config: Any) -> Iterator[tuple[Any, str, Path, str]]:
    """All `FILE.py:NAME` in a configuration: the mapping that holds it, its key there, the file and the name."""
    for key, value in config.items():
        for part in value if isinstance(value, Sequence) and not isinstance(value, str) else [value]:
            if isinstance(part, Mapping):
                yield from user_references(part)
        if isinstance(value, str) and (match := _NAMED.fullmatch(value)):
            yield config, str(key), user_path(match[1], str(key)), match[2]


def place_files(config: Any) -> None:
    """Write down where the user's files are that a configuration names."""
    for part, key, path, name in list(user_references(config)):
        part[key] = f"{path.absolute()}:{name}"


def own_files(config: Any) -> dict[Path, OwnFile]:
    """The user's files that a configuration names, as they are now, by their paths as they stand there."""
    return {path: _user_file(path) for _, _, path, _ in user_references(config)}


def _user_file(file: Path) -> OwnFile:
    package, path = str(load(file, str(file)).__package__), file.resolve()
    beside = {one.relative_to(path.parent).as_posix(): source for one, source in loaded_sources(package).items()}
    return OwnFile(path, beside, sources_elsewhere(package))


def user_sources(config: Any) -> dict[str, str]:
    """The SHA-256, by path, of all the user's files that results of a configuration depend on."""
    own = {path: sha256 for own in own_files(config).values() for path, sha256 in own.sha256.items()}
    by_hand = (config.get("scenario") or {}).get("hand")
    return own if by_hand is None else {**own, str(by_hand): _sha256(hand.content(by_hand))}


def substitute_copies(values: dict[str, Any], run: Path, own_code: Mapping[str, Any]) -> dict[str, Any]:
    """Plain values of a run with its own copies in place of the user's files. own_code: of its provenance."""
    values = copy.deepcopy(values)
    for part, key, file, name in user_references(values):
        part[key] = f"{(run / own_code[str(file)]['copy']).absolute()}:{name}"
    scenario = values.get("scenario")
    if isinstance(scenario, dict) and scenario.get("hand") is not None:
        scenario["hand"] = str((run / hand.NAME).absolute())
    return values


def is_own(text: str) -> bool:
    """Whether a text of a configuration names something of the user's: FILE.py:NAME, or an object of Python."""
    return ".py:" in text or text in _objects


def object_text(thing: Any) -> str:
    """The text that stands for a class or a function of Python in a configuration of this process.

    Another one of the same name has a number after it: a function may make several.
    """
    name = getattr(thing, "__qualname__", type(thing).__name__)
    names = itertools.chain([name], (f"{name}_{number}" for number in itertools.count(2)))
    known = {text.rpartition(":")[2]: one for text, one in _objects.items()}
    text = f"{thing.__module__}:{next(one for one in names if known.get(one, thing) is thing)}"
    _objects[text] = thing
    return text


def object_named(text: str, key: str) -> Any:
    """What `FILE.py:NAME`, or a text of `object_text`, names; None if the file has no such name.

    key: names it in messages.
    """
    if text in _objects:
        return _objects[text]
    file, _, name = text.rpartition(":")
    return getattr(load(user_path(file, key), f"{key}={text}"), name, None)


def loaders(config: Any) -> list[Callable[[], ModuleType]]:
    """Functions that load the user's files that a configuration names, for another process."""
    paths = dict.fromkeys(path for _, _, path, _ in user_references(config))
    return [functools.partial(load, path, str(path)) for path in paths]


def class_named(text: str, base: type[Base], key: str) -> type[Base]:
    """The subclass of a base class that `FILE.py:NAME` names. key: whose value that is, for messages."""
    kind = object_named(text, key)
    if isinstance(kind, type) and issubclass(kind, base):
        return kind
    if text in _objects:
        raise ConfigError(f"{key} must be a subclass of {base.__name__}, or a function that makes one, got {kind!r}")
    file, _, name = text.rpartition(":")
    module = load(user_path(file, key), f"{key}={text}")
    known = [n for n, v in vars(module).items() if isinstance(v, type) and issubclass(v, base) and v is not base]
    hint = f"{', '.join(known) or 'none'}{did_you_mean(name, known)}"
    raise ConfigError(f"{key}={text}: it has no subclass {name} of {base.__name__}, but {hint}")


def load(file: Path, key: str) -> ModuleType:
    """The module of a user's file. After an edit of it, or of what it imports from its folder, it is another one.

    key: names the file in messages. A file that is not there, or cannot be imported, raises a ConfigError.
    """
    path = file.resolve()
    package = OWN_PACKAGE + _sha256(str(path).encode())[:16]
    name = f"{package}.{path.stem.replace('.', '_')}"  # a dot would mean a package
    if name in sys.modules and _is_unchanged(package):
        return sys.modules[name]
    if path.suffix != ".py" or not path.is_file():
        raise ConfigError(f"{key}: there is no Python file, FILE.py, at {file}")
    _unload(package)
    try:
        return _imported(path, package, name)
    except (Exception, SystemExit) as error:  # a file may even leave Python
        _unload(package)
        where = f"{place}," if (place := user_place(error)) else path
        why = f"{type(error).__name__}: {error}".replace(f"{package}.", "").replace(package, str(path.parent))
        raise ConfigError(f"{key}: {where} cannot be imported: {why}{_hint(error, path.parent)}") from error


def _imported(path: Path, package: str, name: str) -> ModuleType:
    """The module of a file in a package that is made for it."""
    spec = spec_from_file_location(name, path)
    assert spec is not None
    assert spec.loader is not None
    module, folder = module_from_spec(spec), ModuleType(package)
    folder.__path__ = [str(path.parent)]
    sys.modules |= {package: folder, name: module}
    importlib.invalidate_caches()
    known, is_off = set(sys.modules), sys.dont_write_bytecode
    sys.dont_write_bytecode = True  # it would serve for a file that is edited within the same second
    try:
        spec.loader.exec_module(module)
    finally:
        sys.dont_write_bytecode = is_off
    for other in sys.modules.keys() - known:
        file = module_file(sys.modules[other])
        if file and file.parent == path.parent and not other.startswith(OWN_PACKAGE) and not is_installed(file):
            raise ModuleNotFoundError(f"a run would have no copy of {file.name}", name=other)
    loaded_sources(package), sources_elsewhere(package)  # noted now, before anybody edits them
    return module


def _hint(error: BaseException, folder: Path) -> str:
    """What to write where a file imports one of its folder without a dot; nothing after another error."""
    name = str(getattr(error, "name", None)).partition(".")[0]
    is_beside = isinstance(error, ModuleNotFoundError) and any(map(Path.exists, (folder / name, folder / f"{name}.py")))
    return f"; write `from . import {name}`" if is_beside else ""


def _is_unchanged(package: str) -> bool:
    with suppress(OSError):
        return all(file.read_bytes() == source for file, source in loaded_sources(package).items())
    return False


def _unload(package: str) -> None:
    for name in loaded_modules(package):
        del sys.modules[name]


def user_place(error: BaseException) -> str:
    """The file of a user's and its line in which an error arose; "" if it arose elsewhere."""
    if isinstance(error, SyntaxError) and error.filename and error.lineno:
        return f"{error.filename}, line {error.lineno}"
    places = list(traceback.walk_tb(error.__traceback__))
    own = [place for place in places if str(place[0].f_globals.get("__name__")).startswith(OWN_PACKAGE)]
    return f"{own[-1][0].f_code.co_filename}, line {own[-1][1]}" if own else ""


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
