"""The genetic algorithm of the paper: pure functions of a random generator.

Two presets differ in numbers only (`conf/genetic_algorithms.yaml`): `textbook`, what the paper says, completed by the
usual choices, and `as_coded`, what its published program does.

For worlds that change it has three devices, all off by default. Random immigrants take the places of the least fit in
every generation (Grefenstette, PPSN 2 (1992) 137). After a fall of the best fitness, more genes mutate
(hypermutation: Cobb, NRL report 6760 (1990)), and champions of earlier worlds return from a memory (Mori & Kita, IEEE
IECON (2000); Branke, CEC (1999) 1875).
"""

from dataclasses import dataclass, replace
from enum import Enum
from typing import ClassVar

import numpy as np

from epuckhebb.controller import random
from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.genome import GenomePlan
from epuckhebb.controller.random import Stream
from epuckhebb.controller.ranges import check, within
from epuckhebb.evolution.optimizer import Algorithm, Schedule, initial, limits
from epuckhebb.evolution.training import Training
from epuckhebb.tmaze.life import Lifetime

_RECENT = 5  # generations whose best fitness a fall is measured from
_MOST_DRAWS = 100_000  # of a tournament; with this number the fittest always wins


class Selection(Enum):
    """Which individuals enter a tournament: any, or (as coded) only the best and the worst."""

    everyone = "everyone"
    best_or_worst = "best_or_worst"


class Crossover(Enum):
    """How two parents are mixed: gene by gene at random, or the first half of one and the second of the other."""

    uniform = "uniform"
    middle = "middle"


@dataclass(kw_only=True)
class GA(Algorithm):
    """A genetic algorithm.

    population, generations, elites: as in the paper. loops: how often an individual runs a lamp-on and a lamp-off
    lifetime. tournament: draws, with replacement; the fittest becomes a parent. crossover_rate: share of the slots
    that get a child; in the others the individual survives. mutation_rate: share of a child's genes that change by a
    uniform number within +-mutation_range. gene_limit: weights are clipped to +- this. start_noise: how much starts
    vary in training; at 1 by up to 5 mm sideways, 10 mm ahead and 0.1 rad. immigrants: share of random individuals in
    every generation. fall: the best fitness has fallen if it is lower by more than this than its mean over the last
    five generations. hypermutation: the mutation rate then; 0 for no other. memory: how many champions are remembered,
    one from before each fall; all then return.
    """

    key: ClassVar[str] = "ga"

    population: int = within(1, default=50)
    generations: int = within(1, default=30)
    elites: int = 6
    loops: int = within(1, default=3)
    tournament: int = within(1, _MOST_DRAWS, default=4)
    selection: Selection = Selection.everyone
    crossover: Crossover = Crossover.uniform
    crossover_rate: float = within(0, 1, default=1.0)
    mutation_rate: float = within(0, 1, default=0.05)
    mutation_range: float = within(0, above=True, default=1.0)
    gene_limit: float = within(0, above=True, default=1.0)
    start_noise: float = within(0, default=0.0)
    immigrants: float = within(0, 1, default=0.0)
    hypermutation: float = within(0, 1, default=0.0)
    memory: int = within(0, default=0)
    fall: float = within(0, default=0.05)

    def __post_init__(self) -> None:
        check(self, self.key)
        if not 0 <= self.elites <= self.population:
            raise ValueError(f"ga.elites must lie in [0, ga.population], got {self.elites} of {self.population}")
        newcomers = self.memory + round(self.immigrants * self.population)
        if self.elites + newcomers > self.population:
            raise ValueError(f"ga.immigrants and ga.memory leave no room for {self.elites} elites: {newcomers}")

    def schedule(self, training: Training, lifetime: Lifetime) -> Schedule:  # noqa: ARG002  # others need them
        """As set, in any worlds."""
        return Schedule(self.generations, self.loops)

    def start(self, plan: GenomePlan, seed: int) -> None:
        """Begin a search for the genes of a plan."""
        self._plan, self._rng = plan, random.rng(seed, Stream.variation)
        self._individuals = initial(self._rng, self.population, plan)
        self._best: list[float] = []  # of each generation
        self._memory: list[Floats] = []
        self._fittest, self._has_fallen = self._individuals[0], False

    def begin_at(self, genes: Floats) -> None:
        """Begin at these genes, (genes,): the first generation is them and their mutants."""
        limit = limits(self._plan, self.gene_limit)
        self._individuals = np.array([genes, *(mutate(self._rng, genes, self, limit) for _ in self._individuals[1:])])

    def inherit(self, learnt: Floats) -> None:
        """Let the last individuals have these weights, (individuals, weights), which are the first of their genes."""
        limit, weights = limits(self._plan, self.gene_limit), learnt.shape[1]
        learnt = np.clip(learnt, -limit[:weights], limit[:weights])
        self._individuals = np.hstack([learnt, self._individuals[:, weights:]])

    def ask(self) -> Floats:
        """The population."""
        return self._individuals

    def tell(self, fitness: Floats) -> None:
        """Let the fittest have offspring, beside random immigrants and, after a fall, those that are remembered."""
        best, returning = float(fitness.max()), []
        has_fallen = bool(self._best) and best < float(np.mean(self._best[-_RECENT:])) - self.fall
        if self.memory and has_fallen and not self._has_fallen:
            self._memory = [*self._memory, self._fittest][-self.memory :]
            returning = self._memory
        self._best.append(best)
        self._fittest, self._has_fallen = self._individuals[np.argmax(fitness)].copy(), has_fallen
        ga = replace(self, mutation_rate=self.hypermutation) if has_fallen and self.hypermutation else self
        self._individuals = next_generation(self._rng, self._individuals, fitness, ga, self._plan)
        immigrants = initial(self._rng, round(self.immigrants * self.population), self._plan)
        for row, newcomer in enumerate([*returning, *immigrants], 1):
            self._individuals[-row] = newcomer


def next_generation(rng: np.random.Generator, population: Floats, fitness: Floats, ga: GA, plan: GenomePlan) -> Floats:
    """The elites unchanged, then one individual for every other slot.

    population: (population, genes). fitness: (population,), larger is better. Returns (population, genes).
    """
    limit = limits(plan, ga.gene_limit)
    ranked = population[np.argsort(-fitness, kind="stable")]
    offspring = ranked.copy()
    for slot in range(ga.elites, len(ranked)):
        if rng.random() < ga.crossover_rate:
            mother, father = select(rng, ranked, ga), select(rng, ranked, ga)
            offspring[slot] = mutate(rng, crossover(rng, mother, father, ga), ga, limit)
    return offspring


def select(rng: np.random.Generator, ranked: Floats, ga: GA) -> Floats:
    """A parent: the fittest of a few drawn with replacement from `ranked` (population, genes), best first."""
    if ga.selection is Selection.best_or_worst:
        drawn = rng.choice([0, len(ranked) - 1], ga.tournament)
    else:
        drawn = rng.integers(0, len(ranked), ga.tournament)
    parent: Floats = ranked[drawn.min()]
    return parent


def crossover(rng: np.random.Generator, mother: Floats, father: Floats, ga: GA) -> Floats:
    """A child's genes, (genes,), each from one of its parents."""
    middle = len(mother) // 2
    if ga.crossover is Crossover.middle:
        return np.concatenate([mother[:middle], father[middle:]])
    return np.where(rng.random(len(mother)) < 0.5, mother, father)


def mutate(rng: np.random.Generator, child: Floats, ga: GA, limit: Floats) -> Floats:
    """The child (genes,) with a few genes changed, each clipped to +-its limit (genes,)."""
    mutated = rng.random(len(child)) < ga.mutation_rate
    change = rng.uniform(-ga.mutation_range, ga.mutation_range, len(child))
    return np.clip(np.where(mutated, child + change, child), -limit, limit)
