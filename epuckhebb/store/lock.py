"""Who may write in a run folder: the process that claimed it as new, or that has locked it.

A new run belongs to the process that could create its `status.json`; it is never merged or overwritten. A resumed
evolution, or a study, belongs to the process that has locked its folder.
"""

import errno
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import BaseFileLock, FileLock, Timeout

from epuckhebb.runtime import ConfigError, refusing
from epuckhebb.store.disk import STATUS

LOCK = ".epuckhebb.lock"  # exists while a process is at work in the folder, and after one that was killed
PATIENCE_S = 1.0  # how long another process may lock a folder just to look whether it is locked


def claim(folder: Path) -> None:
    """Take a folder for a new run: of many processes, only one can create its `status.json`."""
    try:
        (folder / STATUS).touch(exist_ok=False)
    except FileExistsError:
        raise ConfigError(f"{folder} holds a run; runs are never overwritten, choose another folder") from None


def lock(folder: Path, patience_s: float = 0.0) -> BaseFileLock | None:
    """Lock a folder for this process; give the result to `release`, or just end.

    The system releases a lock when its process ends, however that ends. On file systems without locks the result is
    None, and no process is kept out. If another process has the lock, perhaps only to look, for longer than
    `patience_s`, that is a BlockingIOError.
    """
    file_lock = FileLock(folder / LOCK, timeout=patience_s, thread_local=False, fallback_to_soft=False)
    try:
        file_lock.acquire()
    except Timeout:
        raise BlockingIOError(errno.EWOULDBLOCK, "another process is at work in it", str(folder)) from None
    except (FileNotFoundError, PermissionError):
        raise
    except OSError:  # some network file systems
        return None
    return file_lock


def release(file_lock: BaseFileLock | None) -> None:
    """Let others in."""
    if file_lock is not None:
        with suppress(OSError):  # Windows removes it itself, once no process has it open
            Path(file_lock.lock_file).unlink()  # first: a process that has just opened it sees that it is gone
        file_lock.release()


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Keep other calls out of a folder, which is made."""
    with refusing(lambda _: f"another process is working on {folder}; wait for it or stop it", BlockingIOError):
        folder.mkdir(parents=True, exist_ok=True)
        held = lock(folder, PATIENCE_S)
    try:
        yield
    finally:
        release(held)


def is_locked(folder: Path) -> bool:
    """Whether a process is at work in a folder; also where that cannot be known. Looking leaves no file."""
    if not (folder / LOCK).exists():
        return False
    try:
        file_lock = lock(folder)
    except OSError:
        return True
    release(file_lock)
    return file_lock is None
