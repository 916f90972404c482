"""A task of your own: to be near the goal at the end counts, and how the robot drives there does not."""

from dataclasses import dataclass

from epuckhebb import Task


@dataclass(frozen=True, kw_only=True)
class Arrive(Task):
    """weight: of the goal reward."""

    weight: float = 1.0

    def fitness(self, behaviour, reward, trials, at_start):
        """The fitness of a lifetime. reward: 1 at the goal, less the farther away."""
        return self.weight * reward
