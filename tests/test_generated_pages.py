"""The verb `keys`, and the descriptions of columns."""

from fnmatch import fnmatch
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from cases import COLUMNS, described_columns, done, refused

from epuckhebb.analysis import evaluate, findings, reversal, summary
from epuckhebb.analysis.evaluate import Traces
from epuckhebb.analysis.tables import Table
from epuckhebb.controller.network import Network
from epuckhebb.controller.wirings.elman import Elman
from epuckhebb.evolution.evolve import Generation, history_row
from epuckhebb.store.disk import parse_arrays
from epuckhebb.store.genome import champion_file, load_genome
from epuckhebb.store.traces import traces_arrays
from epuckhebb.tmaze.physics.ode import Ode
from epuckhebb.tmaze.samples import empty_samples

ROOT = Path(__file__).parents[1]
REFERENCE = ROOT / "runs" / "reference"


def test_the_verb_prints_the_commented_files():
    assert "repeats: 10" in done("keys").stdout
    assert "sun_turn_deg: 0.0           # how far" in done("keys", "scenario").stdout
    assert done("keys", "scenario.sun_turn_deg").stdout == done("keys", "scenario").stdout
    assert "change_signal: none" in done("keys", "adaptation").stdout


def test_an_unknown_group_is_refused():
    assert "must be one of evaluate, evolve" in refused("keys", "scenery")


def test_every_column_is_described():
    assert described_columns("metrics.csv") == list(evaluate.COLUMNS)
    assert described_columns("metrics.csv with task=reversal") == list(evaluate.REWARDED)
    assert described_columns("reversal_trials.csv") == list(evaluate.TRIALS)
    assert described_columns("reversal.csv") == list(reversal.COLUMNS)
    one = np.zeros(1)
    last = {"champion": one, "champion_fitness": 0.0, "log": (), "tables": {}, "robot_steps": 0}
    history = history_row(Generation(number=0, fitness=one, success=one, remeasured=(0.0, 0.0), **last))
    assert described_columns("history.csv") == list(history)
    lifetime = pd.DataFrame([dict.fromkeys([*evaluate.COLUMNS, "rewarded_share"], "1")])
    written = list(summary.summary(lifetime, ["light"]))
    assert written[written.index("n") :] == described_columns("summary.csv")
    trials = findings.trials(lifetime.assign(**lifetime.iloc[0, 11:20].astype(float)))
    assert described_columns("trials.csv") == list(trials)


@pytest.mark.parametrize("table", sorted(REFERENCE.rglob("*.csv")), ids=lambda table: str(table.relative_to(REFERENCE)))
def test_the_columns_of_the_reference_results_are_described(table):
    own = [table.parent] if (table.parent / COLUMNS.name).is_file() else []  # of a study that is an example
    columns, described = list(pd.read_csv(table, nrows=0)), described_columns(table.name, *own)
    if table.name in ("ends.csv", "ends_by_champion.csv", "discrimination.csv"):
        columns = columns[columns.index("experiment") :]  # after those of other keys that were set
    assert columns == [name for name in described if name in columns]  # some were made before a column was added


def test_every_column_without_a_text_has_one_elsewhere():
    files = yaml.safe_load(COLUMNS.read_text())
    known = set(files.pop("everywhere"))
    for file in files.values():
        for column, text in file["columns"].items():
            assert text or column in known or column.endswith(("low", "high")), column
            known.add(column)


def test_every_array_is_described():
    network = Network((16, *Elman().sizes), wiring=Elman())
    one = empty_samples(5, network, Ode())
    traces = Traces(controller=["GA"], side=["left"], samples=type(one)(*(array[None] for array in one)))
    assert set(traces_arrays(traces, np.zeros(216), network)) == set(described_columns("traces.npz"))
    champion = champion_file(load_genome("reference", "obstacles"), 1.0, 1, 2)
    for name in parse_arrays(champion):
        assert any(fnmatch(name, described) for described in described_columns("champion.npz")), name


def without_module(name):
    return name.rpartition(":")[2]


def test_the_table_of_packages_is_that_of_the_csv(generated):
    """A row a package; `nox -s worlds` writes the CSV, which has a row an id."""
    tried = pd.read_csv(ROOT / "benchmarks" / "worlds.csv", keep_default_na=False)
    lines = []
    for package, rows in tried.groupby("package", sort=False):
        works = (rows[["loop", "evolves", "evaluates", "repeats"]] == "yes").all(axis=1)
        kinds = [kind for cell in [*rows.observations, *rows.actions] if (kind := cell.partition(" ")[0])]
        changes = rows.change[rows.acts == "yes"].str.split(":").str[0]
        why = [f"{without_module(row.id)}: {row.why}" if row.id else row.why for row in rows.itertuples() if row.why]
        names = ", ".join(map(without_module, rows.id[works]))
        count = f"{works.sum()} of {len(rows)}" if rows.id.any() else "0"
        cells = [
            rows.versions.iloc[0] or package,
            count,
            names,
            *(", ".join(dict.fromkeys(x)) for x in (kinds, changes)),
        ]
        lines.append([*cells, "; ".join(why)])
    head = ["package", "work", "which", "spaces", "changes that act", "what does not work, and why"]
    generated(ROOT / "docs" / "any_world.md", "packages", Table(head, lines).markdown())
