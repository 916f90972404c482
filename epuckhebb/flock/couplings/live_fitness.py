"""Couplings by competence: a robot listens to those that get nearer to the goal."""

from dataclasses import dataclass

import numpy as np

from epuckhebb.controller.arrays import Floats
from epuckhebb.flock.coupling import Coupling, Moment


@dataclass(frozen=True, kw_only=True)
class LiveFitness(Coupling):
    """Twice the live fitness of the robot that is listened to, less the mean of all."""

    def drive(self, now: Moment) -> Floats:
        """What moves each weight, (robots, robots): twice the fitness of the other robot, less the mean."""
        return np.broadcast_to(2.0 * (now.fitness - now.fitness.mean()), now.weights.shape)
