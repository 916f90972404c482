"""Tables and figures of lifetimes in environments: the return before and after a change, with intervals."""

import itertools
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from epuckhebb.analysis.lifetimes import Evaluated, Gathered
from epuckhebb.analysis.statistics import bootstrap, mean
from epuckhebb.analysis.tables import Table, plain
from epuckhebb.worlds.environment import Lived

_RETURNS = ("return", "return_before", "return_after")
_MEANS = (*_RETURNS, "steps", "recovery_steps", "weight_change_mean", "saturated_fraction")
CONDITION = ("environment", "change", "controller", "N")
_OWN = ("genome", "seed", "environment", "environment.change", "environment.changes", "hebbian.N")  # have columns
_NO_CONDITION = ("repeats", "environment.processes")  # keys that do not change what is evaluated
_BINS = 50  # of a lifetime, in `lifetime.csv`
_COLOURS = ("#555555", "#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00")


def over_lifetime(names: Sequence[str], lives: Sequence[Lived], horizon: int) -> list[dict[str, Any]]:
    """What happened in equal parts of a lifetime: a row for each controller and part, means over those that live.

    names: of the controller of each lifetime.
    """
    edges = np.unique(np.linspace(0, horizon, min(_BINS, horizon) + 1).astype(int))
    rows: list[dict[str, Any]] = []
    for name in dict.fromkeys(names):
        own = [lived for other, lived in zip(names, lives, strict=True) if other == name]
        for begin, end in itertools.pairwise(edges):
            there = [lived for lived in own if len(lived.rewards) > begin]
            if there:
                parts = (
                    [getattr(one, what)[begin:end].mean() for one in there]
                    for what in ("rewards", "weight_changes", "weight_steps")
                )
                reward, change, step = map(float, map(np.mean, parts))
                rows.append(
                    {
                        "controller": name,
                        "step": int(end),
                        "alive": len(there) / len(own),
                        "reward": reward,
                        "weight_change": change,
                        "weight_step": step,
                    }
                )
    return rows


def gather(evaluations: Sequence[Evaluated]) -> Gathered:
    """Put the lifetimes of many evaluations together; see `epuckhebb.analysis.lifetimes.gather`."""
    keys = list(dict.fromkeys(key for one in evaluations for key in one.settings if key not in _OWN + _NO_CONDITION))
    names = {(one.rows.genome.iloc[0], one.sha256) for one in evaluations}
    twice = {name for name, count in Counter(name for name, _ in names).items() if count > 1}
    frames = []
    for one in evaluations:
        first = {**one.place, **{key: one.settings.get(key, "") for key in keys}}
        frame = pd.concat([pd.DataFrame(first, index=one.rows.index), one.rows], axis=1)
        frame["genome"] = [f"{name}_{one.sha256[:8]}" if name in twice else name for name in frame.genome]
        frames.append(frame)
    return Gathered(pd.concat(frames, ignore_index=True), keys, "")


def table(metrics: pd.DataFrame, by: Sequence[str] = ("controller", "N")) -> pd.DataFrame:
    """A row for each condition, with means and 95 % bootstrap intervals of returns.

    With several champions each is one case, the mean of its lifetimes, and intervals are over champions; of a single
    champion they are over its lifetimes, and about the noise alone.
    """
    metrics = metrics.assign(**{name: pd.to_numeric(metrics[name]) for name in ("N", *_MEANS)})
    rows: list[dict[str, Any]] = []
    for condition, own in metrics.groupby(list(by), sort=False, dropna=False):
        champions = own.genome.nunique()
        cases = own.groupby("genome", sort=False)[list(_MEANS)].mean() if champions > 1 else own[list(_MEANS)]
        row: dict[str, Any] = dict(zip(by, condition, strict=True)) | {"champions": champions, "lifetimes": len(own)}
        for column in _MEANS:
            values = cases[column].to_numpy(float)
            row[column] = float(np.nanmean(values)) if np.isfinite(values).any() else np.nan
            if column in _RETURNS:
                row[f"{column}_low"], row[f"{column}_high"] = bootstrap(mean, values)
        rows.append(row)
    return pd.DataFrame(rows)


def readable(rows: pd.DataFrame, title: str = "") -> Table:
    """That table to read."""

    def cell(row: Mapping[str, Any], name: str) -> str:
        value, low, high = (row[f"{name}{end}"] for end in ("", "_low", "_high"))
        digits = 0 if abs(value) >= 100 else 1
        return f"{value:.{digits}f}" + ("" if np.isnan(low) else f" [{low:.{digits}f}, {high:.{digits}f}]")

    before = list(rows)[: list(rows).index("champions")]
    first = [name for name in before if name == "controller" or (name != "N" and rows[name].nunique(dropna=False) > 1)]
    headings = [*first, "return", "before", "after", "recovery (steps)", "weight change"]
    lines = [
        [
            *(plain(str(row[name])) for name in first),
            *(cell(row, name) for name in _RETURNS),
            "–" if np.isnan(row["recovery_steps"]) else f"{row['recovery_steps']:.0f}",
            f"{row['weight_change_mean']:.3g}",
        ]
        for row in rows.to_dict("records")
    ]
    return Table(headings, lines, title, text=len(first), numbers=True)


def lifetime(course: pd.DataFrame, title: str, changes: Sequence[int]) -> Figure:
    """The mean reward of a step and the weight change over a lifetime, with the changes marked.

    course: a row for each controller and part, of one champion or many. changes: steps.
    """
    from epuckhebb.analysis.figures import tidy

    drawn = Figure(figsize=(6.4, 5.6), layout="constrained")
    panels = drawn.subplots(2, 1, sharex=True)
    for number, (name, own) in enumerate(course.groupby("controller", sort=False)):
        mean_of = own.groupby("step")[["reward", "weight_change"]].mean()
        look = {"color": _COLOURS[number % len(_COLOURS)], "linestyle": ("-", "--", ":")[number // len(_COLOURS) % 3]}
        for axes, column in zip(panels, mean_of, strict=True):
            axes.plot(mean_of.index, mean_of[column], label=plain(str(name)), **look)
    for axes, label in zip(panels, ("mean reward of a step", "weight change"), strict=True):
        for step in changes:
            axes.axvline(step, color="black", linewidth=0.8, linestyle=":")
        axes.set_ylabel(label)
        tidy(axes)
    panels[1].set_xlabel("step" + (", changes dotted" if changes else ""))
    panels[0].legend(frameon=False, fontsize=8)
    drawn.suptitle(plain(title), fontsize=9)
    return drawn
