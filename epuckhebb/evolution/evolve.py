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
from epuckhebb.sim import random
from epuckhebb.sim.block import Individual, live_block
from epuckhebb.sim.controller import GA_ALONE, Controller
from epuckhebb.sim.genome import plan_of
from epuckhebb.sim.lifetime import Lifetime
from epuckhebb.sim.maze import SIDES, Pose
from epuckhebb.sim.network import PAPER_NETWORK, Network
from epuckhebb.sim.plasticity.control import signs
from epuckhebb.sim.plasticity.rule import Rule
from epuckhebb.sim.random import Stream
from epuckhebb.sim.scenario import Scenario

_START_SPREAD = np.array([0.005, 0.010, 0.1])  # m, m, rad at ga.start_noise = 1
_COPIES, _LIFE_BYTES = 4.0, 1000.0  # of the genes of an individual; of one who shall live, and how it went
_TRIALS = tuple(reversed(SIDES))  # lamp on (right) first, as in the published program


@dataclass(frozen=True, kw_only=True)
class Generation:
    """One generation, and where to go on.

    number: from 0. fitness: (population,). success: (population,) share of each one's lifetimes that ended at the
    goal. champion: (genes,) the fittest. population: (population, genes) the next generation, as yet unborn. rng_state:
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
    *,
    network: Network = PAPER_NETWORK,
    controller: Controller = GA_ALONE,
) -> Iterator[Generation]:
    """Evolve controllers in a scenario; yields one record a generation.

    after: the last record of an earlier, unfinished evolution with the same arguments, to go on from. network: what is
    evolved. controller: what drives the robots besides their genes; with a plasticity rule they learn while they are
    judged, and what of the rule is evolved is part of the genome.

    Raises:
        ValueError: network, robot and rule do not fit each other.
        LostRobotError: a pose or a weight stopped being finite.
    """
    plan = plan_of(network, type(controller.rule))
    rng = random.rng(seed, Stream.variation)
    if after is None:
        first, population = 0, initial(rng, ga.population, plan)
    else:
        first, population = after.number + 1, after.population
        rng.bit_generator.state = after.rng_state
    for number in range(first, ga.generations):
        began = time.perf_counter()
        individuals = list(_individuals(population, number, ga, scenario, seed, network, controller))
        outcomes = [outcome for outcome, _ in live_block(individuals, scenario, lifetime, threads)]
        shape = (len(population), -1)
        fitness = np.array([outcome.fitness for outcome in outcomes]).reshape(shape).mean(axis=1)
        success = np.array([outcome.success for outcome in outcomes], float).reshape(shape).mean(axis=1)
        offspring = next_generation(rng, population, fitness, ga, plan)
        yield Generation(
            number=number,
            fitness=fitness,
            success=success,
            champion=population[np.argmax(fitness)].copy(),
            population=offspring,
            rng_state=dict(rng.bit_generator.state),
            robot_steps=len(individuals) * lifetime.steps,
            seconds=time.perf_counter() - began,
        )
        population = offspring


def room_to_evolve(ga: GA, network: Network, rule: type[Rule]) -> float:
    """How many bytes of memory a generation takes, about."""
    each = _COPIES * np.dtype(float).itemsize * plan_of(network, rule).genes + len(SIDES) * ga.loops * _LIFE_BYTES
    return ga.population * each + np.dtype(float).itemsize * ga.tournament


def _individuals(
    population: NDArray[np.float64],
    generation: int,
    ga: GA,
    scenario: Scenario,
    seed: int,
    network: Network,
    controller: Controller,
) -> Iterator[Individual]:
    """Who lives in a generation: each individual, `ga.loops` times on either side."""
    of_updates = signs(controller.rule.sign, network.synapses, random.rng(seed, Stream.shuffled_signs))
    for individual, genes in enumerate(population):
        for loop in range(ga.loops):
            for side in _TRIALS:
                place = (generation, individual, loop, SIDES.index(side))
                yield Individual(
                    genes=genes,
                    network=network,
                    side=side,
                    controller=controller,
                    signs=of_updates,
                    key=random.key(seed, Stream.training_noise, *place),
                    start=_start(scenario.maze.start, ga.start_noise, seed, place),
                )


def _start(start: Pose, noise: float, seed: int, place: tuple[int, ...]) -> Pose:
    if noise == 0:
        return start
    shift = noise * _START_SPREAD * random.rng(seed, Stream.training_start, *place).uniform(-1, 1, 3)
    return Pose(*(np.array(start) + shift).tolist())


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
