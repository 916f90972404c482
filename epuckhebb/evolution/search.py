"""A search with an optimizer: what it asks is checked, and all results that it receives are logged, to resume from.

An optimizer need not know how to store itself. To resume, a new copy of it receives the same results again, and a
digest shows whether it asks for the same genomes as before.
"""

import hashlib
import inspect
import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.errors import PartError
from epuckhebb.controller.genome import GenomePlan
from epuckhebb.controller.own_class import calling, is_user_class
from epuckhebb.evolution.optimizer import Algorithm, Optimizer
from epuckhebb.tmaze.own_fitness import OF_OUTCOME

if TYPE_CHECKING:
    import pandas as pd

_FITNESS = "fitness"
LEARNT = "learnt_weights"  # among the measures: what individuals then inherit, (individuals, weights)


class Results(NamedTuple):
    """The results of a generation, as an optimizer receives them.

    digest: of the genomes that it had asked for. fitness: (individuals,). measures: what else it wants to know, by
    name, (individuals, loops, sides) each.
    """

    digest: str
    fitness: Floats
    measures: Mapping[str, Floats]


class Search:
    """A search in progress. log: the results of each generation so far. measures: of an outcome, for the optimizer."""

    def __init__(
        self,
        optimizer: Algorithm,
        plan: GenomePlan,
        seed: int,
        log: Sequence[Results] = (),
        start: Floats | None = None,
    ) -> None:
        """Start a copy of an optimizer for the genes of a plan, and give it the results that are logged.

        start: the genes at which it begins, (genes,); None for random ones.
        """
        self.log: tuple[Results, ...] = ()
        self._settings, self._plan = optimizer, plan
        self._optimizer = replace(optimizer)  # type: ignore[type-var]  # all are dataclasses
        self.measures = [name for name in type(optimizer).arguments("tell") if name in OF_OUTCOME]
        self._do("start", plan, seed)
        if start is not None:
            self._do("begin_at", start.copy())
        for number, results in enumerate(log):
            self.ask()
            if self._digest != results.digest:
                raise PartError(f"optimizer {optimizer.name} asks for other genomes than before in generation {number}")
            self.tell(results.fitness, results.measures)

    def ask(self) -> Floats:
        """The genomes of the next generation, (individuals, genes)."""
        most = max(self._settings.population, self._settings.first_generation)
        self._population = self._genomes("ask", self._do("ask"), most)
        self._digest = hashlib.sha256(self._population.tobytes()).hexdigest()[:16]
        return self._population

    def tell(self, fitness: Floats, measures: Mapping[str, Floats]) -> None:
        """Give the optimizer their results; measures by name."""
        if LEARNT in measures:
            self._do("inherit", measures[LEARNT].copy())
        results = {_FITNESS: fitness, **measures}
        names = inspect.signature(self._optimizer.tell).parameters
        self._do("tell", **{name: results[name].copy() for name in names})  # which the optimizer may change
        self._fittest = self._population[[np.argmax(fitness)]]
        self.log = (*self.log, Results(self._digest, fitness, measures))

    def candidates(self) -> Floats:
        """Candidates for the champion after this generation, (candidates, genes)."""
        candidates = self._do("candidates")
        if candidates is None:
            return self._fittest
        return self._genomes("candidates", np.atleast_2d(candidates))

    def tables(self) -> dict[str, "pd.DataFrame"]:
        """What the optimizer has to show, by name."""
        tables = self._do("tables")
        if not isinstance(tables, Mapping) or not all(hasattr(table, "to_csv") for table in tables.values()):
            raise PartError(f"optimizer {self._settings.name}: `tables` must return data frames by name")
        return dict(tables)

    def _genomes(self, method: str, returned: Any, most: float = math.inf) -> Floats:
        """Genomes that a method of the optimizer gave, (rows, genes), as an array of their own."""
        optimizer: Any = self._settings
        genes = self._plan.genes
        with suppress(TypeError, ValueError, OverflowError):
            genomes = np.array(returned, np.float64)
            is_limited = isinstance(optimizer, Optimizer) and is_user_class(type(optimizer))
            limit = optimizer.limits(self._plan) if is_limited else math.inf
            if genomes.ndim == 2 and 1 <= len(genomes) <= most and genomes.shape[1] == genes:
                if (np.abs(genomes) <= limit).all() and np.isfinite(genomes).all():
                    return genomes
                returned = f"{genomes.min():g} to {genomes.max():g}"
            else:
                returned = f"shape {genomes.shape}"
        needed = f"1 to {most:g} genomes of {genes} finite numbers within optimizer.gene_limit"
        raise PartError(f"optimizer {optimizer.name}: `{method}` must return {needed}, got {returned}")

    def _do(self, method: str, *arguments: Any, **named: Any) -> Any:
        """Call a method of the optimizer."""
        with calling(f"optimizer {self._settings.name}: `{method}`"):
            return getattr(self._optimizer, method)(*arguments, **named)


def check_start(optimizer: Algorithm, plan: GenomePlan, seed: int, start: Floats | None = None) -> Search:
    """A search that has begun; a PartError if it asks for other genomes when it is started again."""
    search, again = (Search(optimizer, plan, seed, start=start) for _ in range(2))
    if not np.array_equal(search.ask(), again.ask()):
        raise PartError(f"optimizer {optimizer.name} asks for other genomes with the same seed: no run repeats")
    return search
