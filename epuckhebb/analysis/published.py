"""The paper's Tables 1 to 3, cell by cell, beside the values of this program."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from epuckhebb.analysis.findings import PAPER_N
from epuckhebb.analysis.paper_table import METRICS
from epuckhebb.analysis.tables import NEW_LINE, Table
from epuckhebb.tmaze.individual import GA
from epuckhebb.tmaze.maze import SIDES

CELL = ["scenario", "controller", "side"]
_DECIMALS = {"success": 0, "time_to_goal_s": 2}
_CLOSE = 0.05
_DURATION_S = {"light": 200.0, "obstacles": 250.0}


def published_values(tables: Mapping[str, Any]) -> pd.DataFrame:
    """The contents of `conf/paper/tables.yaml`, a row a number, its cell in the columns before it."""
    return pd.DataFrame(
        {"table": name, "experiment": table["experiment"], "scenario": cell["scenario"]}
        | {"controller": cell["controller"], "side": side, "metric": metric}
        | {"published": float(cell[side].get(metric, np.nan))}
        for name, table in tables.items()
        if name != "success_elsewhere"
        for cell in table["cells"]
        for side in SIDES
        for metric in METRICS.values()
    )


def published_success(tables: Mapping[str, Any]) -> pd.DataFrame:
    """The paper's success in every cell: experiment, scenario, controller, side, success (0, 1 or nan)."""
    values = published_values(tables)
    values = values[values.metric == "success"].rename(columns={"published": "success"})
    elsewhere = {
        (cell["scenario"], cell["controller"], side): cell[side]
        for cell in tables["success_elsewhere"]
        for side in SIDES
    }
    success = [elsewhere.get(tuple(row[name] for name in CELL), row["success"]) for _, row in values.iterrows()]
    return values.assign(success=np.array(success, float))[["experiment", *CELL, "success"]]


def compare(published: pd.DataFrame, each: pd.DataFrame, showcase: Mapping[str, str]) -> pd.DataFrame:
    """For every number of the paper: that of the showcase, its relative deviation, and the quartiles of all champions.

    each: `epuckhebb.analysis.findings.trials`. showcase: the champion to put beside the paper, for each experiment.
    """
    rows = []
    for _, cell in published[published.experiment.isin(list(showcase))].iterrows():
        trials = _cell_trials(each, cell).set_index("genome")
        values = trials[cell.metric] if cell.metric in trials else trials.path_length_m / _DURATION_S[cell.experiment]
        ours = float(values.get(showcase[cell.experiment], np.nan))
        if cell.metric == "weight_change_mean" and cell.controller == GA:
            continue
        quartiles = values.quantile([0.25, 0.5, 0.75]).to_numpy(float)
        rows.append(
            {**cell, "ours": ours, "relative_deviation": ours / cell.published - 1 if cell.published else np.nan}
            | {"median": quartiles[1], "q25": quartiles[0], "q75": quartiles[2], "n": int(values.notna().sum())}
        )
    return pd.DataFrame(rows)


def close(comparison: pd.DataFrame) -> str:
    """How many of the paper's numbers, success apart, the showcase meets to 5 %, of how many."""
    numbers = comparison[(comparison.metric != "success") & (comparison.published.fillna(0.0) != 0.0)]
    return f"{int((numbers.relative_deviation.abs() <= _CLOSE).sum())} of {len(numbers)}"


def _cell_trials(table: pd.DataFrame, cell: "pd.Series[Any]") -> pd.DataFrame:
    """Our trials of a cell of the paper's tables, at the paper's rate."""
    rate = 0.0 if cell.controller == GA else PAPER_N[cell.experiment]
    return table[(table[["experiment", *CELL]] == cell[["experiment", *CELL]]).all(axis=1) & (rate == table.N)]


def table(comparison: pd.DataFrame, *, of_all: bool) -> Table:
    """A table in the paper's layout; each cell `ours (paper)`, or for all champions `median [quartiles] (paper)`."""
    columns = comparison[CELL].drop_duplicates()
    head = ["", *(f"{c.scenario}{NEW_LINE}{c.controller} {c.side}" for c in columns.itertuples())]
    cells = {(row.metric, *row[CELL]): _cell(row, of_all=of_all) for _, row in comparison.iterrows()}
    lines = [
        [f"**{name}**", *(cells.get((metric, *column), "–") for column in columns.itertuples(index=False))]
        for name, metric in METRICS.items()
        if metric in set(comparison.metric)
    ]
    return Table(head, lines, numbers=True)


def _cell(value: "pd.Series[Any]", *, of_all: bool) -> str:
    """One cell of a table in the paper's layout: our number, and the paper's in brackets."""
    decimals = _DECIMALS.get(value.metric, 4 if abs(value.ours) < 10 or np.isnan(value.ours) else 2)

    def text(number: float, places: int) -> str:
        return "–" if np.isnan(number) else f"{number:.{places}f}"

    paper = f" ({text(value.published, decimals)})" if not np.isnan(value.published) else ""
    places = 1 if value.metric == "success" and (of_all or value.ours % 1) else decimals
    if not of_all:
        return f"{text(value.ours, places)}{paper}"
    return f"{text(value['median'], places)} [{text(value.q25, places)}, {text(value.q75, places)}]{paper}"
