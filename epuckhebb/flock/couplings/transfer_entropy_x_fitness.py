"""Couplings by influence times competence: influence counts as much as the robot that has it gets nearer."""

from dataclasses import dataclass

import numpy as np

from epuckhebb.controller.arrays import Floats
from epuckhebb.flock.coupling import Coupling, Moment
from epuckhebb.flock.couplings.transfer_entropy import relative


@dataclass(frozen=True, kw_only=True)
class TransferEntropyXFitness(Coupling):
    """Transfer entropy times the live fitness, at least 0, of the robot that is listened to; over its mean, less 1."""

    def drive(self, now: Moment) -> Floats:
        """What moves each weight, (robots, robots): transfer entropy from the other robot, times its fitness."""
        return relative(now.transfer_entropy * np.maximum(0.0, now.fitness))
