"""A plasticity rule of your own: a synapse learns, and loses some of its weight, only while its input is active."""

from dataclasses import dataclass

from epuckhebb import Rule


@dataclass(frozen=True, kw_only=True)
class Gated(Rule):
    """Hebb's rule with presynaptic gating and a leak. active: the least input that counts. leak: share that is lost."""

    active: float = 0.2
    leak: float = 0.1

    @staticmethod
    def synapse(pre, post, weight, by):
        """The direction of the weight's change."""
        return pre * post - by.leak * weight if abs(pre) > by.active else 0.0
