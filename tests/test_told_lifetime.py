"""A lifetime that is longer, faster or noisier than usual is told wherever a changed world is told."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from epuckhebb.app.cli import app
from epuckhebb.app.hydra_bridge import alternatives, combinations, composed


@pytest.mark.parametrize(
    ("verb", "words", "told"),
    [
        ("evaluate", ["scenario=lowlight", "lifetime.duration_s=200", "lifetime.record_every=0"], ""),
        ("evaluate", ["scenario=lowlight", "lifetime.duration_s=250"], "lifetime.duration_s=250"),
        ("evaluate", ["scenario.paper_duration_s=50"], "paper_duration_s=50"),
        ("evaluate", ["lifetime=evolve"], "lifetime.duration_s=60, lifetime.gain_rad_s=4"),
        ("evaluate", ["task=reversal"], "task=reversal, lamp.intensity=0"),
        ("evolve", [], ""),
        ("evolve", ["scenario.light=0.5", "lifetime.noise=0"], "light=0.5, lifetime.noise=0"),
    ],
)
def test_what_is_unusual_is_told_and_nothing_else(verb, words, told):
    assert composed(verb, words).changed == told


def test_the_jobs_of_a_sweep_tell_it():
    choices = alternatives(["lifetime.duration_s=100,250", "seed=1,2"])
    told = [config["changed"] for _, config in combinations("evaluate", [], choices, None)]
    assert told == ["lifetime.duration_s=100"] * 2 + [""] * 2


def test_it_stands_in_the_title_in_the_table_and_in_the_name_of_the_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = ["evaluate", "lifetime.duration_s=0.064", "lifetime.record_every=0", "repeats=1"]
    result = CliRunner().invoke(app, words)
    assert result.exit_code == 0, result.output
    assert "base (lifetime.duration_s=0.064)" in result.output
    (run,) = Path("runs/evaluate").iterdir()
    assert "_base+lifetime.duration_s-0.064_seed1" in run.name
    assert all(row.endswith(",lifetime.duration_s=0.064") for row in (run / "metrics.csv").read_text().splitlines()[1:])
