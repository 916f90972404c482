"""Whether a function draws random numbers of its own."""

import dis
import functools
import random
import sys
import sysconfig
import types
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import llvmlite
import numba
import numpy as np

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


def python_of(value: Any) -> types.FunctionType | None:
    """The Python function that an object is, or that numba compiles for it; None if there is none.

    numba's objects are those of `@njit`, `@vectorize`, `@guvectorize`, `@cfunc` and `@intrinsic`.
    """
    if not isinstance(value, types.FunctionType) and _is_known_module(type(value).__module__):
        value = getattr(value, "__wrapped__", None)
    return value if isinstance(value, types.FunctionType) else None


def random_generator(function: Callable[..., Any]) -> str | None:
    """The global random generator that a function, or one that it calls, uses, such as `np.random`; None if none.

    Its state is not part of a lifetime, so no run could be repeated.
    """
    seen: set[types.FunctionType] = set()
    waiting = [python_of(function)]
    while waiting:
        python = waiting.pop()
        if (
            python is None
            or python in seen
            or _is_known(python.__code__.co_filename)
            or Path(python.__code__.co_filename).resolve().is_relative_to(_OURS)
        ):
            continue
        seen.add(python)
        for value in _loaded(python.__code__, python):
            drawn = getattr(value, "__self__", value)
            if drawn is random or isinstance(drawn, random.Random):
                return "random"
            if drawn is np.random or isinstance(drawn, np.random.RandomState):
                return "np.random"
            waiting.append(python_of(value))
    return None


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
