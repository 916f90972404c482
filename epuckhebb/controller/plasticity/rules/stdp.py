"""Spike-timing-dependent plasticity by pairs: pre before post strengthens, post before pre weakens.

    a'   = a e^(-step / tau) + x          traces of both neurons; x: 1 at a spike, else 0
    D    = A+ a_j' x_i - A- x_j a_i'

Both traces are updated first, then the weight. So a pair in one substep (dt = 0) counts in both terms and changes a
weight by A+ - A-, -.05 with the defaults. Other orders give 0, +1 or -1.05 (`docs/spikes.md`).

A pair of spikes dt apart changes a weight by A+ e^(-dt / tau+), or by -A- e^(-dt / tau-). An activation between -1 and
1, such as a sensor reading, counts as so much of a spike in each substep.

Source: Song, Miller & Abbott, Nature Neuroscience 3 (2000): tau+ = tau- = 20 ms, A- / A+ = 1.05; their A+, .005 of the
largest weight, is N here. Caporale & Dan, Annual Review of Neuroscience 31 (2008), for the window.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

from epuckhebb.controller.network import decayed
from epuckhebb.controller.plasticity.rule import Rule
from epuckhebb.controller.ranges import within


@dataclass(frozen=True, kw_only=True)
class STDP(Rule):
    """Plasticity by the order of spikes. A_plus, A_minus: of a pair; tau_plus_s, tau_minus_s: of the window [s]."""

    synapse_state: ClassVar = {"pre": 0.0, "post": 0.0}

    A_plus: float = within(0, default=1.0)
    A_minus: float = within(0, default=1.05)
    tau_plus_s: float = within(0, above=True, default=0.02)
    tau_minus_s: float = within(0, above=True, default=0.02)

    @staticmethod
    def synapse(pre: float, post: float, synapse_state: Any, step_s: float, by: Any) -> float:
        """Move both traces, then D = A+ a_j x_i - A- x_j a_i."""
        synapse_state.pre = decayed(synapse_state.pre, step_s, by.tau_plus_s) + pre
        synapse_state.post = decayed(synapse_state.post, step_s, by.tau_minus_s) + post
        return float(by.A_plus * synapse_state.pre * post - by.A_minus * pre * synapse_state.post)
