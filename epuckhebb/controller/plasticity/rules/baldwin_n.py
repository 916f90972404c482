"""The paper's rule during evolution, with an evolved learning rate (Baldwin 1896).

    T' = 0.95 T + 0.05 x_j x_i
    D  = 10^theta T'                 theta: evolved, one for the network; the base rate is N 10^theta

Source: the rule of Hammami et al., ALIFE 2025, there added after evolution; in evolution as in Hinton & Nowlan, Complex
Systems 1 (1987). `hebbian=baldwin` is the same with a set N and nothing of the rule evolved.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.evolved import Evolved
from epuckhebb.controller.plasticity.rules.paper import Paper


@dataclass(frozen=True, kw_only=True)
class BaldwinN(Paper):
    """The paper's rule with an evolved rate."""

    evolved: ClassVar = {"theta": Evolved(start=1.0, limit=1.5)}
    coefficients: ClassVar = ("factor",)

    N_gain_rad_s: float = 4.0

    @classmethod
    def express(cls, parameters: Mapping[str, Floats]) -> Mapping[str, Floats]:
        """The factor on N."""
        return {"factor": 10.0 ** parameters["theta"]}

    @staticmethod
    def synapse(  # type: ignore[override]  # arguments go by name
        correlation: float, synapse_state: Any, factor: float, by: Any
    ) -> float:
        """T' = 0.95 T + 0.05 C, D = 10^theta T'."""
        synapse_state.trace = by.trace_decay * synapse_state.trace + by.trace_update * correlation
        return float(factor * synapse_state.trace)
