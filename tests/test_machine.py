"""What the machine gives: cores, memory, homes, a cache, and locks of folders that end with their process."""

import errno
import importlib
import io
import os
import pwd
import subprocess
import sys
from pathlib import Path

import filelock
import pytest
from cases import call, refused
from joblib import cpu_count
from rich.console import Console

from epuckhebb.cli.console import is_of_output
from epuckhebb.runtime import resources
from epuckhebb.runtime.errors import JOB_FAILED, USAGE, ConfigError
from epuckhebb.runtime.resources import path_of, thread_count
from epuckhebb.store import disk
from epuckhebb.store.folder import RunFolder

compiled = importlib.import_module("epuckhebb.controller.compiling.kernel")


@pytest.fixture
def homeless(monkeypatch):
    """A process of a user whom nobody knows, as in a container with a random number for a user."""

    def unknown(who):
        raise KeyError(who)

    for name in ("HOME", "NUMBA_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(pwd, "getpwuid", unknown)
    monkeypatch.setattr(pwd, "getpwnam", unknown)


@pytest.mark.usefixtures("homeless")
def test_without_a_home_kernels_are_compiled_without_a_cache(here):
    assert compiled._cache_folder("name") is None
    assert list(here.iterdir()) == []
    with pytest.raises(ConfigError, match="genome=~/x"):
        path_of("~/x", "genome")


def test_where_kernels_are_kept(monkeypatch, here):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(here))
    assert compiled._cache_folder("name") == here / "epuckhebb" / "kernel-name"
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(here / "numba"))
    assert compiled._cache_folder("name") == here / "numba" / "kernel-name"


def test_cores_are_those_that_this_process_may_use(monkeypatch):
    assert thread_count(0) == cpu_count()
    monkeypatch.setenv("LOKY_MAX_CPU_COUNT", "1")
    assert thread_count(0) == cpu_count() == 1
    assert thread_count(3) == 3


@pytest.mark.parametrize(
    ("said", "cores"),
    [(["150000 100000"], 2), (["max 100000"], 8), (["50000", "100000"], 1), (["-1", "100000"], 8), ([""], 8), ([], 8)],
)
def test_cores_are_those_of_the_container(monkeypatch, here, said, cores):
    files = [here / f"limit_{number}" for number in range(len(said))] or [here / "none"]
    for file, text in zip(files, said, strict=False):
        file.write_text(f"{text}\n")
    monkeypatch.setattr(resources, "_QUOTAS", (files,))
    monkeypatch.setattr("os.cpu_count", lambda: 8)
    monkeypatch.setattr("psutil.Process.cpu_affinity", lambda _: [*range(9)])
    assert resources.cores() == cores


@pytest.mark.parametrize(("said", "limit"), [("1000000\n", 1_000_000), ("max\n", None)])
def test_memory_is_that_of_the_container(monkeypatch, here, said, limit):
    monkeypatch.setattr(resources, "_LIMITS", (str(here / "none"),))
    whole = resources.memory()
    assert whole > 2**28
    (here / "memory.max").write_text(said, encoding="utf-8")
    monkeypatch.setattr(resources, "_LIMITS", (str(here / "none"), str(here / "memory.max")))
    assert resources.memory() == (limit or whole)


TOO_MUCH = {
    "many repeats": (["evaluate", "repeats=1000000000"], "repeats"),
    "a long life, recorded": (["evaluate", "lifetime.duration_s=1e9", "lifetime.record_every=1"], "record_every"),
    "a slow life at home": (["evaluate", "adaptation=late", "lifetime.gain_rad_s=1e-5"], "lifetime.gain_rad_s"),
    "a large population": (["evolve", "ga.population=1000000000"], "ga.population"),
    "a long memory": (["evolve", "scenario.paper_duration_s=1e12"], "scenario.paper_duration_s"),
    "many champions": (["reproduce", "light", "champions=1000000000"], "champions"),
    "a wide maze": (["evaluate", "maze.arena_m=10"], "maze.arena_m"),
}


@pytest.mark.parametrize("what", TOO_MUCH)
def test_what_there_is_no_memory_for_is_refused(here, monkeypatch, what):
    monkeypatch.setattr(resources, "memory", lambda: 2**30)
    words, remedy = TOO_MUCH[what]
    told = refused(*words)
    assert "GiB of memory, and there are 1.0 GiB" in told
    assert remedy in told
    assert list(here.iterdir()) == []


def test_a_folder_is_held_by_one_and_nothing_stays_there(here):
    held = disk.lock(here)
    assert disk.is_locked(here)
    with pytest.raises(BlockingIOError):
        disk.lock(here)
    disk.release(held)
    assert not disk.is_locked(here)
    assert list(here.iterdir()) == []
    assert not disk.is_locked(here / "nowhere")


def test_the_system_lets_go_of_a_folder_when_its_process_is_killed(here):
    hold = "import filelock, os, sys; lock = filelock.FileLock(sys.argv[1]); lock.acquire(); os.kill(os.getpid(), 9)"
    subprocess.run([sys.executable, "-c", hold, str(here / disk.LOCK)], check=False)
    assert [path.name for path in here.iterdir()] == [disk.LOCK]
    assert not disk.is_locked(here)
    with RunFolder.resume(here, "sweep", None, [], {}):  # what it left is known as ours
        assert disk.is_locked(here)


@pytest.mark.usefixtures("here")
def test_a_file_system_without_locks_is_not_fatal(monkeypatch):
    def acquire(lock):
        assert lock.lock_file == disk.LOCK
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(filelock.FileLock, "acquire", acquire)
    assert disk.lock(Path()) is None
    disk.release(None)


def test_what_switches_the_compiler_off_is_named_and_nothing_runs(monkeypatch, here):
    """Without it, it would live without physics, and say that it had finished."""
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    assert "NUMBA_DISABLE_JIT is set" in refused("evaluate", "repeats=1")
    assert not list(here.iterdir())


def test_a_current_folder_that_is_gone_is_named(monkeypatch, tmp_path):
    gone = tmp_path / "gone"
    gone.mkdir()
    monkeypatch.chdir(gone)
    gone.rmdir()
    told = call("evaluate", "repeats=1")
    assert (told.exit_code, told.stderr.startswith("Error: the current folder is gone")) == (USAGE, True)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="only Linux has a device that is always full")
def test_an_output_that_takes_nothing_is_named():
    with Path("/dev/full").open("wb", buffering=0) as full:
        told = subprocess.run(
            [sys.executable, "-m", "epuckhebb", "--help"], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
        with pytest.raises(OSError, match="No space left") as error:
            Console(file=io.TextIOWrapper(full, write_through=True)).print("a table")
    assert told.returncode == JOB_FAILED
    assert told.stderr == "Error: the output cannot be written: No space left on device\n"
    assert is_of_output(error.value)
