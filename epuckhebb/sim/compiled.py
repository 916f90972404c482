"""How the science is compiled: plain functions of numbers and arrays, turned into machine code by numba.

Arithmetic is IEEE float64 in the order in which it is written (no `fastmath`), so that the same lifetime gives the
same bits whatever runs beside it. `error_model="numpy"` only says that 1 / 0 is infinite instead of an exception.
"""

import hashlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

Function = TypeVar("Function", bound=Callable[..., Any])

_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy"}


def compiled(function: Function) -> Function:
    """Compile a building block; it becomes part of the kernel that calls it and needs no cache of its own.

    `inline` spares a call with dozens of arguments (an array is seven) and lets constants reach the loops.
    """
    return cast(Function, numba.njit(inline="always", **_OPTIONS)(function))


def compiled_and_cached(function: Function) -> Function:
    """Compile a kernel that Python calls, and keep the machine code on disk for the next start.

    numba notices a change of the file that holds the kernel but not of the files it calls. The folder of the cache is
    therefore named by the content of all of `sim/`: change one equation and the kernel is compiled anew.
    """
    folder = _cache_folder()
    try:
        folder.mkdir(parents=True, exist_ok=True)
        writable = os.access(folder, os.W_OK)
    except OSError:
        writable = False
    if not writable:
        return compiled(function)
    settings: Any = numba.config
    before, settings.CACHE_DIR = settings.CACHE_DIR, str(folder)
    try:
        return cast(Function, numba.njit(cache=True, **_OPTIONS)(function))
    finally:
        settings.CACHE_DIR = before


def _cache_folder() -> Path:
    """`$NUMBA_CACHE_DIR` or the user's cache folder, with a sub-folder for this version of the science."""
    sources = sorted(Path(__file__).parent.glob("*.py"))
    content = hashlib.sha256(b"\0".join(source.read_bytes() for source in sources)).hexdigest()
    user_cache = os.environ.get("XDG_CACHE_HOME") or str(Path.home() / ".cache")
    root = os.environ.get("NUMBA_CACHE_DIR") or str(Path(user_cache) / "epuckhebb")
    return Path(root) / f"sim-{content[:16]}"
