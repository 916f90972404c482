"""A search with an optimizer: what it asks is checked, and all results that it receives are logged, to resume from.

An optimizer need not know how to store itself. To resume, a new copy of it receives the same results again, and a
digest shows whether it asks for the same genomes as before.
"""

import hashlib
import inspect
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.genome import GenomePlan
from epuckhebb.controller.own_class import arguments, calling, is_own
from epuckhebb.evolution.optimizer import Algorithm, Optimizer
from epuckhebb.tmaze.own_fitness import OF_OUTCOME

if TYPE_CHECKING:
    import pandas as pd

_FITNESS = "fitness"


class OptimizerError(ValueError):
    """An optimizer failed, or asked for what is no genome; the message says which, and what it asked."""


class Results(NamedTuple):
    """The results of a generation, as an optimizer receives them.

    digest: of the genomes that it had asked for. fitness: (individuals,). measures: what else it wants to know, by
    name, (individuals, loops, sides) each.
    """

    digest: str
    fitness: Floats
    measures: Mapping[str, Floats]


def measures_of(optimizer: Algorithm) -> tuple[str, ...]:
    """The fields of an outcome that an optimizer wants to know: the arguments of its `tell`, but for the fitness."""
    names = arguments(optimizer.what(), optimizer.tell, (_FITNESS, *OF_OUTCOME))
    return tuple(name for name in names if name != _FITNESS)


class Search:
    """A search in progress. log: the results of each generation so far. measures: as `measures_of` has them."""

    def __init__(self, optimizer: Algorithm, plan: GenomePlan, seed: int, log: Sequence[Results] = ()) -> None:
        """Start a copy of an optimizer for the genes of a plan, and give it the results that are logged."""
        self.log: tuple[Results, ...] = ()
        self._settings, self._plan = optimizer, plan
        self._optimizer = replace(optimizer)  # type: ignore[type-var]  # all are dataclasses
        self.measures = measures_of(optimizer)
        self._do("start", plan, seed)
        for number, results in enumerate(log):
            self.ask()
            if self._digest != results.digest:
                raise OptimizerError(
                    f"optimizer {optimizer.name} asks for other genomes than before in generation {number}: it depends "
                    "on more than its seed and the results, or a library or the machine is another"
                )
            self.tell(results.fitness, results.measures)

    def ask(self) -> Floats:
        """The genomes of the next generation, (individuals, genes)."""
        given, genes = self._do("ask"), self._plan.genes
        most = max(self._settings.population, self._settings.first_generation)
        wanted = f"{self._settings.name}: `ask` must return genomes, an array of 1 to {most} rows with {genes} numbers"
        self._population = self._genomes(given, wanted)
        if not 1 <= len(self._population) <= most:
            raise OptimizerError(f"optimizer {wanted}; it has {len(self._population)} rows")
        self._digest = hashlib.sha256(self._population.tobytes()).hexdigest()[:16]
        return self._population

    def tell(self, fitness: Floats, measures: Mapping[str, Floats]) -> None:
        """Give the optimizer their results; measures by name."""
        given = {_FITNESS: fitness, **measures}
        names = inspect.signature(self._optimizer.tell).parameters
        self._do("tell", **{name: given[name].copy() for name in names})  # which the optimizer may change
        self._fittest = self._population[[np.argmax(fitness)]]
        self.log = (*self.log, Results(self._digest, fitness, measures))

    def candidates(self) -> Floats:
        """Candidates for the champion after this generation, (candidates, genes)."""
        given = self._do("candidates")
        if given is None:
            return self._fittest
        wanted = f"{self._settings.name}: `candidates` must return genomes, rows of {self._plan.genes} numbers, or None"
        return self._genomes(np.atleast_2d(given), wanted)

    def tables(self) -> dict[str, "pd.DataFrame"]:
        """What the optimizer has to show, by name."""
        tables = self._do("tables")
        if not isinstance(tables, Mapping) or not all(hasattr(table, "to_csv") for table in tables.values()):
            raise OptimizerError(f"optimizer {self._settings.name}: `tables` must return data frames by name")
        return dict(tables)

    def _genomes(self, given: Any, wanted: str) -> Floats:
        """Genomes that an optimizer gave, (rows, genes), as an array of their own."""
        try:
            genomes = np.array(given, np.float64)
        except (TypeError, ValueError) as error:
            raise OptimizerError(f"optimizer {wanted}, got {given!r}") from error
        if genomes.ndim != 2 or genomes.shape[1] != self._plan.genes:
            raise OptimizerError(f"optimizer {wanted}, got {'None' if given is None else f'shape {genomes.shape}'}")
        if not np.isfinite(genomes).all():
            raise OptimizerError(f"optimizer {wanted}; one is nan or infinite")
        if is_own(type(self._settings)) and isinstance(self._settings, Optimizer):
            beyond = np.abs(genomes) > self._settings.limits(self._plan)
            if beyond.any():
                raise OptimizerError(
                    f"optimizer {wanted}, each within its limit (optimizer.gene_limit is "
                    f"{self._settings.gene_limit:g}); one is {genomes[beyond][0]:g}"
                )
        return genomes

    def _do(self, method: str, *arguments: Any, **named: Any) -> Any:
        """Call a method of the optimizer."""
        with calling(f"optimizer {self._settings.name}: `{method}`", OptimizerError):
            return getattr(self._optimizer, method)(*arguments, **named)


def check_start(optimizer: Algorithm, plan: GenomePlan, seed: int) -> None:
    """Check that an optimizer starts, and asks for the same genomes when it is started again."""
    first, again = (Search(optimizer, plan, seed).ask() for _ in range(2))
    if not np.array_equal(first, again):
        raise OptimizerError(
            f"optimizer {optimizer.name} asks for other genomes with the same seed, so no run could be repeated; draw "
            "all random numbers from the seed that `start` is given"
        )
