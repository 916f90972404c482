"""Figures of results: dose-response, learning curves, weight change, the network, rescue and harm, the leaderboard.

Colours are Okabe and Ito's, which colour-blind readers can distinguish; line styles, markers or positions differ too.
"""

import itertools
from collections.abc import Iterable, Mapping

import numpy as np
import pandas as pd
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, MaxNLocator, NullFormatter, StrMethodFormatter
from numpy.typing import NDArray

from epuckhebb.analysis import rescue
from epuckhebb.analysis.figures import SIDE_COLOUR, plain, tidy
from epuckhebb.analysis.image import as_by_default
from epuckhebb.analysis.statistics import LEAST
from epuckhebb.controller.network import PAPER_NETWORK, Network, initial_weights_of
from epuckhebb.tmaze.individual import CONTROLS, GA
from epuckhebb.tmaze.robot import EPUCK, Robot
from epuckhebb.tmaze.samples import Samples

_PANELS = 4  # side by side
_CURVES = {"best_fitness": ("#0072B2", "-"), "mean_fitness": ("#E69F00", "--")}
_CURVES |= {"best_fitness_again": ("#009E73", "-."), "best_fitness_rule_off": ("#D55E00", ":")}
_WEIGHT_CHANGE = "weight change\n(mean of sum |W − W_gene|)"
_NAMED = 8  # rates for whose names an axis has room
_AS_NUMBER = StrMethodFormatter("{x:g}")  # 100, not 10 to the 2
_SCENARIO_STYLE = {
    "base": ("#0072B2", "o", "-"),
    "2obstacles": ("#E69F00", "s", "--"),
    "4obstacles": ("#D55E00", "^", ":"),
    "highlight": ("#0072B2", "o", "-"),
    "lowlight": ("#D55E00", "^", "--"),
}


def _name_rates(axes: Axes, places: Iterable[float], rates: Iterable[float]) -> None:
    axes.set_xticks(list(places), [f"{rate:g}" for rate in rates], fontsize=8)


@as_by_default()
def dose_response(doses: pd.DataFrame, harm: pd.DataFrame, experiment: str, champions: int) -> Figure:
    """Success, time to goal, weight change, and rescue and harm with their controls, against N.

    doses, harm: tables of `epuckhebb.analysis.findings`.
    """
    figure = Figure(figsize=(11, 7.2), layout="constrained")
    (top_left, top_right), (low_left, low_right) = figure.subplots(2, 2)
    own = doses[(doses.experiment == experiment) & doses.controller.isin([GA, "Hebbian"])]
    rates = sorted(own.N.unique())
    at = {rate: place for place, rate in enumerate(rates)}  # equal distances, since a log axis has no 0
    present = [name for name in _SCENARIO_STYLE if name in set(own.scenario)]
    for axes, column, label in (
        (top_left, "success", "success (share of lifetimes)"),
        (top_right, "time_to_goal_s", "time to goal (s), where it is reached"),
        (low_left, "weight_change_mean", _WEIGHT_CHANGE),
    ):
        for number, scenario in enumerate(present):
            look = dict(zip(("color", "marker", "linestyle"), _SCENARIO_STYLE[scenario], strict=True))
            by_rate = own[own.scenario == scenario].sort_values("N")
            x = np.array([at[rate] for rate in by_rate.N]) + 0.08 * (number - 1)
            y, low, high = (by_rate[column + end].to_numpy(float) for end in ("", "_low", "_high"))
            axes.errorbar(x, y, [y - low, high - y], capsize=2, label=scenario, **look)
        axes.set(ylabel=label, xlabel="base Hebbian rate N (0: GA alone)")
        _name_rates(axes, at.values(), at)
        tidy(axes, "y" if axes is low_left else None)
    top_left.legend(frameon=False, fontsize=9)
    top_left.set_ylim(-0.04, 1.04)
    low_left.set_yscale("symlog", linthresh=0.1)
    low_left.set_ylim(bottom=-0.02)
    low_left.yaxis.set_major_formatter(_AS_NUMBER)
    _rescue_and_harm(low_right, harm[harm.experiment == experiment], at)
    intervals = " with 95 % intervals" if champions >= LEAST else ""
    figure.suptitle(f"{experiment}: dose-response, mean over n = {champions} champions{intervals}", fontsize=11)
    return figure


def _rescue_and_harm(axes: Axes, harm: pd.DataFrame, at: Mapping[float, int]) -> None:
    styles = {"Hebbian": "o-", "anti-Hebbian": "s--", "shuffled signs": "^:"}
    totals = (
        harm.groupby(["controller", "N"], sort=False)[["broken", "rescued", "intact", "harmed"]].sum().reset_index()
    )
    for kind in CONTROLS.values():
        own = totals[totals.controller == kind].sort_values("N")
        if len(own):
            x, style = [at[rate] for rate in own.N], styles[kind]
            axes.plot(x, own.rescued / own.broken, style, color="#009E73", label=f"rescued, {kind}")
            axes.plot(x, own.harmed / own.intact, style, color="#CC79A7", label=f"harmed, {kind}")
    broken, intact = int(totals.broken.max()), int(totals.intact.max())
    axes.set(ylabel=f"rescued of {broken}, harmed of {intact} trials", xlabel="base Hebbian rate N")
    axes.set_ylim(-0.04, 1.04)
    _name_rates(axes, at.values(), at)
    tidy(axes)
    axes.legend(frameon=False, fontsize=8)


@as_by_default()
def rates(doses: pd.DataFrame) -> Figure:
    """Success, weight change and saturated weights against the base rate, a row of panels for each condition.

    doses: of `analysis.summary.dose_response`; the rows of `GA` are without plasticity.
    """
    over = "champions" if doses.champions.max() > 1 else f"noise, {doses.genome.iloc[0]} alone"
    conditions = list(doses.groupby("condition", sort=False))
    figure = Figure(figsize=(13, 2.9 * len(conditions) + 0.6), layout="constrained")
    rows = figure.subplots(len(conditions), 3, squeeze=False, sharex=True, sharey="col")
    labels = {
        "success": "success",
        "weight_change_mean": _WEIGHT_CHANGE,
        "saturated_fraction": "share of weights at their bound",
    }
    for (condition, own), panels in zip(conditions, rows, strict=True):
        alone, plastic = own[own.controller == GA], own[own.controller != GA].sort_values("N")
        for axes, (column, label) in zip(panels, labels.items(), strict=True):
            for side, marker, shift in (("left", "o", 1 / 1.03), ("right", "^", 1.03)):
                of_side = plastic[plastic.side == side]
                y, low, high = (of_side[column + end].to_numpy(float) for end in ("", "_low", "_high"))
                look = {"color": SIDE_COLOUR[side], "marker": marker, "capsize": 2, "label": side}
                axes.errorbar(of_side.N * shift, y, np.nan_to_num([y - low, high - y]), **look)
                for success in alone.success[alone.side == side] if column == "success" else ():
                    axes.axhline(success, color=SIDE_COLOUR[side], linestyle="--", linewidth=1.2, label=f"GA, {side}")
            axes.set(xscale="log", xlabel="base rate N", ylabel=label)
            if plastic.N.nunique() <= _NAMED:
                _name_rates(axes, *[plastic.N.unique()] * 2)
            axes.set_xticks([], minor=True)
            tidy(axes, "y")
        panels[0].set_title(plain(condition), fontsize=10, loc="left")
        panels[0].set_ylim(-0.04, 1.04)
        if (own.weight_change_mean > 0).any():  # an adaptation may never act
            panels[1].set_yscale("log")
    figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4, frameon=False)
    intervals = " with 95 % intervals" if doses.success_low.notna().any() else ""
    figure.suptitle(f"Dose-response, means{intervals} (over {over})", fontsize=10)
    return figure


@as_by_default()
def learning_curves(histories: Mapping[str, list[pd.DataFrame]]) -> Figure:
    """Best and mean fitness over the generations, and the best without plasticity where it was measured.

    For many evolutions these are median and quartiles.
    """
    columns = min(len(histories), _PANELS)
    rows = -(-len(histories) // columns)
    figure = Figure(figsize=(5 * columns, 3.6 * rows), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes in panels[len(histories) :]:
        axes.remove()
    for axes, (experiment, runs) in zip(panels, histories.items(), strict=False):
        for column, (colour, line) in _CURVES.items():
            if column not in runs[0]:
                continue
            values = np.array([run[column][: min(map(len, runs))] for run in runs])
            low, middle, high = np.percentile(values, [25, 50, 75], axis=0)
            generation = np.arange(1, len(middle) + 1)
            axes.plot(generation, middle, color=colour, linestyle=line, label=column.replace("_", " "))
            axes.fill_between(generation, low, high, color=colour, alpha=0.2, linewidth=0)
        title = f"{experiment}, {len(runs)} evolutions" if len(runs) > 1 else experiment
        axes.set(title=plain(title), xlabel="generation", ylabel="fitness")
        least, most = axes.dataLim.intervaly
        axes.set_ylim(min(0.0, least), max(1.0, 1.02 * most))  # a bonus can bring fitness above 1
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        tidy(axes)
        axes.legend(frameon=False, fontsize=9, loc="lower right")
    if any(len(runs) > 1 for runs in histories.values()):
        figure.suptitle("Median over evolutions, with quartiles", fontsize=10)
    return figure


@as_by_default()
def weight_change(conditions: Mapping[str, Mapping[str, Samples]], against: str, title: str) -> Figure:
    """A panel for each condition: weight change between samples against fitness or a sensor reading.

    conditions: name -> side -> samples of one lifetime. against: `fitness`, `light` (mean) or `proximity` (largest).
    """
    figure = Figure(figsize=(4.4 * len(conditions), 3.8), layout="constrained")
    panels = figure.subplots(1, len(conditions), squeeze=False, sharey=True)[0]
    for axes, (name, sides) in zip(panels, conditions.items(), strict=True):
        for (side, samples), marker in zip(sides.items(), ("o", "^"), strict=True):
            look = {"color": SIDE_COLOUR[side], "marker": marker, "s": 9, "alpha": 0.35, "linewidths": 0}
            change = np.abs(np.diff(samples.weights, axis=0)).sum(axis=1)
            lights, distances = (samples.sensors[:, EPUCK.inputs_of(of)] for of in (EPUCK.light, EPUCK.distance))
            values = {"fitness": samples.fitness, "light": lights.mean(axis=1), "proximity": distances.max(axis=1)}
            axes.scatter(values[against][1:], change, label=side, **look)
        axes.set(
            title=plain(f"{name} (n = {len(samples.time) - 1} samples a side)"), xlabel=_AGAINST[against], yscale="log"
        )
        axes.title.set_fontsize(10)
        tidy(axes)
        axes.yaxis.set_minor_formatter(NullFormatter())
    panels[0].set_ylabel("weight change between samples, sum |ΔW|")
    panels[0].legend(frameon=False, fontsize=9, markerscale=2)
    figure.suptitle(plain(title), fontsize=10)
    return figure


_AGAINST = {
    "fitness": "live fitness F",
    "light": "mean light sensor reading (1 = dark)",
    "proximity": "largest proximity sensor reading (1 = touching)",
}


@as_by_default()
def network(
    genes: NDArray[np.float64],
    samples: Mapping[str, Samples],
    title: str,
    network: Network = PAPER_NETWORK,
    robot: Robot = EPUCK,
) -> Figure:
    """The network at the end of each lifetime, connections coloured by the change of their weight.

    genes: the weights first. samples: side -> lifetime. robot: its sensors name the inputs; they are numbered where the
    counts differ.
    """
    initial = initial_weights_of(genes[: network.synapses])
    changes = {side: own.weights[-1].astype(float) - initial for side, own in samples.items()}
    scale = max(float(np.abs(change).max()) for change in changes.values()) or 1.0
    layers = (network.inputs + 1, *network.post)
    figure = Figure(figsize=(6.2 * len(samples), max(4.8, 0.17 * max(layers) + 1)), layout="constrained")
    places = np.array([(x, y) for x, count in enumerate(layers) for y in _heights(count)])
    ends = np.stack([places[synapse_ends] for synapse_ends in network.joined], axis=1)  # (synapses, 2, x and y)
    sensors = [f"{group.short}{i}" for group in robot.sensors for i in range(group.count)]
    names = [*(sensors if len(sensors) == network.inputs else map(str, range(network.inputs))), "bias"]
    for axes, (side, change) in zip(figure.subplots(1, len(samples), squeeze=False)[0], changes.items(), strict=True):
        order = np.argsort(np.abs(change))  # the strongest on top
        strength = np.abs(change[order]) / scale
        colours = np.array([to_rgba("#D55E00"), to_rgba("#0072B2")])[(change[order] <= 0).astype(int)]
        colours[:, 3] = 0.08 + 0.85 * strength
        axes.add_collection(LineCollection(list(ends[order]), colors=colours, linewidths=0.4 + 2.6 * strength))
        for layer, count in enumerate(layers):
            heights = _heights(count)
            axes.scatter([layer] * count, heights, s=40, color="white", edgecolor="black", zorder=3)
        axes.set_xticks([0, len(layers) - 1], ["sensors\nand bias", "wheels"], fontsize=8)
        axes.yaxis.set_major_locator(FixedLocator([]))
        axes.spines[:].set_visible(False)
        axes.set_title(f"{side}: weight higher (orange) or lower (blue) by up to {scale:.2g}", fontsize=10)
        for name, height in zip(names, _heights(layers[0]), strict=True):
            axes.annotate(name, (0, height), (-10, 0), textcoords="offset points", ha="right", va="center", fontsize=7)
    figure.suptitle(plain(title), fontsize=10)
    return figure


_RESCUED, _HARMED = "#0072B2", "#D55E00"


@as_by_default()
def rescue_over_all(over_all: pd.DataFrame) -> Figure:
    """A panel for each experiment: the shares rescued and harmed by each plasticity, with their intervals."""
    groups = list(over_all.groupby("experiment", sort=False))
    most = max(len(own) for _, own in groups)
    drawn = Figure(figsize=(5.6 * len(groups) + 1.6, 0.36 * most + 1.5), layout="constrained")
    panels = drawn.subplots(1, len(groups), squeeze=False)[0]
    for axes, (experiment, own) in zip(panels, groups, strict=True):
        places = -np.arange(len(own), dtype=float)
        for what, name, colour, marker, shift in (
            ("rescued", rescue.RESCUED, _RESCUED, "o", 0.13),
            ("harmed", rescue.HARMED, _HARMED, "s", -0.13),
        ):
            share = own[f"{what}_share"].to_numpy()
            away = np.abs(own[[f"{what}_low", f"{what}_high"]].to_numpy().T - share)
            look = {"color": colour, "fmt": marker, "markersize": 5, "elinewidth": 1.2}
            axes.errorbar(share, places + shift, xerr=away, label=name, **look)
        names = [plain(rescue.label(row.controller, row.N)) for row in own.itertuples()]
        axes.set_yticks(places, names, fontsize=8)
        axes.set(xlim=(-0.02, 1.02), ylim=(0.5 - len(own), 0.6), xlabel="share of trials")
        axes.set_title(f"{experiment} experiment", fontsize=10)
        tidy(axes, "x")
    handles = panels[-1].get_legend_handles_labels()
    drawn.legend(*handles, frameon=False, fontsize=8, loc="outside lower center", ncols=2)
    return drawn


def _heights(count: int) -> NDArray[np.float64]:
    """Heights of the neurons of a layer, from the top."""
    return 1.0 - (np.arange(count, dtype=np.float64) + 0.5) / count


_CONTROLLER_COLOURS = ("#999999", "#009E73", "#CC79A7", "#0072B2", "#D55E00", "#E69F00")
_AROUND = (-3, 6)  # trials after the switch


@as_by_default()
def reversal(table: pd.DataFrame, trials: pd.DataFrame, title: str) -> Figure:
    """The rewarded share of each controller around the switch of the rewarded end, beside the first limit of `table`.

    trials: a row each; lifetimes without a switch are left out.
    """
    lifetime = [trials.controller, trials.side, trials.repeat]
    first = trials.rewarded_side.groupby(lifetime).transform("first")
    switch = trials.trial.where(trials.rewarded_side != first).groupby(lifetime).transform("min")
    after = trials.trial - switch
    known = after.between(*_AROUND)
    drawn = Figure(figsize=(6.4, 4.0), layout="constrained")
    axes = drawn.subplots()
    for name, colour in zip(table.controller[table.lifetimes.notna()], itertools.cycle(_CONTROLLER_COLOURS)):
        own = known & (trials.controller == name)
        shares = trials.rewarded[own].groupby(after[own].astype(int)).mean()
        axes.plot(shares.index, shares, color=colour, marker="o", markersize=4, label=plain(name))
    for limit in table[table.lifetimes.isna()][:1].itertuples():
        axes.axhline(limit.rewarded_share, color="#222222", linestyle="--", label=limit.controller)
    axes.axvline(-0.5, color="#222222", linewidth=0.8, linestyle=":")
    axes.set(xlabel="trials after the switch of the rewarded end", ylabel="share of rewarded trials")
    axes.set(xticks=range(_AROUND[0], _AROUND[1] + 1), ylim=(0, 1.05))
    tidy(axes)
    axes.legend(fontsize=8, frameon=False)
    drawn.suptitle(plain(title), fontsize=9)
    return drawn
