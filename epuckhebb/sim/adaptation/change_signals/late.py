"""Lateness: the robot has been away from the goal for longer than it ever was in its training world.

    lateness = away / longest away

Above 1 it is later than ever. It needs a clock that started with the trial, and to be told when the robot is at the
goal; so it is for robots with a supervisor, as the paper's fitness is.
"""

import math

from epuckhebb.sim.adaptation.change_signal import NominalOfSide, Now
from epuckhebb.sim.compiled import compiled

LEAST_AWAY_S = 5.0  # an excursion from the goal that is not worth noticing


@compiled
def change_signal(now: Now, nominal: NominalOfSide) -> float:
    """Time away over the longest remembered: of the way to the goal until it arrives, of excursions afterwards.

    It is nan, which opens no gate, if the robot remembers no arrival.
    """
    if now.arrived and not math.isnan(nominal.time_to_goal_s):
        return now.away_s / max(nominal.away_s, LEAST_AWAY_S)
    return now.away_s / nominal.time_to_goal_s
