"""Novelty: the robot's readings are unlike those of its training world. It knows only what the robot senses.

novelty = min over lamps of mean |s' - m| / (d + 0.01)      recent readings against the remembered, in spreads
"""

import numpy as np

from epuckhebb.sim.adaptation.change_signal import NominalOfSide, Now
from epuckhebb.sim.compiled import compiled

LEAST_SPREAD = 0.01  # of a reading: the noise of a light sensor


@compiled
def change_signal(now: Now, nominal: NominalOfSide) -> float:
    """Mean distance of the inputs, in spreads, from the remembered state that fits best: without or with the lamp."""
    least = np.inf
    inputs = nominal.reading_mean.shape[1]
    for lamp in range(2):
        total = 0.0
        for i in range(inputs):
            away = abs(now.recent[i] - nominal.reading_mean[lamp, i])
            total += away / (nominal.reading_spread[lamp, i] + LEAST_SPREAD)
        least = min(least, total / inputs)
    return least
