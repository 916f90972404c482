"""The oracle: after the break nobody listens to the robot that broke. It is given that number; no robot senses it."""

from dataclasses import dataclass

import numpy as np

from epuckhebb.controller.arrays import Floats
from epuckhebb.flock.coupling import Coupling, Moment


@dataclass(frozen=True, kw_only=True)
class Oracle(Coupling):
    """Every weight is 1, and 0 to the broken robot."""

    def weights(self, now: Moment) -> Floats:
        """The new weights, (robots, robots), of one who knows which robot is broken."""
        weights = np.ones_like(now.weights)
        if now.broken >= 0:
            weights[:, now.broken] = 0.0
        return weights
