"""A rule of your own: Hebb's, with a decay that bounds the weights."""

from dataclasses import dataclass

from epuckhebb import Rule


@dataclass(frozen=True, kw_only=True)
class Decay(Rule):
    """decay: how fast a weight goes back to where it began, in units of N."""

    decay: float = 0.1

    @staticmethod
    def synapse(correlation, weight, initial_weight, by):
        """D = x_j x_i - decay (w - w_0)."""
        return correlation - by.decay * (weight - initial_weight)
