"""Couplings by influence: a robot listens to those whose turns predict its own."""

from dataclasses import dataclass

from epuckhebb.controller.arrays import Floats
from epuckhebb.flock.coupling import Coupling, Moment


@dataclass(frozen=True, kw_only=True)
class TransferEntropy(Coupling):
    """Transfer entropy over its mean, less 1; after the idea of Masumori, Doi & Ikegami (2024)."""

    def drive(self, now: Moment) -> Floats:
        """What moves each weight, (robots, robots): the transfer entropy from the other robot."""
        return relative(now.transfer_entropy)


def relative(values: Floats) -> Floats:
    """Values of pairs over their mean, less 1; nothing where all are 0. The diagonal is 0 and does not count."""
    pairs = len(values) * (len(values) - 1)
    mean = values.sum() / pairs
    return values / mean - 1.0 if mean > 0.0 else values
