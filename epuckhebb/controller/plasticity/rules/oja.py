"""Oja's rule: Hebb's, with a decay that keeps the weights into a neuron from growing without bound.

    D = x_j x_i - x_i^2 w

Source: Oja, A simplified neuron model as a principal component analyzer, J. Math. Biology 15 (1982), equation 3.
"""

from dataclasses import dataclass

from epuckhebb.controller.plasticity.rule import Rule


@dataclass(frozen=True, kw_only=True)
class Oja(Rule):
    """Hebbian growth with a decay in proportion to the square of the postsynaptic activation."""

    @staticmethod
    def synapse(correlation: float, post: float, weight: float) -> float:
        """D = x_j x_i - x_i^2 w."""
        return correlation - post * post * weight
