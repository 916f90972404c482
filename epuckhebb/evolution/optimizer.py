"""What every optimizer is: settings, `ask` (the next genomes) and `tell` (how well they did).

An optimizer of the program is one file of `optimizers/` with a subclass of `Optimizer`, whose fields are its settings.
A file of `conf/optimizer/` has their values, and `algorithm`, the name of its file. To switch off the settings of the
GA, do as `conf/optimizer/sep_cma_es.yaml` does. An optimizer of the user's is such a class, too, in any file.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller import random
from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.genome import GenomePlan
from epuckhebb.controller.own_class import OwnClass
from epuckhebb.controller.random import Stream
from epuckhebb.controller.ranges import within
from epuckhebb.evolution.training import Training
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.maze import SIDES
from epuckhebb.tmaze.own_fitness import OF_OUTCOME

if TYPE_CHECKING:
    import pandas as pd

_PAPER_LIFETIMES = 50 * 30 * 3 * 2  # population, generations, loops and sides of the paper's algorithm

CANDIDATES, CONFIRM = 3, 12  # candidates for the champion of learners, and fresh lifetimes of each


class Schedule(NamedTuple):
    """How long a search is. loops: how often an individual runs a lamp-on and a lamp-off lifetime in a generation."""

    generations: int
    loops: int


class Algorithm(OwnClass, ABC):
    """An optimizer: its settings, and what it remembers of a search; subclasses are dataclasses.

    A search is a copy that is started once (`epuckhebb.evolution.search`). To resume, a new copy is given the same
    results again. So what it asks may depend on the seed and on these results, and on nothing else.

    key: of the settings in the configuration. population: most individuals of a generation. common_random_numbers:
    whether all individuals of a generation have the same starts and noise, so that they differ only in their genes.
    start_noise: how much starts vary in the training world. confirm: least number of fresh lifetimes for each candidate
    after the last generation; 0 if a single one is taken at its word. tell: a method that receives the results of the
    last `ask`. Its arguments are any of these names, in any order: `fitness`, (individuals,), larger is better; and
    fields of `epuckhebb.tmaze.outcome.Outcome`, (individuals, loops, sides), the lamp-on (right) side first.
    """

    PART: ClassVar[str] = "optimizer"
    KEY: ClassVar[str] = "optimizer.algorithm"
    METHODS: ClassVar[tuple[str, ...]] = ("tell",)
    ARGUMENTS: ClassVar[Collection[str]] = ("self", "fitness", *OF_OUTCOME)
    key: ClassVar[str] = "optimizer"
    common_random_numbers: ClassVar[bool] = False
    population: int
    start_noise: float = 0.0
    confirm: int = 0
    tell: Callable[..., None]

    @property
    def first_generation(self) -> int:
        """The size of the first generation; of the others it is `population`."""
        return self.population

    @abstractmethod
    def schedule(self, training: Training, lifetime: Lifetime) -> Schedule:
        """How long a search in these worlds is, with open settings filled in."""

    def check(self, plan: GenomePlan) -> None:  # most can search any plan
        """Check that these settings fit the parts of a genome; else a ValueError."""

    @abstractmethod
    def start(self, plan: GenomePlan, seed: int) -> None:
        """Begin a search for the genes of a plan."""

    def begin_at(self, genes: Floats) -> None:  # noqa: ARG002  # others need it
        """Begin at these genes, (genes,), instead of random ones; called after `start`."""
        raise ValueError("it has no method `begin_at`, which start=GENOME needs")

    def inherit(self, learnt: Floats) -> None:  # noqa: ARG002  # others need it
        """Let the individuals of the last `ask` have these weights, (individuals, weights); called before `tell`."""
        raise ValueError("its individuals cannot inherit what was learnt; leave out training.lamarckian")

    @abstractmethod
    def ask(self) -> Floats:
        """The genomes of the next generation, (individuals, genes)."""

    def candidates(self) -> Floats | None:
        """Candidates for the champion, (candidates, genes), or one; None for the fittest of the last generation."""
        return None

    def tables(self) -> "Mapping[str, pd.DataFrame]":
        """Tables for the run folder, by name; each becomes `NAME.csv` when the evolution has ended."""
        return {}


@dataclass(kw_only=True)
class Optimizer(Algorithm):
    """What all optimizers but the GA have in common, and the class to inherit from for one of your own.

    population: most individuals of a generation. generations: None for as many as fit into the robot-steps of the
    paper's evolutions. loops: how often an individual runs a lamp-on and a lamp-off lifetime in a generation; None for
    once in each kind of training world. gene_limit: weights stay within +- this. confirm: least number of fresh
    lifetimes for each of the `candidates` after the last generation; the best of them is the champion.
    """

    common_random_numbers: ClassVar[bool] = True

    population: int = within(1, default=30)
    generations: int | None = within(1, default=None)
    loops: int | None = within(1, default=None)
    gene_limit: float = within(0, above=True, default=2.0)
    confirm: int = within(1, default=12)

    def limits(self, plan: GenomePlan) -> Floats:
        """The bound of each gene, (genes,)."""
        return limits(plan, self.gene_limit)

    def schedule(self, training: Training, lifetime: Lifetime) -> Schedule:
        """As set; open settings follow from the training and from the paper's number of robot-steps.

        The first generation and the confirmation of the candidates are subtracted from it. The rest is divided by the
        steps of a generation, whose lifetimes last longer on average if the gain varies.
        """
        loops = training.loops if self.loops is None else self.loops
        if self.generations is not None:
            return Schedule(self.generations, loops)
        round_ = loops * len(SIDES)  # lifetimes of an individual in a generation
        confirmation = CANDIDATES * -(-self.confirm // round_) * round_
        left = _PAPER_LIFETIMES / training.stretch(lifetime) - self.first_generation * round_ - confirmation
        return Schedule(1 + max(0, math.floor(left / (self.population * round_))), loops)


@dataclass(kw_only=True)
class EvolutionStrategy(Optimizer):
    """What evolution strategies have in common: a cloud of genomes around a mean, with common random numbers.

    starts: random individuals of the first generation; the fittest is the first mean (a mean of 0 would be a saddle: a
    network of zeros stands still, whatever one of its weights is). sigma: first standard deviation of a gene, in units
    of its part's start, 1 for weights. The random generator is seeded anew for each generation.
    """

    population: int = within(4, default=30)
    starts: int = within(2, default=50)
    sigma: float = within(0, above=True, default=0.5)

    @property
    def first_generation(self) -> int:
        """The random individuals."""
        return self.starts

    def start(self, plan: GenomePlan, seed: int) -> None:
        """Begin a search; genes are in units of their part's start from here on."""
        starts = np.concatenate([np.full(part.size, part.start) for part in plan.parts])
        self._plan, self._seed, self._generations = plan, seed, 0
        self._unit = np.where(starts > 0, starts, 1.0)
        self._bound = self.limits(plan) / self._unit

    def begin_at(self, genes: Floats) -> None:
        """Begin at these genes, (genes,), as the first mean; there is no random generation."""
        self._mean, self._generations = genes / self._unit, 1

    def ask(self) -> Floats:
        """First random genomes, then samples around the mean."""
        rng = random.rng(self._seed, Stream.variation, self._generations)
        if self._generations == 0:
            self._population = initial(rng, self.starts, self._plan) / self._unit
        else:
            self._population = self._sample(rng)
        return self._population * self._unit

    def tell(self, fitness: Floats) -> None:
        """Start at the fittest, or move the mean towards the fitter half."""
        self._ranked = self._population[np.argsort(-fitness, kind="stable")]
        if self._generations == 0:
            self._mean = np.clip(self._ranked[0], -self._bound, self._bound)
        else:
            self._mean = self._move(fitness)
        self._generations += 1

    def candidates(self) -> Floats:
        """The mean, and the two fittest of the last generation."""
        return np.array([self._mean, *self._ranked[: CANDIDATES - 1]]) * self._unit

    @abstractmethod
    def _sample(self, rng: np.random.Generator) -> Floats:
        """The next generation, (population, genes)."""

    @abstractmethod
    def _move(self, fitness: Floats) -> Floats:
        """The mean after this generation, (genes,)."""


def ties(ordered: Floats) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """For each of these values, (n,) in ascending order, the first and the last place of an equal one."""
    return np.searchsorted(ordered, ordered, "left"), np.searchsorted(ordered, ordered, "right") - 1


def initial(rng: np.random.Generator, count: int, plan: GenomePlan) -> Floats:
    """Random genomes: (count, genes), each part uniform in its +-start; weights in [-1, 1]."""
    return np.concatenate([rng.uniform(-part.start, part.start, (count, part.size)) for part in plan.parts], axis=1)


def limits(plan: GenomePlan, otherwise: float) -> Floats:
    """The bound of each gene, (genes,): that of its part, or else this one."""
    return np.concatenate([np.full(part.size, otherwise if part.limit is None else part.limit) for part in plan.parts])
