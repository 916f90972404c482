"""The BCM rule: activity above a neuron's usual level strengthens its inputs, activity below weakens them.

    theta_i' = theta_i + (x_i^2 - theta_i) / (time / step)    sliding threshold, a running mean of x_i^2
    D        = x_j x_i (x_i - theta_i')

Source: Bienenstock, Cooper & Munro, Theory for the development of neuron selectivity, J. Neuroscience 2 (1982), with
the threshold as the mean square, as is usual since Intrator & Cooper (1992). Activations here may be negative.
"""

from dataclasses import dataclass
from typing import Any, ClassVar

from epuckhebb.controller.plasticity.rule import Rule
from epuckhebb.controller.ranges import within


@dataclass(frozen=True, kw_only=True)
class BCM(Rule):
    """Hebbian plasticity about a sliding threshold. threshold_time_s: time constant of the threshold [s]."""

    synapse_state: ClassVar = {"threshold": 0.0}  # of the postsynaptic neuron, the same for all synapses onto it

    threshold_time_s: float = within(0, above=True, default=5.0)

    @staticmethod
    def synapse(correlation: float, post: float, synapse_state: Any, step_s: float, by: Any) -> float:
        """Move the threshold, then D = x_j x_i (x_i - theta_i)."""
        share = min(1.0, step_s / by.threshold_time_s)
        synapse_state.threshold += (post * post - synapse_state.threshold) * share
        return float(correlation * (post - synapse_state.threshold))
