"""Novelty: the robot's sensor readings are unlike those of its training world. It uses the senses alone.

novelty = min over lamps of mean |s' - m| / (d + 0.01)      s': recent readings; m, d: their mean and spread in training
"""

from dataclasses import dataclass

import numpy as np

from epuckhebb.adaptation.change_signal import ChangeSignal, NominalOfSide
from epuckhebb.controller.arrays import Floats

LEAST_SPREAD = 0.01  # of a reading: the noise of a light sensor


@dataclass(frozen=True, kw_only=True)
class Novelty(ChangeSignal):
    """Mean distance of the inputs from training, in spreads."""

    @staticmethod
    def signal(readings: Floats, nominal: NominalOfSide) -> float:
        """Without or with the lamp, whichever fits better."""
        least = np.inf
        inputs = nominal.reading_mean.shape[1]
        for lamp in range(2):
            total = 0.0
            for i in range(inputs):
                away = abs(readings[i] - nominal.reading_mean[lamp, i])
                total += away / (nominal.reading_spread[lamp, i] + LEAST_SPREAD)
            least = min(least, total / inputs)
        return least
