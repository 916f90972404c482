"""Over many evolutions: a row for each way to evolve, with intervals over seeds, and a table to read."""

import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from epuckhebb.analysis.statistics import bootstrap, interval_title, mean
from epuckhebb.analysis.tables import Table, cell, interval_text, plain
from epuckhebb.tmaze.robot import STEP_S

_NEVER = 1e12  # robot-hours; more than any evolution has
_TO_SUCCESS = "hours_to_success"
_HEADINGS = {"best_fitness": "best fitness", "best_success": "its success", _TO_SUCCESS: "hours to success"}
HOURS = STEP_S / 3600  # of a robot-step

Histories = Sequence[tuple[Mapping[str, Any], Sequence[pd.DataFrame]]]


def summary(evolutions: Histories, fitness: float | None = None) -> pd.DataFrame:
    """A row for each way to evolve: number of seeds, best fitness and success at the end, robot-hours to success.

    evolutions: for each way its settings, and the `history.csv` of each seed. fitness: robot-hours are those until the
    best fitness reaches this; None: until all lifetimes of the fittest end at the goal. They are the median over all
    seeds, those that never reach it included, and empty if half of them do not. Intervals: bootstrap over seeds. An
    environment knows no success, and no hours.
    """
    rows = []
    for settings, histories in evolutions:
        values = {
            name: np.array([run[name].iloc[-1] for run in histories]) for name in _HEADINGS if name in histories[0]
        }
        steps = np.mean([history.robot_steps.sum() for history in histories])
        row = {**settings, "n": len(histories)}
        if "best_success" in values:
            values[_TO_SUCCESS] = hours = np.array([_hours(history, fitness) for history in histories])
            row |= {"robot_hours": steps * HOURS, "n_reached": int((hours < _NEVER).sum())}
        else:
            row["robot_steps"] = steps
        for name, finals in values.items():
            statistic = _median if name == _TO_SUCCESS else mean
            numbers = float(statistic(finals)), *bootstrap(statistic, finals)
            reached = [number if number < _NEVER else math.nan for number in numbers]
            row |= dict(zip((name, f"{name}_low", f"{name}_high"), reached, strict=True))
        rows.append(row)
    return pd.DataFrame(rows)


def distinct(evolutions: Iterable[tuple[NDArray[np.float64], pd.DataFrame]]) -> list[pd.DataFrame]:
    """The histories of evolutions, each of them once: copies are no sample.

    evolutions: the champion's genes and the history of each. Copies have both bit-identical.
    """
    once: dict[tuple[bytes, str], pd.DataFrame] = {}
    for champion, history in evolutions:
        once.setdefault((champion.tobytes(), history.to_csv(index=False)), history)
    return list(once.values())


def readable(table: pd.DataFrame) -> Table:
    """The table to read."""
    settings = list(table.columns[: table.columns.get_loc("n")])
    cost = "robot_hours" if "robot_hours" in table else "robot_steps"
    names = [name for name in _HEADINGS if name in table]
    rows = []
    for _, row in table.astype(object).iterrows():  # a row of numbers alone would have no whole ones
        numbers = [interval_text(row, name, ".3g") for name in names]
        if "n_reached" in row:
            numbers[-1] += f" ({row['n_reached']} of {row['n']})"
        rows.append([*(cell(row[key]) for key in settings), str(row["n"]), *numbers, f"{row[cost]:.4g}"])
    headings = [*map(plain, settings), "n", *(_HEADINGS[name] for name in names), plain(cost)]
    title = f"Evolutions: means, {interval_title('seeds', table.n.tolist())}"
    return Table(headings, rows, title, text=len(settings))


def _hours(history: pd.DataFrame, fitness: float | None) -> float:
    """Robot-hours until the first generation that reaches it."""
    reached = history.best_success >= 1 if fitness is None else history.best_fitness >= fitness
    return float(history.robot_steps.cumsum()[reached].min() * HOURS) if reached.any() else _NEVER


def _median(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.quantile(values, 0.5, axis=-1, method="higher"))
