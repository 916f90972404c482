"""Evaluates a genome: lifetimes in a scenario with and without plasticity, one row of metrics for each.

Every lifetime with plasticity has a paired control (GA): the same lifetime without it, on the same random numbers.
"""

import math
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epuckhebb.adaptation.nominal import Nominal
from epuckhebb.analysis.tables import Rows
from epuckhebb.controller import random
from epuckhebb.controller.genome import GenomePlan, make_plan
from epuckhebb.controller.network import PAPER_NETWORK, Network
from epuckhebb.controller.plasticity.control import Sign, signs, signs_of_draw, yoking
from epuckhebb.controller.random import Stream
from epuckhebb.tmaze.batch import run_lifetimes
from epuckhebb.tmaze.individual import GA_ALONE, Controller, Individual, has_control
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.maze import SIDES, Side
from epuckhebb.tmaze.outcome import Outcome
from epuckhebb.tmaze.robot import STEP_S
from epuckhebb.tmaze.samples import Samples
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.task import rewarded

_CONDITION = ("genome", "experiment", "scenario", "light", "obstacles", "controller", "N", "signal")
_REPEAT = ("side", "repeat", "seed")
_PATH = ("time_to_goal_s", "path_length_m", "average_speed_m_s", "final_position_error_m")
_FIRST = (*_PATH, "weight_change_mean", "weight_change_final", "fitness", "contact_fraction")
_LATER = ("saturated_fraction", "weight_path")  # further means, after the column `changed`
MEANS = (*_FIRST, *_LATER)
COLUMNS = (*_CONDITION, *_REPEAT, "success", *_FIRST, "changed", *_LATER, "end")
REWARDED = ("rewarded_share", "switch_trial")  # more columns, where a lifetime is many trials
_TRIAL_OF = ("genome", "controller", *_REPEAT)
TRIALS = (*_TRIAL_OF, "trial", "rewarded_side", "reached_side", "rewarded", "time_s")


@dataclass(frozen=True, kw_only=True)
class Traces:
    """Recorded lifetimes, all of equal length; first axis: lifetimes.

    controller, side: of each lifetime. samples: as in `tmaze.samples.Samples`, with the axis of lifetimes in front.
    trials: a row for each trial of all lifetimes, recorded or not, with the columns `TRIALS`; empty where a
    lifetime is one trial.
    """

    controller: list[str]
    side: list[Side]
    samples: Samples
    trials: Rows = field(default_factory=list)

    @property
    def lifetimes(self) -> list[tuple[str, Side, Samples]]:
        """The controller, the side and the samples of each lifetime."""
        samples = (Samples(*arrays) for arrays in zip(*self.samples, strict=True))
        return list(zip(self.controller, self.side, samples, strict=True))

    def side_samples(self, controller: str) -> dict[str, Samples]:
        """The samples of the lifetimes of a controller by side."""
        return {side: samples for name, side, samples in self.lifetimes if name == controller}


def evaluate(
    genes: NDArray[np.float64],
    scenario: Scenario,
    controllers: Sequence[Controller],
    lifetime: Lifetime,
    nominal: Nominal | None = None,
    *,
    repeats: int,
    seed: int,
    threads: int = 1,
    name: str = "genome",
    changed: str = "",
    network: Network = PAPER_NETWORK,
    plan: GenomePlan | None = None,
    evolved_signs: NDArray[np.float64] | None = None,
) -> tuple[Rows, Traces]:
    """Run `repeats` lifetimes a side without plasticity, and as many with each of `controllers`.

    genes: (genes,). nominal: statistics of the training world, for adaptations that compare with them. name, changed:
    values of the columns `genome` and `changed`. network: of these genes. plan: the parts of the genes, weights alone
    unless given; each controller takes the parts of its rule. evolved_signs: shuffled signs of updates with which the
    genome was evolved; without them, a control has those of its draw. Returns one row a lifetime, with the columns
    `COLUMNS` (and `REWARDED`, where a lifetime is many trials), and the traces of the first repeat (empty if
    `lifetime.record_every` is 0).

    Raises:
        ValueError: two controllers have one name and N.
        LostRobotError: a pose or a weight is no longer finite.
    """
    everyone = [GA_ALONE, *controllers]
    names = [f"{controller.name}, N = {controller.rule.N:g}" for controller in everyone]
    if len(set(names)) < len(names):
        raise ValueError(f"two controllers have the same name and N, of {'; '.join(names)}")
    lifetimes: list[tuple[int, Side, int]] = [
        (number, side, repeat) for number in range(len(everyone)) for side in SIDES for repeat in range(repeats)
    ]
    plan = plan or make_plan(network)
    individuals = make_individuals(genes, everyone, lifetimes, nominal, plan, network, seed, evolved_signs)
    outcomes = run_lifetimes(individuals, scenario, lifetime, threads, weight_path=has_control(controllers))
    rows = [
        {
            "genome": name,
            "experiment": scenario.experiment,
            "scenario": scenario.name,
            "light": scenario.light,
            "obstacles": scenario.obstacles,
            "controller": everyone[number].name,
            "N": everyone[number].rule.N,
            "signal": str(everyone[number].rule.signal) if number else "",
            "side": side,
            "repeat": repeat,
            "seed": seed,
            **_metrics(outcome, lifetime),
            "changed": changed,
            "saturated_fraction": outcome.saturated_fraction,
            "weight_path": outcome.weight_path if number else 0.0,
            "end": "" if outcome.end is None else outcome.end.value,
            **(_rewarded(outcome.trials) if scenario.task.has_trials else {}),
        }
        for (number, side, repeat), (outcome, _) in zip(lifetimes, outcomes, strict=True)
    ]
    recorded = [(w, samples) for w, (_, samples) in zip(lifetimes, outcomes, strict=True) if w[2] == 0]
    traces = Traces(
        controller=[everyone[number].name for (number, *_), _ in recorded],
        side=[side for (_, side, _), _ in recorded],
        samples=Samples(*(np.stack(arrays) for arrays in zip(*(samples for _, samples in recorded), strict=True))),
        trials=[
            {**{key: row[key] for key in _TRIAL_OF}, **trial}
            for row, (outcome, _) in zip(rows, outcomes, strict=True)
            for trial in _trials(outcome.trials)
        ],
    )
    return rows, traces


def make_individuals(
    genes: NDArray[np.float64],
    controllers: Sequence[Controller],
    lifetimes: Sequence[tuple[int, Side, int]],
    nominal: Nominal | None,
    plan: GenomePlan,
    network: Network,
    seed: int,
    evolved_signs: NDArray[np.float64] | None,
) -> list[Individual]:
    """The individuals of an evaluation, one for each lifetime.

    lifetimes: the number of the controller, the side and the repeat of each.
    """
    rules = [controller.rule for controller in controllers]
    taken = [plan.pick(genes, make_plan(network, type(rule))) for rule in rules]
    genome_key = zlib.crc32(taken[0].tobytes())
    of_updates = [
        evolved_signs
        if evolved_signs is not None and rule.sign is Sign.shuffled
        else signs(rule.sign, network.synapses, signs_of_draw(rule.sign_draw, genome_key))
        for rule in rules
    ]
    yokings = [yoking(rule.control, network, rule.sign_draw, genome_key) for rule in rules]

    pairs = list(product(dict.fromkeys(repeat for *_, repeat in lifetimes), SIDES))
    places = [(repeat, SIDES.index(side)) for repeat, side in pairs]
    keys = dict(zip(pairs, random.keys(seed, Stream.evaluation_noise, places), strict=True))
    task_keys = {repeat: int(random.key(seed, Stream.evaluation_task, repeat)) for repeat, _ in pairs}
    of_side = {} if nominal is None else {side: nominal.statistics(side) for side in SIDES}

    def individual(number: int, side: Side, repeat: int) -> Individual:
        carries = side == "right" and rules[number].carries_history
        return Individual(
            genes=taken[number],
            network=network,
            side=side,
            controller=controllers[number],
            key=keys[repeat, side],
            task_key=task_keys[repeat],
            signs=of_updates[number],
            yoking=yokings[number],
            nominal=of_side.get(side),
            record=repeat == 0,
            previous=replace(individual(number, "left", repeat), record=False) if carries else None,
        )

    return [individual(number, side, repeat) for number, side, repeat in lifetimes]


def _rewarded(trials: NDArray[np.void]) -> dict[str, Any]:
    """The share of rewarded trials of a lifetime, and the first trial after the rewarded end has switched."""
    switches = np.flatnonzero(np.diff(trials["good"]))
    return {
        "rewarded_share": float(rewarded(trials).mean()),
        "switch_trial": int(switches[0]) + 2 if len(switches) else None,  # counted from 1
    }


def _trials(trials: NDArray[np.void]) -> Iterator[dict[str, Any]]:
    """A row for each trial of a lifetime; none where a lifetime is one trial."""
    sides = {-1: "left", 0: "", 1: "right"}
    for number, (good, reached, steps, *_) in enumerate(trials.tolist(), start=1):
        yield {
            "trial": number,
            "rewarded_side": sides[good],
            "reached_side": sides[reached],
            "rewarded": int(reached == good),
            "time_s": steps * STEP_S if steps else math.nan,
        }


def _metrics(outcome: Outcome, lifetime: Lifetime) -> dict[str, float]:
    """The measures of a lifetime, by column."""
    seconds = lifetime.duration_s if outcome.steps == lifetime.steps else outcome.steps * STEP_S
    return {
        "success": int(outcome.success),
        "time_to_goal_s": outcome.time_to_goal,
        "path_length_m": outcome.path_length,
        "average_speed_m_s": outcome.path_length / seconds,
        "final_position_error_m": outcome.final_distance,
        "weight_change_mean": outcome.weight_change_mean,
        "weight_change_final": outcome.weight_change_final,
        "fitness": outcome.fitness,
        "contact_fraction": outcome.contact_fraction,
    }
