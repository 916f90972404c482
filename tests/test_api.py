"""The Python interface for notebooks: the same keys, the same numbers, no files."""

import html
import io
import re
from array import array
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cases import SMALL_GA, call, described_columns, done
from PIL import Image

import epuckhebb
from epuckhebb.analysis.evaluate import COLUMNS
from epuckhebb.store import load_genome

FAST = ["lifetime.duration_s=8", "repeats=2"]
BRIEF = {"lifetime": {"duration_s": 0.64, "record_every": 1}, "repeats": 1}
TINY = {"lifetime.duration_s": 3, "scenario.paper_duration_s": 10, "progress": False}


def test_evaluate_gives_what_the_command_line_writes(here):
    rows = epuckhebb.evaluate(epuckhebb.load("reference"), "scenario=4obstacles", *FAST).metrics
    assert tuple(rows.columns) == COLUMNS
    assert list(here.iterdir()) == []
    call("evaluate", "scenario=4obstacles", *FAST, "hydra.run.dir=run")
    assert rows.assign(genome="reference").to_csv(index=False) == Path("run/metrics.csv").read_text()


def test_keywords_and_objects_are_overrides():
    words = ["scenario=lowlight", "seed=3", "hebbian.N=0.0005", "lifetime.gain_rad_s=2", "lifetime.duration_s=0.64"]
    named = epuckhebb.evaluate("reference_7", *words, "lifetime.record_every=0", "repeats=1").metrics
    lifetime = epuckhebb.Lifetime(duration_s=0.64, gain_rad_s=2.0)
    own = {"scenario": "lowlight", "seed": np.int64(3), "lifetime": lifetime, "repeats": 1}
    result = epuckhebb.evaluate("reference_7", **own, hebbian=epuckhebb.Hebbian(N=0.0005))
    pd.testing.assert_frame_equal(result.metrics, named)
    for show in (lambda: result.traces, result.plot, result.replay):
        with pytest.raises(ValueError, match=r"give lifetime=\{'record_every': 8\}"):
            show()


def test_a_result_has_tables_traces_a_picture_and_a_page(here):
    result = epuckhebb.evaluate("reference", compare={"wrong": {"N": 0.002, "sign": "shuffled"}}, **BRIEF)
    assert list(result.table.columns.get_level_values(0).unique()) == ["GA", "Hebbian", "wrong"]
    assert "Time-to-Goal" in result._repr_html_()
    assert "Time-to-Goal" in repr(result)
    of_others = {"wiring", "joined", "activations", "tilt"}  # of networks with a wiring, and of three dimensions
    assert set(result.traces) == set(described_columns("traces.npz")) - of_others
    assert result.traces["pose"].shape == (6, 20, 3)
    with Image.open(io.BytesIO(result.plot()._repr_png_())) as picture:
        assert picture.width > picture.height
    page = result.replay()
    shown = re.search(r'srcdoc="([^"]*)"', page._repr_html_())[1]
    assert html.unescape(shown) == page.text
    assert list(here.iterdir()) == []


def test_a_sweep_is_one_table_the_same_each_time(capfd):
    over = {"scenario": ["base", "lowlight"], "hebbian": [epuckhebb.Hebbian(N=N) for N in (0.0002, 0.002)]}
    one, again = (epuckhebb.sweep("reference", over=over, lifetime={"duration_s": 0.064}, repeats=1) for _ in range(2))
    pd.testing.assert_frame_equal(one, again)
    assert list(one.columns) == ["hebbian", *COLUMNS]
    assert len(one) == 2 * 6  # in each world the genes alone and two rates, on both sides
    assert capfd.readouterr().err == ""  # it took less than half a minute


def test_an_evolution_is_a_champion_and_its_history(capfd):
    evolution = epuckhebb.evolve(seed=7, ga=epuckhebb.GA(population=4, generations=2, elites=1), **TINY)
    assert capfd.readouterr().err == ""
    assert len(evolution.history) == 2
    rows = epuckhebb.evaluate(evolution, **BRIEF).metrics.assign(genome="genome")
    pd.testing.assert_frame_equal(rows, epuckhebb.evaluate(evolution.champion, **BRIEF).metrics)


@pytest.mark.usefixtures("here")
def test_an_evolution_is_that_of_a_run():
    words = [*SMALL_GA, "lifetime.duration_s=2", "hebbian=abcd", "hebbian.sign=shuffled", "seed=3"]
    evolution = epuckhebb.evolve(*words, progress=False)
    done("evolve", *words, "hydra.run.dir=run")
    ours, theirs = evolution.genome, load_genome("run", "")
    np.testing.assert_array_equal(ours.signs, theirs.signs)
    assert (ours.sha256, ours.nominal_sha256, ours.rule) == (theirs.sha256, theirs.nominal_sha256, "abcd")
    own, run = (epuckhebb.evaluate(one, "hebbian.sign=shuffled", hebbian="abcd", **BRIEF) for one in (evolution, "run"))
    pd.testing.assert_frame_equal(own.metrics.assign(genome="run"), run.metrics)
    assert epuckhebb.compare({"one": [evolution, "run"]}).n[0] == 1
    settings = {**evolution.settings, "ga": {**evolution.settings["ga"], "mutation_rate": 0.5}}
    others = replace(evolution, settings=settings)
    with pytest.raises(ValueError, match=r"ga\.mutation_rate"):
        epuckhebb.compare({"two": [evolution, others]})


def test_files_of_your_own_are_found():
    folder = Path(__file__).parents[1] / "examples" / "own_maze"
    result = epuckhebb.evaluate("reference", maze="zigzag", config_dir=folder, **BRIEF)
    assert "maze=zigzag" in result.metrics.changed[0]


def test_both_bundled_champions_load():
    assert not np.array_equal(epuckhebb.load(), epuckhebb.load(experiment="light"))


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: epuckhebb.load("nowhere"), "genome=nowhere does not exist"),
        (lambda: epuckhebb.evaluate(np.zeros(227)), "234"),
        (lambda: epuckhebb.evolve("ga=sound"), "textbook"),
        (lambda: epuckhebb.evaluate(None), "genome=the given array must hold 234 numbers"),
        (lambda: epuckhebb.evaluate("reference", {"repeats": 1}), "overrides are texts such as"),
        (lambda: epuckhebb.evaluate("reference", senario="base"), "senario"),
        (lambda: epuckhebb.evaluate(progres=False), "progres"),
        (lambda: epuckhebb.evaluate("reference", scenario="bas"), "4obstacles"),
        (lambda: epuckhebb.evaluate("reference", seed=pd.Series([1])), "seed must be text, a number"),
        (lambda: epuckhebb.evaluate("reference", hebbian=epuckhebb.Hebbian), "hebbian must be a name or settings"),
        (lambda: epuckhebb.evaluate("reference", hebbian=epuckhebb.Hebbian(floor=0.3)), "has N = 0; give N"),
        (lambda: epuckhebb.evaluate("reference", lifetime={"duration": 3}), "duration_s"),
        (lambda: epuckhebb.evaluate("reference", config_dir="nowhere"), "nowhere is no folder"),
        (lambda: epuckhebb.evaluate("reference", adaptation=epuckhebb.Adaptation(homeostasis=True)), "needs a name"),
        (lambda: epuckhebb.evolve(hebbian=epuckhebb.Hebbian()), "has N = 0; give N"),
        (lambda: epuckhebb.evaluate("scenario=base"), "genome=scenario=base does not exist"),
        (lambda: epuckhebb.evaluate("reference", scenario=["base", "lowlight"]), "scenario must be one"),
        (lambda: epuckhebb.evolve("reference"), "overrides are texts such as"),
        (lambda: epuckhebb.sweep("reference", over=["hebbian.N"]), "over must be keys with lists"),
        (lambda: epuckhebb.sweep("reference", over={"seed": 3}), "over must be keys with lists"),
    ],
)
def test_mistakes_are_value_errors_that_say_what_is_wrong(call, message):
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.parametrize("value", [True, np.True_, Fraction(1, 5000), "0.002"])
def test_a_rate_is_a_number_and_nothing_that_python_can_count_with(value):
    with pytest.raises(ValueError, match=r"hebbian\.N must"):
        epuckhebb.Hebbian(N=value)
    assert epuckhebb.Hebbian(N=np.float64(0.5)).N == epuckhebb.Hebbian(N=np.float32(0.5)).N == 0.5


def test_values_that_numpy_and_python_have_for_numbers_are_settings():
    for value in (np.float64(0.02), np.array(0.02)):
        config = epuckhebb.evaluate(hebbian={"N": value}, **BRIEF, progress=False).config
        assert config.controllers[0].rule.N == 0.02


def test_genes_are_whatever_numpy_makes_an_array_of():
    genes = epuckhebb.load()

    class Tensor:
        def __array__(self, dtype=None, copy=None):
            return genes

    for given in (array("d", genes), pd.Series(genes), Tensor()):
        np.testing.assert_array_equal(epuckhebb.evaluate(given, **BRIEF, progress=False).genome.genes, genes)
