"""Figures of the leaderboard: success and differences, performance profiles, anytime curves."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from epuckhebb.analysis import leaderboard
from epuckhebb.analysis.figures import plain, tidy
from epuckhebb.analysis.image import as_by_default
from epuckhebb.analysis.statistics import performance_profile

_COLOUR = {leaderboard.PLAIN: "#555555", leaderboard.EVOLVED: "#0072B2", leaderboard.POST_HOC: "#D55E00"}


@as_by_default()
def leaderboard_of(board: pd.DataFrame, champions: pd.DataFrame, limits: Mapping[str, Mapping[str, float]]) -> Figure:
    """Two panels for each experiment: success of each method, and the difference to its matched control.

    board, champions: the two tables of `analysis.leaderboard`. limits: for some experiments lines with their names,
    such as chance and the optimum.
    """
    groups = list(board.groupby("experiment", sort=False))
    heights = [0.27 * len(own) + 0.9 for _, own in groups]
    drawn = Figure(figsize=(10.5, sum(heights) + 0.5), layout="constrained")
    panels = drawn.subplots(len(groups), 2, squeeze=False, height_ratios=heights, width_ratios=(3, 2))
    for (left, right), (experiment, own) in zip(panels, groups, strict=True):
        for line, row in enumerate(own.itertuples()):
            place = -line
            colour = _COLOUR[str(row.kind)]
            single = champions[(champions.experiment == experiment) & (champions.method == row.method)]
            shares = single.successes / single.trials
            left.scatter(shares, [place - 0.25] * len(shares), s=10, color=colour, alpha=0.45, linewidths=0)
            _interval(left, place, colour, row.success, row.success_low, row.success_high)
            left.scatter([row.success_off], [place], s=26, marker="x", color=colour, linewidths=1.1)
            left.scatter([row.success_inverted], [place], s=26, marker="v", color=colour, facecolor="none")
            _interval(right, place, colour, row.difference, row.difference_low, row.difference_high)
        left.set_yticks(-np.arange(len(own)), [plain(name) for name in own.method], fontsize=8)
        for name, share in limits.get(str(experiment), {}).items():
            left.axvline(share, color="black", linewidth=0.8, linestyle="--", zorder=0.5)
            left.annotate(name, (share, 0.6), (2, -7), textcoords="offset points", fontsize=7)
        left.set(xlim=(-0.02, 1.02), title=leaderboard.title(str(experiment)))
        right.set(title="difference to the matched control")
        right.axvline(0, color="black", linewidth=0.8)
        right.tick_params(labelleft=False)
        for axes in (left, right):
            axes.set_ylim(0.6 - len(own), 0.6)
            axes.title.set_fontsize(10)
            tidy(axes, "x")
        right.set_yticks(left.get_yticks())
    panels[-1][0].set_xlabel("share of trials that succeed")
    panels[-1][1].set_xlabel("difference of that share")
    marks = [
        Line2D([], [], color=colour, marker="o", linestyle="", markersize=5, label=leaderboard.KINDS[kind])
        for kind, colour in _COLOUR.items()
        if kind in set(board.kind)
    ]
    drawn.legend(handles=marks, frameon=False, fontsize=8, loc="outside lower center", ncols=len(marks))
    return drawn


@as_by_default()
def profiles(board: pd.DataFrame, champions: pd.DataFrame) -> Figure:
    """The share of champions that exceed each success, of each method; see `leaderboard_of`."""
    thresholds = np.linspace(0.0, 1.0, 401)

    def curve(own: pd.DataFrame) -> tuple[Any, Any]:
        return thresholds, performance_profile((own.successes / own.trials).to_numpy(float), thresholds)

    drawn = _curves(board, champions, curve, drawstyle="steps-post")
    for axes in drawn.axes:
        axes.set(xlim=(0, 1), xlabel="success over the test worlds", ylabel="share of champions that exceed it")
    return drawn


@as_by_default()
def anytime(board: pd.DataFrame, course: pd.DataFrame) -> Figure:
    """The success of each method against the robot-steps of its evolution. course: of `leaderboard.anytime`."""
    tested = board[board.method.isin(course.method)]
    drawn = _curves(tested, course, lambda own: (own.robot_steps / 1e6, own.success), marker="o", markersize=3)
    for axes in drawn.axes:
        axes.set(xscale="log", xlabel="million robot-steps of evolution", ylabel="success over the test worlds")
    return drawn


def _curves(
    board: pd.DataFrame, rows: pd.DataFrame, curve: Callable[[pd.DataFrame], tuple[Any, Any]], **style: Any
) -> Figure:
    """A line for each method, a panel for each experiment; the best method of each kind has its name."""
    groups = list(board[board.experiment.isin(rows.experiment)].groupby("experiment", sort=False))
    drawn = Figure(figsize=(3.6 * len(groups) + 1.0, 3.6), layout="constrained")
    for axes, (experiment, own) in zip(drawn.subplots(1, len(groups), squeeze=False)[0], groups, strict=True):
        best = own.loc[own.groupby("kind").success.idxmax()].set_index("method").kind
        for method in sorted(own.method, key=lambda name: name in best):
            line = curve(rows[(rows.experiment == experiment) & (rows.method == method)])
            axes.plot(*line, color="#bbbbbb", linewidth=0.8, **style)
            if method in best:
                axes.plot(*line, color=_COLOUR[best[method]], linewidth=2.0, label=plain(method), **style)
        axes.set(ylim=(0, 1.02), title=leaderboard.title(str(experiment)))
        axes.title.set_fontsize(10)
        tidy(axes)
        axes.legend(frameon=False, fontsize=8)
    return drawn


def _interval(axes: Axes, place: int, colour: str, value: float, low: float, high: float) -> None:
    away = None if np.isnan(low) else [[value - low], [high - value]]
    axes.errorbar([value], [place], xerr=away, fmt="o", color=colour, markersize=5, elinewidth=1.3)
