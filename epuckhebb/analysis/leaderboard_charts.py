"""Figures of the leaderboard: success and differences, performance profiles, anytime curves."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import LogLocator

from epuckhebb.analysis import leaderboard
from epuckhebb.analysis.charts import INK, KIND, SOFT, annotate_row, empty_figure, group_experiments
from epuckhebb.analysis.image import house_style, plain
from epuckhebb.analysis.statistics import LEAST, performance_profile

_MARKER = {leaderboard.PLAIN: "o", leaderboard.EVOLVED: "D", leaderboard.POST_HOC: "s"}
_SHARE = ("share of trials that succeed", "share of rewarded trials")
_OTHERS = {"rule off": "x", "reward inverted": "v", "one champion": "."}


@house_style()
def success(board: pd.DataFrame, champions: pd.DataFrame, limits: Mapping[str, float]) -> Figure:
    """Success of each method of an experiment below its class of knowledge, and the difference to the matched control.

    board, champions: the rows of the experiment in the two tables of `analysis.leaderboard`; methods with fewer than
    six champions are left out. limits: lines with their names, such as chance and the optimum.
    """
    is_reversal = bool((board.experiment == leaderboard.REVERSAL).all())  # all have one knowledge there, the reward
    by = "experiment" if is_reversal else "knowledge_class"
    groups = list(board[board.champions >= LEAST].groupby(by, sort=False))
    if not groups:
        return empty_figure()
    lines = sum(len(group) + 1 for _, group in groups)
    drawn = Figure(figsize=(8.0, 0.25 * lines + 1.4))
    left, right = drawn.subplots(1, 2, width_ratios=(3, 2), sharey=True)
    ticks, y = dict[int, str](), 0
    for knowledge, group in groups:
        if len(groups) > 1:
            head = {"xycoords": ("axes fraction", "data"), "ha": "right", "va": "center", "weight": "bold"}
            left.annotate(knowledge, (-0.01, y), **head)
            y -= 1
        for row in group.itertuples():
            look = {"color": KIND[row.kind], "marker": _MARKER[row.kind]}
            single = champions[champions.method == row.method]
            left.scatter(single.successes / single.trials, [y - 0.3] * len(single), s=5, color=SOFT, linewidths=0)
            for value, marker in ((row.success_off, "x"), (row.success_inverted, "v")):
                left.scatter(value, y, s=24, marker=marker, color=INK, facecolor="none" if marker == "v" else INK)
            for axes, name in ((left, "success"), (right, "difference")):
                value, low, high = (getattr(row, name + end) for end in ("", "_low", "_high"))
                axes.errorbar(value, y, xerr=np.nan_to_num([[value - low], [high - value]]), **look)
            annotate_row(right, f"{row.success:.2f}", y, 6)
            annotate_row(right, f"{row.champions}", y, 42)
            ticks[y], y = plain(row.method), y - 1
    left.set_yticks(list(ticks), list(ticks.values()))
    for name, share in limits.items():
        left.axvline(share, color=INK, linewidth=0.8, linestyle="--", zorder=0.5)
        left.annotate(name, (share, 0.6), (2, 0), textcoords="offset points", fontsize=8)
    left.set(xlim=(-0.02, 1.02), ylim=(y + 0.3, 0.8), xlabel=f"{_SHARE[is_reversal]} (aim: 1)")
    right.set(xlim=(-0.62, 0.62), xlabel="difference to the matched control\n(aim: above 0)")
    right.axvline(0, color=INK, linewidth=0.8)
    annotate_row(right, "share", 0.5, 6, weight="bold")
    annotate_row(right, "n", 0.5, 42, weight="bold")
    for axes in (left, right):
        axes.grid(axis="x")
        axes.tick_params(axis="y", length=0)
    kinds = [(leaderboard.KINDS[kind], KIND[kind], _MARKER[kind]) for kind in _MARKER if kind in set(board.kind)]
    dots = {"rule off": board.success_off, "reward inverted": board.success_inverted, "one champion": board.champions}
    kinds += [(name, INK, marker) for name, marker in _OTHERS.items() if dots[name].notna().any()]
    marks = [Line2D([], [], color=colour, marker=mark, linestyle="", label=name) for name, colour, mark in kinds]
    drawn.legend(handles=marks, loc="outside lower center", ncols=3, title="bars: 95 % intervals over champions")
    return drawn


@house_style()
def profiles(board: pd.DataFrame, champions: pd.DataFrame) -> Figure:
    """The share of champions that exceed each success: a curve for each method, a panel for each experiment.

    board, champions: the tables `leaderboard.csv` and `champions.csv`.
    """
    thresholds = np.linspace(0.0, 1.0, 401)

    def curve(rows: pd.DataFrame) -> tuple[Any, Any]:
        return thresholds, performance_profile((rows.successes / rows.trials).to_numpy(float), thresholds)

    drawn = _curves(board, champions, curve, drawstyle="steps-post")
    for axes in drawn.axes:
        axes.set(xlim=(0, 1), xlabel="success over the test worlds")
    drawn.axes[0].set_ylabel("share of champions that exceed it")
    return drawn


@house_style()
def anytime(board: pd.DataFrame, course: pd.DataFrame) -> Figure:
    """The success of each method against the robot-steps of its evolution. course: `anytime.csv`."""
    tested = board[board.method.isin(course.method)]
    drawn = _curves(tested, course, lambda rows: (rows.robot_steps / 1e6, rows.success), marker="o", markersize=3)
    for axes in drawn.axes:
        axes.set(xscale="log", xlabel="million robot-steps of evolution")
        axes.minorticks_off()
        axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        axes.xaxis.set_major_formatter("{x:g}")
        axes.legend(title="band: 95 % interval over champions", alignment="left")
    drawn.axes[0].set_ylabel("success over the test worlds")
    return drawn


def _curves(
    board: pd.DataFrame, rows: pd.DataFrame, curve: Callable[[pd.DataFrame], tuple[Any, Any]], **style: Any
) -> Figure:
    """A line for each method, a panel for each experiment; the best method of each kind has its name.

    board: a row for each method and experiment. rows: of both. curve: x and y of a line, from the rows of its method.
    """
    groups = group_experiments(board[board.experiment.isin(rows.experiment)])
    drawn = Figure(figsize=(3.5 * len(groups) + 0.8, 3.4))
    panels = drawn.subplots(1, len(groups), squeeze=False, sharey=True)[0]
    for axes, (experiment, methods) in zip(panels, groups, strict=True):
        best = methods.loc[methods.groupby("kind").success.idxmax()].set_index("method").kind
        for method in sorted(methods.method, key=lambda name: name in best):  # the best come last, above the others
            line = rows[(rows.experiment == experiment) & (rows.method == method)]
            x, y = curve(line)
            look = {"color": "#c4c4c4", "linewidth": 0.8, **style}
            if method in best:
                colour, label = KIND[best[method]], plain(method)
                if "success_low" in line:
                    label += f", at the end {line.success.iloc[-1]:.2f}"
                    band = {"color": colour, "alpha": 0.12, "linewidth": 0, "zorder": 0}
                    axes.fill_between(x, line.success_low, line.success_high, **band)
                look |= {"color": colour, "linewidth": 2.2, "label": label}
            axes.plot(x, y, **look)
        axes.set(ylim=(0, 1.02), title=f"{leaderboard.title(experiment)}, n = {methods.champions.max()}")
        axes.legend()
    return drawn
