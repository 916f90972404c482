"""What the machine gives: cores, memory, homes and a cache."""

import importlib
import os
import pwd
import subprocess
import sys
import time
from pathlib import Path

import pytest
from cases import SHORT, call, refused
from joblib import cpu_count

from epuckhebb.controller.network import PAPER_NETWORK
from epuckhebb.runs import maze
from epuckhebb.runtime import progress
from epuckhebb.runtime.errors import USAGE, ConfigError
from epuckhebb.runtime.resources import thread_count, user_path
from epuckhebb.store import Run
from epuckhebb.tmaze.scenario import Scenario

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
        user_path("~/x", "genome")


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


def test_a_slip_that_would_fill_the_memory_is_refused(here):
    assert "lifetime.record_every=1 " in refused("evaluate", "lifetime.duration_s=1e6", "lifetime.record_every=1")
    assert list(here.iterdir()) == []


@pytest.mark.usefixtures("here")
def test_a_closed_stream_leads_nowhere():
    def ended(redirected, *words):
        command = ["sh", "-c", f'exec "$@" {redirected}', "sh", sys.executable, "-m", "epuckhebb", *words]
        return subprocess.run(command, capture_output=True, check=False)

    run = ended("2>&-", "evaluate", *SHORT, "hydra.run.dir=run")
    assert (run.returncode, Run(Path("run")).status["state"], b"Success" in run.stdout) == (0, "finished", True)
    assert ended("<&- >&- 2>&-", "show", "run").returncode == 0
    assert ended("2>&-", "evaluate", "seed=x").returncode == USAGE


@pytest.mark.usefixtures("here")
def test_a_reader_that_stops_does_not_stop_the_work():
    tiny = ["champions=1", "repeats=1", "rates=[0.002]", "ga.population=4", "ga.elites=1", "ga.generations=1"]
    study = ["obstacles", *tiny, "ga.loops=1", "hydra/launcher=basic", "hydra.sweep.dir=study"]
    words = [sys.executable, "-m", "epuckhebb", "reproduce", *study]
    with subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL) as started:
        started.stdout.close()
        assert started.wait() == 0
    assert Run(Path("study")).status["state"] == "finished"


def test_who_waits_for_a_compiler_is_told(monkeypatch, capsys):
    monkeypatch.setattr(progress, "_SOON_S", 0.0)
    monkeypatch.setattr(maze, "load_kernel", lambda *_, **__: time.sleep(0.3))
    maze.compile_kernels([], PAPER_NETWORK, Scenario())
    assert "Compiling" in capsys.readouterr().err


def test_a_command_says_soon_what_it_does(monkeypatch):
    monkeypatch.setattr(progress, "_SOON_S", 0.0)
    assert call("keys", "maze").stderr.startswith("keys: ")


@pytest.mark.parametrize("where", ["environment", "file"])
def test_without_compiled_code_it_ends_with_one_message(here, where):
    words, environment = [sys.executable, "-m", "epuckhebb", "evaluate"], dict(os.environ)
    if where == "file":
        (here / ".numba_config.yaml").write_text("disable_jit: 1\n")
    else:
        environment["NUMBA_DISABLE_JIT"] = "1"
    ended = subprocess.run(words, env=environment, capture_output=True, text=True, check=False)
    assert (ended.returncode, ended.stderr.count("Error: ")) == (2, 1)
    assert "NUMBA_DISABLE_JIT" in ended.stderr
