"""Separable CMA-ES: a cloud of genomes that moves and learns how wide it should be along each gene (Ros & Hansen 2008).

The algorithm is `SepCMA` of the library cmaes; this file starts it. Its random generator is seeded anew for each
generation.
"""

from dataclasses import dataclass

import numpy as np
from cmaes import SepCMA

from epuckhebb.controller import random
from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.genome import GenomePlan
from epuckhebb.controller.random import Stream
from epuckhebb.evolution.optimizer import CANDIDATES, EvolutionStrategy, initial, units


@dataclass(kw_only=True)
class SepCmaEs(EvolutionStrategy):
    """Separable CMA-ES; its settings are those of any evolution strategy.

    Genes are in units of their part's start. `_generations`: those evaluated so far.
    """

    def start(self, plan: GenomePlan, seed: int) -> None:
        """See `Algorithm`."""
        self._plan, self._seed, self._unit = plan, seed, units(plan)
        self._generations = 0
        self._cma: SepCMA | None = None

    def ask(self) -> Floats:
        """First random genomes, then samples of the distribution."""
        rng = random.rng(self._seed, Stream.variation, self._generations)
        if self._cma is None:
            self._population = initial(rng, self.starts, self._plan) / self._unit
        else:
            self._cma.reseed_rng(int(rng.integers(2**32)))
            self._population = np.array([self._cma.ask() for _ in range(self.population)])
        return self._population * self._unit

    def tell(self, fitness: Floats) -> None:
        """Start around the fittest, or move the distribution towards the fitter half."""
        self._ranked = self._population[np.argsort(-fitness, kind="stable")]
        if self._cma is None:
            bound = self.limits(self._plan) / self._unit
            self._cma = SepCMA(
                mean=np.clip(self._ranked[0], -bound, bound),
                sigma=self.sigma,
                bounds=np.stack([-bound, bound], axis=1),
                population_size=self.population,
            )
        else:
            self._cma.tell([(genes, -float(value)) for genes, value in zip(self._population, fitness, strict=True)])
        self._generations += 1

    def candidates(self) -> Floats:
        """The mean, and the two fittest."""
        assert self._cma is not None  # since the first `tell`
        return np.array([self._cma.mean, *self._ranked[: CANDIDATES - 1]]) * self._unit
