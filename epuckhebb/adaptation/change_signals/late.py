"""Late: the robot has been away from the goal for longer than it ever was in its training world.

    late = time away / longest time away in training        above 1: later than ever

The robot is given a clock that starts with the trial and a signal at the goal. Like the paper's fitness, this needs a
supervisor.
"""

import math
from dataclasses import dataclass

from epuckhebb.adaptation.change_signal import ChangeSignal, NominalOfSide

LEAST_AWAY_S = 5.0  # shorter excursions from the goal do not count


@dataclass(frozen=True, kw_only=True)
class Late(ChangeSignal):
    """Time away over the longest in training."""

    @staticmethod
    def signal(away_s: float, arrived: bool, nominal: NominalOfSide) -> float:
        """Before the first arrival, the time on the way; it is nan, which opens no gate, without one in training."""
        if arrived and not math.isnan(nominal.time_to_goal_s):
            return away_s / max(nominal.away_s, LEAST_AWAY_S)
        return away_s / nominal.time_to_goal_s
