"""What a run says of itself, and that it can be repeated to the byte."""

import contextlib
import hashlib
import json
import shutil
import subprocess
import sys
from datetime import datetime
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from epuckhebb.app import files
from epuckhebb.app.cli import app

EVALUATE = ["evaluate", "lifetime.duration_s=3", "lifetime.record_every=0", "repeats=1", "-q"]
EVOLVE = ["evolve", "ga.population=6", "ga.generations=2", "ga.elites=2", "ga.loops=1", "lifetime.duration_s=3", "-q"]


def call(*words):
    return CliRunner().invoke(app, list(words))


@pytest.fixture(scope="module", params=[EVALUATE, EVOLVE], ids=["evaluate", "evolve"])
def made(request, tmp_path_factory):
    """A folder with a run of this verb in it, not to be changed."""
    folder = tmp_path_factory.mktemp("made")
    with contextlib.chdir(folder):
        assert call(*request.param, "hydra.run.dir=run").exit_code == 0
    return folder


@pytest.fixture
def run(made, tmp_path, monkeypatch):
    """A copy of that run, in which anything may be done."""
    monkeypatch.chdir(shutil.copytree(made, tmp_path / "copy"))
    return Path("run")


def test_a_run_says_where_it_comes_from(run):
    told = json.loads((run / "provenance.json").read_text())
    status = json.loads((run / "status.json").read_text())
    assert told["command"][0] == "epuckhebb"
    assert set(told["overrides"]) <= set(told["command"])
    assert told["seed"] == 1
    assert set(told["code"]) == {"version", "science", "commit", "dirty"}
    assert {"numpy", "numba", "pymunk", "hydra-core", "pandas"} <= set(told["packages"])
    assert told["python"].count(".") == 2
    assert told["platform"]
    assert told["cores"] >= 1
    assert datetime.fromisoformat(status["started"]) < datetime.fromisoformat(status["finished"])
    if told["verb"] == "evaluate":
        genes = files.load_genome("reference", "obstacles").genes
        assert told["genome_sha256"] == hashlib.sha256(genes.tobytes()).hexdigest()
    assert "${" not in (run / ".hydra" / "config.yaml").read_text()


def test_show_tells_all_of_it(run):
    told = json.loads((run / "provenance.json").read_text())
    shown = call("show", str(run)).stdout.replace("\n", "").replace(" ", "")
    facts = [*told["overrides"], told["python"], told["platform"], f"{told['cores']}cores", told["code"]["science"]]
    facts += [f"{name}{number}" for name, number in told["packages"].items()]
    facts += ["seed=1", "scenario.lamp.beam_rad=1.5", "finished", told.get("genome_sha256", "history.csv")]
    for fact in facts:
        assert fact.replace(" ", "") in shown, fact


def test_a_repeated_run_is_the_same_bytes(run):
    result = call("rerun", str(run))
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith("same bytes: runs/")
    again = Path(result.stdout.removeprefix("same bytes: ").strip())
    assert json.loads((again / "provenance.json").read_text())["rerun_of"] == "run"


def test_what_differs_is_named(run):
    name = "metrics.csv" if (run / "metrics.csv").is_file() else "history.csv"
    lines = (run / name).read_text().splitlines(keepends=True)
    (run / name).write_text("".join([*lines[:2], "another,line\n", *lines[3:]]))
    result = call("rerun", str(run))
    assert result.exit_code == 1
    assert f"{name} differs first in line 3:\n  was another,line\n  is  {lines[2]}" in result.stderr
    (run / name).write_text("".join(lines[:-1]))
    told = json.loads(call("rerun", str(run), "--json").stdout)
    assert f"line {len(lines)}" in told["difference"]
    assert "was (nothing)" in told["difference"]


@pytest.mark.thorough
def test_an_evolution_that_was_resumed_is_repeated_whole(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    call(*EVOLVE, "hydra.run.dir=run")
    assert call("evolve", "resume=run", "ga.generations=4", "-q").exit_code == 0
    assert "Resumed" in call("show", "run").stdout
    assert call("rerun", "run", "-q").exit_code == 0


def test_what_cannot_be_repeated(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.save("mine.npy", np.zeros(234))
    assert call(*EVALUATE, "genome=mine.npy", "hydra.run.dir=mine").exit_code == 0
    for name in ("unfinished", "other", "torn"):
        shutil.copytree("mine", name)
    np.save("mine.npy", np.ones(234))
    (tmp_path / "unfinished" / "status.json").write_text('{"state": "interrupted"}')
    told = (tmp_path / "other" / "provenance.json").read_text()
    (tmp_path / "other" / "provenance.json").write_text(told.replace('"verb": "evaluate"', '"verb": "reproduce"'))
    (tmp_path / "torn" / ".hydra" / "config.yaml").write_text("seed: [")
    for name, expected in [
        ("mine", "is not the genome of mine"),
        ("unfinished", "interrupted"),
        ("other", "provenance.json is not what this run wrote"),
        ("torn", "config.yaml is not what this run wrote"),
        ("nowhere", "nowhere"),
    ]:
        result = call("rerun", name)
        assert result.exit_code == 2, (name, result.output)
        assert expected in result.stderr, name
    assert not (tmp_path / "runs").exists()


def evaluations_at_once(count, cwd):
    assert call(*EVALUATE, f"hydra.run.dir={cwd / 'compiled'}").exit_code == 0  # else each of them compiles
    words = ["-c", "from epuckhebb.__main__ import main; main()", *EVALUATE, "threads=1"]
    started = [
        subprocess.Popen([sys.executable, *words], cwd=cwd, stderr=subprocess.PIPE, text=True) for _ in range(count)
    ]
    for process in started:
        told = process.communicate()[1]
        assert process.returncode == 0, told
    runs = list((cwd / "runs" / "evaluate").iterdir())
    assert len(runs) == count
    for run in runs:
        assert json.loads((run / "status.json").read_text())["state"] == "finished"
    assert len({(run / "metrics.csv").read_bytes() for run in runs}) == 1


@pytest.mark.thorough
def test_evaluations_started_at_once_do_not_meet(tmp_path):
    evaluations_at_once(2, tmp_path)


@pytest.mark.slow
def test_sixty_four_evaluations_started_at_once_do_not_meet(tmp_path):
    evaluations_at_once(64, tmp_path)
