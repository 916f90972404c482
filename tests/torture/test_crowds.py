"""Many at once: processes that all begin without a cache, jobs that are all done, and what is left of a small disk."""

import os
import random
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest
from cases import call, contents, done
from test_disk import CALLS, disk, full  # noqa: F401  # a fixture

from epuckhebb.studies import sweep

pytestmark = pytest.mark.torture

PROCESSES, JOBS, FILLINGS = 16, 2000, 10
SMALL = ["lifetime.duration_s=1", "repeats=5"]


def test_sixteen_processes_begin_at_once_without_a_cache(tmp_path):
    words = [sys.executable, "-m", "epuckhebb", "evaluate", "scenario=4obstacles", *SMALL, "-q"]
    environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache")}
    started = [subprocess.Popen(words, cwd=tmp_path, env=environment) for _ in range(PROCESSES)]
    assert [process.wait() for process in started] == [0] * PROCESSES
    tables = list(tmp_path.glob("runs/evaluate/*/metrics.csv"))
    assert len(tables) == PROCESSES
    assert len({table.read_bytes() for table in tables}) == 1


@pytest.mark.usefixtures("here")
def test_two_thousand_jobs_that_are_done_are_looked_at_again():
    words = ["obstacles", "scenario=base", *SMALL, "hydra.sweep.dir=many", "hydra/launcher=basic"]
    done("sweep", *words, "seed=1")
    (one,) = Path("many").glob("job_*")
    many = [*words, f"seed=range(1,{JOBS + 1})"]
    for job in sweep.plan(many[0], many[1:]).jobs:
        if job.run != one.name:
            shutil.copytree(one, Path("many", job.run))
    began = time.process_time()
    result = call("sweep", *many)
    seconds = time.process_time() - began
    print(f"{JOBS} finished jobs: {seconds:.1f} CPU s")
    assert result.exit_code == 0, result.output
    assert f"{JOBS} jobs, {JOBS} done before, 0 to do." in result.output
    assert len(Path("many", "sweep.csv").read_text().splitlines()) == 1 + 20  # copies of one run count once
    assert seconds < 20


@pytest.mark.parametrize("command", CALLS)
def test_a_disk_that_is_full_sooner_or_later(disk, command, request):  # noqa: F811  # pytest's way to ask for it
    chance = random.Random(f"{request.config.getoption('--torture-seed')} {command}")
    first, second = CALLS[command]
    for _ in range(FILLINGS):
        done(*first)
        before = contents("one")
        with full(disk, chance.randrange(60)):
            result = call(*second)
            assert result.exit_code in {0, 1, 2}, result.output
            assert "Traceback" not in result.output
            if result.exit_code == 2 and command in ("evaluate", "evolve"):
                assert not list(Path("two").rglob("*.csv"))
        if command in ("evaluate", "evolve"):
            assert contents("one") == before
        else:  # there is room again: the same command goes on
            done(*second)
        for folder in ("one", "two"):
            shutil.rmtree(folder, ignore_errors=True)
