"""Ours beside theirs: the paper's Tables 1 to 3, cell by cell."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from epuckhebb.sim.controller import GA
from epuckhebb.study.findings import PAPER_N
from epuckhebb.study.tables import ROWS

NEW_LINE = "<br>"  # in a cell of a table in Markdown
CELL = ["scenario", "controller", "side"]
_DECIMALS = {"success": 0, "time_to_goal_s": 2}


def published_values(tables: Mapping[str, Any]) -> pd.DataFrame:
    """The contents of `conf/paper/tables.yaml`, a row a number, its cell in the columns before it.

    Raises:
        ValueError: a cell lacks its scenario, controller or side.
        TypeError: a value is no number.
    """
    rows = []
    for name, table in tables.items():
        if name == "success_elsewhere":
            continue
        for cell in table["cells"]:
            for side in ("left", "right"):
                if not {"scenario", "controller", side} <= set(cell):
                    raise ValueError(f"{name}: every cell needs scenario, controller, left and right; got {cell}")
                for metric in ROWS.values():
                    value = cell[side].get(metric, float("nan"))
                    if not isinstance(value, int | float):
                        raise TypeError(f"{name}: {metric} of {cell['scenario']} must be a number, got {value!r}")
                    rows.append(
                        {"table": name, "experiment": table["experiment"], "scenario": cell["scenario"]}
                        | {"controller": cell["controller"], "side": side, "metric": metric, "published": value}
                    )
    return pd.DataFrame(rows)


def published_success(tables: Mapping[str, Any]) -> pd.DataFrame:
    """What the paper says of success in every cell: experiment, scenario, controller, side, success (0, 1 or nan)."""
    values = published_values(tables)
    values = values[values.metric == "success"].rename(columns={"published": "success"})
    elsewhere = {
        (cell["scenario"], cell["controller"], side): cell[side]
        for cell in tables["success_elsewhere"]
        for side in ("left", "right")
    }
    known = [elsewhere.get(tuple(row[name] for name in CELL), row["success"]) for _, row in values.iterrows()]
    return values.assign(success=np.array(known, float))[["experiment", *CELL, "success"]]


def compare(published: pd.DataFrame, each: pd.DataFrame, showcase: Mapping[str, str]) -> pd.DataFrame:
    """For every number of the paper: the showcase's, its relative deviation, and median and quartiles of all champions.

    each: `epuckhebb.study.findings.trials`. showcase: the champion to put beside the paper, for each experiment.
    """
    rows = []
    for _, cell in published[published.experiment.isin(list(showcase))].iterrows():
        rate = 0.0 if cell.controller == GA else PAPER_N[cell.experiment]
        here = each[(each.experiment == cell.experiment) & (each.scenario == cell.scenario) & (each.side == cell.side)]
        here = here[(here.controller == cell.controller) & (rate == here.N)].set_index("genome")
        values = here[cell.metric] if cell.metric in here else _speed(here, cell.experiment)
        ours = float(values.get(showcase[cell.experiment], float("nan")))
        if cell.metric == "weight_change_mean" and cell.controller == GA:
            continue
        quartiles = values.quantile([0.25, 0.5, 0.75]).to_numpy(float)
        rows.append(
            {**cell, "ours": ours, "relative_deviation": _deviation(ours, cell.published)}
            | {"median": quartiles[1], "q25": quartiles[0], "q75": quartiles[2], "n": int(values.notna().sum())}
        )
    return pd.DataFrame(rows)


def _speed(here: pd.DataFrame, experiment: str) -> pd.Series:
    return here.path_length_m / {"light": 200.0, "obstacles": 250.0}[experiment]


def _deviation(ours: float, published: float) -> float:
    return ours / published - 1 if published else float("nan")


def to_markdown(comparison: pd.DataFrame, *, of_all: bool) -> str:
    """A table in the paper's layout; each cell `ours (paper)`, or for all champions `median [quartiles] (paper)`."""
    columns = comparison[CELL].drop_duplicates()
    head = ["", *(f"{c.scenario}{NEW_LINE}{c.controller} {c.side}" for c in columns.itertuples())]
    lines = [head, ["---", *["---:"] * len(columns)]]
    for row, metric in ROWS.items():
        of_metric = comparison[comparison.metric == metric].set_index(CELL)
        if not len(of_metric):
            continue
        cells = []
        for column in columns.itertuples(index=False):
            value = of_metric.loc[tuple(column)] if tuple(column) in of_metric.index else None
            cells.append("–" if value is None else _cell(value, metric, of_all=of_all))
        lines.append([f"**{row}**", *cells])
    return "".join(f"| {' | '.join(line)} |\n" for line in lines)


def _cell(value: "pd.Series[Any]", metric: str, *, of_all: bool) -> str:
    decimals = _DECIMALS.get(metric, 4 if abs(value.ours) < 10 or np.isnan(value.ours) else 2)

    def text(number: float, places: int = decimals) -> str:
        return "–" if np.isnan(number) else f"{number:.{places}f}"

    paper = f" ({text(value.published)})" if not np.isnan(value.published) else ""
    if not of_all:
        return f"{text(value.ours, 1 if metric == 'success' and value.ours % 1 else decimals)}{paper}"
    places = 1 if metric == "success" else decimals
    return f"{text(value['median'], places)} [{text(value.q25, places)}, {text(value.q75, places)}]{paper}"
