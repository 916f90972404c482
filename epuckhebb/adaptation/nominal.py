"""Nominal statistics: what is normal for a champion in its training world, so that a change can be noticed.

The champion runs ten lifetimes a side in its training world, without plasticity, at the wheel gain of the evaluation.
The statistics are the worst that was normal, such as the slowest arrival and the least live fitness in each second, and
the mean and spread of each sensor reading.
"""

import zlib
from dataclasses import dataclass

import numpy as np

from epuckhebb.adaptation.change_signal import RECENT_S, NominalOfSide
from epuckhebb.adaptation.homeostasis import EVERY, light_patterns, pattern_lengths
from epuckhebb.controller import random
from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.readonly import readonly
from epuckhebb.controller.network import PAPER_NETWORK, Network
from epuckhebb.controller.random import Stream
from epuckhebb.tmaze.batch import run_lifetimes
from epuckhebb.tmaze.individual import Individual
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.maze import SIDES, Place, Side
from epuckhebb.tmaze.robot import STEP_S
from epuckhebb.tmaze.samples import Samples
from epuckhebb.tmaze.scenario import Scenario

REPEATS = 10  # lifetimes a side
_RECORD_EVERY = EVERY  # steps: eight samples a second


@dataclass(frozen=True, kw_only=True)
class Nominal:
    """Nominal statistics of a champion; axes of length 2: left (without the lamp), right (with it).

    experiment, scenario: the training world. gain_rad_s: wheel gain. success: (2,) share of its lifetimes.
    time_to_goal_s: (2,) slowest arrival, nan if it never arrived. away_s: (2,) longest excursion from the goal
    afterwards. fitness: (2, seconds) least recent live fitness. reading_mean, reading_spread: (2, inputs). patterns:
    (64, lights) what the light looks like. novelty: the largest distance from these.
    """

    experiment: str
    scenario: str
    gain_rad_s: float
    success: Floats
    time_to_goal_s: Floats
    away_s: Floats
    fitness: Floats
    reading_mean: Floats
    reading_spread: Floats
    patterns: Floats
    novelty: float

    def statistics(self, side: Side) -> NominalOfSide:
        """The nominal statistics of one side, as a kernel needs them."""
        k = SIDES.index(side)
        nominal: NominalOfSide = readonly(
            NominalOfSide(
                float(self.time_to_goal_s[k]),
                float(self.away_s[k]),
                self.fitness[k],
                self.reading_mean,
                self.reading_spread,
                np.ascontiguousarray(self.patterns.T),
                pattern_lengths(self.patterns),
                self.novelty,
            )
        )
        return nominal


def measure_nominal(
    genes: Floats, scenario: Scenario, gain_rad_s: float = 1.0, threads: int = 1, network: Network = PAPER_NETWORK
) -> Nominal:
    """Run lifetimes in the training world and measure nominal statistics; they depend on genome and world alone.

    genes: weights of the network, (synapses,). scenario: the training world. gain_rad_s: wheel speed of a network
    output of 1.

    Raises:
        LostRobotError: a pose stopped being finite.
    """
    duration_s = scenario.paper_duration_s / gain_rad_s
    lifetime = Lifetime(duration_s=duration_s, gain_rad_s=gain_rad_s, record_every=_RECORD_EVERY)
    genome_key = zlib.crc32(genes.tobytes())
    individuals = [
        Individual(
            genes=genes,
            network=network,
            side=side,
            key=random.key(0, Stream.nominal_noise, genome_key, k, repeat),
            record=True,
        )
        for k, side in enumerate(SIDES)
        for repeat in range(REPEATS)
    ]
    recorded = run_lifetimes(individuals, scenario, lifetime, threads)
    sides = recorded[:REPEATS], recorded[REPEATS:]
    arrivals = np.array([[outcome.time_to_goal for outcome, _ in side] for side in sides])
    readings = [np.concatenate([samples.sensors for _, samples in side]) for side in sides]
    lights = scenario.robot.input_places(scenario.robot.light)
    patterns, novelty = light_patterns([1.0 - samples.sensors[:, lights] for _, samples in recorded])
    goals, radius = [scenario.goals_now[name] for name in SIDES], scenario.maze.goal_radius_m
    away = [
        max(_longest_away(samples, goal, radius) for _, samples in side)
        for goal, side in zip(goals, sides, strict=True)
    ]
    return Nominal(
        experiment=scenario.experiment,
        scenario=scenario.name,
        gain_rad_s=gain_rad_s,
        success=np.array([[outcome.success for outcome, _ in side] for side in sides]).mean(axis=1),
        time_to_goal_s=np.fmax.reduce(arrivals, axis=1),
        away_s=np.array(away),
        fitness=np.array([np.min([_recent_fitness(samples) for _, samples in side], axis=0) for side in sides]),
        reading_mean=np.array([side.mean(axis=0) for side in readings]),
        reading_spread=np.array([side.std(axis=0) for side in readings]),
        patterns=patterns,
        novelty=novelty,
    )


def _longest_away(samples: Samples, goal: Place, radius: float) -> float:
    """The longest time [s] away from the goal after the first arrival; 0 if it never arrived, or stayed."""
    at_goal = np.hypot(samples.pose[:, 0] - goal[0], samples.pose[:, 1] - goal[1]) < radius
    visits = np.append(np.flatnonzero(at_goal), len(at_goal))
    return float((np.diff(visits) - 1).max(initial=0)) * _RECORD_EVERY * STEP_S


def _recent_fitness(samples: Samples) -> Floats:
    """The least recent mean of live fitness in each second of a lifetime."""
    interval = _RECORD_EVERY * STEP_S
    recent, least = samples.fitness[0], np.full(int(samples.time[-1]) + 1, np.inf)
    for time, fitness in zip(samples.time, samples.fitness, strict=True):
        recent += interval / (RECENT_S + interval) * (fitness - recent) if time > 0 else 0.0
        least[int(time)] = min(least[int(time)], recent)
    return least
