"""Writes files atomically, locks folders, and names the files of a run folder."""

import errno
import json
import os
from contextlib import suppress
from pathlib import Path
from typing import Any

from filelock import BaseFileLock, FileLock, Timeout

from epuckhebb.runtime.errors import ConfigError

REFERENCE = "reference"
CHAMPION, CHECKPOINT, TRACES = "champion.npz", "checkpoint.npz", "traces.npz"
FINDINGS, SUMMARY, OVER_CHAMPIONS = "findings.csv", "summary.csv", "over_champions.csv"
RESCUE_OVER_ALL = "rescue_over_all.csv"
DOSE_RESPONSE = "figures/dose_response.png"
REVERSAL, REVERSAL_TRIALS = "reversal.csv", "reversal_trials.csv"

SCHEMA = 1  # of provenance.json and status.json
STATUS, PROVENANCE = "status.json", "provenance.json"
LOCK = ".epuckhebb.lock"  # there while a process is at work in the folder, or after one that was killed
OVERRIDES, CONFIG = ".hydra/overrides.yaml", ".hydra/config.yaml"


def write_atomic(target: Path, content: bytes, *, lasting: bool = True) -> None:
    """Write a file whole, or not at all, and its folder; if `lasting`, wait until it would outlast a power failure."""
    target.parent.mkdir(parents=True, exist_ok=True)
    beside = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    try:
        with beside.open("wb") as file:
            file.write(content)
            if lasting:
                file.flush()
                os.fsync(file.fileno())
        beside.replace(target)
    except OSError:  # a full disk, for example
        beside.unlink(missing_ok=True)
        raise


def lock(folder: Path, patience_s: float = 0.0) -> BaseFileLock | None:
    """Keep other processes of this program out of a folder; give the result to `release`, or just end.

    The system lets go of a folder when the process ends, however it ends. None comes back where the file system knows
    no such locks; then nothing is kept out.

    folder: one that is there. patience_s: how long to try while another process holds it; one may just be looking.

    Raises:
        BlockingIOError: Another process holds it.
        OSError: It is not there, or cannot be written to.
    """
    found = FileLock(folder / LOCK, timeout=patience_s, thread_local=False, fallback_to_soft=False)
    try:
        found.acquire()
    except Timeout:
        raise BlockingIOError(errno.EWOULDBLOCK, "another process is at work in it", str(folder)) from None
    except (FileNotFoundError, PermissionError):
        raise
    except OSError:  # some network file systems
        return None
    return found


def release(held: BaseFileLock | None) -> None:
    """Let others in."""
    if held is not None:
        with suppress(OSError):  # Windows removes it itself, once nobody has it open
            Path(held.lock_file).unlink()  # first: who has just opened it sees that it is gone, and does not hold it
        held.release()


def is_locked(folder: Path) -> bool:
    """Whether a process is at work in a folder; yes, where that cannot be known. Looking leaves nothing there."""
    if not (folder / LOCK).exists():
        return False
    try:
        held = lock(folder)
    except OSError:
        return True
    release(held)
    return held is None


def bytes_of(file: Path) -> bytes:
    """The content of a file."""
    try:
        return file.read_bytes()
    except OSError as error:
        raise ConfigError(f"{file} cannot be read: {error.strerror}") from error


def as_json(content: dict[str, Any]) -> bytes:
    """The content of a JSON file."""
    return (json.dumps(content, indent=2) + "\n").encode()
