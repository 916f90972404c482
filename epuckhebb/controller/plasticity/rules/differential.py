"""Differential plasticity: spike-timing-dependent plasticity for rates.

    a_j' = a_j + (x_j - a_j) / (time / step)    traces of both neurons
    a_i' = a_i + (x_i - a_i) / (time / step)
    D    = a_j' x_i - x_j a_i'                   pre before post strengthens, post before pre weakens

Source: Caporale & Dan, Annual Review of Neuroscience 31 (2008), for the timing; Di Paolo, Adaptive Behavior 10 (2002),
for its use in evolved robots. Traces with the time constant of a few steps stand for the window of spike pairs.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

from epuckhebb.controller.plasticity.rule import Rule
from epuckhebb.controller.ranges import within


@dataclass(frozen=True, kw_only=True)
class Differential(Rule):
    """Plasticity by the order of activity. trace_time_s: time constant of the traces [s]."""

    synapse_state: ClassVar = {"trace_pre": 0.0, "trace_post": 0.0}

    trace_time_s: float = within(0, above=True, default=0.16)

    @staticmethod
    def synapse(pre: float, post: float, synapse_state: Any, step_s: float, by: Any) -> float:
        """Move both traces, then D = a_j x_i - x_j a_i."""
        share = min(1.0, step_s / by.trace_time_s)
        synapse_state.trace_pre += (pre - synapse_state.trace_pre) * share
        synapse_state.trace_post += (post - synapse_state.trace_post) * share
        return float(synapse_state.trace_pre * post - pre * synapse_state.trace_post)
