"""Figures of `epuckhebb flock`: heading to the goal by time, and couplings before and after the break."""

import pandas as pd
from matplotlib.figure import Figure

from epuckhebb.analysis.charts import INK, KIND, SOFT
from epuckhebb.analysis.image import house_style
from epuckhebb.flock.tables import WHAT_BREAKS, coupling_title


@house_style()
def curves(table: pd.DataFrame, at_s: float, runs: int) -> Figure:
    """Mean cosine of heading to the goal by minute: a row for each kind of break, a column for each coupling.

    A dashed line is the control of the coupling; a grey one is the frozen coupling.
    """
    kinds = list(table.groupby("breaks", sort=False))
    names = [name for name in table.coupling.unique() if name != "frozen" and " " not in name]
    figure = Figure(figsize=(1.75 * len(names) + 0.9, 1.9 * len(kinds) + 0.9))
    rows = figure.subplots(len(kinds), len(names), squeeze=False, sharex=True, sharey=True)
    for panels, (breaks, group) in zip(rows, kinds, strict=True):
        for axes, name in zip(panels, names, strict=True):
            control = f"{name} (shuffled)"
            for coupling, colour, line in (("frozen", SOFT, "-"), (control, KIND["post_hoc"], "--"), (name, INK, "-")):
                course = group[group.coupling == coupling]
                label = {"frozen": "frozen", name: "the coupling"}.get(coupling, "shuffled control")
                axes.plot(course.minute, course.cosine, color=colour, linestyle=line, label=label)
                band = {"color": colour, "alpha": 0.15, "linewidth": 0}
                axes.fill_between(course.minute, course.cosine_low, course.cosine_high, **band)
            axes.axvline(at_s / 60, color=INK, linestyle=":", linewidth=0.8)
            axes.grid(axis="y")
        panels[0].set_ylabel(WHAT_BREAKS[breaks].replace(" that", "\nthat").replace(" breaks", "\nbreaks"))
    for name, top, bottom in zip(names, rows[0], rows[-1], strict=True):
        top.set_title(coupling_title(name))
        bottom.set_xlabel("minutes")
    rows[0][0].set_ylim(-0.35, 1.05)
    figure.suptitle(f"Heading to the goal of the intact robots (cosine; aim: 1), n = {runs} flocks; dotted: the break")
    figure.legend(*rows[0][0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    return figure


@house_style()
def couplings(pairs: pd.DataFrame, broken: int, knowers: int, runs: int) -> Figure:
    """Who listens to whom just before the break and at the end: a column for each coupling.

    pairs: the table `couplings.csv`: a row for each coupling, listener and speaker.
    """
    groups = pairs.groupby("coupling", sort=False)
    figure = Figure(figsize=(1.85 * len(groups) + 0.9, 4.4))
    rows = figure.subplots(2, len(groups), squeeze=False)
    robots = range(pairs.listener.max() + 1)
    names = ["×" if robot == broken else "knows" if robot < knowers else str(robot) for robot in robots]
    for panels, (coupling, group) in zip(rows.T, groups, strict=True):
        for axes, when in zip(panels, ("before", "end"), strict=True):
            shares = group.pivot_table(when, "listener", "speaker")
            drawn = axes.imshow(shares, cmap="Greys", vmin=0, vmax=pairs[["before", "end"]].to_numpy().max())
            axes.spines[:].set_visible(False)
            axes.set_xticks(robots, names, rotation=90, fontsize=7)
            axes.set_yticks(robots, names if axes in rows[:, 0] else [], fontsize=7)
        panels[0].set_title(coupling_title(str(coupling)))
        panels[1].set_xlabel("speaker")
    for axes, when in zip(rows[:, 0], ("before the break", "at the end"), strict=True):
        axes.set_ylabel(f"{when}\nlistener")
    figure.colorbar(drawn, ax=rows, label="share of the listener's attention", shrink=0.6, aspect=30)
    figure.suptitle(f"Mean of n = {runs} flocks; ×: the robot that breaks; knows: is given the goal")
    return figure
