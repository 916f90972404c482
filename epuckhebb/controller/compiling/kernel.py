"""How the science is compiled: plain functions of numbers and arrays, turned into machine code by numba.

A building block is an ordinary Python function, which tests can call; when a kernel calls it, numba compiles it into
that kernel. A *kernel* is a whole loop (a lifetime) that Python calls. Its parts, such as the plasticity rule or the
robot's senses, are chosen when it is made: `kernel(live, values, learn=...)` is `live` in which the name `learn` means
that function. So parts cost nothing while the loop runs, and only those in use are compiled. Numba compiles a building
block once in a process: functions that make one for a robot or a network, and not for a rule, give the same one each
time.

Arithmetic is IEEE float64 in the written order (no `fastmath`), so the same lifetime is always bit-identical.
`error_model="numpy"` makes 1 / 0 infinite instead of an exception. `_nrt=False` leaves out numba's counting of
references: a kernel makes no array, and the counting took up to a third of a step with an adaptation.
"""

import os
import types
from collections.abc import Callable, Iterable
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar, cast

import numba
import numpy as np
import platformdirs
from numba.extending import register_jitable

from epuckhebb.controller.compiling.inlining import CheckedCompiler, InlinedCompiler
from epuckhebb.controller.compiling.sources import UnknownSourceError, kernel_key

Function = TypeVar("Function", bound=Callable[..., Any])

_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "_nrt": False}
_settings: Any = numba.config
if _settings.DISABLE_JIT:  # by the environment, or by a file `.numba_config.yaml`
    raise OSError("NUMBA_DISABLE_JIT must be unset or 0: all that runs here is compiled by numba")
MOST_CALLS = 16  # that are written out
BUILDING_BLOCK: dict[str, Any] = {"forceinline": True, "pipeline_class": InlinedCompiler, **_OPTIONS}
_building_block: Any = register_jitable(**BUILDING_BLOCK)
_checked: Any = register_jitable(forceinline=True, pipeline_class=CheckedCompiler, **_OPTIONS)
_njit: Any = numba.njit


def compiled(function: Function) -> Function:
    """Make a building block usable in kernels; in Python it remains the same function.

    Forced inlining avoids calls with dozens of arguments (an array is seven) and lets constants reach the loops.
    """
    return cast(Function, _building_block(function))


def compiled_checked(function: Function) -> Function:
    """Make a function of the user's usable in kernels. An index beyond an array raises an IndexError there.

    It is compiled by numba's own steps: without them, a `print` in it would never return.
    """
    return cast(Function, _checked(function))


# Parts that do nothing, whatever they are given.
nothing: Callable[..., None] = compiled(lambda *_: None)
zero: Callable[..., float] = compiled(lambda *_: 0.0)
one: Callable[..., float] = compiled(lambda *_: 1.0)


def written(arguments: str, expression: str, names: dict[str, Any]) -> Any:
    """A building block that is written out as text: an expression of its arguments, and of names and their values.

    So a kernel has calls whose number, or whose arguments, are known only when it is made. arguments: their names,
    separated by commas.
    """
    return compiled(eval(f"lambda {arguments}: {expression}", names))


def call_each(function: Callable[..., None], constants: Iterable[tuple[int, ...]], arguments: str) -> Any:
    """A building block that calls another one once with each row of constants, which stand before its own arguments.

    A few calls are written out, because numbers in the code become constants of the machine code; many are a loop.

    arguments: their names, separated by commas.
    """
    rows, parts = list(constants), {"function": compiled(function)}
    if len(rows) <= MOST_CALLS:
        calls = "".join(f"function({', '.join(map(str, numbers))}, {arguments}), " for numbers in rows)
        return written(arguments, f"({calls})", parts)
    table, count = np.array(rows), len(rows)
    numbers = ", ".join(f"table[k, {column}]" for column in range(len(rows[0])))
    call = written(f"table, k, {arguments}", f"function({numbers}, {arguments})", parts)

    @compiled
    def loop(*values: Any) -> None:
        for k in range(count):
            call(table, k, *values)

    return loop


def kernel(function: Function, values: object, **parts: object) -> Function:
    """Compile a function that Python calls, with these parts in place of its module's global names.

    The machine code is stored on disk, in a folder named by its sources and `values`. It is compiled in memory where
    the cache cannot be written, or a class is not from a file that `FILE.py:NAME` names.

    values: all that the parts are made from, such as network, robot and the class of a rule.
    """
    made = bind_parts(function, parts)
    with suppress(UnknownSourceError):
        key = kernel_key(values)
        made.__qualname__ = f"{function.__name__}_{key}"  # symbols of kernels in one process must differ
        made.__module__ = function.__module__
        stored = _stored(made, key)
        if stored is not None:
            return cast(Function, stored)
    return cast(Function, _njit(**_OPTIONS)(made))


class SameTypes:
    """A kernel that is called with arguments of the same types every time.

    numba looks at the type of each number and array of a call. For a lifetime this takes 45 of the 50 us of a call. So
    only the first call goes to numba (`call` then is the machine code itself). The machine code looks at nothing: a
    whole number that is given where it was compiled for a fraction is fine, the reverse is not.
    """

    def __init__(self, kernel: Any) -> None:
        self._kernel = kernel
        self.call: Callable[..., None] = self._first

    def _first(self, *arguments: object) -> None:
        """Call the kernel through numba; from then on its machine code alone, if it has one."""
        self._kernel(*arguments)
        signatures = list(self._kernel.overloads.values())
        if len(signatures) == 1:  # the one that was called
            self.call = signatures[0].entry_point


def _stored(made: types.FunctionType, key: str) -> Any:
    """A kernel whose machine code is kept on disk; None if no folder can be written to."""
    folder, previous = _cache_folder(key), _settings.CACHE_DIR
    if folder is None:
        return None
    try:
        _settings.CACHE_DIR = str(folder)
        dispatcher = _njit(cache=True, no_cfunc_wrapper=True, **_OPTIONS)(made)
    except (OSError, RuntimeError):  # the folder is gone, full or read-only by now
        return None
    finally:
        _settings.CACHE_DIR = previous
    if not Path(dispatcher.stats.cache_path).is_relative_to(folder):  # numba has looked for another place
        return None
    _tolerate_damage(dispatcher._cache)
    return dispatcher


def bind_parts(function: Callable[..., Any], parts: dict[str, Any]) -> types.FunctionType:
    """A copy of a function with these parts in place of its module's global names."""
    code = cast(types.FunctionType, function)
    return types.FunctionType(code.__code__, {**code.__globals__, **parts}, code.__name__)


def _tolerate_damage(cache: Any) -> None:
    """Treat a cache that is damaged, full or lost as empty: then the kernel is compiled.

    `_load_overload` is called because `load_overload` would first import all that compiling needs: 0.6 s of each start.
    """
    load, save = cache._load_overload, cache.save_overload

    def load_or_none(signature: object, target: object) -> object:
        try:
            return load(signature, target)
        except Exception:  # unpickling may raise anything, for example if a module of the code is gone
            with suppress(OSError):
                cache.flush()
            return None

    def save_if_possible(signature: object, result: object) -> None:
        with suppress(OSError):  # without space on disk, it stays in memory
            save(signature, result)

    cache.load_overload, cache.save_overload = load_or_none, save_if_possible


def move_to_module(function: Function, name: str) -> Function:
    """A copy of a function that belongs to another module: a cached kernel must not need the user's file by name."""
    copy = types.FunctionType(
        function.__code__, function.__globals__, function.__name__, function.__defaults__, function.__closure__
    )
    copy.__module__ = name
    return cast(Function, copy)


def _cache_folder(name: str) -> Path | None:
    """The folder of a kernel in `$NUMBA_CACHE_DIR` or the user's cache folder; None if it cannot be written to."""
    override = os.environ.get("NUMBA_CACHE_DIR")
    try:
        root = Path(override).absolute() if override else platformdirs.user_cache_path("epuckhebb", appauthor=False)
        folder = root / f"kernel-{name}"
        if not root.is_absolute():  # no folder of the user is known, as in some containers
            return None
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, RuntimeError):
        return None
    return folder if os.access(folder, os.W_OK) else None
