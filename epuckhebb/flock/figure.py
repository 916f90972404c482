"""Figures of `epuckhebb flock`: heading to the goal by time, couplings before and after the break, and the sweep."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch
from numpy.typing import NDArray

from epuckhebb.analysis.figures import tidy
from epuckhebb.analysis.image import as_by_default
from epuckhebb.flock.tables import CONDITION, WHAT_BREAKS, title_of

_COLOURS = {  # Okabe and Ito's; the control of a coupling is dashed
    "frozen": "#000000", "transfer_entropy": "#D55E00", "live_fitness": "#0072B2",
    "transfer_entropy_x_fitness": "#E69F00", "oracle": "#009E73",
}  # fmt: skip
_OWN = "#CC79A7"  # a coupling of the user's
_STRONG = 0.15  # share of what a robot listens to, from which on a coupling is drawn


def _look(coupling: str) -> dict[str, str]:
    name, _, control = coupling.partition(" ")
    return {"color": _COLOURS.get(name, _OWN), "linestyle": "--" if control else "-"}


@as_by_default()
def curves(table: pd.DataFrame, at_s: float, runs: int) -> Figure:
    """Mean cosine of heading to the goal by minute, a panel for each kind of break."""
    figure = Figure(figsize=(11, 4.4), layout="constrained")
    kinds = list(dict.fromkeys(table.breaks))
    panels = figure.subplots(1, len(kinds), sharey=True, squeeze=False)[0]
    for axes, breaks in zip(panels, kinds, strict=True):
        for coupling, own in table[table.breaks == breaks].groupby("coupling", sort=False):
            look = _look(str(coupling))
            axes.plot(own.minute, own.cosine, label=title_of(str(coupling)), **look)
            axes.fill_between(own.minute, own.cosine_low, own.cosine_high, color=look["color"], alpha=0.12, linewidth=0)
        axes.axvline(at_s / 60, color="#777777", linestyle=":", linewidth=1)
        axes.annotate("break", (at_s / 60, -0.28), (4, 0), textcoords="offset points", fontsize=9, color="#555555")
        axes.set(title=f"{WHAT_BREAKS[breaks]}, n = {runs}", xlabel="minutes", ylim=(-0.35, 1.03))
        tidy(axes)
    panels[0].set_ylabel("cosine of heading to the goal\n(intact robots)")
    figure.legend(
        *panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=9, frameon=False
    )
    return figure


@as_by_default()
def couplings(
    shown: Mapping[str, tuple[NDArray[np.float64], NDArray[np.float64]]], broken: int, knowers: int
) -> Figure:
    """Who listens to whom just before the break and at the end. shown: the two couplings of each row."""
    figure = Figure(figsize=(3.1 * len(shown), 6.4), layout="constrained")
    panels = figure.subplots(2, len(shown), squeeze=False)
    for column, (coupling, both) in enumerate(shown.items()):
        for axes, weights, when in zip(panels[:, column], both, ("before the break", "at the end"), strict=True):
            _network(axes, weights, broken, knowers)
            axes.set_title(f"{title_of(coupling)}\n{when}", fontsize=10)
    figure.supxlabel(
        "arrow: to a listener, from a robot with more than 15 % of its attention · disc: larger if others listen more "
        "· blue: knows the way · orange: breaks",
        fontsize=8,
    )
    return figure


def _network(axes: Axes, weights: NDArray[np.float64], broken: int, knowers: int) -> None:
    count = len(weights)
    angle = np.pi / 2 - 2 * np.pi * np.arange(count) / count
    places = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    shares = weights / np.maximum(weights.sum(axis=1, keepdims=True), 1e-9)
    for listener, speaker in np.argwhere(shares > _STRONG):
        look: dict[str, Any] = {"arrowstyle": "-|>", "connectionstyle": "arc3,rad=0.15", "color": "#555555"}
        look |= {"alpha": 0.75, "linewidth": 0.6 + 3 * shares[listener, speaker], "mutation_scale": 8}
        axes.add_patch(FancyArrowPatch(tuple(places[speaker]), tuple(places[listener]), shrinkA=8, shrinkB=9, **look))
    attention = weights.sum(axis=0) / (count - 1)
    colours = ["#D55E00" if k == broken else "#56B4E9" if k < knowers else "#dddddd" for k in range(count)]
    axes.scatter(
        places[:, 0], places[:, 1], s=60 + 130 * attention, c=colours, edgecolors="black", linewidths=0.8, zorder=3
    )
    for number, (x, y) in enumerate(places):
        axes.annotate(str(number), (1.27 * x, 1.27 * y), ha="center", va="center", fontsize=8)
    axes.set(xlim=(-1.5, 1.5), ylim=(-1.5, 1.5), aspect="equal")
    axes.axis("off")


@as_by_default()
def sweep(table: pd.DataFrame) -> Figure:
    """The cosine long after the break in every condition, a panel for each kind of break."""
    kinds = list(dict.fromkeys(table.breaks))
    figure = Figure(figsize=(11, 1.2 + 3.2 * len(kinds)), layout="constrained")
    for axes, breaks in zip(figure.subplots(len(kinds), 1, sharex=True, squeeze=False)[:, 0], kinds, strict=True):
        own = table[table.breaks == breaks]
        names = list(dict.fromkeys(own.coupling))
        conditions = own[list(CONDITION[:3])].drop_duplicates().sort_values(list(CONDITION[:3])).reset_index(drop=True)
        for place, coupling in enumerate(names):
            rows = conditions.merge(own[own.coupling == coupling])
            away = [rows.long_after - rows.long_after_low, rows.long_after_high - rows.long_after]
            x = np.arange(len(rows)) + 0.1 * (place - (len(names) - 1) / 2)
            look = _look(coupling)
            face = "white" if look["linestyle"] == "--" else look["color"]
            axes.errorbar(
                x, rows.long_after, away, fmt="o", color=look["color"], markerfacecolor=face, markersize=4, capsize=1.5,
                linewidth=1, label=title_of(coupling),
            )  # fmt: skip
        labels = [f"{row.loudness:g}\n{row.knowers}\n{row.range_m:g}" for row in conditions.itertuples()]
        axes.set_xticks(range(len(conditions)), labels)
        axes.set(title=WHAT_BREAKS[breaks], ylabel="long after the break", ylim=(-0.7, 1.05))
        tidy(axes, "y")
        last = axes
    last.set_xlabel("loudness of the broken robot / robots that know the way / range (m)")
    figure.legend(*last.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=9, frameon=False)
    return figure
