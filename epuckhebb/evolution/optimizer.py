"""What every optimizer is: settings, from which a search begins that is asked who lives and told how well they did.

An optimizer is one file of `optimizers/`, with a subclass of `Optimizer` that holds its settings and a subclass of
`Search`. Nothing else has to know of it, but a file of `conf/optimizer/` has its values: `algorithm`, the name of its
file, and its settings; `conf/optimizer/sep_cma_es.yaml` shows how it says that the GA's settings are not wanted.
"""

import math
from abc import ABC, abstractmethod
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.evolution.training import Training
from epuckhebb.sim.genome import GenomePlan
from epuckhebb.sim.lifetime import Lifetime
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

    @abstractmethod
    def search(self, plan: GenomePlan, seed: int, state: State | None = None) -> Search:
        """A search for the genes of a plan; with a state, one that goes on from there to the same bits.

        Raises:
            KeyError: something is missing in the state.
            ValueError: the state is of another search.
        """


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


def limits(plan: GenomePlan, otherwise: float) -> NDArray[np.float64]:
    """The bound of each gene, (genes,): of its part, or else this one."""
    return np.concatenate([np.full(part.size, otherwise if part.limit is None else part.limit) for part in plan.parts])
