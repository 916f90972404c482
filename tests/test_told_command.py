"""The command that a run folder tells is whole: the folder of the user's own files is part of it."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from epuckhebb.app import runs, sweep
from epuckhebb.app.cli import app


def call(*words):
    return CliRunner().invoke(app, list(words))


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
    result = call(*asked, "-q", "--config-dir", "mine")
    assert result.exit_code == 0, result.output
    (run,) = Path("runs/evaluate").iterdir()
    whole = " ".join(["epuckhebb", *asked, "--config-dir", "mine"])
    assert whole in " ".join(call("show", "latest").stdout.split())
    again = " ".join(word for word in whole.split() if "record_every" not in word)
    assert f"{again} lifetime.record_every=8" in call("replay", str(run)).stderr
    assert runs.read(run)["overrides"] == asked[1:]


@pytest.mark.usefixtures("_here")
def test_a_sweep_tells_it_too():
    assert sweep.plan("dusk", [], "mine").arguments == ["dusk", "--config-dir", "mine"]
