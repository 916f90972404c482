"""Shortfall: the robot does worse than it ever did at this time of a lifetime in its training world.

    shortfall = M(t) - F'       M: least live fitness in training at this time; F': recent live fitness

The live fitness includes whether the robot is in the correct arm, so this signal needs a supervisor.
"""

from epuckhebb.adaptation.change_signal import NominalOfSide, SignalContext
from epuckhebb.controller.compiling.kernel import compiled


@compiled
def change_signal(context: SignalContext, nominal: NominalOfSide) -> float:
    """The least nominal fitness of this second (or of the last one), less the recent fitness."""
    second = min(int(context.time_s), nominal.fitness.shape[0] - 1)
    return float(nominal.fitness[second]) - float(context.recent[context.recent.shape[0] - 1])
