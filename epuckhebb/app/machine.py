"""What is asked of the machine: how many cores and how much memory it gives us, and where its users are at home."""

from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple

from epuckhebb.app.errors import ConfigError

_LIMITS = ("/sys/fs/cgroup/memory.max", "/sys/fs/cgroup/memory/memory.limit_in_bytes")  # of a container, in Linux


def cores() -> int:
    """How many cores this process, or the container that it runs in, may use."""
    from joblib import cpu_count

    return int(cpu_count())


def memory() -> int:
    """How many bytes of memory there are for this process, or for the container that it runs in."""
    from psutil import virtual_memory

    found = [int(virtual_memory().total)]
    for limit in _LIMITS:
        with suppress(OSError, ValueError):  # there is no such file; it says `max`
            found.append(int(Path(limit).read_text(encoding="utf-8")))
    return min(found)


def path_of(text: str, key: str) -> Path:
    """A path that a user gave, `~` and `~name` at its beginning being home folders; `key` is told in the message.

    Raises:
        ConfigError: There is no such user, or nobody knows the user's home.
    """
    try:
        return Path(text).expanduser()
    except RuntimeError as error:
        raise ConfigError(
            f"{key}={text}: no home folder is known for {text.partition('/')[0]}; give the whole path"
        ) from error


class Need(NamedTuple):
    """Memory that something will take, about.

    Attributes:
        size: How many bytes.
        what: What takes them.
        remedy: What to type for less.
    """

    size: float
    what: str
    remedy: str


def require(needs: Sequence[Need]) -> None:
    """Refuse what this machine has no memory for, before it begins: the system would kill it in the middle.

    Raises:
        ConfigError: It has not so much; the message says how much is needed, for what, and how it would be less.
    """
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
