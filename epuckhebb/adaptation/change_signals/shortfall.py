"""Shortfall: the robot does worse than it ever did at this time of a lifetime in its training world.

    shortfall = M(t) - F'       M: least live fitness in training at this time; F': recent live fitness

The live fitness includes whether the robot is in the correct arm, so this signal needs a supervisor.
"""

from dataclasses import dataclass

from epuckhebb.adaptation.change_signal import ChangeSignal, NominalOfSide


@dataclass(frozen=True, kw_only=True)
class Shortfall(ChangeSignal):
    """The least nominal fitness of this second, less the recent fitness."""

    @staticmethod
    def signal(time_s: float, fitness: float, nominal: NominalOfSide) -> float:
        """After the last second in training, that second counts."""
        second = min(int(time_s), nominal.fitness.shape[0] - 1)
        return float(nominal.fitness[second]) - fitness
