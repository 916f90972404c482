"""A folder in which one process works. The system lets go of it when that process ends, however it ends."""

import os
import sys
from pathlib import Path


def hold(folder: Path) -> int | None:
    """Keep other processes of this program out of a folder; give the result to `release`, or just end.

    None where the file system or the operating system knows no such locks: then nothing is kept out.

    Raises:
        BlockingIOError: another process holds it.
    """
    if sys.platform == "win32":
        return None
    import fcntl

    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise
    except OSError:  # some network file systems
        os.close(descriptor)
        return None
    return descriptor


def release(held: int | None) -> None:
    """Let others in."""
    if held is not None:
        os.close(held)


def is_held(folder: Path) -> bool:
    """Whether another process works in a folder."""
    try:
        release(hold(folder))
    except BlockingIOError:
        return True
    return False
