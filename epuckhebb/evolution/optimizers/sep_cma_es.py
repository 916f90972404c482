"""Separable CMA-ES: a cloud of genomes that moves and learns how wide it should be along each gene (Ros & Hansen 2008).

The algorithm is `SepCMA` of the library cmaes; this file starts and stores it. The library can only pickle a search,
so its private numbers are read and set by name (`_STORED`). The random generator is seeded anew for each generation, so
its state need not be stored.
"""

from dataclasses import dataclass

import numpy as np
from cmaes import SepCMA

from epuckhebb.evolution.optimizer import CANDIDATES, EvolutionStrategy, Search, State, initial, limits, units
from epuckhebb.sim import random
from epuckhebb.sim.arrays import Floats
from epuckhebb.sim.genome import GenomePlan
from epuckhebb.sim.random import Stream

_STORED = ("_mean", "_sigma", "_C", "_p_sigma", "_pc", "_g")  # all that changes in a SepCMA


@dataclass(kw_only=True)
class SepCmaEs(EvolutionStrategy):
    """Separable CMA-ES; its settings are those of any evolution strategy."""

    def search(self, plan: GenomePlan, seed: int, state: State | None = None) -> "SepCmaEsSearch":
        """See `Optimizer`."""
        return SepCmaEsSearch(self, plan, seed, state)


class SepCmaEsSearch(Search):
    """Separable CMA-ES in progress. Genes are in units of their part's start. `_generations`: evaluated so far."""

    def __init__(self, settings: SepCmaEs, plan: GenomePlan, seed: int, state: State | None) -> None:
        self._settings, self._plan, self._seed = settings, plan, seed
        self._unit = units(plan)
        self._generations = 0 if state is None else int(state["generations"])
        self._cma = None if state is None else self._resumed(state)
        self._population = np.empty((0, plan.genes))
        self._ranked = self._population

    def _started(self, mean: Floats) -> SepCMA:
        bound = limits(self._plan, self._settings.gene_limit) / self._unit
        return SepCMA(
            mean=np.clip(mean, -bound, bound),
            sigma=self._settings.sigma,
            bounds=np.stack([-bound, bound], axis=1),
            population_size=self._settings.population,
        )

    def _resumed(self, state: State) -> SepCMA:
        for name in ("_mean", "_C", "_p_sigma", "_pc"):
            if state[name[1:]].shape != (self._plan.genes,):
                raise ValueError(
                    f"its {name[1:]} has shape {state[name[1:]].shape}, the configuration asks for "
                    f"({self._plan.genes},)"
                )
        cma = self._started(state["mean"])
        for name in _STORED:
            value = state[name[1:]]
            setattr(cma, name, value.copy() if value.ndim else value.item())
        return cma

    def ask(self) -> Floats:
        """First random genomes, then samples of the distribution."""
        rng = random.rng(self._seed, Stream.variation, self._generations)
        if self._cma is None:
            self._population = initial(rng, self._settings.starts, self._plan) / self._unit
        else:
            self._cma.reseed_rng(int(rng.integers(2**32)))
            self._population = np.array([self._cma.ask() for _ in range(self._settings.population)])
        return self._population * self._unit

    def tell(self, fitness: Floats) -> None:
        """Start around the fittest, or move the distribution towards the fitter half."""
        self._ranked = self._population[np.argsort(-fitness, kind="stable")]
        if self._cma is None:
            self._cma = self._started(self._ranked[0])
        else:
            self._cma.tell([(genes, -float(value)) for genes, value in zip(self._population, fitness, strict=True)])
        self._generations += 1

    def candidates(self) -> Floats:
        """The mean, and the two fittest."""
        assert self._cma is not None  # since the first `tell`
        return np.array([self._cma.mean, *self._ranked[: CANDIDATES - 1]]) * self._unit

    @property
    def state(self) -> State:
        """The number of calls of `tell`, and all of the library's search that changes."""
        return {"generations": np.array(self._generations)} | {
            name[1:]: np.array(getattr(self._cma, name)) for name in _STORED
        }
