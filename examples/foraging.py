"""Foraging: which controllers turn round when the season does, and when does learning pay? docs/foraging.md says it.

epuckhebb sweep examples/foraging.py:Methods quick=true    a smoke test in a minute
epuckhebb sweep examples/foraging.py:Methods               eight methods, ten champions each
epuckhebb sweep examples/foraging.py:Lifespans             season length and lifespan
"""

from dataclasses import dataclass, field
from itertools import product

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

import epuckhebb
from epuckhebb.analysis.image import house_style
from epuckhebb.analysis.statistics import bootstrap, difference, holm, mean, permutation, sign_flip
from epuckhebb.analysis.tables import Table, interval_text
from epuckhebb.controller.random import Stream
from epuckhebb.runs.gymnasium import environment_seed
from epuckhebb.worlds.foragers import FORAGERS, earned, season_sums
from epuckhebb.worlds.foraging import Foraging

UNTOLD = {  # networks that do not read the reward
    name: {"hebbian": "none", **wiring, "environment.reads_reward": False}
    for name, wiring in {"plain, no reward": {}, "elman, no reward": {"network.wiring": "elman"}}.items()
}
METHODS = {  # rates: docs/plans.md
    **UNTOLD,
    "plain": {"hebbian": "none"},
    "elman": {"hebbian": "none", "network.wiring": "elman"},
    "paper": {"hebbian": "paper", "hebbian.N": 0.0002},
    "discrete": {"hebbian": "discrete", "hebbian.N": 0.001},
    "abcd": {"hebbian": "abcd", "hebbian.N": 0.05},
    "modulated": {"hebbian": "modulated", "hebbian.N": 0.03},
}
RULES = list(METHODS)[4:]
COLOURS = dict(zip(RULES, ("#0072B2", "#CC79A7", "#E69F00", "#D55E00"), strict=True))
COLOURS |= dict(zip(list(METHODS)[:4], ("#BBBBBB", "#56B4E9", "#555555", "#009E73"), strict=True))
CONTROLS = {"frozen at the change": "frozen", "without plasticity": "off"}  # as tables of environments name them
BIN = 50  # steps of a point of the course
FRESH = 1001  # seed of the lifetimes in which champions are tested
STEPS = 2000


@dataclass(kw_only=True)
class Methods(epuckhebb.Study):
    """Eight methods in `environment=foraging`: reward by season, and how long each needs to turn round.

    *No reward*: the network does not read it. *frozen*: the rule acts in the first season alone. *off*: the weights
    never change. *shuffled*: signs of the updates drawn for each synapse. *inverted*: the modulatory neuron receives
    the reward with the other sign. A robot that receives all of its reward with the other sign lives in the other
    season, so that it earns exactly what it would earn there, with the other sign.
    """

    seeds: list[int] = field(default_factory=lambda: list(range(911, 921)))
    repeats: int = 50
    generations: int = 150
    quick: bool = False

    def __post_init__(self):
        """Take the settings of a smoke test."""
        if self.quick:
            self.seeds, self.repeats, self.generations = self.seeds[:1], 2, 1

    def plan(self):
        """A job for each champion, and for each scripted forager."""
        shared = {"season": 500, "steps": STEPS, "known": False, "repeats": self.repeats}
        evolved = [
            {"method": method, "seed": seed, "generations": self.generations, **shared}
            for seed, method in product(self.seeds, METHODS)
        ]
        return [*evolved, *({"method": name, **shared} for name in FORAGERS)]

    @classmethod
    def do(cls, job):
        """Evolve a champion, and test it in fresh lifetimes with its controls; or let a scripted forager live there."""
        rewards = scripted(job) if job["method"] in FORAGERS else evolved(job)
        one = {key: job.get(key) for key in ("method", "seed", "season", "steps", "known")}
        seasons, course = [], []
        for controller, found in rewards.items():
            turned = np.nan if job["method"] in ("innate", *UNTOLD) else turn_round(found, job["season"])
            names = one | {"controller": controller}
            means = season_sums(found, job["season"]).mean(axis=0)
            seasons += [
                {**names, "number": number, "reward": reward, "turn_round": turned}
                for number, reward in enumerate(means, 1)
            ]
            if controller in ("rule", "network", "frozen"):
                points = season_sums(found, BIN).mean(axis=0) / BIN
                course += [{**names, "step": BIN * k, "reward": reward} for k, reward in enumerate(points, 1)]
        return {"seasons": pd.DataFrame(seasons), "course": pd.DataFrame(course)}

    def tables(self, runs):
        """Rewards by champion and season; their means; the differences that are tested; the course of a lifetime."""
        seasons, course = gathered(runs, "seasons.csv"), gathered(runs, "course.csv")
        same = ["season", "steps", "known"]
        tables = {"methods": method_means(seasons), "differences": differences(seasons)}
        return tables | {"seasons": seasons.drop(columns=same), "course": course.drop(columns=same)}

    @classmethod
    def shown(cls, run):
        """Rewards of a lifetime and of its seasons, and what is tested."""
        methods, tested = run.table("methods.csv"), run.table("differences.csv")
        seasons = [name for name in methods if name.startswith("season_") and name.count("_") == 1]
        rows = [
            [row.method, row.controller, str(row.champions), interval_text(row, "reward", ".1f")]
            + [f"{getattr(row, name):.1f}" for name in seasons]
            + [steps_text(row.turn_round)]
            for row in methods.itertuples()
        ]
        headings = ["method", "controller", "n", "reward", *(name.removeprefix("season_") for name in seasons)]
        pairs = [
            [
                row.ours,
                row.other,
                row.seasons,
                interval_text(row, "difference", "+.1f"),
                f"{row.p:.2g}",
                f"{row.p_holm:.2g}",
            ]
            for row in tested.rename(columns={"low": "difference_low", "high": "difference_high"}).itertuples()
        ]
        return [
            Table([*headings, "turns round"], rows, "Reward of a lifetime, and of each season", text=2),
            Table(["ours", "other", "seasons", "difference", "p", "p (Holm)"], pairs, "What is tested", text=3),
        ]

    def figures(self, run):
        """The reward over a lifetime."""
        return {"foraging": _course(run.table("course.csv"))}


def gathered(runs, name):
    """The tables of a name; scripted foragers have no seed."""
    return pd.concat([run.table(name) for run in runs], ignore_index=True).astype({"seed": "Int64"})


def evolved(job):
    """The rewards of a champion and of its controls, (lifetimes, steps) each."""
    method, season, steps = job["method"], job["season"], job["steps"]
    keys = {"environment": "foraging", **METHODS[method], "environment.options.season": season}
    keys |= {"environment.horizon": steps, "environment.processes": 1, "progress": False}
    budget = {"environment.population": 40, "environment.generations": job["generations"]}
    chance = {"environment.options.summer_first": 1.0 if job["known"] else 0.5}
    champion = epuckhebb.evolve(seed=job["seed"], **budget, **chance, **keys)
    # A change that changes nothing: weights are frozen from there on.
    keys["environment.changes"] = [{"at": season, "winter": True}] if season < steps else []
    if method == "modulated":
        keys["compare"] = {"inverted": {"reward": "inverted"}}
    rewards = {}
    for chance in first_seasons(job):
        tests = {"seed": FRESH, "repeats": job["repeats"], "environment.options.summer_first": chance}
        found = epuckhebb.evaluate(champion, **tests, **keys)
        for name in found.metrics.controller.unique():
            its = found.traces["reward"][found.metrics.controller == name]
            rewards.setdefault(label(name, method), []).append(its)
    return {name: np.concatenate(its) for name, its in rewards.items()}


def first_seasons(job):
    """The chances of a summer first with which lifetimes are tested: the two of a pair differ in that alone."""
    return (1.0,) if job["known"] else (1.0, 0.0)


def scripted(job):
    """The rewards of a scripted forager in the lifetimes of the champions."""
    seeds = [environment_seed(FRESH, Stream.evaluation_noise, repeat) for repeat in range(job["repeats"])]
    worlds = [Foraging(season=job["season"], summer_first=chance) for chance in first_seasons(job)]
    rewards = [earned(world, job["method"], seed, job["steps"]) for world in worlds for seed in seeds]
    return {"network": np.array(rewards)}


def steps_text(value):
    """A number of steps; a dash where there is none."""
    return "–" if np.isnan(value) else f"{value:.0f}"


def label(name, method):
    """What a controller is called here."""
    if method not in RULES:
        return "network"
    if name in (method, "inverted"):
        return {method: "rule"}.get(name, name)
    control = name.removeprefix(f"{method} (").removesuffix(")")
    return CONTROLS.get(control, control)


def turn_round(rewards, season):
    """Steps from a switch until the mean reward earned since it is least: from there on more is gained than lost.

    The mean is over lifetimes and switches. 0: nothing is lost. The whole season: the robot never turns round.
    """
    seasons = rewards.reshape(len(rewards), -1, season)[:, 1:]
    if not seasons.size:
        return np.nan
    return int(np.argmin([0.0, *seasons.mean(axis=(0, 1)).cumsum()]))


def totals(rows, numbers):
    """The reward of each champion in some seasons."""
    return rows[rows.number.isin(numbers)].groupby("seed").reward.sum().to_numpy()


def method_means(seasons):
    """A row for each method and control: means over champions with 95 % intervals; a scripted forager is one."""
    rows, numbers = [], sorted(seasons.number.unique())
    for (method, controller), its in seasons.fillna({"seed": 0}).groupby(["method", "controller"], sort=False):
        row = {"method": method, "controller": controller, "champions": its.seed.nunique()}
        for name, which in {"reward": numbers, **{f"season_{number}": [number] for number in numbers}}.items():
            values = totals(its, which)
            row[name] = values.mean()
            row[f"{name}_low"], row[f"{name}_high"] = bootstrap(mean, values)
        rows.append(row | {"turn_round": its.groupby("seed").turn_round.first().median()})
    return pd.DataFrame(rows)


def differences(seasons):
    """The tests of the plan: each rule against its weights frozen after the first season, and against *plain*.

    The first is over the seasons after the first, paired; the others over the whole lifetime, unpaired.
    """
    numbers = sorted(seasons.number.unique())
    main = seasons[seasons.controller.isin(["rule", "network"])]
    reward = {method: totals(its, numbers) for method, its in main.groupby("method")}
    rows = []
    for method in RULES:
        its = seasons[seasons.method == method]
        later = [totals(its[its.controller == name], numbers[1:]) for name in ("rule", "frozen")]
        apart = later[0] - later[1]
        row = {"ours": method, "other": "frozen", "seasons": "2 to 4", "difference": apart.mean()}
        rows.append(row | interval(mean, apart) | {"p": sign_flip(apart)})
    for method, other in [
        *product([*RULES, "elman"], ["plain"]),
        ("elman", "elman, no reward"),
        ("plain", "plain, no reward"),
    ]:
        apart = reward[method].mean() - reward[other].mean()
        row = {"ours": method, "other": other, "seasons": "1 to 4", "difference": apart}
        p = permutation(reward[method], reward[other])
        rows.append(row | interval(difference, reward[method], reward[other]) | {"p": p})
    return pd.DataFrame(rows).assign(p_holm=lambda table: holm(table.p))


def interval(statistic, *groups):
    """The ends of a bootstrap interval, as two cells."""
    return dict(zip(("low", "high"), bootstrap(statistic, *groups), strict=True))


@house_style()
def _course(course):
    """Reward a step over a lifetime: networks without plasticity to the left, rules to the right."""
    figure = Figure(figsize=(9, 3.8))
    panels = figure.subplots(1, 2, sharey=True)
    known = course[course.controller.isin(["rule", "network"])]
    for axes, title, methods in zip(
        panels, ("without plasticity", "with a rule"), (list(METHODS)[:4], ["plain", *RULES]), strict=True
    ):
        for start in range(500, STEPS, 1000):
            axes.axvspan(start, start + 500, color="#EEEEEE", lw=0)
        for name, line in zip(FORAGERS, ("-", "--", ":"), strict=True):
            its = known[known.method == name]
            axes.plot(its.step - BIN / 2, its.reward, line, color="black", lw=0.8, label=name)
        for method in methods:
            points = known[known.method == method].pivot(index="seed", columns="step", values="reward")
            at = points.columns.to_numpy() - BIN / 2
            ends = np.array([bootstrap(mean, points[step].to_numpy()) for step in points])
            axes.fill_between(at, *ends.T, color=COLOURS[method], alpha=0.25, lw=0)
            axes.plot(at, points.mean(), color=COLOURS[method], lw=1.4, label=method)
        axes.axhline(0, color="black", lw=0.5)
        axes.set(title=title, xlabel="step", xlim=(0, STEPS))
    panels[0].set(ylabel="reward a step")
    lines = {text: line for axes in panels for line, text in zip(*axes.get_legend_handles_labels(), strict=True)}
    figure.legend(lines.values(), lines.keys(), loc="outside lower center", ncols=4)
    n = known[known.method == "plain"].seed.nunique()
    figure.set_label(
        f"Reward over a lifetime, in bins of {BIN} steps: mean and 95 % bootstrap interval over {n} champions; "
        "every other season is grey, the first one is drawn; black: scripted foragers"
    )
    return figure


CELLS = [  # season, steps of a lifetime, whether the first season is known
    *((season, STEPS, False) for season in (50, 200, 1000, STEPS)),
    (STEPS, STEPS, True),
    *((season, 500, False) for season in (50, 500)),
    (500, 500, True),
]
LEARNERS = ["plain", "elman", "modulated"]


@dataclass(kw_only=True)
class Lifespans(Methods):
    """When does learning pay? Three methods by the length of a season and of a lifetime.

    With one season that is known, there is nothing to learn. All networks read the reward.
    """

    seeds: list[int] = field(default_factory=lambda: list(range(931, 937)))

    def plan(self):
        """A job for each champion, and for each scripted forager in each cell."""
        jobs = []
        for season, steps, known in CELLS:
            shared = {"season": season, "steps": steps, "known": known, "repeats": self.repeats}
            jobs += [
                {"method": method, "seed": seed, "generations": self.generations, **shared}
                for seed, method in product(self.seeds, LEARNERS)
            ]
            jobs += [{"method": name, **shared} for name in FORAGERS]
        return jobs

    def tables(self, runs):
        """Rewards a step by champion; their means in each cell, and what a rule adds to *plain*."""
        cell = ["season", "steps", "known"]
        champions = (
            gathered(runs, "seasons.csv")
            .fillna({"seed": 0})
            .groupby([*cell, "method", "controller", "seed"], sort=False)
            .agg(reward=("reward", "sum"), turn_round=("turn_round", "first"))
            .reset_index()
            .assign(reward=lambda rows: rows.reward / rows.steps)
        )
        rows = []
        for (*place, method, controller), its in champions.groupby([*cell, "method", "controller"], sort=False):
            row = dict(zip([*cell, "method", "controller"], [*place, method, controller], strict=True))
            plain = champions[(champions[cell] == place).all(axis=1) & (champions.method == "plain")].reward
            row |= {"champions": len(its), "reward": its.reward.mean(), "turn_round": its.turn_round.median()}
            row |= {f"reward_{end}": value for end, value in interval(mean, its.reward.to_numpy()).items()}
            row["over_plain"] = its.reward.mean() - plain.mean()
            ends = interval(difference, its.reward.to_numpy(), plain.to_numpy())
            rows.append(row | {f"over_plain_{end}": value for end, value in ends.items()})
        return {"cells": pd.DataFrame(rows), "champions": champions}

    @classmethod
    def shown(cls, run):
        """Rewards a step in each cell."""
        rows = [
            [str(row.season), str(row.steps), "known" if row.known else "drawn", row.method, row.controller]
            + [str(row.champions), interval_text(row, "reward", ".3f"), interval_text(row, "over_plain", "+.3f")]
            + [steps_text(row.turn_round)]
            for row in run.table("cells.csv").itertuples()
        ]
        headings = [
            "season",
            "steps",
            "first",
            "method",
            "controller",
            "n",
            "reward a step",
            "over plain",
            "turns round",
        ]
        return [Table(headings, rows, "Reward a step", text=5)]

    def figures(self, run):
        """The reward of each method in each cell."""
        return {"lifespans": _cells(run.table("cells.csv"))}


@house_style()
def _cells(cells):
    """A panel for each lifespan, a group of points for each season."""
    figure = Figure(figsize=(8, 3.6))
    main = cells[cells.controller.isin(["rule", "network"])]
    spans = sorted(main.steps.unique(), reverse=True)
    panels = figure.subplots(1, len(spans), sharey=True, width_ratios=[5, 3])
    for axes, steps in zip(panels, spans, strict=True):
        here = main[main.steps == steps]
        places = list(dict.fromkeys(zip(here.season, here.known, strict=True)))
        for number, method in enumerate(LEARNERS):
            its = here[here.method == method]
            at = [places.index(place) + 0.2 * (number - 1) for place in zip(its.season, its.known, strict=True)]
            axes.vlines(at, its.reward_low, its.reward_high, color=COLOURS[method])
            axes.plot(at, its.reward, "o", color=COLOURS[method], markersize=4, label=method)
        for name, line in zip(FORAGERS, ("-", "--", ":"), strict=True):
            its = here[here.method == name]
            at = np.array([places.index(place) for place in zip(its.season, its.known, strict=True)])
            axes.hlines(its.reward, at - 0.4, at + 0.4, "black", line, lw=0.8, label=name)
        ticks = [f"one,\n{'known' if known else 'drawn'}" if season == steps else season for season, known in places]
        axes.set_xticks(range(len(places)), ticks)
        axes.set(xlabel="steps of a season", title=f"lifetimes of {steps} steps")
    panels[0].set(ylabel="reward a step")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=6)
    n = main[main.method == "plain"].champions.iloc[0]
    figure.set_label(
        f"Reward a step by season and lifespan: mean and 95 % bootstrap interval over {n} champions; "
        "black: scripted foragers"
    )
    return figure
