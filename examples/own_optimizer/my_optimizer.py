"""An optimizer of your own: CMA-ME of pyribs, which fills an archive with controllers that end in different places."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from ribs.archives import GridArchive
from ribs.emitters import EvolutionStrategyEmitter
from ribs.schedulers import Scheduler

from epuckhebb import Optimizer


@dataclass(kw_only=True)
class CmaMe(Optimizer):
    """emitters: so many strategies share the population. cells: of the archive, each way. sigma: of the first genes."""

    emitters: int = 3
    cells: int = 20
    sigma: float = 0.5

    def start(self, plan, seed):
        """An empty archive, and emitters around random genomes; all random numbers come from the seed."""
        rng, self._limits = np.random.default_rng(seed), self.limits(plan)
        self._archive = GridArchive(solution_dim=plan.genes, dims=[self.cells] * 2, ranges=[(-0.45, 0.45)] * 2)
        emitters = [
            EvolutionStrategyEmitter(
                self._archive,
                x0=rng.uniform(-1, 1, plan.genes),
                sigma0=self.sigma,
                es="sep_cma_es",
                batch_size=self.population // self.emitters,
                seed=int(rng.integers(2**31)),
            )
            for _ in range(self.emitters)
        ]
        self._scheduler = Scheduler(self._archive, emitters)

    def ask(self):
        """The genomes of the next generation, within the limits; the emitters know none."""
        return np.clip(self._scheduler.ask(), -self._limits, self._limits)

    def tell(self, fitness, x):
        """How well they did, and where they ended: x has the shape (individuals, loops, sides), lamp on first."""
        self._scheduler.tell(fitness, x.mean(axis=1))

    def candidates(self):
        """The three fittest of the archive; the best of them in fresh lifetimes becomes the champion."""
        fitness, _, genomes = self._elites()
        return genomes[np.argsort(-fitness, kind="stable")[:3]]

    def tables(self):
        """archive.csv: a row for each cell with a controller, its genes among the columns."""
        fitness, ends, genomes = self._elites()
        facts = pd.DataFrame({"x_lamp_on": ends[:, 0], "x_lamp_off": ends[:, 1], "fitness": fitness})
        genes = pd.DataFrame(genomes, columns=[f"gene_{number}" for number in range(genomes.shape[1])])
        return {"archive": pd.concat([facts, genes], axis=1)}

    def _elites(self):
        """The fitness, the ends and the genomes of all cells that have a controller."""
        fitness, ends, genomes = self._archive.data(["objective", "measures", "solution"], return_type="tuple")
        return fitness, ends, np.clip(genomes, -self._limits, self._limits)
