"""The chart of ends: in how many trials robots are at the right goal, at the wrong one and elsewhere."""

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from epuckhebb.analysis.charts import EFFECT, INK
from epuckhebb.analysis.image import house_style, plain
from epuckhebb.analysis.lifetimes import ANY
from epuckhebb.tmaze.individual import GA, HEBBIAN
from epuckhebb.tmaze.scenario import TRAINED

END = {"right": EFFECT["rescued"], "wrong": EFFECT["harmed"], "elsewhere": "#D9DDE3"}
_TEXT = {"right": "right end", "wrong": "wrong end", "elsewhere": "elsewhere"}
_WORLDS = {"highlight": "bright light", "lowlight": "dimmed light", "base": "no obstacles"}
_WORLDS |= {"2obstacles": "two obstacles", "4obstacles": "four obstacles"}
_CONTROLLERS = {GA: "no plasticity", HEBBIAN: "paper's rule", "anti": "opposite sign", "shuffled": "shuffled signs"}
_CONTROLLERS |= {"yoked_sign": "yoked, signs", "yoked_place": "yoked, places", "light_code": "rule, authors' F"}
_LEAST_SHARE = 0.16  # of a bar that has room for its number


@house_style()
def ends(table: pd.DataFrame) -> Figure:
    """The shares of trials that end right, wrong and elsewhere: a panel a world, a bar a controller, n in its title.

    table: `ends.csv`; its rows of all trials are drawn.
    """
    worlds = {
        str(experiment): list(group.groupby("scenario", sort=False))
        for experiment, group in table[table.among == "all"].groupby("experiment", sort=False)
    }
    wide = 2 if max(map(len, worlds.values())) > 1 else 1
    grid = [(name, group[k : k + wide]) for name, group in worlds.items() for k in range(0, len(group), wide)]
    bars = [max(len(group) for _, group in row) for _, row in grid]
    figure = Figure(figsize=(4.7, 0.8 + sum(0.55 + 0.27 * count for count in bars)))
    panels = figure.subplots(len(grid), wide, squeeze=False, sharex=True, height_ratios=bars)
    for axes in panels[-1]:
        axes.set_xlabel("share of trials")
    for row, (experiment, shown) in zip(panels, grid, strict=True):
        names = _bar_names(pd.concat(group for _, group in worlds[experiment]))
        for axes in row[len(shown) :]:
            axes.remove()
        for axes, (scenario, group) in zip(row, shown, strict=False):
            _draw_ends(axes, group)
            trained = " (training)" if scenario == TRAINED[experiment] else ""
            n = " to ".join(map(str, sorted({group.trials.min(), group.trials.max()})))
            axes.set_title(plain(f"{_WORLDS.get(str(scenario), str(scenario))}{trained}\nn = {n} trials"))
            labels, first = list(names[group.index]), list(names[shown[0][1].index])
            axes.set_yticks(range(len(group)), [""] * len(group) if axes is not row[0] and labels == first else labels)
    figure.legend(*panels[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


def _draw_ends(axes: Axes, rows: pd.DataFrame) -> None:
    """Draw a bar for each row, with the number of trials in each part that has room for it."""
    start = np.zeros(len(rows))
    for end, colour in END.items():
        shares, letters = (rows[end] / rows.trials).to_numpy(), "white" if end == "wrong" else INK
        axes.barh(range(len(rows)), shares, left=start, height=0.8, color=colour, edgecolor="white", label=_TEXT[end])
        for number, count in enumerate(rows[end]):
            if shares[number] >= _LEAST_SHARE:
                middle = start[number] + shares[number] / 2
                axes.text(middle, number, f"{count:.0f}", color=letters, ha="center", va="center")
        start += shares
    axes.set(xlim=(0, 1), xticks=(0, 0.5, 1), xticklabels=("0", "½", "1"))
    axes.invert_yaxis()


def _bar_names(rows: pd.DataFrame) -> "pd.Series[str]":
    """The name of each row of a table of ends: its controller, and the settings that differ."""
    settings = rows.columns[: rows.columns.get_loc("among")].drop(["experiment", "scenario", "controller", "N"])
    differ = [name for name in settings if rows[rows.controller != GA][name].nunique() > 1]
    rates = rows.groupby("controller").N.nunique()
    names = [
        ", ".join(
            [_CONTROLLERS.get(row["controller"], row["controller"])]
            + ([f"N = {row['N']:g}"] if rates[row["controller"]] > 1 else [])
            + [f"{name} {row[name]}" for name in differ if row[name] != ANY]
            + [f"{row['draws']} draws"] * (row["draws"] > 1)
        )
        for row in rows.to_dict("records")
    ]
    return pd.Series([plain(name) for name in names], rows.index)
