"""Four terms: what the evolved rules after Najarro & Risi have in common.

    D = A x_j x_i + B x_j + C x_i + D0 - leak (w - w0)    w0: initial weight

A, B, C and D0 (D in the papers) are evolved, and multiplied by the evolved learning rate eta.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.plasticity.rule import Rule
from epuckhebb.controller.ranges import within


@dataclass(frozen=True, kw_only=True)
class FourTerms(Rule):
    """Plasticity by the product of two activations, by each of them, and by a constant.

    leak: how fast a weight returns to its initial value, in units of N; 0 in the papers. The live fitness does not
    scale the rate (`floor` is 1, its maximum). N holds at the wheel gain of training, so that a robot learns as much
    on each metre at any gain.
    """

    coefficients: ClassVar = ("A", "B", "C", "D")

    N_gain_rad_s: float = 4.0
    floor: float = 1.0
    leak: float = within(0, default=0.0)

    @classmethod
    def express(cls, parameters: Mapping[str, Floats]) -> Mapping[str, Floats]:
        """Eta in A, B, C and D."""
        return {name: parameters["eta"] * parameters[name] for name in cls.coefficients}

    @staticmethod
    def synapse(
        pre: float, post: float, weight: float, initial_weight: float, A: float, B: float, C: float, D: float, by: Any
    ) -> float:
        """D = A x_j x_i + B x_j + C x_i + D0 - leak (w - w0)."""
        return float((A * post + B) * pre + C * post + D - by.leak * (weight - initial_weight))
