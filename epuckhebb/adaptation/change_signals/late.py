"""Late: the robot has been away from the goal for longer than it ever was in its training world.

    late = time away / longest time away in training        above 1: later than ever

The robot is given a clock that starts with the trial and a signal at the goal. Like the paper's fitness, this needs a
supervisor.
"""

import math

from epuckhebb.adaptation.change_signal import NominalOfSide, SignalContext
from epuckhebb.controller.compiling.kernel import compiled

LEAST_AWAY_S = 5.0  # shorter excursions from the goal do not count


@compiled
def change_signal(context: SignalContext, nominal: NominalOfSide) -> float:
    """Time away over the longest in training: on the way to the goal before the first arrival, off it afterwards.

    It is nan, which opens no gate, if the robot never arrived in training.
    """
    if context.arrived and not math.isnan(nominal.time_to_goal_s):
        return context.away_s / max(nominal.away_s, LEAST_AWAY_S)
    return context.away_s / nominal.time_to_goal_s
