"""Locks of run folders, which end with their process."""

import errno
import os
import subprocess
import sys
from contextlib import contextmanager
from pathlib import Path

import filelock
import pytest
from cases import refused

from epuckhebb.runtime import ConfigError
from epuckhebb.store import lock
from epuckhebb.store.folder import RunFolder


def test_a_folder_is_held_by_one_and_nothing_stays_there(here):
    held = lock.lock(here)
    assert lock.is_locked(here)
    with pytest.raises(BlockingIOError):
        lock.lock(here)
    lock.release(held)
    assert not lock.is_locked(here)
    assert list(here.iterdir()) == []
    assert not lock.is_locked(here / "nowhere")


def test_the_system_lets_go_of_a_folder_when_its_process_is_killed(here):
    hold = "import filelock, os, sys; held = filelock.FileLock(sys.argv[1]); held.acquire(); os.kill(os.getpid(), 9)"
    subprocess.run([sys.executable, "-c", hold, str(here / lock.LOCK)], check=False)
    assert [path.name for path in here.iterdir()] == [lock.LOCK]
    assert not lock.is_locked(here)
    with RunFolder.resume(here, "sweep", None, [], {}):  # what it left is known as ours
        assert lock.is_locked(here)


def test_a_multirun_that_finds_another_at_work_leaves_its_files(here, monkeypatch):
    """Also those that the other one writes while this one waits for the folder."""

    @contextmanager
    def busy(folder):
        folder.mkdir()
        (folder / "multirun.yaml").write_text("of the other")
        raise ConfigError("another process is working on many")
        yield

    monkeypatch.setattr("epuckhebb.runs.hydra.locked", busy)
    assert "another process" in refused("evaluate", "-m", "seed=1,2", "hydra.sweep.dir=many")
    assert (here / "many" / "multirun.yaml").read_text() == "of the other"


@pytest.mark.usefixtures("here")
def test_a_file_system_without_locks_is_not_fatal(monkeypatch):
    def acquire(held):
        assert held.lock_file == lock.LOCK
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(filelock.FileLock, "acquire", acquire)
    assert lock.lock(Path()) is None
    lock.release(None)
