"""The outcome of a lifetime: success and all other metrics."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim.task import NO_TRIALS


class Outcome(NamedTuple):
    """The metrics of a lifetime.

    time_to_goal: s, first time within 5 cm of the goal, nan if never. path_length: m. final_distance: m from the goal.
    behaviour: mean combined fitness over the steps. reward: goal reward at the end. weight_change_mean,
    weight_change_final: sum over weights of |W - W_gene|. contact_fraction: share of steps with a distance reading
    above 0.8. success: whether the robot was within 5 cm of its goal at the last step. fitness: how well it did its
    task; the paper's final fitness unless that is another. steps: done. saturated_fraction: share of the final weights
    at their bound. x, y: m, where the robot is at the end.
    """

    time_to_goal: float
    path_length: float
    final_distance: float
    behaviour: float
    reward: float
    weight_change_mean: float
    weight_change_final: float
    contact_fraction: float
    success: bool
    fitness: float
    steps: int
    saturated_fraction: float
    x: float
    y: float

    def with_fitness(self, fitness: float) -> "Outcome":
        """The same metrics with another fitness."""
        return self._replace(fitness=fitness)

    @property
    def trials(self) -> NDArray[np.void]:
        """The trials of the lifetime, records of `epuckhebb.sim.task.TRIAL`; none where it is one."""
        return NO_TRIALS


class OutcomeOfTrials(Outcome):
    """The metrics of a lifetime of many trials."""

    _trials: NDArray[np.void]

    @property
    def trials(self) -> NDArray[np.void]:
        """See `Outcome`."""
        return self._trials

    def with_fitness(self, fitness: float) -> "Outcome":
        """See `Outcome`."""
        return self.of(self._replace(fitness=fitness), self._trials)

    @classmethod
    def of(cls, outcome: Outcome, trials: NDArray[np.void]) -> "OutcomeOfTrials":
        """The metrics of the whole lifetime, with its trials."""
        made = cls(*outcome)
        made._trials = trials
        return made
