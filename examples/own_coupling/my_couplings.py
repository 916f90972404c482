"""Couplings of your own between robots: listen to those that are at least as fit as you."""

from dataclasses import dataclass

import numpy as np

from epuckhebb import Coupling


@dataclass(frozen=True, kw_only=True)
class Fitter(Coupling):
    """margin: by how much another robot may be less fit and still be listened to more."""

    margin: float = 0.1

    def drive(self, now):
        """1 for a robot that is fit enough, -1 for another; rows are listeners."""
        return np.sign(now.fitness[None, :] - now.fitness[:, None] + self.margin)
