"""The table of an evaluation is printed before its figures are drawn, and stays when one fails."""

import io
import json
import re

import pytest
from cases import call, done

from epuckhebb.analysis import figures
from epuckhebb.cli import results, show
from epuckhebb.cli.console import Terminal
from epuckhebb.store import Run

QUICK = ["lifetime.duration_s=8", "repeats=2"]
FIGURE = "figures/trajectories.png"


@pytest.fixture
def run(here):
    """The folder of the run of a test, in its current folder."""
    return (here / "run").relative_to(here)


def printed(run):
    """What a run prints from its finished folder."""
    console = Terminal()
    console.file = io.StringIO()
    show.print_finished([run], console)
    return console.file.getvalue()


def no_figure(raised):
    """A function in place of the one that draws, which raises."""

    def trajectories(*_):
        raise raised

    return trajectories


@pytest.mark.parametrize("columns", ["80", "200"])
def test_the_text_is_that_of_the_finished_run(run, monkeypatch, columns):
    monkeypatch.setenv("COLUMNS", columns)
    told = done("evaluate", *QUICK, "hydra.run.dir=run").stdout
    assert "controller" in told
    assert told == printed(run)


@pytest.mark.parametrize("words", [["-q"], ["--json"], ["-m"]])
def test_other_calls_print_at_their_end(here, monkeypatch, words):
    monkeypatch.setattr(figures, "trajectories", no_figure(ValueError("no font")))
    failed = call("evaluate", *QUICK, *words, "seed=1")
    assert failed.stdout == ""
    assert failed.exit_code == 1
    assert list(here.glob("runs/**/metrics.csv"))


def test_a_figure_that_fails_leaves_the_rest(run, monkeypatch):
    monkeypatch.setattr(figures, "trajectories", no_figure(ValueError("no font")))
    failed = call("evaluate", *QUICK, "hydra.run.dir=run")
    assert failed.exit_code == 1
    assert f"a job failed: {run} has its tables, and lacks {FIGURE}: ValueError: no font" in failed.stderr
    assert "Success" in failed.stdout
    assert "Run folder" not in failed.stdout
    kept = {"metrics.csv", "table.csv", "table.md", "traces.npz"}
    status = json.loads((run / "status.json").read_text())
    assert status["state"] == "failed"
    assert kept <= status["sha256"].keys()
    assert "no font" in status["error"]
    assert "no font" in status["traceback"]
    assert all(Run(run).content(name) for name in kept)
    assert re.search("State +failed: ", done("show", "run").stdout)


def test_an_interrupted_figure_leaves_the_rest(run, monkeypatch):
    monkeypatch.setattr(figures, "trajectories", no_figure(KeyboardInterrupt()))
    stopped = call("evaluate", *QUICK, "hydra.run.dir=run")
    assert stopped.exit_code == 130
    lacks = f"{run} has its tables, and lacks {FIGURE}"
    assert f"interrupted: {lacks}\n" in stopped.stderr
    assert "Success" in stopped.stdout
    assert Run(run).status["state"] == "interrupted"
    assert Run(run).status["error"] == lacks


def test_an_interrupted_report_names_all_that_is_lacking(run, monkeypatch):
    monkeypatch.setattr(results, "print_results", no_figure(KeyboardInterrupt()))
    stopped = call("evaluate", *QUICK, "hydra.run.dir=run")
    assert stopped.exit_code == 130
    assert Run(run).status["error"] == f"{run} has its tables, and lacks traces.npz and {FIGURE}"


def test_a_table_that_cannot_be_printed_does_not_end_the_run(run, monkeypatch):
    monkeypatch.setattr(results, "print_results", no_figure(OSError(28, "No space left on device", "a device")))
    failed = call("evaluate", *QUICK, "hydra.run.dir=run")
    assert failed.exit_code == 2
    assert "No space left on device" in failed.stderr
    assert Run(run).is_whole
    assert Run(run).has(FIGURE)
