"""An optimizer of your own in fifteen lines: mutants of the fittest genome so far."""

import numpy as np

from epuckhebb import Optimizer


class HillClimber(Optimizer):
    """Keeps the fittest genome, and tries mutants of it."""

    def start(self, plan, seed):
        """Begin with zeros; all random numbers come from the seed."""
        self._rng, self._limits = np.random.default_rng(seed), self.limits(plan)
        self._best, self._fitness = np.zeros(plan.genes), -np.inf

    def ask(self):
        """The genomes of the next generation, (population, genes)."""
        mutants = self._best + 0.3 * self._rng.standard_normal((self.population, len(self._best)))
        self._asked = np.clip(mutants, -self._limits, self._limits)
        return self._asked

    def tell(self, fitness):
        """How well they did; larger is better."""
        if fitness.max() > self._fitness:
            self._best, self._fitness = self._asked[fitness.argmax()], fitness.max()
