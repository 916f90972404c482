"""Figures of results, and the palette of all figures; `drawing.css` has the same colours for pages.

Hues are of Okabe and Ito, which colour-blind readers can distinguish, where there are enough of them; markers or line
styles differ too.
"""

import itertools
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from numpy.typing import NDArray

from epuckhebb.analysis import environments, rescue
from epuckhebb.analysis.image import house_style, plain
from epuckhebb.analysis.lifetimes import is_of_controller
from epuckhebb.analysis.statistics import LEAST
from epuckhebb.controller.network import starting_weights
from epuckhebb.controller.plasticity.weight_change import saturated_fraction
from epuckhebb.tmaze.individual import GA
from epuckhebb.tmaze.robot import EPUCK
from epuckhebb.tmaze.samples import Samples
from epuckhebb.tmaze.scenario import TRAINED

if TYPE_CHECKING:
    import pandas as pd

# The palette: a hue has one meaning.
SIDE = {"left": "#0072B2", "right": "#D55E00"}
EFFECT = {"rescued": "#009E73", "harmed": "#C2185B"}
KIND = {"plain": "#8A9099", "evolved": "#22262B", "post_hoc": "#E69F00"}  # classes of methods
WEIGHT = {"higher": "#6A3FB5", "lower": "#7D8500"}  # than the gene
INK, SOFT = KIND["evolved"], KIND["plain"]
SERIES = [(SOFT, "-"), (INK, "-"), (KIND["post_hoc"], "-"), (INK, "--"), (KIND["post_hoc"], "--"), (INK, ":")]
MARKER = {"left": "o", "right": "^"}

_DOSES = {
    "success": "success",
    "weight_change_mean": "weight change, mean of Σ|W − W_gene|",
    "saturated_fraction": "share of weights at the bound",
}
_CURVES = {"best_fitness": (INK, "-"), "mean_fitness": (SOFT, "--")}  # of an evolution
_CURVES |= {"best_fitness_again": (KIND["post_hoc"], "-"), "best_fitness_rule_off": (KIND["post_hoc"], ":")}
_OWN_PANELS = 3  # changed worlds that have a panel each
_NAMED = 8  # rates for whose names an axis has room


def group_experiments(table: "pd.DataFrame") -> "list[tuple[str, pd.DataFrame]]":
    """The rows of each experiment; obstacles before light."""
    return sorted(table.groupby("experiment"), reverse=True)


def annotate_row(axes: Axes, text: str, y: float, points: float = 4, **look: Any) -> None:
    """Write a number of a row at the right margin of its panel. y: of the row. points: from the edge."""
    where: dict[str, Any] = {"xycoords": ("axes fraction", "data"), "textcoords": "offset points", "va": "center"}
    axes.annotate(text, (1, y), (points, 0), fontsize=8, **where, **look)


def empty_figure() -> Figure:
    """A figure that says why it has no row."""
    figure = Figure(figsize=(5.2, 1.0))
    text = f"Fewer than {LEAST} champions have such trials: no interval, and no figure."
    figure.text(0.5, 0.5, text, ha="center", va="center")
    return figure


def sample_size(rows: "pd.DataFrame") -> str:
    """How many champions intervals are over; of a single one, how many lifetimes."""
    champions, lifetimes = rows[["champions", "lifetimes"]].max()
    return f"{champions} champions" if champions > 1 else f"{lifetimes} lifetimes"


def draw_interval(axes: Axes, x: "Sequence[float] | pd.Series", rows: "pd.DataFrame", column: str, **look: Any) -> None:
    """Draw a column of a table, with its interval where that is known."""
    y, low, high = (rows[column + end].to_numpy(float) for end in ("", "_low", "_high"))
    axes.errorbar(x, y, np.nan_to_num([y - low, high - y]), **look)


@house_style()
def dose_response(doses: "pd.DataFrame") -> Figure:
    """Success, weight change and saturated weights against the base rate, a row of panels for each condition.

    doses: a row for each condition, controller, rate and side; the rows of `GA` are without plasticity.
    """
    conditions = list(doses.groupby("condition", sort=False))
    rates = np.sort(doses.N[doses.N > 0].unique())
    figure = Figure(figsize=(8.0, 2.1 * len(conditions) + 1.0))
    rows = figure.subplots(len(conditions), 3, squeeze=False, sharex=True, sharey="col")
    for (condition, group), panels in zip(conditions, rows, strict=True):
        for axes, column in zip(panels, _DOSES, strict=True):
            for (side, of_side), shift in zip(group.groupby("side"), (1 / 1.04, 1.04), strict=True):
                plastic, alone = (of_side[(of_side.controller == GA) == is_ga] for is_ga in (False, True))
                look = {"color": SIDE[side], "marker": MARKER[side], "label": side}
                draw_interval(axes, plastic.sort_values("N").N * shift, plastic.sort_values("N"), column, **look)
                if column == "success" and len(alone):
                    axes.axhline(alone.success.iloc[0], color=SIDE[side], linestyle="--", label=f"GA alone, {side}")
            axes.set_xscale("log")
            axes.grid(axis="y")
            if rates.size <= _NAMED:
                axes.set_xticks(rates, [f"{rate:g}" for rate in rates], rotation=90)
            axes.set_xticks([], minor=True)
        panels[0].set_title(plain(condition), loc="left", fontweight="bold")
        panels[0].set_ylim(-0.04, 1.04)
        if (group.weight_change_mean > 0).any():  # an adaptation may never act
            panels[1].set_yscale("log")
        n = sample_size(group).replace(" ", "\n")
        panels[2].annotate(
            f"n = {n}", (1, 0.5), (7, 0), xycoords="axes fraction", textcoords="offset points", va="center"
        )
    for axes, label in zip(rows[0], _DOSES.values(), strict=True):
        axes.annotate(label, (0.5, 1.22), xycoords="axes fraction", ha="center")
    for axes in rows[-1]:
        axes.set_xlabel("base rate N")
    over = "champions" if doses.champions.max() > 1 else f"noise, {doses.genome.iloc[0]} alone"
    intervals = " with 95 % intervals" if doses.success_low.notna().any() else ""
    figure.suptitle(plain(f"Dose-response, means{intervals} (over {over})"))
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    return figure


@house_style()
def rescue_and_harm(over_all: "pd.DataFrame", by_world: "pd.DataFrame") -> Figure:
    """Rescued and harmed trials of each plasticity, with intervals and counts: a row of panels for each experiment.

    An experiment with at most three changed worlds has a panel for each, others one for all together.

    over_all, by_world: the tables `rescue_over_all.csv` and `rescue_and_harm.csv`. What fewer than six champions can
    show has no interval, and is left out.
    """
    rows = {name: panels for name, group in group_experiments(over_all) if (panels := _panels(name, group, by_world))}
    if not rows:
        return empty_figure()
    columns = max(map(len, rows.values()))
    methods = [max(len(group) for _, group in panels) for panels in rows.values()]
    figure = Figure(figsize=(2.4 + 3.0 * columns, 0.6 + sum(0.9 + 0.27 * count for count in methods)))
    grid = figure.subplots(len(rows), columns, squeeze=False, height_ratios=[2 + count for count in methods])
    for all_axes, panels in zip(grid, rows.values(), strict=True):
        for axes in all_axes[len(panels) :]:
            axes.remove()
        for axes, (title, group) in zip(all_axes, panels, strict=False):
            _rescue_panel(axes, group)
            axes.set_title(plain(title), loc="left")
    figure.supxlabel("share of trials, 95 % interval over champions; beside it, how many of how many", fontsize=9)
    figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside upper center", ncols=min(columns, 2))
    return figure


def _panels(experiment: str, over_all: "pd.DataFrame", by_world: "pd.DataFrame") -> "list[tuple[str, pd.DataFrame]]":
    """The panels of an experiment: their titles, and the rows that have both intervals."""
    changed = by_world[(by_world.experiment == experiment) & (by_world.scenario != TRAINED[experiment])]
    worlds = list(changed.groupby("scenario", sort=False))
    panels = [(f"{experiment}, {len(worlds)} changed worlds", over_all)]
    if len(worlds) <= _OWN_PANELS:
        panels = [(f"{experiment}: {world}", group) for world, group in worlds]
    complete = [(title, group.dropna(subset=["rescued_low", "harmed_low"])) for title, group in panels]
    return [(title, group) for title, group in complete if len(group)]


def _rescue_panel(axes: Axes, table: "pd.DataFrame") -> None:
    """Draw the shares of trials rescued and harmed, a row for each plasticity, with counts at the right."""
    one_rate = table.controller.map(table.controller.value_counts() == 1)
    names = table.controller.where(one_rate, [rescue.label(row.controller, row.N) for row in table.itertuples()])
    places = np.arange(len(table))
    for what, whole, text, marker, shift, column in (
        ("rescued", "broken", f"{rescue.RESCUED} (aim: 1)", "o", -0.15, 8),
        ("harmed", "intact", f"{rescue.HARMED} (aim: 0)", "s", 0.15, 58),
    ):
        share, low, high = (table[f"{what}_{end}"].to_numpy(float) for end in ("share", "low", "high"))
        look: dict[str, Any] = {"color": EFFECT[what], "marker": marker, "linestyle": "", "capsize": 0}
        axes.errorbar(share, places + shift, xerr=[share - low, high - share], label=text, clip_on=False, **look)
        for y, part, of in zip(places, table[what], table[whole], strict=True):
            annotate_row(axes, f"{part}/{of}", float(y), column, color=EFFECT[what])
    axes.set_yticks(places, [plain(name) for name in names])
    axes.set(xlim=(0, 1), ylim=(len(table) - 0.5, -0.5))
    axes.grid(axis="x")
    axes.tick_params(axis="y", length=0)


@house_style()
def learning_curves(ways: "Mapping[str, Sequence[pd.DataFrame]]", keys: str = "") -> Figure:
    """Best fitness over the robot-steps of evolutions: a line for each way to evolve, on one axis.

    Of a single way, the mean fitness too, and the best one without plasticity where it was measured. Of many seeds
    these are median and quartiles.

    ways: the histories of each. keys: of the settings that the names of ways are values of.
    """
    figure = Figure(figsize=(6.4, 3.8))
    axes, (first, *rest) = figure.subplots(), ways
    curves = {column: look for column, look in _CURVES.items() if column in ways[first][0]}
    lines = [(way, "best_fitness") for way in ways] if rest else [(first, column) for column in curves]
    for (way, column), (colour, line) in zip(lines, itertools.cycle(SERIES if rest else curves.values())):
        runs, label = ways[way], way if rest else column.replace("_", " ")
        count = min(map(len, runs))
        low, middle, high = np.percentile([run[column][:count] for run in runs], [25, 50, 75], axis=0)
        steps = np.median([run.robot_steps[:count].cumsum() for run in runs], axis=0)
        named = f"{label}, n = {len(runs)}" if rest else label
        axes.plot(steps, middle, color=colour, linestyle=line, label=plain(named))
        axes.fill_between(steps, low, high, color=colour, alpha=0.2, linewidth=0)
    n = max(map(len, ways.values()))
    shown = "" if n == 1 else "median and quartiles" if rest else f"median and quartiles, n = {n}"
    axes.set(title=plain(", ".join(filter(None, [first * (not rest), shown]))), xlabel="robot-steps")
    axes.set_ylabel("best fitness" if rest else "fitness")
    least, most = axes.dataLim.intervaly
    axes.set_ylim(min(0.0, least), max(1.0, 1.02 * most))  # a bonus can bring fitness above 1
    figure.legend(loc="outside right upper", title=plain(keys))
    return figure


@house_style()
def weight_change(conditions: Mapping[str, Mapping[str, Samples]], against: str, title: str) -> Figure:
    """A panel for each condition: weight change between samples against a sensor reading.

    conditions: name -> side -> samples of one lifetime. against: `light` (mean) or `proximity` (largest).
    """
    figure = Figure(figsize=(3.9 * len(conditions), 3.4))
    panels = figure.subplots(1, len(conditions), squeeze=False, sharey=True)[0]
    for axes, (name, sides) in zip(panels, conditions.items(), strict=True):
        for side, samples in sides.items():
            change = np.abs(np.diff(samples.weights, axis=0)).sum(axis=1)
            lights, distances = (samples.sensors[1:, EPUCK.input_places(of)] for of in (EPUCK.light, EPUCK.distance))
            values = lights.mean(axis=1) if against == "light" else distances.max(axis=1)
            look = {"color": SIDE[side], "marker": MARKER[side], "s": 9, "alpha": 0.35, "linewidths": 0}
            axes.scatter(values, change, label=side, **look)
        what = {"light": "mean light reading (1: dark)", "proximity": "largest proximity reading (1: touching)"}
        axes.set(title=plain(f"{name}, {len(change)} samples a side"), xlabel=what[against], yscale="log")
        axes.yaxis.set_minor_formatter(NullFormatter())
    panels[0].set_ylabel("weight change between samples, sum |ΔW|")
    panels[0].legend(markerscale=2)
    figure.suptitle(plain(title))
    return figure


@house_style()
def weights(genes: NDArray[np.float64], lifetimes: Mapping[str, Samples], bound: float, title: str) -> Figure:
    """Each weight before and after a lifetime, a panel a side. bound: of the weights. genes: the weights first."""
    figure = Figure(figsize=(3.8 * len(lifetimes), 4.2))
    panels = figure.subplots(1, len(lifetimes), squeeze=False, sharey=True)[0]
    for axes, (side, samples) in zip(panels, lifetimes.items(), strict=True):
        end = samples.weights[-1].astype(float)
        start = starting_weights(genes[: len(end)])
        axes.plot([-bound, bound], [-bound, bound], color=SOFT, linewidth=0.8, label="unchanged")
        for edge, label in ((bound, "bound"), (-bound, "")):
            axes.axhline(edge, color=INK, linestyle="--", linewidth=0.8, label=label)
        for name, chosen in (("higher", end > start), ("lower", end < start)):
            axes.scatter(start[chosen], end[chosen], s=14, color=WEIGHT[name], alpha=0.6, linewidths=0, label=name)
        share = saturated_fraction(end, bound)
        axes.set(title=f"{side}: {share:.0%} of {len(end)} weights at the bound", xlabel="weight before (gene)")
    panels[0].set_ylabel("weight at the end of the lifetime")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    figure.suptitle(plain(title))
    return figure


_AROUND = (-3, 6)  # trials after the switch


@house_style()
def reversal(table: "pd.DataFrame", trials: "pd.DataFrame", title: str) -> Figure:
    """The rewarded share of each controller around a switch of the rewarded end, beside the first limit of `table`.

    trials: a row each; it is shown after the switch before it, or, if there is none, before the first one. Lifetimes
    without a switch are left out.
    """
    lifetime = [trials.controller, trials.side, trials.repeat]
    last_side = trials.rewarded_side.groupby(lifetime).shift()
    switch = trials.trial.where(last_side.notna() & (trials.rewarded_side != last_side)).groupby(lifetime)
    offset = trials.trial - switch.ffill().fillna(switch.transform("min"))
    is_near = offset.between(*_AROUND)
    drawn = Figure(figsize=(6.4, 4.0))
    axes = drawn.subplots()
    for name, (colour, line) in zip(table.controller[table.lifetimes.notna()], itertools.cycle(SERIES)):
        chosen = is_near & (trials.controller == name)
        shares = trials.rewarded[chosen].groupby(offset[chosen].astype(int)).mean()
        axes.plot(shares.index, shares, color=colour, linestyle=line, marker="o", markersize=4, label=plain(name))
    for limit in table[table.lifetimes.isna()][:1].itertuples():
        axes.axhline(limit.rewarded_share, color=INK, linestyle="--", linewidth=0.8, label=limit.controller)
    axes.axvline(-0.5, color=INK, linewidth=0.8, linestyle=":")
    axes.set(xlabel="trials after a switch of the rewarded end", ylabel="share of rewarded trials")
    axes.set(xticks=range(_AROUND[0], _AROUND[1] + 1), ylim=(0, 1.05))
    axes.legend()
    drawn.suptitle(plain(title))
    return drawn


@house_style()
def lifetime(course: "pd.DataFrame", title: str, changes: Sequence[int]) -> Figure:
    """The mean reward of a step and the weight change over a lifetime in an environment, with the changes marked.

    Bands are quartiles of the lifetimes. course: a row for each controller and part. changes: steps.
    """
    drawn = Figure(figsize=(6.4, 5.6))
    panels = drawn.subplots(2, 1, sharex=True)
    for (name, rows), (colour, line) in zip(course.groupby("controller", sort=False), itertools.cycle(SERIES)):
        for axes, column in zip(panels, ("reward", "weight_change"), strict=True):
            axes.plot(rows.step, rows[column], color=colour, linestyle=line, label=plain(str(name)))
        quartiles = rows.reward_quartile_1, rows.reward_quartile_3
        panels[0].fill_between(rows.step, *quartiles, color=colour, alpha=0.15, linewidth=0)
    for axes, label in zip(panels, ("mean reward of a step, quartiles", "weight change"), strict=True):
        for step in changes:
            axes.axvline(step, color=INK, linewidth=0.8, linestyle=":")
        axes.set_ylabel(label)
    panels[1].set_xlabel("step" + (", changes dotted" if changes else ""))
    panels[0].legend()
    drawn.suptitle(plain(title))
    return drawn


def _title(row: "pd.Series", names: Sequence[str]) -> str:
    """The world of a row, in a line for each key in which worlds differ. names: of these keys."""
    return "\n".join(str(row[name]) if name in ("environment", "change") else f"{name} = {row[name]}" for name in names)


@house_style()
def returns(rows: "pd.DataFrame") -> Figure:
    """The mean return before and after a change, of each controller, with intervals: a panel for each world.

    The number beside a row is the return after the change. Settings that differ are part of the names.
    """
    differ = environments.differing(rows)
    of_world = [name for name in differ if not is_of_controller(name)]
    several = environments.has_several_rates(rows)
    more = [*(["N"] if several else []), *(name for name in differ if is_of_controller(name))]
    rows = rows.fillna({"change": "nothing changes"})
    rows = rows.assign(
        panel=[_title(row, of_world) for _, row in rows.iterrows()] if of_world else rows.change,
        line=[", ".join([row.controller, *(f"{name} = {row[name]}" for name in more)]) for _, row in rows.iterrows()],
    )
    worlds = rows.groupby("panel", sort=False)
    rules = list(dict.fromkeys(rows.controller.str.partition(" (")[0]))
    ordered = rows.assign(rule=rows.controller.str.partition(" (")[0].map(rules.index))
    names = list(dict.fromkeys(ordered.sort_values("rule", kind="stable").line))
    drawn = Figure(figsize=(max(5.2, 2.2 + 2.6 * len(worlds)), 1.6 + 0.28 * len(names)))
    panels = drawn.subplots(1, len(worlds), sharey=True, sharex=True, squeeze=False)[0]
    for axes, (world, group) in zip(panels, worlds, strict=True):
        for when, colour, marker, shift in (("before", SOFT, "s", -0.15), ("after", INK, "o", 0.15)):
            places = [names.index(name) + shift for name in group.line]
            axes.hlines(places, group[f"return_{when}_low"], group[f"return_{when}_high"], color=colour)
            look = {"linestyle": "", "marker": marker, "color": colour, "markersize": 4, "label": when}
            axes.plot(group[f"return_{when}"], places, **look)
        for y, value in zip(places, group.return_after, strict=True):
            annotate_row(axes, "–" if np.isnan(value) else f"{round(value)}", y)
        axes.set(title=plain(str(world)), xlabel="return")
        axes.grid(axis="x")
    panels[0].set_yticks(range(len(names)), [plain(name) for name in names])
    panels[0].invert_yaxis()
    n = sample_size(rows)
    drawn.supxlabel(f"mean of n = {n}, 95 % interval; beside it, the return after the change", fontsize=9)
    drawn.legend(*panels[0].get_legend_handles_labels(), loc="outside upper center", ncols=2)
    return drawn
