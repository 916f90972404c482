"""What the machine gives: cores, the standard streams, paths of the user's, and the data folders of the program."""

import math
import os
import sys
from contextlib import suppress
from pathlib import Path
from typing import IO

from epuckhebb.runtime.errors import refusing

_PACKAGE = Path(__file__).resolve().parents[1]
LATEST = "latest"  # the word for the run of the last call
REFERENCE = "reference"  # the word for the bundled champions
_MANY = 1_000_000  # cores: no limit


def open_missing_streams() -> None:
    """Open `os.devnull` in place of each standard stream that the caller closed, as `2>&-` does.

    A file that is opened later would otherwise get the stream's number, and what is printed would end in it.
    """
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            stream = Path(os.devnull).open(mode, encoding="utf-8")  # noqa: SIM115 - it stays open to the end
            os.set_inheritable(stream.fileno(), True)  # workers have the same streams
            setattr(sys, name, stream)


def discard(stream: IO[str]) -> None:
    """Let nothing come of what else is written to a stream that nobody reads, at the end of the program too."""
    with suppress(OSError, ValueError):  # a stream of a test has no number
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def thread_count(threads: int = 0) -> int:
    """The number of threads to use; 0 stands for one for each core that this process, or its container, may use.

    LOKY_MAX_CPU_COUNT, of the environment, limits them, too, as it limits the processes of joblib. That counts the same
    cores, and would take a while to load.
    """
    if threads:
        return threads
    most = os.environ.get("LOKY_MAX_CPU_COUNT", str(_MANY))
    with refusing(lambda error: f"LOKY_MAX_CPU_COUNT, of the environment, must be a whole number: {error}", ValueError):
        allowed = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
        return max(1, min(allowed, _container_cores(), int(most)))


def _container_cores() -> int:
    """The cores for which the container's quota of time suffices; many where it has none."""
    with suppress(OSError, ValueError):  # the second: "max", no quota
        quota, period = Path("/sys/fs/cgroup/cpu.max").read_text(encoding="ascii").split()
        return math.ceil(int(quota) / int(period))
    return _MANY


def data_folder(name: str) -> Path:
    """A folder that lies beside the package in a checkout and inside it when installed (`conf`, `runs/reference`)."""
    inside = _PACKAGE / name
    return inside if inside.is_dir() else _PACKAGE.parent / name


def user_path(text: str, key: str) -> Path:
    """A path that a user gave for a key, with `~` or `~name` at its beginning replaced by that folder."""
    unknown = f"{key}={text}: {text.partition('/')[0]} stands for no folder here; give the whole path"
    with refusing(lambda _: unknown, RuntimeError):
        return Path(text).expanduser()
