"""Names a kernel by its sources: after any edit of an equation, ours or a user's, it is compiled anew."""

import functools
import hashlib
import platform
import re
import site
import sys
import sysconfig
from collections.abc import Iterable, Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numba
import numpy as np

OWN_PACKAGE = "epuckhebb_own_"  # begins the names of the packages in which users' files are loaded
_ROOT = Path(__file__).parents[2]
_SCIENCE = ("controller", "tmaze", "worlds", "adaptation", "flock")  # the packages that kernels are made of
_OURS = {*sys.stdlib_module_names, "epuckhebb", "numpy"}
_PLAIN = (bool, int, float, complex, str, bytes, tuple, list, dict)
_INSTALLED = [
    Path(folder).resolve()
    for folder in (
        *(sysconfig.get_path(name) for name in ("stdlib", "platstdlib", "purelib", "platlib")),
        *site.getsitepackages(),
        site.getusersitepackages(),
    )
]


class UnknownSourceError(ValueError):
    """A class was not loaded as FILE.py:NAME, so it is not known which files it depends on."""


def kernel_key(values: object) -> str:
    """Sixteen hexadecimal digits for a kernel. values: all that its parts are made from, as tuples and dataclasses."""
    text = re.sub(rf"{OWN_PACKAGE}\w+", "own", repr(values))  # wherever the user's file is
    packages = [name for name in _packages(values) if not name.startswith(OWN_PACKAGE)]
    if packages or " at 0x" in text or "<locals>" in text:  # what a function makes holds values of which no file tells
        raise UnknownSourceError(f"the sources of {', '.join(packages) or text} are not known")
    return _digest(_science(), user_code(values), text)


def user_code(values: object) -> str:
    """A digest of the users' files that the classes of these values are from, and of where these classes are."""
    digests = []
    for package in _packages(values):
        beside = loaded_sources(package).values() if package.startswith(OWN_PACKAGE) else ()
        held = (
            part
            for name, module in loaded_modules(package).items()
            for part in (name.partition(".")[2], *_held(module))
        )
        digests.append(_digest(*beside, *held, *(content for _, content in sorted(sources_elsewhere(package).items()))))
    return _digest(*sorted(digests), *(location for kind in _foreign(values) for location in _places(kind)))


def loaded_modules(package: str) -> dict[str, ModuleType]:
    """The modules of a package that are loaded, by their names, in the order of these."""
    return {name: module for name, module in sorted(sys.modules.items()) if name.partition(".")[0] == package}


def loaded_sources(package: str) -> dict[Path, bytes]:
    """The files of a package that are loaded. Their content is that of the first time that this process asked."""
    files = {module: getattr(module, "__file__", None) for module in loaded_modules(package).values()}
    return {Path(file): _imported_content(module, Path(file)) for module, file in files.items() if file}


def module_file(module: ModuleType | None) -> Path | None:
    """The file of a module; None without one, as of those that a library makes: `torch.ops` names `_ops.py` as its."""
    file = Path(getattr(module, "__file__", None) or "")
    return file.resolve() if file.is_file() else None


def sources_elsewhere(package: str) -> dict[str, bytes]:
    """The files of the user's that a package uses and that are neither in it nor installed, by their paths.

    Such as a helper on `PYTHONPATH`. Their content is that of the first time that this process asked.
    """
    sources: dict[str, bytes] = {}
    waiting = list(loaded_modules(package).values())
    seen = {module.__name__ for module in waiting}
    while waiting:
        for value in list(vars(waiting.pop()).values()):
            name = value.__name__ if isinstance(value, ModuleType) else str(getattr(value, "__module__", None))
            used = sys.modules.get(name)
            if used is None or name in seen or name.startswith(OWN_PACKAGE) or not (file := module_file(used)):
                continue
            seen.add(name)
            if not is_installed(file):
                sources[str(file)] = _imported_content(used, file)
                waiting.append(used)
    return sources


def is_installed(file: Path) -> bool:
    """Whether a file, an absolute path, is the program's or an installed library's."""
    return any(map(file.is_relative_to, [_ROOT, *_INSTALLED]))


@functools.cache
def _imported_content(_module: ModuleType, file: Path) -> bytes:
    """The content of a module's file, which may be edited after it was imported."""
    return file.read_bytes()


def _packages(values: object) -> set[str]:
    """The packages, but for ours and Python's, that classes of these values are from."""
    return {kind.__module__.partition(".")[0] for kind in _foreign(values)}


def _foreign(values: object) -> Iterator[type]:
    """The classes in these values that are neither ours nor Python's."""
    return (kind for kind in _kinds(values) if kind.__module__.partition(".")[0] not in _OURS)


def _places(kind: type) -> list[str]:
    """The names by which modules of its package hold a class: two that a function made have one name of their own.

    A class that none holds, as one in a list of a notebook, is known in this process alone.
    """
    modules = loaded_modules(kind.__module__.partition(".")[0]).items()
    held = (
        (module.partition(".")[2], name, value) for module, content in modules for name, value in vars(content).items()
    )
    return [f"{module} {name}" for module, name, value in held if value is kind] or [str(id(kind))]


def _kinds(values: Any) -> Iterator[type]:
    """The classes in these values, and those of the values."""
    is_class = isinstance(values, type)
    yield values if is_class else type(values)
    inner: Iterable[Any] = values if isinstance(values, tuple) else ()
    if is_dataclass(values) and not is_class:
        inner = [getattr(values, field.name) for field in fields(values)]
    for value in inner:
        yield from _kinds(value)


def _held(module: ModuleType) -> Iterator[str | bytes]:
    """What a module holds beside its source: it may come from a file of data."""
    for name, value in vars(module).items():
        if isinstance(value, np.ndarray):
            yield from (name, str(value.dtype), value.tobytes())
        elif isinstance(value, _PLAIN) and not name.startswith("__"):
            yield re.sub(" at 0x[0-9a-f]+", "", f"{name} {value!r}")  # an address is another one in each process


@functools.cache
def _science() -> str:
    """A digest of our sources and of the versions of all that compiles them."""
    sources = [file.read_bytes() for room in _SCIENCE for file in sorted((_ROOT / room).rglob("*.py"))]
    return _digest(numba.__version__, np.__version__, platform.python_version(), *sources)


def _digest(*parts: str | bytes) -> str:
    content = hashlib.sha256()
    for part in parts:
        content.update(hashlib.sha256(part.encode() if isinstance(part, str) else part).digest())
    return content.hexdigest()[:16]
