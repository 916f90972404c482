"""The paper's rule during evolution, with an evolved learning rate (Baldwin 1896).

    T' = 0.95 T + 0.05 x_j x_i
    D  = 10^theta T'                 theta: evolved, one for the network; the base rate is N 10^theta

Source: the rule of Hammami et al., ALIFE 2025, there added after evolution; in evolution as in Hinton & Nowlan, Complex
Systems 1 (1987). `hebbian=baldwin` is the same with a set N and nothing of the rule evolved.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

from epuckhebb.sim.arrays import Floats
from epuckhebb.sim.evolved import Evolved
from epuckhebb.sim.plasticity.rule import Rule
from epuckhebb.sim.ranges import check_range


@dataclass(frozen=True, kw_only=True)
class BaldwinN(Rule):
    """The paper's rule with an evolved rate. trace_decay, trace_update: share of the old trace and of the new C."""

    synapse_state: ClassVar = {"trace": 0.0}
    evolved: ClassVar = {"theta": Evolved(start=1.0, limit=1.5)}
    coefficients: ClassVar = ("factor",)

    N_gain_rad_s: float = 4.0
    trace_decay: float = 0.95
    trace_update: float = 0.05

    def __post_init__(self) -> None:
        super().__post_init__()
        check_range(self, "hebbian", "trace_decay", "trace_update", most=1)

    @classmethod
    def express(cls, parameters: Mapping[str, Floats]) -> Mapping[str, Floats]:
        """The factor on N."""
        return {"factor": 10.0 ** parameters["theta"]}

    @staticmethod
    def synapse(correlation: float, synapse_state: Any, factor: float, by: Any) -> float:
        """T' = 0.95 T + 0.05 C, D = 10^theta T'."""
        synapse_state.trace = by.trace_decay * synapse_state.trace + by.trace_update * correlation
        return float(factor * synapse_state.trace)
