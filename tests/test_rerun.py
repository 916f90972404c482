"""What a run says of itself, and that it can be repeated to the byte."""

import contextlib
import hashlib
import json
import shutil
import subprocess
from datetime import datetime
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cases import call, done

from epuckhebb.store import genome, provenance
from epuckhebb.store.run import Run
from epuckhebb.studies import sweep

EVALUATE = ["evaluate", "lifetime.duration_s=3", "lifetime.record_every=0", "repeats=1", "-q"]
EVOLVE = ["evolve", "ga.population=6", "ga.generations=2", "ga.elites=2", "ga.loops=1", "lifetime.duration_s=3", "-q"]
EVOLVE += ["scenario.paper_duration_s=10"]


@pytest.fixture(
    scope="module", params=[EVALUATE, pytest.param(EVOLVE, marks=pytest.mark.thorough)], ids=["evaluate", "evolve"]
)
def made(request, tmp_path_factory):
    """A folder with a run of this verb in it, not to be changed."""
    folder = tmp_path_factory.mktemp("made")
    with contextlib.chdir(folder):
        done(*request.param, "hydra.run.dir=run")
    return folder


@pytest.fixture
def run(made, tmp_path, monkeypatch):
    """A copy of that run, in which anything may be done."""
    monkeypatch.chdir(shutil.copytree(made, tmp_path / "copy"))
    return Path("run")


def test_a_run_says_where_it_comes_from(run):
    told = json.loads((run / "provenance.json").read_text())
    status = json.loads((run / "status.json").read_text())
    assert told["command_line"][0] == "epuckhebb"
    assert set(told["overrides"]) <= set(told["command_line"])
    assert told["seed"] == 1
    assert set(told["code"]) == {"version", "science", "commit", "dirty"}
    assert {"numpy", "numba", "pymunk", "hydra-core", "pandas"} <= set(told["packages"])
    assert told["python"].count(".") == 2
    assert told["platform"]
    assert told["cores"] >= 1
    assert datetime.fromisoformat(status["started"]) < datetime.fromisoformat(status["finished"])
    if told["command"] == "evaluate":
        genes = genome.load_genome("reference", "obstacles").genes
        assert told["genome_sha256"] == hashlib.sha256(genes.tobytes()).hexdigest()
    assert "${" not in (run / ".hydra" / "config.yaml").read_text()


def test_the_commit_is_that_of_the_program_in_a_hook_of_another_repository(tmp_path, monkeypatch):
    provenance._code_version.cache_clear()
    expected = dict(provenance._code_version())
    subprocess.run(["git", "init", "-q", tmp_path], check=True)
    for name, place in {"GIT_DIR": ".git", "GIT_WORK_TREE": ".", "GIT_INDEX_FILE": ".git/index"}.items():
        monkeypatch.setenv(name, str(tmp_path / place))
    provenance._code_version.cache_clear()
    assert provenance._code_version() == expected
    assert (expected["commit"] is None) == (not (provenance._PACKAGE.parent / ".git").exists())


def test_numbers_are_read_back_to_the_last_bit(tmp_path):
    drawn = np.random.default_rng(1)
    numbers = drawn.normal(size=20_000) * 10.0 ** drawn.integers(-20, 20, 20_000)
    pd.DataFrame({"fitness": numbers}).to_csv(tmp_path / "metrics.csv", index=False)
    (tmp_path / "status.json").write_text("{}")
    assert Run(tmp_path).table("metrics.csv").fitness.to_numpy().tobytes() == numbers.tobytes()
    as_text = pd.read_csv(tmp_path / "metrics.csv", dtype=str).fitness  # as `gather` has it
    assert pd.to_numeric(as_text).to_numpy().tobytes() == numbers.tobytes()


def test_show_tells_what_it_is_and_where_the_rest_stands(run):
    told = json.loads((run / "provenance.json").read_text())
    shown = call("show", str(run)).stdout.replace("\n", "").replace(" ", "")
    facts = [*told["overrides"], told["code"]["version"], "finished", "provenance.json"]
    facts += [told.get("genome_sha256", "history.csv")]
    for fact in facts:
        assert fact.replace(" ", "") in shown, fact


def test_a_repeated_run_is_the_same_bytes(run):
    result = done("rerun", str(run))
    assert result.stdout.startswith("bit-identical: runs/")
    again = Path(result.stdout.removeprefix("bit-identical: ").strip())
    assert json.loads((again / "provenance.json").read_text())["rerun_of"] == "run"


def test_a_machine_with_other_functions_is_named(run, monkeypatch):
    assert "tanh" not in call("rerun", str(run)).stderr
    monkeypatch.setattr(provenance, "functions_digest", lambda: "0" * 12)
    result = call("rerun", str(run))
    assert result.exit_code == 0
    assert [line for line in result.stderr.splitlines() if line.startswith("run was begun on ") and "tanh" in line]


def test_what_differs_is_named(run):
    name = "metrics.csv" if (run / "metrics.csv").is_file() else "history.csv"
    lines = (run / name).read_text().splitlines(keepends=True)
    (run / name).write_text("".join([*lines[:2], "another,line\n", *lines[3:]]))
    result = call("rerun", str(run))
    assert result.exit_code == 1
    assert f"{name} differs first in line 3" in result.stderr
    (run / name).write_text("".join(lines[:-1]))
    told = json.loads(call("rerun", str(run), "--json").stdout)
    assert f"line {len(lines)}" in told["difference"]


@pytest.mark.thorough
@pytest.mark.usefixtures("here")
def test_an_evolution_that_was_resumed_is_repeated_whole():
    call(*EVOLVE, "hydra.run.dir=run")
    done("evolve", "resume=run", "ga.generations=4", "-q")
    done("rerun", "run", "-q")


def test_what_cannot_be_repeated(here):
    np.save("mine.npy", np.zeros(234))
    done(*EVALUATE, "genome=mine.npy", "hydra.run.dir=mine")
    for name in ("unfinished", "other", "torn"):
        shutil.copytree("mine", name)
    np.save("mine.npy", np.ones(234))
    (here / "unfinished" / "status.json").write_text('{"state": "interrupted"}')
    told = (here / "other" / "provenance.json").read_text()
    (here / "other" / "provenance.json").write_text(told.replace('"command": "evaluate"', '"command": "reproduce"'))
    (here / "torn" / ".hydra" / "config.yaml").write_text("seed: [")
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
    assert not (here / "runs").exists()


# The folder of the user's own files is part of the command that a run tells


@pytest.fixture
def _here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "200")
    Path("mine", "scenario").mkdir(parents=True)
    Path("mine", "scenario", "dusk.yaml").write_text("defaults: [base]\nlight: 0.5\n")
    Path("mine", "experiment").mkdir()
    text = "# @package _global_\nhydra: {sweeper: {params: {scenario: 'base,dusk'}}}\n"
    Path("mine", "experiment", "dusk.yaml").write_text(text)


@pytest.mark.usefixtures("_here")
def test_a_run_tells_where_its_own_files_were():
    asked = ["evaluate", "scenario=dusk", "repeats=1", "lifetime.duration_s=0.064", "lifetime.record_every=0"]
    done(*asked, "-q", "--config-dir", "mine")
    (run,) = Path("runs/evaluate").iterdir()
    whole = " ".join(["epuckhebb", *asked, "--config-dir", "mine"])
    assert whole in " ".join(call("show", "latest").stdout.split())
    assert "lifetime.record_every=8" in call("replay", str(run)).stderr
    assert Run(run).provenance["overrides"] == asked[1:]


@pytest.mark.usefixtures("_here")
def test_a_sweep_tells_it_too():
    assert sweep.plan("dusk", [], "mine").arguments == ["dusk", "--config-dir", "mine"]
