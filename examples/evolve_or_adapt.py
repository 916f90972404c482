"""Evolve or adapt? Champions in changed worlds, evolved again or with plasticity; docs/plans.md has the plan.

epuckhebb sweep examples/evolve_or_adapt.py:EvolveOrAdapt quick=true    a smoke test in three minutes
epuckhebb sweep examples/evolve_or_adapt.py:EvolveOrAdapt               the study; again, it does the rest
"""

import functools
from dataclasses import asdict, dataclass, field, replace

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

import epuckhebb
from epuckhebb.analysis.charts import draw_interval
from epuckhebb.analysis.claims import claim
from epuckhebb.analysis.evolutions import HOURS
from epuckhebb.analysis.image import house_style
from epuckhebb.analysis.statistics import bootstrap, holm, mean, sign_flip, wilson_by_champion
from epuckhebb.analysis.tables import Table
from epuckhebb.config import EvaluateConfig, EvolveConfig, load
from epuckhebb.controller.network import PAPER_NETWORK
from epuckhebb.runs import compile_kernels, prepare_evaluation, prepare_evolution
from epuckhebb.store import load_genome
from epuckhebb.tmaze.scenario import TRAINED

CHAMPIONS = {  # the first thirty that solve both sides in training, in the order of the plan
    "light": [*range(4, 12), 13, 14, 15, 18, 19, 20, 103, *range(106, 112), *range(113, 119), *range(122, 125)],
    "obstacles": [1, 2, 3, 4, *range(6, 10), 11, 12, 14, *range(17, 21), *range(104, 111), *range(112, 115)]
    + [116, 117, 118, 119, 120],
}
SEASONED = [4, 6, 7, 8, 9, 10, 11, 18]  # the first eight of the light experiment that `lowlight` breaks
CHANGES = ["slip_left", "weak", "ir_low", "two_dead_ahead", "goals_nearer"]
WORLDS = {
    "light": ["lowlight", *(f"highlight+{change}" for change in CHANGES)],
    "obstacles": [f"base+{change}" for change in ("4obstacles", "moved1", *CHANGES)],
}
EVOLUTIONS = {  # settings of `evolve` in the changed world
    "from the champion": ["start=reference_{}"],
    "from scratch": [],
    "with rehearsal": ["start=reference_{}", "training=rehearsal"],
}
RULES = ("baldwin_n", "modulated")  # evolved for the champion in its training world
DEVICES = {
    "plain": [],
    "immigrants": ["ga.immigrants=0.2"],
    "hypermutation": ["ga.hypermutation=0.3"],
    "memory": ["ga.memory=5"],
}
INHERITED = {  # settings of `evolve hebbian=baldwin`
    "genes": [],
    "learnt weights": ["training.lamarckian=true"],
    "genes, no plasticity": ["hebbian.N=0"],
}
ALONE, PAPER, LATE, SHUFFLED = "GA", "Hebbian", "late", "shuffled"
FIXED, NEVER, WITHIN = "champion", "never", "within a lifetime"
ADAPTED = f"compare={{{LATE}: null, {SHUFFLED}: {{sign: shuffled}}}}"
WHO = ["experiment", "champion"]
GENERATION_HOURS = 5  # of robots, in the changed world or in both
WARM, NOTHING = ("from the champion", ALONE), (FIXED, ALONE)
FORGETS = [WARM, ("with rehearsal", ALONE)]
REPLACES = [(FIXED, PAPER), (FIXED, SHUFFLED), (FIXED, LATE), *((rule, rule) for rule in RULES)]
COMPARED = [  # what is compared, and two ways with their controllers
    ("recovered", WARM, ("from scratch", ALONE)),
    ("recovered", WARM, (FIXED, PAPER)),
    ("recovered", ("with rehearsal", ALONE), WARM),
    ("retained", ("with rehearsal", ALONE), WARM),
    ("retained", WARM, NOTHING),
]


@dataclass(kw_only=True)
class Counted(epuckhebb.GA):
    """The genetic algorithm, whose log also has the share of steps that each lifetime was next to touching a wall."""

    def tell(self, fitness, contact_fraction):
        """See `Algorithm`."""
        super().tell(fitness)


@dataclass(kw_only=True)
class EvolveOrAdapt(epuckhebb.Study):
    """What it costs to evolve again when the world has changed, what plasticity saves, and what is forgotten."""

    champions: int = 30
    marks: list[int] = field(default_factory=lambda: [1, 2, 4, 8, 16])  # generations at which recovery is judged
    rule_generations: int = 30
    repeats: int = 10
    season_champions: int = 8
    periods: list[int] = field(default_factory=lambda: [1, 3, 8])
    season_generations: int = 24
    innate_seeds: int = 10
    innate_generations: int = 30
    quick: bool = False

    def __post_init__(self):
        """Take the settings of a smoke test."""
        if self.quick:
            self.champions, self.marks, self.rule_generations, self.repeats = 2, [1, 2], 1, 3
            self.season_champions, self.periods, self.season_generations = 1, [1], 2
            self.innate_seeds, self.innate_generations = 1, 3

    def plan(self):
        """A job for each champion of each experiment, one for each in seasons, and one for each that becomes innate."""
        shared = {"marks": self.marks, "rule_generations": self.rule_generations, "repeats": self.repeats}
        seasons = {"periods": self.periods, "generations": self.season_generations, "repeats": -(-self.repeats // 2)}
        jobs = [
            {"experiment": experiment, "champion": seed, "worlds": WORLDS[experiment][: 2 if self.quick else None]}
            for experiment, seeds in CHAMPIONS.items()
            for seed in seeds[: self.champions]
        ]
        turns = [{"experiment": "light", "champion": seed} for seed in SEASONED[: self.season_champions]]
        innate = [
            {"way": way, "seed": seed, "generations": self.innate_generations}
            for way in INHERITED
            for seed in range(401, 401 + self.innate_seeds)
        ]
        return [job | shared for job in jobs] + [job | seasons for job in turns] + innate

    @classmethod
    def do(cls, job):
        """All worlds and ways of a champion, or its seasons; or an evolution with plasticity, and with its rule off."""
        return _recover(job) if "worlds" in job else _seasons(job) if "periods" in job else _innate(job)

    def tables(self, runs):
        """All rows; shares of each way and world; tests; seasons and their tests."""
        names = ("cases", "recovery", "seasons", "innate")
        every = {
            name: pd.concat([run.table(f"{name}.csv") for run in runs if run.has(f"{name}.csv")], ignore_index=True)
            for name in names
        }
        recovery, seasons = every["recovery"], every["seasons"]
        by = ["device", "period", "controller", "champion"]
        sums = seasons.groupby(by, sort=False)[["succeeded", "lifetimes"]].sum().reset_index()
        return every | {
            "half": _half(ways := _ways(recovery)),
            "ways": ways,
            "claims": _claims(recovery, max(self.marks)),
            "tests": _tests(recovery, max(self.marks)),
            "periods": _periods(sums),
            "season_tests": _season_tests(sums, str(self.periods[len(self.periods) // 2])),
            "innate_tests": _innate_tests(every["innate"]),
        }

    @classmethod
    def shown(cls, run):
        """The claims, the shares over all worlds at the fixed generations, the hours to recover, and the tests."""
        ways, claims = run.table("ways.csv"), run.table("claims.csv")
        ways = ways[ways.world == "all"].drop(columns="world").round({"robot_hours": 1, "contact_hours": 1})
        for name in ("recovered", "retained"):
            ways = _with_interval(ways, name, f"{name}_")
        for name, ends in (("share", ""), ("control_share", "control_")):
            claims = _with_interval(claims, name, ends)
        claims = claims[["claim", "true", "n", "share", "control_share", "verdict"]]
        frames = {
            "Claims": claims.rename(columns={"control_share": "nothing"}),
            "Shares of all cases": ways,
            "Robot-hours until half have recovered": run.table("half.csv").dropna(),
        }
        for name, title in {"tests": "Tests", "season_tests": "Tests, seasons", "innate_tests": "Rule off"}.items():
            frames[title] = _with_interval(run.table(f"{name}.csv").round(4), "difference", "difference_")
        return [Table(list(own), own.map(str).to_numpy().tolist(), title, 2) for title, own in frames.items()]

    def figures(self, run):
        """What is recovered and retained against robot-hours; success in seasons; fitness with the rule off."""
        ways = run.table("ways.csv")
        return {
            "evolve_or_adapt": _plane(ways[ways.world == "all"]),
            "seasons": _season_curves(run.table("periods.csv")),
            "innate": _innate_curves(run.table("innate.csv"), run.table("innate_tests.csv")),
        }


def _with_interval(table, name, ends):
    """A table in which a column has its interval beside it, and the columns of the interval are gone."""
    low, high = table.pop(f"{ends}low"), table.pop(f"{ends}high")
    rows = zip(table[name], low, high, strict=True)
    table[name] = [f"{a:.2f} [{b:.2f}, {c:.2f}]" if pd.notna(b) else f"{a:.2f}" for a, b, c in rows]
    return table


def _recover(job):
    """Every way to cope with every world that breaks the champion."""
    genome, home = load_genome(f"reference_{job['champion']}", job["experiment"]), TRAINED[job["experiment"]]
    cases, rows, learners = [], [], {}
    for world in job["worlds"]:
        case = {"experiment": job["experiment"], "champion": job["champion"], "world": world}
        is_case = not _solved(_shares(genome, world, 1, job["repeats"])).loc[ALONE]
        cases.append(case | {"is_case": is_case})
        if not is_case:
            continue

        def judge(way, own, *words, generation=0, hours=0.0, contacts=0.0, case=case):
            there, back = (_solved(_shares(own, one, 2, job["repeats"], *words)) for one in (case["world"], home))
            cost = {"generation": generation, "robot_hours": hours, "contact_hours": contacts}
            for controller in there.index:
                outcome = {"recovered": there[controller], "retained": back[controller]}
                rows.append(case | {"way": way, "controller": controller} | cost | outcome)

        judge(FIXED, genome, ADAPTED)
        for rule in RULES:
            if rule not in learners:
                words = [f"genome=reference_{job['champion']}", f"hebbian={rule}", "training=varied"]
                *_, (prepared, last, *_) = _evolved(home, 1000 + job["champion"], job["rule_generations"], *words)
                learners[rule] = replace(genome, genes=last.champion, plan=prepared.plan)
            judge(rule, learners[rule], f"hebbian={rule}")
        for way, words in EVOLUTIONS.items():
            named = [word.format(job["champion"]) for word in words]
            for _, one, hours, contacts in _evolved(world, 1000 + job["champion"], max(job["marks"]), *named):
                done = one.number + 1
                if done in job["marks"]:
                    own = replace(genome, genes=one.champion)
                    judge(way, own, generation=done, hours=hours, contacts=contacts)
    columns = ["experiment", "champion", "world", "way", "controller", "generation", "robot_hours", "contact_hours"]
    return {
        "cases": pd.DataFrame(cases),
        "recovery": pd.DataFrame(rows, columns=[*columns, "recovered", "retained"]),
    }


def _seasons(job):
    """A champion whose world changes every so many generations: evolved with each device, and with plasticity."""
    genome, worlds = load_genome(f"reference_{job['champion']}", "light"), ("lowlight", "highlight")
    fixed = {world: _succeeded(genome, world, job["repeats"]) for world in (*worlds, "highlight+light_changes")}
    rows = []

    def add(device, period, generation, succeeded):
        whole = {"champion": job["champion"], "device": device, "period": period, "generation": generation}
        of = {"lifetimes": 2 * job["repeats"]}
        rows.extend(whole | {"controller": name, "succeeded": count} | of for name, count in succeeded.items())

    add(FIXED, WITHIN, 0, fixed["highlight+light_changes"])
    for period in (*job["periods"], NEVER):
        words = [] if period == NEVER else ["training=seasons", f"training.season={period}"]
        for device, own in DEVICES.items():
            start = f"start=reference_{job['champion']}"
            for _, one, *_ in _evolved("lowlight", 1000 + job["champion"], job["generations"], start, *words, *own):
                world = worlds[0 if period == NEVER else (one.number + 1) // period % 2]  # of the next generation
                succeeded = _succeeded(replace(genome, genes=one.champion), world, job["repeats"])
                add(device, str(period), one.number, succeeded)
                if device == "plain":
                    add(FIXED, str(period), one.number, fixed[world])
    return {"seasons": pd.DataFrame(rows)}


def _innate(job):
    """Fitness of the fittest of every generation in fresh lifetimes, and in these with the rule off."""
    words = ["training=varied", "hebbian=baldwin", "training.rule_off=true", *INHERITED[job["way"]]]
    rows = [
        {"way": job["way"], "seed": job["seed"], "generation": one.number}
        | dict(zip(("fitness", "rule_off"), one.remeasured, strict=True))
        for _, one, *_ in _evolved("base", job["seed"], job["generations"], *words)
    ]
    return {"innate": pd.DataFrame(rows)}


def _evolved(world, seed, generations, *words):
    """Evolve in a world; yields the preparation, each generation, and the robot-hours and hours of contact so far."""
    scenario, *changes = world.split("+")
    shared = [f"scenario={scenario}", f"change={changes}", f"seed={seed}", f"ga.generations={generations}"]
    config = load(EvolveConfig, [*shared, *words])
    config = replace(config, ga=Counted(**asdict(config.ga)))
    prepared = prepare_evolution(config)
    prepared.compile()
    hours = contacts = 0.0
    for generation in prepared.generations(1, quiet=True):
        took = generation.robot_steps * HOURS
        hours += took
        contacts += took * generation.log[-1].measures["contact_fraction"].mean()
        yield prepared, generation, hours, contacts


@functools.cache
def _evaluation(world, seed, repeats, *words):
    """An evaluation in a world, with the paper's plasticity unless words say otherwise."""
    scenario, *changes = world.split("+")
    named = [f"scenario={scenario}", f"change={changes}", f"seed={seed}", f"repeats={repeats}"]
    config = load(EvaluateConfig, [*named, "lifetime.record_every=0", *words])
    compile_kernels(config.controllers, PAPER_NETWORK, config.world)
    return config


def _shares(genome, world, seed, repeats, *words):
    """The share of lifetimes that succeed: a row for each controller, a column for each side."""
    prepared = prepare_evaluation(_evaluation(world, seed, repeats, *words), genome)
    rows, _ = prepared.run(1)
    return pd.DataFrame(rows).groupby(["controller", "side"], sort=False).success.mean().unstack()


def _solved(shares):
    """Whether both sides succeed in more than half of the lifetimes, for each controller."""
    return (shares > 0.5).all(axis=1)


def _succeeded(genome, world, repeats):
    """How many lifetimes of both sides succeed, for each controller."""
    return (_shares(genome, world, 2, repeats) * repeats).sum(axis=1).round().astype(int).to_dict()


def _ways(recovery):
    """Shares recovered and retained in each world and in all, for each way, controller and fixed generation."""
    rows = []
    by = ["world", "way", "controller", "generation"]
    for place, own in pd.concat([recovery.assign(world="all"), recovery]).groupby(by, sort=False):
        row = dict(zip(by, place, strict=True)) | {"cases": len(own), **own[["robot_hours", "contact_hours"]].mean()}
        for name in ("recovered", "retained"):
            counts = own.groupby(WHO)[name].agg(["sum", "size"]).astype(int)
            low, high = wilson_by_champion(counts["sum"].to_numpy(), counts["size"].to_numpy())
            row |= {name: own[name].mean(), f"{name}_low": low, f"{name}_high": high}
        rows.append(row)
    return pd.DataFrame(rows)


def _half(ways):
    """The first fixed generation at which half of all cases have recovered, in robot-hours; nan if there is none."""
    rows = [
        {"way": way, "controller": controller, "robot_hours": own.robot_hours[own.recovered >= 0.5].min()}
        for (way, controller), own in ways[ways.world == "all"].groupby(["way", "controller"], sort=False)
    ]
    return pd.DataFrame(rows)


def _claims(recovery, last):
    """Whether evolution forgets, and whether adaptation replaces it; each beside the champion that does nothing."""
    at_end = recovery[recovery.generation.isin([0, last])].set_index(["way", "controller", *WHO, "world"]).sort_index()
    lost, back = ~at_end.retained.astype(bool), at_end.recovered.astype(bool)
    asked = [("forgets", "cases: a side fails in training afterwards", lost, one, ~lost[one].isna()) for one in FORGETS]
    counted = f"cases that evolution {WARM[0]} recovers: it does, too"
    asked += [("replaces evolution", counted, back, one, back[WARM]) for one in REPLACES]
    rows = []
    for text, counted, true, one, among in asked:
        counts = pd.DataFrame({"true": true[one] & among, "of": among, "control": true[NOTHING] & among})
        sums = counts.groupby(WHO).sum()
        rows.append(claim(f"{' + '.join(one)} {text}", counted, *(sums[name].to_numpy() for name in sums)))
    return pd.DataFrame(rows)


def _tests(recovery, last):
    """The comparisons of the plan, after the last fixed generation; differences in cases, over champions."""
    rows = []
    at_end = recovery[recovery.generation.isin([0, last])].groupby(["way", "controller", *WHO])
    for what, one, other in COMPARED:
        sums, cases = at_end[what].sum().astype(int), at_end.size()
        difference = (sums[one] - sums[other]).to_numpy()
        low, high = bootstrap(mean, difference / cases[one].to_numpy())
        row = {"what": what, "way": " + ".join(one), "other": " + ".join(other), "champions": len(difference)}
        row |= {"difference": (difference / cases[one]).mean(), "difference_low": low, "difference_high": high}
        rows.append(row | {"p": sign_flip(difference)})
    return pd.DataFrame(rows).assign(p_holm=holm([row["p"] for row in rows]))


def _periods(sums):
    """Mean success over champions with its interval, for each device, period and controller."""
    rows = []
    for place, own in sums.groupby(["device", "period", "controller"], sort=False):
        shares = (own.succeeded / own.lifetimes).to_numpy()
        low, high = bootstrap(mean, shares)
        row = dict(zip(("device", "period", "controller"), place, strict=True)) | {"champions": len(own)}
        rows.append(row | {"success": shares.mean(), "success_low": low, "success_high": high})
    return pd.DataFrame(rows)


def _season_tests(sums, period):
    """Each device against the plain GA, and the plain GA against the champion with plasticity, at one period."""
    own = sums[sums.period == period].set_index(["device", "controller", "champion"]).sort_index()
    pairs = [((device, ALONE), ("plain", ALONE)) for device in list(DEVICES)[1:]]
    pairs.append((("plain", ALONE), (FIXED, PAPER)))
    rows = []
    for one, other in pairs:
        difference = (own.succeeded[one] - own.succeeded[other]).to_numpy()
        shares = difference / own.lifetimes[one].to_numpy()
        low, high = bootstrap(mean, shares)
        row = {"way": " + ".join(one), "other": " + ".join(other), "period": period, "champions": len(difference)}
        row |= {"difference": shares.mean(), "difference_low": low, "difference_high": high}
        rows.append(row | {"p": sign_flip(difference)})
    return pd.DataFrame(rows).assign(p_holm=holm([row["p"] for row in rows]))


def _innate_tests(innate):
    """What the rule adds to fitness in the first and in the last third of the generations, over seeds."""
    rows = []
    for way, own in innate.assign(gap=innate.fitness - innate.rule_off).groupby("way", sort=False):
        gaps = own.pivot_table(index="generation", columns="seed", values="gap")
        third = -(-len(gaps) // 3)
        first, last = gaps[:third].mean(), gaps[-third:].mean()
        low, high = bootstrap(mean, (first - last).to_numpy())
        row = {"way": way, "seeds": len(last), "first": first.mean(), "last": last.mean()}
        rows.append(row | {"difference": (first - last).mean(), "difference_low": low, "difference_high": high})
    return pd.DataFrame(rows)


_COLOURS = {"from the champion": "#0072B2", "from scratch": "#999999", "with rehearsal": "#009E73"}
_DEVICES = {"plain": ("o", "#0072B2"), "immigrants": ("s", "#009E73"), "hypermutation": ("^", "#E69F00")}
_DEVICES |= {"memory": ("D", "#CC79A7"), FIXED: ("X", "black")}
_POINTS = {NOTHING: ("nothing", "X", "black"), (FIXED, PAPER): ("the paper's plasticity", "o", "#D55E00")}
_POINTS |= {(FIXED, SHUFFLED): ("shuffled signs", "x", "#D55E00"), (FIXED, LATE): ("late", "s", "#E69F00")}
_POINTS |= {("baldwin_n", "baldwin_n"): ("baldwin_n, evolved", "^", "#CC79A7")}
_POINTS |= {("modulated", "modulated"): ("modulated, evolved", "v", "#56B4E9")}


@house_style()
def _plane(ways):
    """What is recovered against what is not forgotten: of evolution a path over generations, of others a point."""
    figure = Figure(figsize=(8, 5))
    axes = figure.subplots()
    axes.fill_between([0.5, 1.1], 0.5, 1.1, color="#009E73", alpha=0.08, linewidth=0)
    for (way, controller), own in ways.groupby(["way", "controller"], sort=False):
        end = own.iloc[-1]
        if way in _COLOURS and controller == ALONE:
            colour = _COLOURS[way]
            axes.plot(own.recovered, own.retained, marker="o", linewidth=2, color=colour)
            place, look = {"xytext": (7, 5), "textcoords": "offset points"}, {"color": colour, "weight": "bold"}
            axes.annotate(f"evolution {way}, {end.recovered:.2f}", (end.recovered, end.retained), **place, **look)
            for one, above in ((own.iloc[0], 7), (end, -13)):
                place["xytext"] = (-4 if above > 0 else 7, above)
                axes.annotate(f"{one.robot_hours:.0f} h", (one.recovered, one.retained), **place, color=colour)
        elif (way, controller) in _POINTS:
            name, marker, colour = _POINTS[way, controller]
            axes.plot(
                own.recovered, own.retained, marker, color=colour, markersize=9, label=f"{name}, {end.recovered:.2f}"
            )
        else:
            continue
        for name, line in (("recovered", axes.hlines), ("retained", axes.vlines)):
            other = end["retained" if name == "recovered" else "recovered"]
            line(other, end[f"{name}_low"], end[f"{name}_high"], color=colour, alpha=0.4)
    axes.set(xlim=(-0.03, 1.02), ylim=(-0.04, 1.04), xlabel="recovered: share of cases that solve the changed world")
    axes.set_ylabel("not forgotten: share that still solves the training world")
    axes.set_title(
        f"n = {ways.cases.max()} cases; lines: 95 % intervals over champions; numbers: recovered", loc="left"
    )
    axes.text(1.0, 1.0, "recovers and remembers", ha="right", va="top", color="#00664b")
    axes.legend(loc="lower right", title="within the lifetime, 0 h", alignment="left")
    figure.set_label(
        "Evolve or adapt: what is recovered against what is not forgotten, after so many robot-hours in the changed "
        "world; lines are 95 % intervals over champions"
    )
    return figure


@house_style()
def _season_curves(periods):
    """Success in the next generation's world for each period, a point for each device, alone and with plasticity."""
    figure = Figure(figsize=(6.8, 4.8))
    axes = figure.subplots()
    order = list(dict.fromkeys(periods.period))
    shown = periods[(periods.controller != PAPER) | periods.device.isin([FIXED, "plain"])]
    ways = list(shown.groupby(["device", "controller"], sort=False))
    for shift, ((device, controller), own) in zip(np.linspace(-0.3, 0.3, len(ways)), ways, strict=True):
        name = "champion, never evolved" if device == FIXED else f"evolution, {device}"
        marker, colour = _DEVICES[device]
        filled = "none" if controller == PAPER else colour
        label = f"{name}{' + plasticity' * (controller == PAPER)}"
        places = [order.index(period) + shift for period in own.period]
        look = {"color": colour, "marker": marker, "markerfacecolor": filled, "linestyle": "", "label": label}
        draw_interval(axes, places, own, "success", **look)
    hours = [one if one in (NEVER, WITHIN) else f"{GENERATION_HOURS * int(one)} h" for one in order]
    axes.set_xticks(range(len(order)), hours)
    axes.set(xlabel="robot-hours until the world changes", ylabel="success in the next generation's world", ylim=(0, 1))
    axes.grid(axis="y")
    axes.set_title(f"n = {periods.champions.max()} champions, mean with 95 % interval", loc="left")
    figure.legend(fontsize=8, loc="outside lower center", ncols=3)
    figure.set_label(
        "When the world keeps changing: mean success of the fittest in the next generation's world, with 95 % "
        "intervals over champions"
    )
    return figure


@house_style()
def _innate_curves(innate, tests):
    """What the rule adds to the fitness of the fittest over the generations, with its mean in both thirds."""
    gaps = innate.assign(gap=innate.fitness - innate.rule_off)
    ways = list(gaps.groupby("way", sort=False))
    figure = Figure(figsize=(3.2 * len(ways), 3.6))
    panels = figure.subplots(1, len(ways), sharey=True, squeeze=False)[0]
    for axes, (way, own), colour in zip(panels, ways, _COLOURS.values(), strict=True):
        table = own.pivot_table(index="generation", columns="seed", values="gap")
        axes.plot(table.index + 1, table, color=colour, linewidth=0.6, alpha=0.4)
        axes.plot(table.index + 1, table.mean(axis=1), color=colour, linewidth=2)
        (row,) = tests[tests.way == way].itertuples()
        ends = f" [{row.difference_low:+.3f}, {row.difference_high:+.3f}]" if pd.notna(row.difference_low) else ""
        axes.set_title(f"inherits {way}", loc="left", fontsize=9)
        text = f"first third {row.first:.3f}, last {row.last:.3f}\nless by {row.difference:+.3f}{ends}"
        axes.annotate(text, (0.03, 0.97), xycoords="axes fraction", va="top", fontsize=8)
        axes.axhline(0, color="black", linewidth=0.8)
        axes.set_xlabel("generation")
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
    panels[0].set_ylabel("fitness with the rule, less without")
    panels[0].margins(y=0.3)
    figure.supxlabel(
        f"thin: each of n = {tests.seeds.max()} seeds; thick: their mean; 95 % intervals over seeds", fontsize=9
    )
    figure.set_label("Does it become innate? What the rule adds to the fitness of the fittest in fresh lifetimes")
    return figure
