"""What every optimizer is: settings, and a search with `ask` (the next genomes) and `tell` (their fitness).

An optimizer is one file of `optimizers/`, with a subclass of `Optimizer` that holds its settings and a subclass of
`Search`. A file of `conf/optimizer/` has its values: `algorithm`, the name of its file, and its settings. To switch off
the settings of the GA, do as `conf/optimizer/sep_cma_es.yaml` does.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.evolution.training import Training
from epuckhebb.sim.arrays import Floats
from epuckhebb.sim.genome import GenomePlan
from epuckhebb.sim.life import Lifetime
from epuckhebb.sim.maze import SIDES
from epuckhebb.sim.ranges import check_range

_PAPER_LIFETIMES = 50 * 30 * 3 * len(SIDES)  # population, generations, loops and sides of the paper's algorithm

CANDIDATES, CONFIRM = 3, 12  # candidates for the champion of learners, and fresh lifetimes of each

State = dict[str, NDArray[Any]]


class Schedule(NamedTuple):
    """How long a search is.

    generations: how many. loops: how often an individual runs a lamp-on and a lamp-off lifetime in each.
    """

    generations: int
    loops: int


class Search(ABC):
    """A search for genomes in progress."""

    @abstractmethod
    def ask(self) -> Floats:
        """The genomes of the next generation, (individuals, genes)."""

    @abstractmethod
    def tell(self, fitness: Floats) -> None:
        """Receive their fitness, (individuals,), larger is better."""

    @abstractmethod
    def candidates(self) -> Floats:
        """Candidates for the champion after this generation, (candidates, genes); fresh lifetimes decide."""

    @property
    @abstractmethod
    def state(self) -> State:
        """All that the search needs to resume, as arrays by name."""


class Optimizer(ABC):
    """The settings of an optimizer; subclasses are dataclasses.

    name: that of its file. key: of the settings in the configuration. common_random_numbers: whether all individuals of
    a generation have the same starts and noise, so that they differ only in their genes. start_noise: how much starts
    vary in the training world. confirm: least number of fresh lifetimes for each candidate after the last generation.
    """

    key: ClassVar[str] = "optimizer"
    common_random_numbers: ClassVar[bool] = False
    start_noise: float = 0.0
    confirm: int = 1

    @property
    def name(self) -> str:
        """The name of its file."""
        return type(self).__module__.rpartition(".")[2]

    @property
    @abstractmethod
    def individuals(self) -> int:
        """The size of the largest generation."""

    @abstractmethod
    def schedule(self, training: Training, lifetime: Lifetime) -> Schedule:
        """How long a search in these worlds is, with open settings filled in."""

    def check(self, plan: GenomePlan) -> None:  # noqa: B027  # most can search any plan
        """Check that these settings fit the parts of a genome; else a ValueError."""

    @abstractmethod
    def search(self, plan: GenomePlan, seed: int, state: State | None = None) -> Search:
        """A search for the genes of a plan; with a state, a search that resumes from it bit-identically.

        Raises:
            KeyError: something is missing in the state.
            ValueError: the state is of another search.
        """


@dataclass(kw_only=True)
class EvolutionStrategy(Optimizer):
    """What evolution strategies have in common: a cloud of genomes around a mean, with common random numbers.

    population: individuals of each generation but the first. generations: None for as many as fit into the robot-steps
    of the paper's evolutions. loops: how often an individual runs a lamp-on and a lamp-off lifetime in a generation;
    None for once in each kind of training world. starts: random individuals of the first generation; the fittest is the
    first mean (a mean of 0 would be a saddle: a network of zeros stands still, whatever one of its weights is). sigma:
    first standard deviation of a gene, in units of its part's start, 1 for weights. gene_limit: weights stay within
    +- this. confirm: least number of fresh lifetimes for the last mean and the two fittest of the last generation; the
    best of them is the champion.
    """

    common_random_numbers: ClassVar[bool] = True
    least: ClassVar[dict[str, int]] = {"population": 4, "generations": 1, "loops": 1, "starts": 2, "confirm": 1}

    population: int = 30
    generations: int | None = None
    loops: int | None = None
    starts: int = 50
    sigma: float = 0.5
    gene_limit: float = 2.0
    confirm: int = 12

    def __post_init__(self) -> None:
        """Validate the settings."""
        for name, bound in self.least.items():
            value = getattr(self, name)
            if value is not None and value < bound:
                raise ValueError(f"optimizer.{name} must be {bound} or more, got {value}")
        check_range(self, "optimizer", "sigma", "gene_limit", above=True)

    @property
    def individuals(self) -> int:
        """The size of the largest generation."""
        return max(self.population, self.starts)

    def schedule(self, training: Training, lifetime: Lifetime) -> Schedule:
        """As set; open settings follow from the training and from the paper's number of robot-steps.

        These are 50 individuals x 30 generations x 3 loops x 2 sides x the steps of a lifetime. The first generation
        and the confirmation of the champion are subtracted. The rest is divided by the steps of a generation,
        population x loops x 2 lifetimes, which last longer on average if the gain varies.
        """
        loops = training.loops if self.loops is None else self.loops
        if self.generations is not None:
            return Schedule(self.generations, loops)
        round_ = loops * len(SIDES)
        confirmation = CANDIDATES * -(-self.confirm // round_) * round_
        return Schedule(
            paper_generations(self.starts * round_, self.population * round_, confirmation, training.stretch(lifetime)),
            loops,
        )


def paper_generations(first: int, each: int, last: int, stretch: float) -> int:
    """How many generations fit into the robot-steps of an evolution of the paper.

    first, each, last: lifetimes of the first generation, of each later one, and of the candidates after the last.
    stretch: mean length of a lifetime over the paper's.
    """
    left = _PAPER_LIFETIMES / stretch - first - last
    return 1 + max(0, math.floor(left / each))


def initial(rng: np.random.Generator, count: int, plan: GenomePlan) -> Floats:
    """Random genomes: (count, genes), each part uniform in its +-start; weights in [-1, 1]."""
    return np.concatenate([rng.uniform(-part.start, part.start, (count, part.size)) for part in plan.parts], axis=1)


def units(plan: GenomePlan) -> Floats:
    """The scale of each gene, (genes,): the start of its part; 1 where that is 0."""
    starts = np.concatenate([np.full(part.size, part.start) for part in plan.parts])
    return np.where(starts > 0, starts, 1.0)


def limits(plan: GenomePlan, otherwise: float) -> Floats:
    """The bound of each gene, (genes,): that of its part, or else this one."""
    return np.concatenate([np.full(part.size, otherwise if part.limit is None else part.limit) for part in plan.parts])
