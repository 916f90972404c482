"""Reversal learning: the share of rewarded trials of each controller, beside chance and the optimum."""

from typing import Any

import pandas as pd

from epuckhebb.analysis import statistics
from epuckhebb.analysis.tables import Table
from epuckhebb.tmaze.task import Task

COLUMNS = ("controller", "lifetimes", "rewarded_share", "low", "high", "end_share")


def table(metrics: pd.DataFrame, trials: pd.DataFrame, task: Task, seed: int) -> pd.DataFrame:
    """A row for each controller with the columns `COLUMNS`, and one for each of the limits of the task.

    A repeat is two lifetimes with switches at the same trials: one with each end rewarded first, or, with
    `task.first=left`, two that differ in their noise. Its value is their mean. The interval is a bootstrap over
    repeats.

    metrics: a row for each lifetime. trials: a row for each trial. seed: of the bootstrap.
    """
    rows: list[tuple[Any, ...]] = []
    for name, lifetimes in metrics.groupby("controller", sort=False):
        pairs = lifetimes.groupby("repeat").rewarded_share.mean().to_numpy()
        low, high = statistics.bootstrap(statistics.mean, pairs, seed=seed)
        ends = (trials.reached_side[trials.controller == name] != "").mean()
        rows.append((name, len(lifetimes), pairs.mean(), low, high, ends))
    rows += [(name, None, share, None, None, None) for name, share in task.limits().items()]
    return pd.DataFrame(rows, columns=list(COLUMNS)).astype({"lifetimes": "Int64"})


def readable(table: pd.DataFrame, title: str = "") -> Table:
    """The table to read."""
    rows = []
    for row in table.itertuples():
        interval = "" if pd.isna(row.low) else f"[{row.low:.3f}, {row.high:.3f}]"
        ends = "" if pd.isna(row.end_share) else f"{row.end_share:.3f}"
        count = "" if pd.isna(row.lifetimes) else f"{row.lifetimes:.0f}"
        rows.append([str(row.controller), f"{row.rewarded_share:.3f}", interval, ends, count])
    head = ["", "rewarded share", "95 % interval", "trials in which it reached an end", "lifetimes"]
    return Table(head, rows, title)
