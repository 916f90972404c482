"""The tables of an evaluation stay when its figure cannot be drawn."""

import json

import pytest
from cases import call, done

from epuckhebb.analysis import figures
from epuckhebb.store import Run

QUICK = ["lifetime.duration_s=8", "repeats=2"]


@pytest.fixture
def run(here):
    """The folder of the run of a test, in its current folder."""
    return (here / "run").relative_to(here)


def test_a_figure_that_fails_leaves_the_rest(run, monkeypatch):
    def no_figure(*_):
        raise ValueError("no font")

    monkeypatch.setattr(figures, "trajectories", no_figure)
    failed = call("evaluate", *QUICK, "hydra.run.dir=run")
    assert failed.exit_code == 1
    assert f"a job failed: {run.absolute()}: ValueError: no font" in failed.stderr
    kept = {"metrics.csv", "table.csv", "table.md", "traces.npz"}
    status = json.loads((run / "status.json").read_text())
    assert status["state"] == "failed"
    assert kept <= status["sha256"].keys()
    assert "no font" in status["error"]
    assert "no font" in status["traceback"]
    assert all(Run(run).content(name) for name in kept)
    assert "State: failed: " in done("show", "run").stdout
