"""Shortfall: the robot does worse than it ever did at this time of its life in its training world.

    shortfall = M(t) - F'       remembered live fitness at this time, less the recent one

The live fitness knows when the robot is in the correct arm, so this signal is for robots with a supervisor.
"""

from epuckhebb.sim.adaptation.change_signal import NominalOfSide, Now
from epuckhebb.sim.compiled import compiled


@compiled
def change_signal(now: Now, nominal: NominalOfSide) -> float:
    """The least fitness remembered of this second of life, less the recent one; after the last second, of that."""
    second = min(int(now.time_s), nominal.fitness.shape[0] - 1)
    return float(nominal.fitness[second]) - float(now.recent[now.recent.shape[0] - 1])
