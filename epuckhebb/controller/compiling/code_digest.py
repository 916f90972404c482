"""A digest of all code that a function depends on, and whether it draws random numbers of its own.

Python, NumPy and numba count by their versions; all other code is read.
"""

import dis
import functools
import hashlib
import sys
import sysconfig
import types
from collections.abc import Callable, Iterable, Iterator
from enum import Enum
from pathlib import Path
from typing import Any

import llvmlite
import numba
import numpy as np
from numba.core.dispatcher import Dispatcher

_PLAIN = (type(None), bool, int, float, complex, str, bytes, range, slice, type(...), np.generic, np.dtype)
_LIBRARIES = [
    Path(folder).resolve()
    for folder in (
        sysconfig.get_path("stdlib"),
        sysconfig.get_path("platstdlib"),
        *np.__path__,
        *numba.__path__,
        *llvmlite.__path__,
    )
]
_OURS = Path(__file__).resolve().parents[1]
_INSTALLED = ("site-packages", "dist-packages")  # folders that may lie below that of the standard library
_NOTHING = object()


class UnknownPartError(ValueError):
    """A function uses an object whose content a digest cannot read."""


def digest(function: Callable[..., Any]) -> str:
    """Sixteen hexadecimal digits that name a function by its code and by all that it calls or reads, recursively.

    Bytecode and the present values of global names and closures count, not the text of a file.

    Raises:
        UnknownPartError: it uses an object whose content cannot be read.
    """
    content = hashlib.sha256(f"numba {numba.__version__} numpy {np.__version__} python {sys.version_info[:2]}".encode())
    numbered: dict[int, int] = {}

    def add(text: object) -> None:
        content.update(str(text).encode())

    def take(value: object) -> None:
        python = python_of(value)
        if python is not None and python is not value:
            if not isinstance(value, Dispatcher):
                raise UnknownPartError(f"numba compiles {value!r} in another way than by njit")
            numba_made: Any = value
            only = [] if numba_made._can_compile else numba_made.signatures
            compiler = numba_made._compiler
            options = sorted(compiler.targetoptions.items())
            how = f"{options} {dict(compiler.locals)} {compiler.pipeline_class} {only}"
            if " at 0x" in how:
                raise UnknownPartError(f"the options of {value!r} cannot be read")
            add(how)
            take(python)
        elif isinstance(value, types.ModuleType):
            if not _is_known_module(value):
                raise UnknownPartError(f"what is used of module {value.__name__} cannot be read")
            add(value.__name__)
        elif isinstance(value, types.FunctionType) and _is_known(value.__code__.co_filename):
            add(f"{value.__module__}.{value.__qualname__}")
        elif isinstance(value, types.FunctionType):
            new = id(value) not in numbered
            add(f"function {numbered.setdefault(id(value), len(numbered))}")
            if new:
                take_function(value)
        elif isinstance(value, np.ndarray) and not value.dtype.hasobject:
            add(f"{value.dtype}{value.shape}")
            content.update(value.tobytes())
        elif isinstance(value, tuple | list | dict):
            items = list(value.items() if isinstance(value, dict) else value)
            add(f"{len(items)}{getattr(value, '_fields', '')}(")
            for item in items:
                take(item)
        elif isinstance(value, set | frozenset):
            add(sorted(map(repr, value)))
        elif isinstance(value, type):
            take_class(value)
        elif isinstance(value, (*_PLAIN, Enum, numba.types.Type)):
            add(f"{type(value).__name__} {value!r}")
        elif _is_of_a_library(value):
            add(f"{value.__module__}.{value.__qualname__}")  # type: ignore[attr-defined]
        else:
            raise UnknownPartError(f"the content of {value!r}, a {type(value).__name__}, cannot be read")

    def take_class(kind: type) -> None:
        if _is_known_module(kind.__module__):
            add(f"{kind.__module__}.{kind.__qualname__}")
        elif issubclass(kind, tuple | Enum | BaseException):
            add(f"{kind.__qualname__}{getattr(kind, '_fields', '')}{list(kind) if issubclass(kind, Enum) else ''}")
        else:
            raise UnknownPartError(f"the methods of class {kind.__qualname__} cannot be read")

    def take_function(python: types.FunctionType) -> None:
        take_code(python.__code__, python.__doc__)
        take([python.__defaults__ or (), python.__kwdefaults__ or {}, getattr(python, "in_kernels", ())])
        for value in _used(python):
            take(value)

    def take_code(code: types.CodeType, docstring: str | None = None) -> None:
        content.update(code.co_code + repr((code.co_names, code.co_varnames, code.co_freevars)).encode())
        for constant in code.co_consts:
            if isinstance(constant, types.CodeType):
                take_code(constant)
            elif not (isinstance(constant, str) and constant == docstring):  # it does not change the result
                take(constant)

    take(function)
    return content.hexdigest()[:16]


def python_of(value: Any) -> types.FunctionType | None:
    """The Python function that an object is, or that numba compiles for it; None if there is none.

    numba's objects are those of `@njit`, `@vectorize`, `@guvectorize`, `@cfunc` and `@intrinsic`.
    """
    if not isinstance(value, types.FunctionType) and _is_known_module(type(value).__module__):
        value = getattr(value, "__wrapped__", None)
    return value if isinstance(value, types.FunctionType) else None


def _loaded(code: types.CodeType, python: types.FunctionType) -> Iterator[Any]:
    """The values that the code of a function loads from globals, its closure and modules; of builtins, the names."""
    cells = dict(zip(python.__code__.co_freevars, python.__closure__ or (), strict=True))
    value: Any = _NOTHING
    for step in dis.get_instructions(code):
        if step.opname in ("EXTENDED_ARG", "PUSH_NULL"):
            continue
        if isinstance(value, types.ModuleType) and step.opname in ("LOAD_ATTR", "LOAD_METHOD"):
            value = getattr(value, step.argval, step.argval)
            continue
        if value is not _NOTHING:
            yield value
        value = _NOTHING
        if step.opname == "LOAD_GLOBAL":
            value = python.__globals__.get(step.argval, step.argval)
        elif step.opname == "LOAD_DEREF" and step.argval in cells:
            value = cells[step.argval].cell_contents
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            yield from _loaded(constant, python)


def _used(python: types.FunctionType) -> Iterable[Any]:
    """The values that a function may use. Only if one is not simple, all steps of its code are read, which is slow."""
    names = _names(python.__code__) & python.__globals__.keys()
    used = {name: python.__globals__[name] for name in sorted(names)}
    used |= {f"closure {place}": cell.cell_contents for place, cell in enumerate(python.__closure__ or ())}
    simple = (types.FunctionType, np.ndarray, *_PLAIN)
    if all(isinstance(one, simple) or _is_known_module(one) for one in used.values()):
        return used.items()
    return _loaded(python.__code__, python)


def _names(code: types.CodeType) -> set[str]:
    """The global names and attributes that a code object, and those inside it, mention."""
    inner = (constant for constant in code.co_consts if isinstance(constant, types.CodeType))
    return set(code.co_names).union(*map(_names, inner))


def _is_of_a_library(value: Any) -> bool:
    """Whether an object is a function of Python or NumPy that is written in C."""
    if isinstance(value, np.ufunc):  # numba can make one of a user's function
        return getattr(np, value.__name__, None) is value
    callable_of_a_module = isinstance(getattr(value, "__qualname__", None), str) and callable(value)
    bound = getattr(value, "__self__", None)
    return (
        callable_of_a_module
        and (bound is None or isinstance(bound, types.ModuleType))
        and _is_known_module(type(value).__module__)
        and _is_known_module(getattr(value, "__module__", None))
    )


def _is_known_module(module: Any) -> bool:
    """Whether this is a module, or the name of one, of Python, NumPy or numba."""
    if isinstance(module, str):
        module = sys.modules.get(module)
    if not isinstance(module, types.ModuleType):
        return False
    file = getattr(module, "__file__", None)
    return module.__name__ in sys.builtin_module_names if file is None else _is_known(file)


@functools.cache
def _is_known(file: str) -> bool:
    """Whether a file is of Python, NumPy or numba."""
    if file.startswith("<frozen "):
        return True
    place = Path(file).resolve()
    below = [place.relative_to(folder).parts for folder in _LIBRARIES if place.is_relative_to(folder)]
    return any(not set(_INSTALLED) & set(parts) for parts in below)
