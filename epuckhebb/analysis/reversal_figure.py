"""The figure of reversal learning; apart from the tables, so that these do not wait for matplotlib."""

from collections.abc import Mapping

import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from epuckhebb.analysis.figures import plain, tidy
from epuckhebb.analysis.reversal import CHANCE, OPTIMUM

_COLOURS = ("#999999", "#009E73", "#CC79A7", "#0072B2", "#D55E00", "#E69F00")
_BEFORE, _AFTER = -3, 6  # trials around the switch


def figure(table: pd.DataFrame, trials: pd.DataFrame, title: str) -> Figure:
    """The rewarded share of each controller, over all trials and around the switch of the rewarded end."""
    names = [name for name in table.controller if name not in (CHANCE, OPTIMUM)]
    chance, best = (float(table.rewarded_share[table.controller == name].iloc[0]) for name in (CHANCE, OPTIMUM))
    colours = dict(zip(names, [_COLOURS[k % len(_COLOURS)] for k in range(len(names))], strict=True))
    drawn = Figure(figsize=(9.6, 4.0), layout="constrained")
    over_all, around = drawn.subplots(1, 2, width_ratios=[1, 1.25])
    for place, row in enumerate(table[table.controller.isin(names)].itertuples()):
        error = [[row.rewarded_share - row.low], [row.high - row.rewarded_share]]
        over_all.bar(place, row.rewarded_share, color=colours[row.controller], width=0.6)
        over_all.errorbar(place, row.rewarded_share, yerr=error, color="black", capsize=4)
        over_all.annotate(f"{row.rewarded_share:.2f}", (place, row.high + 0.015), ha="center", fontsize=10)
    labels = [plain(name.replace(" (", "\n(")) for name in names]
    over_all.set(xticks=range(len(names)), xticklabels=labels, ylabel="share of rewarded trials")
    for name in names:
        shares = _around_switch(trials[trials.controller == name])
        around.plot(shares.index, shares, color=colours[name], marker="o", markersize=4, label=plain(name))
    around.axvline(-0.5, color="#222222", linewidth=0.8, linestyle=":")
    around.set(xlabel="trials after the switch of the rewarded end", xticks=range(_BEFORE, _AFTER + 1))
    _lines(over_all, {CHANCE: chance, OPTIMUM: best})
    _lines(around, {CHANCE: chance})
    drawn.legend(*around.get_legend_handles_labels(), fontsize=8, frameon=False, loc="outside lower right", ncols=4)
    drawn.suptitle(plain(title), fontsize=9)
    return drawn


def _around_switch(trials: pd.DataFrame) -> "pd.Series[float]":
    """The share of rewarded trials by the number of trials after the switch; lifetimes without one are left out."""
    lifetime = [trials.side, trials.repeat]
    first = trials.rewarded_side.groupby(lifetime).transform("first")
    switch = trials.trial.where(trials.rewarded_side != first).groupby(lifetime).transform("min")
    after = trials.trial - switch
    known = after.between(_BEFORE, _AFTER)
    return trials.rewarded[known].groupby(after[known].astype(int)).mean()


def _lines(axes: Axes, levels: Mapping[str, float]) -> None:
    axes.set_ylim(0, 1.05)
    tidy(axes)
    left, right = axes.get_xlim()
    for name, height in levels.items():
        axes.axhline(height, color="#222222", linewidth=1.0, linestyle="--", zorder=0.5)
        text = f"{name} {height:.3f}".removesuffix("0")
        axes.annotate(text, (right, height), (-2, 3), textcoords="offset points", fontsize=8, ha="right")
    axes.set_xlim(left, right)
