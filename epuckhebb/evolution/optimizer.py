"""What every optimizer is: settings, from which a search begins that is asked who lives and told how well they did.

An optimizer is one file of `optimizers/`, with a subclass of `Optimizer` that holds its settings and a subclass of
`Search`. Nothing else has to know of it, but a file of `conf/optimizer/` has its values: `algorithm`, the name of its
file, and its settings; `conf/optimizer/sep_cma_es.yaml` shows how it says that the GA's settings are not wanted.
"""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.evolution.training import Training
from epuckhebb.sim.genome import GenomePlan
from epuckhebb.sim.life import Lifetime
from epuckhebb.sim.maze import SIDES

_PAPER_LIFETIMES = 50 * 30 * 3 * len(SIDES)  # population, generations, loops and sides of the paper's algorithm

CANDIDATES, CONFIRM = 3, 12  # who may be the champion of what learns, and in how many fresh lifetimes it is decided

State = dict[str, NDArray[Any]]


class Schedule(NamedTuple):
    """How long a search goes on.

    generations: how many there are. loops: how often an individual lives a lamp-on and a lamp-off lifetime in each.
    """

    generations: int
    loops: int


class Search(ABC):
    """A search for genomes under way."""

    @abstractmethod
    def ask(self) -> NDArray[np.float64]:
        """The genomes that are to live in the next generation, (individuals, genes)."""

    @abstractmethod
    def tell(self, fitness: NDArray[np.float64]) -> None:
        """Take in how well they did, (individuals,), the more the better."""

    @abstractmethod
    def candidates(self) -> NDArray[np.float64]:
        """Who may be the champion after the generation that was just told of, (candidates, genes).

        Of several, the fittest in fresh lifetimes is the champion.
        """

    @property
    @abstractmethod
    def state(self) -> State:
        """All that the search needs to go on from here, as arrays by name."""


class Optimizer(ABC):
    """The settings of an optimizer; subclasses are dataclasses.

    name: that of its file. key: where they stand in the configuration. common_random_numbers: whether all individuals
    of a generation start alike and hear the same noise, so that only their genes tell them apart. start_noise: how much
    starts vary at home. confirm: in how many fresh lifetimes, at least, each candidate is tried after the last
    generation, if there are several.
    """

    key: ClassVar[str] = "optimizer"
    common_random_numbers: ClassVar[bool] = False
    start_noise: float = 0.0
    confirm: int = 1

    @property
    def name(self) -> str:
        """What it is called: as its file."""
        return type(self).__module__.rpartition(".")[2]

    @property
    @abstractmethod
    def individuals(self) -> int:
        """How many live in the largest generation."""

    @abstractmethod
    def schedule(self, training: Training, lifetime: Lifetime) -> Schedule:
        """How long a search in these worlds goes on, with what the settings leave open filled in."""

    def check(self, plan: GenomePlan) -> None:  # noqa: B027  # most can search any plan
        """Refuse a plan for which these settings make no sense.

        Raises:
            ValueError: they make none.
        """

    @abstractmethod
    def search(self, plan: GenomePlan, seed: int, state: State | None = None) -> Search:
        """A search for the genes of a plan; with a state, one that goes on from there to the same bits.

        Raises:
            KeyError: something is missing in the state.
            ValueError: the state is of another search.
        """


@dataclass(kw_only=True)
class EvolutionStrategy(Optimizer):
    """What evolution strategies have in common: a cloud of genomes around a mean, with common random numbers.

    population: individuals of a generation, but for the first. generations: None for as many as fit into the number of
    robot-steps that the paper's evolutions take. loops: how often an individual lives a lamp-on and a lamp-off lifetime
    in a generation; None for once in each kind of world of the training. starts: individuals of the first generation,
    uniform at random; the fittest is the first mean of the others (0 would be a saddle: a network of zeros stands
    still, whatever one of its weights does). sigma: first standard deviation of a gene, in units of its part's start, 1
    for weights. gene_limit: weights stay within +- this. confirm: in how many fresh lifetimes, at least, the last mean
    and the two fittest of the last generation are tried; the best of them is the champion.

    Raises:
        ValueError: a value is outside the range named in the message.
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
        """Refuse algorithms that cannot be."""
        for name, bound in self.least.items():
            value = getattr(self, name)
            if value is not None and value < bound:
                raise ValueError(f"optimizer.{name} must be {bound} or more, got {value}")
        for name in ("sigma", "gene_limit"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) > 0):
                raise ValueError(f"optimizer.{name} must be more than 0, got {getattr(self, name)}")

    @property
    def individuals(self) -> int:
        """How many live in the largest generation."""
        return max(self.population, self.starts)

    def schedule(self, training: Training, lifetime: Lifetime) -> Schedule:
        """As it is set; what is left open follows from the training and from the paper's number of robot-steps.

        The paper's are 50 individuals x 30 generations x 3 loops x 2 sides x the steps of a lifetime. Of these the
        first generation and the confirmation of the champion are taken; the rest is divided by what a generation takes,
        population x loops x 2 lifetimes, which last longer on average where the gain varies.
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
    """How many generations take as many robot-steps as an evolution of the paper, and no more.

    first, each, last: lifetimes of the first generation, of each later one, and of those who may be the champion after
    the last. stretch: how many times as long as in the paper a lifetime lasts on average.
    """
    left = _PAPER_LIFETIMES / stretch - first - last
    return 1 + max(0, math.floor(left / each))


def initial(rng: np.random.Generator, count: int, plan: GenomePlan) -> NDArray[np.float64]:
    """Genomes at random: (count, genes), each part uniform in its +-start; weights in [-1, 1]."""
    return np.concatenate([rng.uniform(-part.start, part.start, (count, part.size)) for part in plan.parts], axis=1)


def units(plan: GenomePlan) -> NDArray[np.float64]:
    """The scale of each gene, (genes,): the start of its part; 1 where that is 0."""
    starts = np.concatenate([np.full(part.size, part.start) for part in plan.parts])
    return np.where(starts > 0, starts, 1.0)


def limits(plan: GenomePlan, otherwise: float) -> NDArray[np.float64]:
    """The bound of each gene, (genes,): of its part, or else this one."""
    return np.concatenate([np.full(part.size, otherwise if part.limit is None else part.limit) for part in plan.parts])
