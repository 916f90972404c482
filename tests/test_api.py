"""The Python interface for notebooks: the same keys, the same numbers, no files."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import epuckhebb
from epuckhebb.app.cli import app
from epuckhebb.study.evaluate import COLUMNS

FAST = ["lifetime.duration_s=8", "repeats=2"]


def test_evaluate_gives_what_the_command_line_writes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rows = epuckhebb.evaluate(epuckhebb.load("reference"), "scenario=4obstacles", *FAST)
    assert tuple(rows.columns) == COLUMNS
    assert list(tmp_path.iterdir()) == []
    CliRunner().invoke(app, ["evaluate", "scenario=4obstacles", *FAST, "hydra.run.dir=run"])
    assert rows.assign(genome="reference").to_csv(index=False) == Path("run/metrics.csv").read_text()


def test_evolve_gives_a_champion_and_its_history():
    tiny = ["ga.population=4", "ga.generations=2", "ga.elites=1", "ga.loops=1", "lifetime.duration_s=3"]
    champion, history = epuckhebb.evolve("seed=7", *tiny)
    assert champion.shape == (234,)
    assert len(history) == 2
    again, _ = epuckhebb.evolve("seed=7", *tiny)
    np.testing.assert_array_equal(champion, again)


def test_both_bundled_champions_load():
    assert not np.array_equal(epuckhebb.load(), epuckhebb.load(experiment="light"))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: epuckhebb.load("nowhere"), "genome=nowhere does not exist"),
        (lambda: epuckhebb.evaluate(np.zeros(227)), "234"),
        (lambda: epuckhebb.evaluate(np.zeros(234), "repeats=0"), "repeats must be 1 or more"),
        (lambda: epuckhebb.evolve("ga=sound"), "textbook"),
    ],
)
def test_mistakes_are_value_errors_that_say_what_is_wrong(call, message):
    with pytest.raises(ValueError, match=message):
        call()
