"""An optimizer of your own: CMA-ME of pyribs, which fills an archive with controllers that end in different places."""

from dataclasses import dataclass

import numpy as np
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
        own_seed, *seeds = rng.integers(2**31, size=1 + self.emitters).tolist()
        shape = {"solution_dim": plan.genes, "dims": [self.cells] * 2, "ranges": [(-0.4, 0.4)] * 2}
        self._archive = GridArchive(**shape, seed=own_seed)  # an emitter that restarts draws from it
        how = {"sigma0": self.sigma, "es": "sep_cma_es", "batch_size": self.population // self.emitters}
        starts = zip(rng.uniform(-1, 1, (self.emitters, plan.genes)), seeds, strict=True)
        emitters = [EvolutionStrategyEmitter(self._archive, x0=x0, seed=number, **how) for x0, number in starts]
        self._scheduler = Scheduler(self._archive, emitters)

    def ask(self):
        """The genomes of the next generation."""
        return np.clip(self._scheduler.ask(), -self._limits, self._limits)

    def tell(self, fitness, x):
        """How well they did, and where they ended: x has the shape (individuals, loops, sides), lamp on first."""
        self._scheduler.tell(fitness, x.mean(axis=1))

    def candidates(self):
        """The three fittest of the archive; the best of them in fresh lifetimes becomes the champion."""
        fittest = self.tables()["archive"].nlargest(3, "objective")
        return fittest.filter(like="solution").clip(-self._limits, self._limits, axis=1)

    def tables(self):
        """archive.csv: a row for each cell that has a controller, with its genes."""
        return {"archive": self._archive.data(return_type="pandas")}
