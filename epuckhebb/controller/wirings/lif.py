"""Leaky integrate-and-fire neurons: a hidden layer that spikes, and outputs that are running means of its spikes.

    tau v' = -v + W [x, 1, s']      v: potential, x: inputs as currents, s': spikes of the substep before, 1 or 0
    s = 1 and v = 0, if v >= threshold; then v stays 0 for the refractory time
    readout y' = -y + U s           y: outputs

A refractory time of n substeps leaves out n of them after a spike; Brian2 counts from the substep of the spike: n - 1.

The solution is exact for a drive that is constant in a substep. So the time between two spikes at a constant drive I is
refractory + tau ln(I / (I - threshold)), in whole substeps (Gerstner et al. 2014, Neuronal Dynamics, section 1.3).
"""

from dataclasses import dataclass
from typing import Any, ClassVar

from epuckhebb.controller.hidden_layer import HiddenLayer
from epuckhebb.controller.network import decayed
from epuckhebb.controller.ranges import within


@dataclass(frozen=True, kw_only=True)
class LIF(HiddenLayer):
    """A spiking network with the synapses of Elman's. tau_s, refractory_s, readout_s: times [s]; threshold: of v."""

    state: ClassVar = {"v": 0.0, "rest_s": 0.0}
    spikes: ClassVar[bool] = True

    substeps: int = within(1, 1000, default=8)
    hidden: int = within(1, default=10)
    tau_s: float = within(0, above=True, default=0.02)
    threshold: float = within(0, above=True, default=1.0)
    refractory_s: float = within(0, default=0.004)
    readout_s: float = within(0, above=True, default=0.1)

    @staticmethod
    def neuron(drive: float, number: int, state: Any, step_s: float, by: Any) -> float:
        """1 for a spike, else 0; of an output, the running mean."""
        if number >= by.hidden:
            state.v = drive + decayed(state.v - drive, step_s, by.readout_s)
            return float(state.v)
        if state.rest_s > 0.5 * step_s:  # whole substeps
            state.rest_s -= step_s
            return 0.0
        state.v = drive + decayed(state.v - drive, step_s, by.tau_s)
        if state.v < by.threshold:
            return 0.0
        state.v, state.rest_s = 0.0, by.refractory_s
        return 1.0
