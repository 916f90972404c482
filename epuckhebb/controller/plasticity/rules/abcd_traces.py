"""ABCD of spikes: every synapse has an evolved rule of its own, which reads traces of the spikes of its two neurons.

    a' = a e^(-step / trace_time) + x                of both neurons; x: 1 at a spike, else 0
    D  = eta (A a_j' a_i' + B a_j' + C a_i' + D0)    eta, A, B, C, D0 of each synapse

Source: FireFly-P, arXiv 2601.21222, for the four terms of traces; the rest is as in `abcd`, and in `stdp`.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

from epuckhebb.controller.evolved import Evolved
from epuckhebb.controller.network import decayed
from epuckhebb.controller.plasticity.four_terms import FourTerms
from epuckhebb.controller.plasticity.rule import InitialWeights
from epuckhebb.controller.ranges import within

_EACH = Evolved("synapse", start=1.0, limit=2.0)


@dataclass(frozen=True, kw_only=True)
class ABCDTraces(FourTerms):
    """Plasticity with five numbers a synapse, by spikes. trace_time_s: time constant of the traces [s]."""

    synapse_state: ClassVar = {"pre": 0.0, "post": 0.0}
    evolved: ClassVar = dict.fromkeys(("A", "B", "C", "D", "eta"), _EACH)

    initial_weights: InitialWeights = InitialWeights.random
    trace_time_s: float = within(0, above=True, default=0.02)

    @staticmethod
    def synapse(  # type: ignore[override]  # arguments go by name
        pre: float,
        post: float,
        weight: float,
        initial_weight: float,
        synapse_state: Any,
        step_s: float,
        A: float,
        B: float,
        C: float,
        D: float,
        by: Any,
    ) -> float:
        """Move both traces, then the four terms of these."""
        synapse_state.pre = a = decayed(synapse_state.pre, step_s, by.trace_time_s) + pre
        synapse_state.post = b = decayed(synapse_state.post, step_s, by.trace_time_s) + post
        return float((A * b + B) * a + C * b + D - by.leak * (weight - initial_weight))
