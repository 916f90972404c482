"""The paper's rule: a weight follows a trace of the recent correlation of its two neurons.

    C  = x_j x_i                correlation of the two neurons that a synapse joins
    T' = 0.95 T + 0.05 C        trace
    D  = T'                     direction of the weight's change

Source: Hammami et al., ALIFE 2025.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

from epuckhebb.controller.plasticity.rule import Rule
from epuckhebb.controller.ranges import within


@dataclass(frozen=True, kw_only=True)
class Paper(Rule):
    """Hebbian plasticity with a trace. trace_decay, trace_update: share of the old trace and of the new C."""

    synapse_state: ClassVar = {"trace": 0.0}

    trace_decay: float = within(0, 1, default=0.95)
    trace_update: float = within(0, 1, default=0.05)

    @staticmethod
    def synapse(correlation: float, synapse_state: Any, by: Any) -> float:
        """T' = 0.95 T + 0.05 C, D = T'."""
        synapse_state.trace = by.trace_decay * synapse_state.trace + by.trace_update * correlation
        return float(synapse_state.trace)
