"""Over many evolutions: a row for each way to evolve, with intervals over seeds, and a table to read."""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from epuckhebb.analysis.statistics import bootstrap, mean
from epuckhebb.analysis.tables import Table, plain
from epuckhebb.tmaze.robot import STEP_S

_NEVER = 1e12  # robot-hours; more than any evolution has
_VALUES = ("best_fitness", "best_success", "hours_to_success")
HOURS = STEP_S / 3600  # of a robot-step

Histories = Sequence[tuple[Mapping[str, Any], Sequence[pd.DataFrame]]]


def summary(evolutions: Histories, fitness: float | None = None) -> pd.DataFrame:
    """A row for each way to evolve: number of seeds, best fitness and success at the end, robot-hours to success.

    evolutions: for each way its settings, and the `history.csv` of each seed. fitness: robot-hours are those until the
    best fitness reaches this; None: until all lifetimes of the fittest end at the goal. They are the median over all
    seeds, those that never reach it included, and empty if half of them do not. Intervals: bootstrap over seeds.
    """
    rows = []
    for settings, histories in evolutions:
        lasts = [history.iloc[-1] for history in histories]
        hours = np.array([_hours(history, fitness) for history in histories])
        row = {**settings, "n": len(lasts), "robot_hours": np.mean([h.robot_steps.sum() for h in histories]) * HOURS}
        row["n_reached"] = int((hours < _NEVER).sum())
        for name in _VALUES:
            values = hours if name == _VALUES[-1] else np.array([last[name] for last in lasts], float)
            statistic = _median if name == _VALUES[-1] else mean
            numbers = float(statistic(values)), *bootstrap(statistic, values)
            known = [number if number < _NEVER else math.nan for number in numbers]
            row |= dict(zip((name, f"{name}_low", f"{name}_high"), known, strict=True))
        rows.append(row)
    return pd.DataFrame(rows)


def readable(table: pd.DataFrame) -> Table:
    """The table to read."""
    settings = list(table.columns[: table.columns.get_loc("n")])
    rows = []
    for row in table.to_dict("records"):
        cells = [_with_interval(row, name) for name in _VALUES]
        cells[-1] += f" ({row['n_reached']} of {row['n']})"
        rows.append([*(plain(str(row[key])) for key in settings), str(row["n"]), *cells, f"{row['robot_hours']:.4g}"])
    headings = [*map(plain, settings), "n", "best fitness", "its success", "robot-hours to success", "robot-hours"]
    return Table(headings, rows, "Evolutions: means over seeds, 95 % intervals", text=len(settings))


def _with_interval(row: Mapping[Any, Any], name: str) -> str:
    value, low, high = row[name], row[f"{name}_low"], row[f"{name}_high"]
    interval = "" if math.isnan(low) else f" [{low:.3g}, {'–' if math.isnan(high) else f'{high:.3g}'}]"
    return ("–" if math.isnan(value) else f"{value:.3g}") + interval


def _hours(history: pd.DataFrame, fitness: float | None) -> float:
    """Robot-hours until the first generation that reaches it."""
    reached = history.best_success >= 1 if fitness is None else history.best_fitness >= fitness
    return float(history.robot_steps.cumsum()[reached].min() * HOURS) if reached.any() else _NEVER


def _median(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.quantile(values, 0.5, axis=-1, method="higher"))
