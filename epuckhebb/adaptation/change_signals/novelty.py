"""Novelty: the robot's sensor readings are unlike those of its training world. It uses the senses alone.

novelty = min over lamps of mean |s' - m| / (d + 0.01)      s': recent readings; m, d: their mean and spread in training
"""

import numpy as np

from epuckhebb.adaptation.change_signal import NominalOfSide, SignalContext
from epuckhebb.controller.compiling.kernel import compiled

LEAST_SPREAD = 0.01  # of a reading: the noise of a light sensor


@compiled
def change_signal(context: SignalContext, nominal: NominalOfSide) -> float:
    """Mean distance of the inputs from training, in spreads: without or with the lamp, whichever fits better."""
    least = np.inf
    inputs = nominal.reading_mean.shape[1]
    for lamp in range(2):
        total = 0.0
        for i in range(inputs):
            away = abs(context.recent[i] - nominal.reading_mean[lamp, i])
            total += away / (nominal.reading_spread[lamp, i] + LEAST_SPREAD)
        least = min(least, total / inputs)
    return least
