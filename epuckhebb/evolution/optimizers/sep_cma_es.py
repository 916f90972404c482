"""Separable CMA-ES: a cloud of genomes that moves and learns how wide it should be along each gene (Ros & Hansen 2008).

The algorithm is `SepCMA` of the library cmaes; here stand how it begins, how long it goes on, and how it is stored. The
library has no public way to store a search but pickle, so its private numbers are read and set by name (`_KEPT`). Its
generator is seeded anew for each generation, so that there is no state of it to keep.
"""

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from cmaes import SepCMA
from numpy.typing import NDArray

from epuckhebb.evolution.optimizer import (
    CANDIDATES,
    Optimizer,
    Schedule,
    Search,
    State,
    initial,
    limits,
    paper_generations,
)
from epuckhebb.evolution.training import Training
from epuckhebb.sim import random
from epuckhebb.sim.genome import GenomePlan
from epuckhebb.sim.lifetime import Lifetime
from epuckhebb.sim.maze import SIDES
from epuckhebb.sim.random import Stream

_KEPT = ("_mean", "_sigma", "_C", "_p_sigma", "_pc", "_g")  # all that changes in a SepCMA, and is used again


@dataclass(kw_only=True)
class SepCmaEs(Optimizer):
    """Separable CMA-ES.

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

    population: int = 30
    generations: int | None = None
    loops: int | None = None
    starts: int = 50
    sigma: float = 0.5
    gene_limit: float = 2.0
    confirm: int = 12

    def __post_init__(self) -> None:
        """Refuse algorithms that cannot be."""
        least = {"population": 4, "generations": 1, "loops": 1, "starts": 2, "confirm": 1}
        for name, bound in least.items():
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

    def search(self, plan: GenomePlan, seed: int, state: State | None = None) -> "SepCmaEsSearch":
        """See `Optimizer`."""
        return SepCmaEsSearch(self, plan, seed, state)


class SepCmaEsSearch(Search):
    """Separable CMA-ES at work. Genes are in units of their part's start; `_told` generations have been told of."""

    def __init__(self, settings: SepCmaEs, plan: GenomePlan, seed: int, state: State | None) -> None:
        self._settings, self._plan, self._seed = settings, plan, seed
        starts = np.concatenate([np.full(part.size, part.start) for part in plan.parts])
        self._unit = np.where(starts > 0, starts, 1.0)
        self._told = 0 if state is None else int(state["told"])
        self._cma = None if state is None else self._going_on(state)
        self._population = np.empty((0, plan.genes))
        self._ranked = self._population

    def _begun(self, mean: NDArray[np.float64]) -> SepCMA:
        bound = limits(self._plan, self._settings.gene_limit) / self._unit
        return SepCMA(
            mean=np.clip(mean, -bound, bound),
            sigma=self._settings.sigma,
            bounds=np.stack([-bound, bound], axis=1),
            population_size=self._settings.population,
        )

    def _going_on(self, state: State) -> SepCMA:
        for name in ("_mean", "_C", "_p_sigma", "_pc"):
            if state[name[1:]].shape != (self._plan.genes,):
                raise ValueError(
                    f"its {name[1:]} has shape {state[name[1:]].shape}, the configuration asks for "
                    f"({self._plan.genes},)"
                )
        cma = self._begun(state["mean"])
        for name in _KEPT:
            value = state[name[1:]]
            setattr(cma, name, value.copy() if value.ndim else value.item())
        return cma

    def ask(self) -> NDArray[np.float64]:
        """At first genomes at random, then those that the cloud of genomes gives."""
        rng = random.rng(self._seed, Stream.variation, self._told)
        if self._cma is None:
            self._population = initial(rng, self._settings.starts, self._plan) / self._unit
        else:
            self._cma.reseed_rng(int(rng.integers(2**32)))
            self._population = np.array([self._cma.ask() for _ in range(self._settings.population)])
        return self._population * self._unit

    def tell(self, fitness: NDArray[np.float64]) -> None:
        """Begin around the fittest, or move the cloud towards the fitter half."""
        self._ranked = self._population[np.argsort(-fitness, kind="stable")]
        if self._cma is None:
            self._cma = self._begun(self._ranked[0])
        else:
            self._cma.tell([(genes, -float(judged)) for genes, judged in zip(self._population, fitness, strict=True)])
        self._told += 1

    def candidates(self) -> NDArray[np.float64]:
        """The mean, and the two fittest."""
        assert self._cma is not None  # since the first `tell`
        return np.array([self._cma.mean, *self._ranked[: CANDIDATES - 1]]) * self._unit

    @property
    def state(self) -> State:
        """How many generations have been told of, and all of the library's search that changes."""
        return {"told": np.array(self._told)} | {name[1:]: np.array(getattr(self._cma, name)) for name in _KEPT}
