"""Finds out what the machine gives: cores, memory, paths of the user's, and the data folders of the program."""

import math
import os
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from epuckhebb.runtime.errors import ConfigError

_PACKAGE = Path(__file__).resolve().parents[1]
LATEST = "latest"  # the word for the run of the last call
REFERENCE = "reference"  # the word for the bundled champions

_LIMITS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")  # of a container, in Linux
_QUOTAS = (  # of a container: microseconds in each period, and the period; -1 for no quota
    ("/sys/fs/cgroup/cpu.max",),
    ("/sys/fs/cgroup/cpu/cpu.cfs_quota_us", "/sys/fs/cgroup/cpu/cpu.cfs_period_us"),
)


def thread_count(threads: int) -> int:
    """The number of threads to use; 0 stands for one for each core that this process, or its container, may use."""
    return threads or cores()


def data_folder(name: str) -> Path:
    """A folder that lies beside the package in a checkout and inside it when installed (`conf`, `runs/reference`)."""
    inside = _PACKAGE / name
    return inside if inside.is_dir() else _PACKAGE.parent / name


def cores() -> int:
    """How many cores this process, or the container that it runs in, may use; at most `LOKY_MAX_CPU_COUNT`.

    joblib counts the same, but takes half as long to load as pandas.
    """
    from psutil import Process

    process, known = Process(), os.cpu_count() or 1
    found = [known, len(process.cpu_affinity()) if hasattr(process, "cpu_affinity") else known]
    for files in _QUOTAS:
        with suppress(OSError, ValueError):  # there is no such file; it says `max`
            quota, period = " ".join(Path(file).read_text(encoding="utf-8") for file in files).split()
            found.append(math.ceil(int(quota) / int(period)))
    with suppress(KeyError, ValueError):
        found.append(int(os.environ["LOKY_MAX_CPU_COUNT"]))
    return min(number for number in found if number > 0)


def memory() -> int:
    """How many bytes of memory there are for this process, or for the container that it runs in."""
    from psutil import virtual_memory

    found = [int(virtual_memory().total)]
    for limit in _LIMITS:
        with suppress(OSError, ValueError):  # there is no such file; it says `max`
            found.append(int(Path(limit).read_text(encoding="utf-8")))
    return min(found)


def unusable_here() -> str:
    """What is wrong with this process's folder or environment, so that nothing can be done; nothing if all is well."""
    try:
        Path.cwd()
    except OSError:
        return "the current folder is gone; change to one that is there and start again"
    if os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
        return "NUMBA_DISABLE_JIT is set, and without compiled code there is no physics; unset it and start again"
    return ""


def path_of(text: str, key: str) -> Path:
    """A path that a user gave for a key, with `~` or `~name` at its beginning replaced by that folder."""
    try:
        return Path(text).expanduser()
    except RuntimeError as error:
        raise ConfigError(
            f"{key}={text}: {text.partition('/')[0]} stands for no folder here; give the whole path"
        ) from error


class Need(NamedTuple):
    """Memory that something takes, about [bytes]; what it is; and what to type for less."""

    size: float
    what: str
    remedy: str


def require(needs: Sequence[Need]) -> None:
    """Refuse what this machine has no memory for, before it begins: the system would kill it in the middle."""
    needed, there = sum(need.size for need in needs), memory()
    if needed <= there:
        return
    most = max(needs, key=lambda need: need.size)
    raise ConfigError(
        f"this needs about {_gib(needed)} of memory, and there are {_gib(there)}: {_gib(most.size)} are for "
        f"{most.what}; {most.remedy}"
    )


def _gib(size: float) -> str:
    return f"{size / 2**30:,.1f} GiB" if size < 1e18 else f"{size / 2**30:.1e} GiB"
