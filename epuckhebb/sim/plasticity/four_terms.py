"""Four terms: what the evolved rules after Najarro & Risi have in common, whoever shares their coefficients.

    D = A x_j x_i + B x_j + C x_i + D0 - leak (w - w0)    w0: the weight at birth

A, B, C and D0 (D in the papers) are evolved; the learning rate eta is evolved too, and already in them here.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

from epuckhebb.sim.plasticity.rule import Rule


@dataclass(frozen=True, kw_only=True)
class FourTerms(Rule):
    """Plasticity by the product of two activations, by each of them, and by neither.

    leak: how fast a weight goes back to what it was at birth, in units of N; 0 in the papers. No live fitness scales
    the rate (`floor` is 1, the greatest that it can be), and N holds at the gain of training: the papers test at the
    pace of training, and a controller that learns four times as much on each metre of its way is another one.
    """

    coefficients: ClassVar = ("A", "B", "C", "D")

    N_gain_rad_s: float = 4.0
    floor: float = 1.0
    leak: float = 0.0

    def __post_init__(self) -> None:
        """Refuse leaks that cannot be."""
        super().__post_init__()
        if self.leak < 0:
            raise ValueError(f"hebbian.leak must be 0 or more, got {self.leak}")

    @staticmethod
    def synapse(
        pre: float, post: float, weight: float, initial_weight: float, A: float, B: float, C: float, D: float, by: Any
    ) -> float:
        """D = A x_j x_i + B x_j + C x_i + D0 - leak (w - w0)."""
        return float((A * post + B) * pre + C * post + D - by.leak * (weight - initial_weight))
