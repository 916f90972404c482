"""Parts of the pages that are generated from the code: what is in each file, and every key."""

import io
from fnmatch import fnmatch
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from epuckhebb.app import files, formats
from epuckhebb.evolution.evolve import Generation, history_row
from epuckhebb.sim.lifetime import empty_samples
from epuckhebb.sim.network import PAPER_NETWORK
from epuckhebb.study import evaluate, findings, self_checks, summary
from epuckhebb.study.evaluate import Traces
from epuckhebb.study.tables import markdown_table

ROOT = Path(__file__).parents[1]
FILES = ROOT / "docs" / "files.md"
REFERENCE = ROOT / "runs" / "reference"


def tables():
    """The columns of every table, as sections of a page."""
    parts = []
    for name, (told, columns) in formats.TABLES.items():
        rows = [[f"`{column}`", meaning.told] for column, meaning in columns.items()]
        parts.append(f"\n## Columns of {name}\n\n{told}\n\n{markdown_table(['column', 'what it is'], rows)}")
    return "".join(parts)


def arrays(told):
    rows = [
        [f"`{name}`", " x ".join(map(str, array.shape)) or "one value", array.unit, array.told]
        for name, array in told.items()
    ]
    return markdown_table(["array", "shape", "unit", "what it is"], rows)


def test_the_page_of_files_tells_what_the_code_tells(generated):
    generated(FILES, "tables", tables())
    generated(FILES, "traces", arrays(formats.TRACES))
    generated(FILES, "champion", arrays(formats.CHAMPION))


def test_every_column_is_told_once():
    told = {name: list(columns) for name, (_, columns) in formats.TABLES.items()}
    assert all(column.told for _, columns in formats.TABLES.values() for column in columns.values())
    assert told["metrics.csv"] == list(evaluate.COLUMNS)
    assert told["findings.csv"] == list(self_checks.COLUMNS)
    one = np.zeros(1)
    last = {"champion": one, "champion_fitness": 0.0, "state": {}, "robot_steps": 0, "seconds": 0.0}
    assert told["history.csv"] == list(history_row(Generation(number=0, fitness=one, success=one, **last)))
    lifetime = pd.DataFrame([dict.fromkeys(evaluate.COLUMNS, "1")])
    assert list(summary.summary(lifetime, ["light"]))[-len(told["summary.csv"]) :] == told["summary.csv"]
    assert told["trials.csv"] == list(findings.trials(lifetime.assign(**lifetime.iloc[0, 11:20].astype(float))))


@pytest.mark.parametrize("table", sorted(REFERENCE.rglob("*.csv")), ids=lambda table: str(table.relative_to(REFERENCE)))
def test_the_tables_of_the_reference_results_are_told(table):
    assert list(pd.read_csv(table, nrows=0)) == list(formats.TABLES[table.name][1])


def test_every_array_of_the_traces_is_told_with_its_shape():
    one = empty_samples(5, PAPER_NETWORK)
    samples = type(one)(*(np.stack([array] * 4) for array in one))
    traces = Traces(controller=["GA"] * 4, side=["left"] * 4, samples=samples)
    with np.load(io.BytesIO(files.traces_file(traces, np.zeros(234), PAPER_NETWORK))) as written:
        assert set(written) == set(formats.TRACES)
        sizes = {"lifetimes": 4, "samples": 5, "inputs": 16, "synapses": 234, "layers": 6}
        for name, array in formats.TRACES.items():
            assert written[name].shape == tuple(sizes.get(size, size) for size in array.shape), name


def test_every_array_of_a_champion_is_told():
    genome = files.load_genome("reference", "obstacles")
    with np.load(io.BytesIO(files.champion_file(genome, 1.0, "obstacles", 1, 2))) as written:
        for name in written:
            assert any(fnmatch(name, told) for told in formats.CHAMPION), name
        assert all(any(fnmatch(name, told) for name in written) for told in formats.CHAMPION if told != "self_*")
