"""Every key and every column has a description."""

import io
from fnmatch import fnmatch
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cases import done, refused

from epuckhebb.analysis import evaluate, findings, reversal, summary
from epuckhebb.analysis.evaluate import Traces
from epuckhebb.cli.keys import sections
from epuckhebb.config import keys
from epuckhebb.config.compose import composed
from epuckhebb.config.compose import plain as plain_values
from epuckhebb.config.words import keys_below
from epuckhebb.controller.network import Network
from epuckhebb.controller.wirings.elman import Elman
from epuckhebb.evolution.evolve import Generation, history_row
from epuckhebb.runtime.conf import groups
from epuckhebb.store.columns import CHAMPION, TABLES, TRACES
from epuckhebb.store.genome import champion_file, load_genome
from epuckhebb.store.traces import traces_file
from epuckhebb.tmaze.physics.ode import Ode
from epuckhebb.tmaze.samples import empty_samples

REFERENCE = Path(__file__).parents[1] / "runs" / "reference"


@pytest.mark.parametrize("command", ["evaluate", "evolve", "reproduce", "leaderboard", "flock"])
def test_every_key_is_told(command):
    told = {key.name: key.description for group in keys.all_groups() for _, own in sections(group) for key in own}
    assert [name for name, meaning in told.items() if not meaning] == []
    assert [name for group in keys.all_groups() for name, meaning in group.choices.items() if not meaning] == []
    names = {f"{group}.name" for group in groups(command)}  # of files, which the program fills in
    whole = ("maze.", "robot.")  # their first keys are told, and not what a maze names below them
    for name in set(keys_below(plain_values(composed(command, [])))) - names:
        parent = ".".join(name.split(".")[: 2 if name.startswith(whole) else None])
        assert parent in told or any(other.startswith(f"{parent}.") for other in told) or parent in groups(command), (
            name
        )


@pytest.mark.parametrize("words", [[], ["scenario"], ["evolve"]])
def test_the_verb_prints_keys(words, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    result = done("keys", *words)
    assert ("scenario.light" in result.stdout) == (words != ["evolve"])
    assert max(map(len, result.stdout.splitlines())) <= 80


def test_a_key_alone_is_printed_too():
    alone = keys.group_named("scenario.light")
    assert [key.name for key in alone.keys] == ["scenario.light"]
    assert not alone.choices
    assert [key.name for key in keys.group_named("repeats").keys] == ["repeats"]


def test_an_unknown_group_is_refused():
    assert "must be one of evaluate, evolve" in refused("keys", "scenery")


def test_every_column_is_told_once():
    told = {name: list(columns) for name, (_, columns) in TABLES.items()}
    assert all(column.meaning for _, columns in TABLES.values() for column in columns.values())
    assert told["metrics.csv"] == list(evaluate.COLUMNS)
    assert told["metrics.csv with task=reversal"] == list(evaluate.REWARDED)
    assert told["reversal_trials.csv"] == list(evaluate.TRIALS)
    assert told["reversal.csv"] == list(reversal.COLUMNS)
    one = np.zeros(1)
    last = {"champion": one, "champion_fitness": 0.0, "log": (), "tables": {}, "robot_steps": 0, "seconds": 0.0}
    assert told["history.csv"] == list(history_row(Generation(number=0, fitness=one, success=one, **last)))
    lifetime = pd.DataFrame([dict.fromkeys([*evaluate.COLUMNS, "rewarded_share"], "1")])
    assert list(summary.summary(lifetime, ["light"]))[-len(told["summary.csv"]) :] == told["summary.csv"]
    assert told["trials.csv"] == list(findings.trials(lifetime.assign(**lifetime.iloc[0, 11:20].astype(float))))


@pytest.mark.parametrize("table", sorted(REFERENCE.rglob("*.csv")), ids=lambda table: str(table.relative_to(REFERENCE)))
def test_the_tables_of_the_reference_results_are_told(table):
    assert list(pd.read_csv(table, nrows=0)) == list(TABLES[table.name][1])


def test_every_array_of_the_traces_is_told_with_its_shape():
    network = Network((16, *Elman().sizes), wiring=Elman())
    one = empty_samples(5, network, Ode())
    samples = type(one)(*(np.stack([array] * 4) for array in one))
    traces = Traces(controller=["GA"] * 4, side=["left"] * 4, samples=samples)
    with np.load(io.BytesIO(traces_file(traces, np.zeros(216), network))) as written:
        assert set(written) == set(TRACES)
        sizes = {"lifetimes": 4, "samples": 5, "inputs": 16, "synapses": 216, "layers": 3, "neurons": 10}
        for name, array in TRACES.items():
            assert written[name].shape == tuple(sizes.get(size, size) for size in array.shape), name


def test_every_array_of_a_champion_is_told():
    genome = load_genome("reference", "obstacles")
    with np.load(io.BytesIO(champion_file(genome, 1.0, "obstacles", 1, 2))) as written:
        for name in written:
            assert any(fnmatch(name, told) for told in CHAMPION), name
        assert all(
            any(fnmatch(name, told) for name in written)
            for told in CHAMPION
            if told
            not in (
                "self_*",
                "rule",
                "task",
                "rewarded",
                "fitness_function",
                "sensors",
                "physics",
                "wiring",
                "joined",
                "wiring_settings",
            )
        )
