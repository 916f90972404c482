"""The generation loop: everyone lives, the fittest have offspring. A generator that can be stopped and continued.

`evolve` yields after each generation all that is needed to go on from there; continued from that, it yields the same
bits as if it had never stopped.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epuckhebb.evolution.ga import GA, initial, next_generation
from epuckhebb.sim import streams
from epuckhebb.sim.lifetime import Life, Lifetime, live_block
from epuckhebb.sim.maze import SIDES, START, Pose
from epuckhebb.sim.plasticity import Hebbian
from epuckhebb.sim.scenario import Scenario
from epuckhebb.sim.streams import Stream

_START_SPREAD = np.array([0.005, 0.010, 0.1])  # m, m, rad at ga.start_noise = 1
_TRIALS = tuple(reversed(SIDES))  # lamp on (right) first, as in the published program
_NOT_PLASTIC = Hebbian(N=0.0)


@dataclass(frozen=True, kw_only=True)
class Generation:
    """One generation, and where to go on.

    number: from 0. fitness: (population,). success: (population,) share of each one's lifetimes that ended at the
    goal. champion: (234,) the fittest. population: (population, 234) the next generation, as yet unborn. rng_state:
    of the generator that will vary it. robot_steps, seconds: what it cost.
    """

    number: int
    fitness: NDArray[np.float64]
    success: NDArray[np.float64]
    champion: NDArray[np.float64]
    population: NDArray[np.float64]
    rng_state: dict[str, Any]
    robot_steps: int
    seconds: float


def evolve(
    ga: GA,
    scenario: Scenario,
    lifetime: Lifetime,
    seed: int,
    threads: int = 1,
    after: Generation | None = None,
) -> Iterator[Generation]:
    """Evolve controllers in a scenario; yields one record a generation.

    after: the last record of an earlier, unfinished evolution with the same arguments, to go on from.

    Raises:
        LostRobotError: a pose stopped being finite.
    """
    rng = streams.rng(seed, Stream.variation)
    if after is None:
        first, population = 0, initial(rng, ga.population)
    else:
        first, population = after.number + 1, after.population
        rng.bit_generator.state = after.rng_state
    for number in range(first, ga.generations):
        began = time.perf_counter()
        fitness, success = _evaluate(population, number, ga, scenario, lifetime, seed, threads)
        offspring = next_generation(rng, population, fitness, ga)
        yield Generation(
            number=number,
            fitness=fitness,
            success=success,
            champion=population[np.argmax(fitness)].copy(),
            population=offspring,
            rng_state=dict(rng.bit_generator.state),
            robot_steps=ga.population * ga.loops * len(_TRIALS) * lifetime.steps,
            seconds=time.perf_counter() - began,
        )
        population = offspring


def _evaluate(
    population: NDArray[np.float64],
    generation: int,
    ga: GA,
    scenario: Scenario,
    lifetime: Lifetime,
    seed: int,
    threads: int,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean final fitness and share of successes over each individual's lifetimes: two (population,)."""
    lives = []
    for individual, genome in enumerate(population):
        for loop in range(ga.loops):
            for side in _TRIALS:
                place = (generation, individual, loop, SIDES.index(side))
                lives.append(
                    Life(
                        genome=genome,
                        side=side,
                        hebbian=_NOT_PLASTIC,
                        key=streams.key(seed, Stream.training_noise, *place),
                        start=_start(ga.start_noise, seed, place),
                    )
                )
    outcomes = [outcome for outcome, _ in live_block(lives, scenario, lifetime, threads)]
    shape = (len(population), -1)
    fitness = np.array([outcome.fitness for outcome in outcomes]).reshape(shape).mean(axis=1)
    success = np.array([outcome.success for outcome in outcomes], float).reshape(shape).mean(axis=1)
    return fitness, success


def _start(noise: float, seed: int, place: tuple[int, ...]) -> Pose:
    if noise == 0:
        return START
    shift = noise * _START_SPREAD * streams.rng(seed, Stream.training_start, *place).uniform(-1, 1, 3)
    return Pose(*(np.array(START) + shift).tolist())


def history_row(generation: Generation) -> dict[str, Any]:
    """The row of `history.csv` that tells of a generation."""
    best = int(np.argmax(generation.fitness))
    return {
        "generation": generation.number,
        "best_fitness": generation.fitness.max(),
        "mean_fitness": generation.fitness.mean(),
        "worst_fitness": generation.fitness.min(),
        "best_success": generation.success[best],
        "mean_success": generation.success.mean(),
        "robot_steps": generation.robot_steps,
    }
