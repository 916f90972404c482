"""The paper's rule: a weight follows a trace of what its two neurons did together lately.

    C  = x_j x_i                correlation of the two neurons that a synapse joins
    T' = 0.95 T + 0.05 C        trace
    D  = T'                     direction of the weight's change

Source: Hammami et al., ALIFE 2025.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

from epuckhebb.sim.plasticity.rule import Rule


@dataclass(frozen=True, kw_only=True)
class Paper(Rule):
    """Hebbian plasticity with a trace. trace_decay: how long it lasts. trace_update: how fast it takes up the new."""

    kept: ClassVar = {"trace": 0.0}

    trace_decay: float = 0.95
    trace_update: float = 0.05

    def __post_init__(self) -> None:
        """Refuse traces that cannot be."""
        super().__post_init__()
        self.in_unit_interval("trace_decay", "trace_update")

    @staticmethod
    def synapse(correlation: float, kept: Any, by: Any) -> float:
        """T' = 0.95 T + 0.05 C, and that way the weight goes."""
        kept.trace = by.trace_decay * kept.trace + by.trace_update * correlation
        return float(kept.trace)
