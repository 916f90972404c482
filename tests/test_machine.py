"""What the machine gives: cores, memory, homes, a cache, and locks of folders that end with their process."""

import errno
import importlib
import os
import pwd
import subprocess
import sys
from pathlib import Path

import filelock
import pytest
from typer.testing import CliRunner

from epuckhebb.app import machine, runs
from epuckhebb.app.cli import app
from epuckhebb.app.config import thread_count
from epuckhebb.app.errors import USAGE, ConfigError
from epuckhebb.app.machine import path_of
from epuckhebb.app.runs import RunFolder

compiled = importlib.import_module("epuckhebb.sim.compiled")


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


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
    with pytest.raises(ConfigError, match=r"genome=~/x: no home folder is known for ~; give the whole path"):
        path_of("~/x", "genome")


def test_where_kernels_are_kept(monkeypatch, here):
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(here))
    assert compiled._cache_folder("name") == here / "epuckhebb" / "kernel-name"
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(here / "numba"))
    assert compiled._cache_folder("name") == here / "numba" / "kernel-name"


@pytest.mark.parametrize(
    "words",
    [
        ["evaluate", "genome='~nosuchuser/x'"],
        ["evaluate", "hebbian.rule='~nosuchuser/x.py:Rule'"],
        ["evaluate", "-m", "hebbian.rule='~nosuchuser/x.py:Rule'", "seed=1,2"],
        ["evolve", "resume=~nosuchuser/x"],
        ["reproduce", "genome='~nosuchuser/x'"],
    ],
)
def test_the_home_of_nobody(here, words):
    told = CliRunner().invoke(app, words)
    assert told.exit_code == USAGE, told.output
    assert "no home folder is known for ~nosuchuser" in told.stderr
    assert list(here.iterdir()) == []


def test_cores_are_those_that_this_process_may_use(monkeypatch):
    monkeypatch.setenv("LOKY_MAX_CPU_COUNT", "1")
    assert thread_count(0) == 1
    assert thread_count(3) == 3


@pytest.mark.parametrize(("said", "limit"), [("1000000\n", 1_000_000), ("max\n", None)])
def test_memory_is_that_of_the_container(monkeypatch, here, said, limit):
    monkeypatch.setattr(machine, "_LIMITS", (str(here / "none"),))
    whole = machine.memory()
    assert whole > 2**28
    (here / "memory.max").write_text(said, encoding="utf-8")
    monkeypatch.setattr(machine, "_LIMITS", (str(here / "none"), str(here / "memory.max")))
    assert machine.memory() == (limit or whole)


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
    monkeypatch.setattr(machine, "memory", lambda: 2**30)
    words, remedy = TOO_MUCH[what]
    told = CliRunner().invoke(app, words)
    assert told.exit_code == USAGE, told.output
    assert "GiB of memory, and there are 1.0 GiB" in told.stderr
    assert remedy in told.stderr
    assert list(here.iterdir()) == []


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["evolve", "ga.tournament=100000000000"], "ga.tournament must lie between 1 and 100000, got 100000000000"),
        (["evaluate", "threads=1000000"], "threads must lie between 0 (one for each core) and 1024, got 1000000"),
        (["evaluate", "lifetime.duration_s=1e300"], "lifetime.duration_s must be at least one step"),
        (["evaluate", "-m", "seed=range(1,1000000000)"], "at most 100000 jobs can be asked for in one call"),
        (["sweep", "n_sweep", "seed=range(1,1000)", "repeats=range(1,1000)"], "at most 100000 jobs"),
    ],
)
def test_what_no_machine_could_do_is_refused(here, words, told):
    result = CliRunner().invoke(app, words)
    assert result.exit_code == USAGE, result.output
    assert told in result.stderr
    assert list(here.iterdir()) == []


def test_a_folder_is_held_by_one_and_nothing_stays_there(here):
    held = runs.hold(here)
    assert runs.is_held(here)
    with pytest.raises(BlockingIOError):
        runs.hold(here)
    runs.release(held)
    assert not runs.is_held(here)
    assert list(here.iterdir()) == []
    assert not runs.is_held(here / "nowhere")


def test_the_system_lets_go_of_a_folder_when_its_process_is_killed(here):
    hold = "import filelock, os, sys; lock = filelock.FileLock(sys.argv[1]); lock.acquire(); os.kill(os.getpid(), 9)"
    subprocess.run([sys.executable, "-c", hold, str(here / runs._LOCK)], check=False)
    assert [path.name for path in here.iterdir()] == [runs._LOCK]
    assert not runs.is_held(here)
    with RunFolder.going_on(here, "sweep", None, [], {}):  # what it left is known as ours
        assert runs.is_held(here)


@pytest.mark.usefixtures("here")
def test_a_file_system_without_locks_is_not_fatal(monkeypatch):
    def acquire(lock):
        assert lock.lock_file == runs._LOCK
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(filelock.FileLock, "acquire", acquire)
    assert runs.hold(Path()) is None
    runs.release(None)
