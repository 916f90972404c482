"""An evolution that was stopped, in whatever way, ends as one that never was."""

import json
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cases import call, done

from epuckhebb.store import lock

TINY = ["ga.population=6", "ga.elites=2", "ga.loops=1", "lifetime.duration_s=3", "scenario.paper_duration_s=10"]
TINY += ["threads=1", "-q"]
RESULTS = ("history.csv", "champion.npz", "checkpoint.npz")
HERE = Path(__file__).parent
CLAIM = 4  # writes before the first generation; each generation has three


@pytest.fixture(scope="module")
def six(tmp_path_factory):
    """Six generations in one go: the folder of the run, not to be written to."""
    folder = tmp_path_factory.mktemp("whole") / "six"
    done("evolve", *TINY, "ga.generations=6", f"hydra.run.dir={folder}")
    return folder


@pytest.fixture(scope="module")
def three_made(tmp_path_factory):
    """Three generations of the same evolution, not to be written to."""
    folder = tmp_path_factory.mktemp("half") / "three"
    done("evolve", *TINY, "ga.generations=3", f"hydra.run.dir={folder}")
    return folder


@pytest.fixture
def three(three_made, tmp_path, monkeypatch):
    """A copy of them, in which anything may be done."""
    monkeypatch.chdir(tmp_path)
    return shutil.copytree(three_made, tmp_path / "run")


def same(one, other):
    return all((one / name).read_bytes() == (other / name).read_bytes() for name in RESULTS)


def test_three_generations_and_three_more_are_six(six, three):
    assert not same(six, three)
    result = done("evolve", f"resume={three}", "ga.generations=6", "--json")
    told = json.loads(result.stdout)["runs"][0]
    assert len(told["history"]) == 6
    assert told["status"]["state"] == "finished"
    assert told["resumed"][0]["generations"] == 3
    assert same(six, three)
    assert "generations: 6" in (three / ".hydra" / "config.yaml").read_text()


@pytest.mark.thorough
@pytest.mark.parametrize("points", ["5 beside 6 before 7 beside 22 after"])
def test_killed_between_any_two_writes(six, tmp_path, points):
    words = ["evolve", *TINY, "ga.generations=6", "--", *points.split()]
    done = subprocess.run(
        [sys.executable, HERE / "killed.py", *words], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    runs = list(tmp_path.iterdir())
    assert len(runs) == len(points.split()) / 2
    for run in runs:
        assert same(six, run), run
        assert list(run.rglob("*.tmp")) == []


@pytest.mark.slow
def test_killed_at_every_write(six, tmp_path):
    every = [f"{write} {where}" for write in range(CLAIM + 1, CLAIM + 19) for where in ("before", "beside", "after")]
    test_killed_between_any_two_writes(six, tmp_path, " ".join(every))


def test_a_finished_evolution_has_nothing_to_go_on_with(three):
    before = {file: file.read_bytes() for file in three.rglob("*") if file.is_file()}
    result = done("evolve", f"resume={three}")
    assert "all of its 3 generations" in result.stderr
    assert {file: file.read_bytes() for file in three.rglob("*") if file.is_file()} == before


def test_what_cannot_be_resumed(three):
    evaluation = ["evaluate", "lifetime.duration_s=3", "repeats=1", "hydra.run.dir=evaluation", "-q"]
    done(*evaluation)
    spoilt = {"text": b"not a checkpoint", "cut": (three / "checkpoint.npz").read_bytes()[:2000]}
    for name, content in spoilt.items():
        shutil.copytree(three, name)
        Path(name, "checkpoint.npz").write_bytes(content)
    shutil.copytree(three, "begun")
    Path("begun", "provenance.json").unlink()  # killed before there were settings
    for words, expected in [
        ([f"resume={three}", "seed=3"], ["seed=3", "only ga.generations, threads"]),
        ([f"resume={three}", "scenario=highlight", "ga.generations=4"], ["scenario=highlight"]),
        ([f"resume={three}", "ga.generations=2"], ["ga.generations must be 3 or more", "2"]),
        ([f"resume={three}", "ga.generations=many"], ["ga.generations", "many"]),
        ([f"resume={three}", f"resume={three}"], ["one run folder"]),
        ([f"resume={three}", "-m"], ["-m"]),
        (["resume="], ["one run folder"]),
        (["resume=nowhere"], ["nowhere"]),
        (["resume=begun"], ["provenance.json"]),
        (["resume=evaluation"], ["evaluate", "only evolutions"]),
        (["resume=text", "ga.generations=4"], ["text/checkpoint.npz"]),
        (["resume=cut", "ga.generations=4"], ["cut/checkpoint.npz"]),
    ]:
        result = call("evolve", *words)
        assert result.exit_code == 2, (words, result.output)
        for text in expected:
            assert text in result.stderr, words
    assert json.loads((three / "status.json").read_text())["state"] == "finished"


@pytest.mark.skipif(sys.platform == "win32", reason="no such locks")
def test_a_run_at_work_is_left_alone(three):
    held = lock.lock(three)
    result = call("evolve", f"resume={three}", "ga.generations=4")
    lock.release(held)
    assert result.exit_code == 2
    assert "another process is working on" in result.stderr
    assert len(pd.read_csv(three / "history.csv")) == 3


@pytest.mark.thorough
def test_ctrl_c_ends_it_in_the_middle_of_a_life_and_the_run_goes_on(tmp_path):
    words = ["evolve", "lifetime.duration_s=1e9", "threads=2", "hydra.run.dir=run"]  # a life takes hours
    started = subprocess.Popen(
        [sys.executable, "-c", "from epuckhebb.__main__ import main; main()", *words],
        cwd=tmp_path,
        stderr=subprocess.PIPE,
        text=True,
    )
    with started:
        while not (tmp_path / "run" / "provenance.json").is_file():
            time.sleep(0.05)
        time.sleep(1)  # so that it is most often inside a life
        started.send_signal(signal.SIGINT)
        told = started.communicate(timeout=300)[1]
    assert started.returncode == 130, told
    assert "interrupted" in told
    assert json.loads((tmp_path / "run" / "status.json").read_text())["state"] == "interrupted"


@pytest.mark.thorough
def test_a_full_disk_keeps_the_generations_before(three, small_files):
    """A limit on the size of files stands for the disk: the last file that fits is the checkpoint."""
    before = {name: (three / name).read_bytes() for name in RESULTS}
    with small_files() as limit:
        limit((three / "checkpoint.npz").stat().st_size - 1)
        result = call("evolve", f"resume={three}", "ga.generations=6", "-q")
    assert result.exit_code == 1, result.output
    assert "File too large" in result.stderr
    assert "Traceback" not in result.output
    assert {name: (three / name).read_bytes() for name in RESULTS} == before
    assert list(three.rglob("*.tmp")) == []
    done("evolve", f"resume={three}", "-q")
    with np.load(three / "checkpoint.npz") as checkpoint:
        assert checkpoint["generation"] == 5
