"""Reversal learning: the share of rewarded trials of each controller, beside chance and the optimum."""

from typing import Any

import pandas as pd

from epuckhebb.analysis import statistics
from epuckhebb.analysis.tables import markdown_table
from epuckhebb.tmaze.tasks.reversal import Reversal

CHANCE, OPTIMUM = "chance", "optimum"  # names of their rows and lines
COLUMNS = ("controller", "lifetimes", "rewarded_share", "low", "high", "end_share")


def limits(task: Reversal) -> dict[str, float]:
    """The share of rewarded trials of a robot that does not learn, and the best possible share, by name.

    Lifetimes come in pairs: one with each end rewarded first, and the switch at the same trial. A fixed sequence of
    choices is therefore right in one lifetime wherever it is wrong in the other.
    """
    return {CHANCE: 0.5, OPTIMUM: task.optimum()}


def table(metrics: pd.DataFrame, trials: pd.DataFrame, task: Reversal, seed: int) -> pd.DataFrame:
    """A row for each controller with the columns `COLUMNS`, and two for chance and the optimum.

    A repeat is two lifetimes: one with each end rewarded first, and the switch at the same trial. Its value is their
    mean. The interval is a bootstrap over repeats.

    metrics, trials: of `epuckhebb.analysis.evaluate`. seed: of the bootstrap.
    """
    rows: list[tuple[Any, ...]] = []
    for name, lifetimes in metrics.groupby("controller", sort=False):
        pairs = lifetimes.groupby("repeat").rewarded_share.mean().to_numpy()
        low, high = statistics.bootstrap_mean(pairs, seed, (0.0, 1.0))
        ends = (trials.reached_side[trials.controller == name] != "").mean()
        rows.append((name, len(lifetimes), pairs.mean(), low, high, ends))
    rows += [(name, None, share, None, None, None) for name, share in limits(task).items()]
    return pd.DataFrame(rows, columns=list(COLUMNS)).astype({"lifetimes": "Int64"})


def to_markdown(table: pd.DataFrame) -> str:
    """The table in Markdown."""
    rows = []
    for row in table.itertuples():
        interval = "" if pd.isna(row.low) else f"{row.low:.3f} to {row.high:.3f}"
        ends = "" if pd.isna(row.end_share) else f"{row.end_share:.3f}"
        count = "" if pd.isna(row.lifetimes) else str(row.lifetimes)
        rows.append([str(row.controller), f"{row.rewarded_share:.3f}", interval, ends, count])
    return markdown_table(
        ["", "rewarded share", "95 % interval", "trials in which it reached an end", "lifetimes"], rows
    )
