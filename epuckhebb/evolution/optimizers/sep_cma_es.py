"""Separable CMA-ES: a cloud of genomes that moves and learns how wide it should be along each gene (Ros & Hansen 2008).

The algorithm is `SepCMA` of the library cmaes.
"""

from dataclasses import dataclass

import numpy as np
from cmaes import SepCMA

from epuckhebb.controller.arrays import Floats
from epuckhebb.evolution.optimizer import EvolutionStrategy


@dataclass(kw_only=True)
class SepCmaEs(EvolutionStrategy):
    """Separable CMA-ES; its settings are those of any evolution strategy."""

    def _sample(self, rng: np.random.Generator) -> Floats:
        """Samples of the distribution, which begins around the fittest of the first generation."""
        if self._generations == 1:
            bounds = np.stack([-self._bound, self._bound], axis=1)
            self._cma = SepCMA(self._mean, self.sigma, bounds=bounds, population_size=self.population)
        self._cma.reseed_rng(int(rng.integers(2**32)))
        return np.array([self._cma.ask() for _ in range(self.population)])

    def _move(self, fitness: Floats) -> Floats:
        """Move the distribution towards the fitter half."""
        self._cma.tell([(genes, -float(value)) for genes, value in zip(self._population, fitness, strict=True)])
        mean: Floats = self._cma.mean
        return mean
