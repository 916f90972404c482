"""How often the world changes, and how long a lifetime is: when does learning pay? docs/reversal.md says what it is.

epuckhebb sweep examples/change_and_lifespan.py:ChangeAndLifespan quick=true          a smoke test in some minutes
epuckhebb sweep examples/change_and_lifespan.py:ChangeAndLifespan "seeds=[601,602]"   the first two champions
epuckhebb sweep examples/change_and_lifespan.py:ChangeAndLifespan                     the study; it does the rest
"""

from dataclasses import dataclass, field
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

import epuckhebb
from epuckhebb.analysis.image import house_style
from epuckhebb.analysis.statistics import bootstrap, mean, sign_flip
from epuckhebb.store import fingerprint
from epuckhebb.tmaze.tasks.reversal import First, Reversal

CELL = ["switches", "trials", "first"]
CELLS = [  # three switches two trials apart do not fit into five trials
    *(
        (switches, trials, "drawn")
        for switches, trials in product((0, 1, 3), (5, 10, 30))
        if (switches, trials) != (3, 5)
    ),
    *((0, trials, "left") for trials in (5, 10, 30)),  # there is nothing to learn
]
PRIMARY = (1, 30, "drawn")
METHODS = {
    "layers": {"hebbian": "none"},
    "modulated": {"hebbian": "modulated"},
    "ctrnn": {"hebbian": "none", "network.wiring": "ctrnn"},
}
RULE, FROZEN, OFF, INVERTED = SHARES = ["rewarded", "frozen", "off", "inverted"]
DESCRIBED = 6  # champions of a cell that is described and not tested: the fewest that have an interval
FRESH = 1001  # seed of the lifetimes in which champions are tested


@dataclass(kw_only=True)
class ChangeAndLifespan(epuckhebb.Study):
    """Reversal learning by the number of switches and of trials: rewarded shares of champions and of their controls.

    *off*: the same champion with its weights frozen from the start. *frozen*: the rule acts until the rewarded end
    first changes (without a change, until the middle of the trials in which it may change). *inverted*: the network or
    its rule receives the reward with the other sign. The primary test is `modulated` less itself with its weights
    frozen from the start, at one switch in 30 trials, first end drawn; all else is description.
    """

    seeds: list[int] = field(default_factory=lambda: list(range(601, 617)))
    repeats: int = 100
    generations: int = 80
    quick: bool = False

    def __post_init__(self):
        """Take the settings of a smoke test, and refuse seeds that are no set."""
        if not self.seeds or len(set(self.seeds)) < len(self.seeds):
            raise ValueError(f"seeds must be one or more, each once, got {self.seeds}")
        if self.quick:
            self.seeds, self.repeats, self.generations = self.seeds[:1], 2, 1

    def plan(self):
        """A job for each champion: all seeds in the cell of the primary test, the first six in the others."""
        shared = {"repeats": self.repeats, "generations": self.generations}
        return [
            {**dict(zip(CELL, cell, strict=True)), "method": method, "seed": seed, **shared}
            for seed, cell, method in product(self.seeds, CELLS, METHODS)
            if (cell, method) == (PRIMARY, "modulated")
            or (seed in self.seeds[:DESCRIBED] and (method == "modulated" or cell[1] < 30))
        ]

    def folder(self, jobs):  # other seeds have the same folder
        """See `Study`."""
        return Path("runs", "sweep", f"{self.label}_{fingerprint([self.repeats, self.generations])[:8]}")

    @classmethod
    def do(cls, job):
        """Evolve a champion, and test it in fresh lifetimes with its controls."""
        world = {"task": "reversal", "task.never": 0.0, **{f"task.{key}": job[key] for key in CELL}}
        shared = {**world, **METHODS[job["method"]], "threads": 1, "progress": False}
        ga = {"ga": "reversal", "ga.generations": job["generations"]}
        evolution = epuckhebb.evolve(seed=job["seed"], **ga, **shared)
        tests = {"seed": FRESH, "repeats": job["repeats"], "lifetime.record_every": 0, **shared}
        names = {"modulated": RULE, "modulated (reward inverted)": INVERTED, "GA": OFF, FROZEN: FROZEN}
        if job["method"] == "modulated":
            tests["compare"] = {FROZEN: {"acts": "before_change"}}
        else:
            names = {"GA": RULE}
        metrics = epuckhebb.evaluate(evolution, **tests).metrics
        rewarded = metrics.groupby("controller").rewarded_share.mean().rename(names)
        if job["method"] == "ctrnn":
            read = epuckhebb.evaluate(evolution, **tests, **{"task.reward": "inverted"}).metrics
            rewarded[INVERTED] = read.rewarded_share.mean()
        row = {key: job[key] for key in (*CELL, "method", "seed")} | {"lifetimes": 2 * job["repeats"]}
        row |= {name: rewarded.get(name) for name in SHARES}
        return {"champions": pd.DataFrame([row | {"robot_steps": int(evolution.history.robot_steps.sum())}])}

    def tables(self, runs):
        """A row for each champion; for each cell and method, beside chance and the optimum; for each control."""
        champions = pd.concat([run.table("champions.csv") for run in runs], ignore_index=True)
        return {"champions": champions, "cells": _cells(champions), "differences": _differences(champions)}

    def figures(self, run):
        """The rewarded share of each method in each cell."""
        return {"change_and_lifespan": _shares(run.table("cells.csv"))}


def limits(switches, trials, first):
    """Chance and the optimum of a cell."""
    return Reversal(switches=switches, trials=trials, first=First[first], never=0.0).limits()


def _cells(champions):
    """Means over champions with 95 % bootstrap intervals."""
    rows = []
    for (*cell, method), own in champions.groupby([*CELL, "method"], sort=False):
        row = {**dict(zip(CELL, cell, strict=True)), "method": method, "champions": len(own), **limits(*cell)}
        for name in SHARES:
            values = own[name].to_numpy(float)
            low, high = bootstrap(mean, values)
            row |= {name: values.mean(), f"{name}_low": low, f"{name}_high": high}
        rows.append(row)
    return pd.DataFrame(rows)


def _differences(champions):
    """`modulated` less itself with its weights frozen from the start, or from the change; p of the primary test."""
    rows = []
    for cell, own in champions[champions.method == "modulated"].groupby(CELL, sort=False):
        for control in (OFF, FROZEN):
            difference = (own[RULE] - own[control]).to_numpy()
            low, high = bootstrap(mean, difference)
            row = {**dict(zip(CELL, cell, strict=True)), "control": control, "champions": len(own)}
            row |= {"difference": difference.mean(), "difference_low": low, "difference_high": high}
            counts = np.rint(difference * own.trials * own.lifetimes).astype(int)  # of rewarded trials
            is_primary = (cell, control) == (PRIMARY, OFF)
            rows.append(row | {"p": sign_flip(counts.to_numpy()) if is_primary else np.nan})
    return pd.DataFrame(rows)


@house_style()
def _shares(cells):
    """A panel for each length of a lifetime, a group of points for each number of switches."""
    figure = Figure(figsize=(8, 3.6))
    panels = figure.subplots(1, cells.trials.nunique(), sharey=True)
    colours = dict(zip(METHODS, ("#999999", "#D55E00", "#0072B2"), strict=True))
    for axes, (trials, here) in zip(panels, cells.groupby("trials"), strict=True):
        places = list(dict.fromkeys(zip(here["first"], here.switches, strict=True)))
        for number, (method, colour) in enumerate(colours.items()):
            own = here[here.method == method]
            at = [places.index(one) + 0.2 * (number - 1) for one in zip(own["first"], own.switches, strict=True)]
            axes.vlines(at, own[f"{RULE}_low"], own[f"{RULE}_high"], color=colour)
            axes.plot(at, own[RULE], "o", color=colour, markersize=4, label=method)
            axes.plot(
                at, own[FROZEN], "x", color=colour, label="modulated, frozen" if own[FROZEN].notna().any() else None
            )
        limit = here.drop_duplicates(CELL)
        for name, line in (("optimum", "-"), ("chance", ":")):
            axes.hlines(limit[name], np.arange(len(limit)) - 0.4, np.arange(len(limit)) + 0.4, "black", line, lw=0.8)
        ticks = [f"{switches}{', left' * (first == 'left')}" for first, switches in places]
        axes.set_xticks(range(len(places)), ticks)
        axes.set(xlabel="switches", title=f"{trials} trials")
    panels[0].set(ylabel="rewarded share", ylim=(0, 1.03))
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)
    n = sorted({*cells.champions})
    count = f"{n[0]}" if len(n) == 1 else f"{n[0]} to {n[-1]}"
    figure.set_label(
        f"Rewarded share by switches and trials: mean and 95 % bootstrap interval over {count} champions; "
        "optimum (line) and chance (dotted)"
    )
    return figure
