"""Leaky integrate-and-fire neurons: a hidden layer that spikes, and outputs that are running means of its spikes.

    tau v' = -v + W [x, 1, s']      v: potential, x: inputs as currents, s': spikes of the substep before, 1 or 0
    s = 1 and v = 0, if v >= threshold; then v stays 0 for the refractory time
    readout y' = -y + U s           y: outputs

The solution is exact for a drive that is constant in a substep: v' = drive + (v - drive) e^(-step / tau). So the time
between two spikes at a constant drive I is the textbook's, in whole substeps: refractory + tau ln(I / (I - threshold)).
A spike is a current of 1 that lasts one substep.

Gerstner, W., Kistler, W. M., Naud, R. & Paninski, L. (2014). Neuronal Dynamics, section 1.3. Cambridge.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import chain, product
from typing import Any, ClassVar

from epuckhebb.controller.network import decayed
from epuckhebb.controller.ranges import within
from epuckhebb.controller.wiring import Wiring


@dataclass(frozen=True, kw_only=True)
class LIF(Wiring):
    """A spiking network. hidden: its spiking neurons. tau_s, refractory_s, readout_s: times [s]; threshold: of v."""

    state: ClassVar = {"v": 0.0, "rest_s": 0.0}
    spikes: ClassVar[bool] = True

    substeps: int = within(1, 1000, default=8)
    hidden: int = within(1, default=10)
    tau_s: float = within(0, above=True, default=0.02)
    threshold: float = within(0, above=True, default=1.0)
    refractory_s: float = within(0, default=0.004)
    readout_s: float = within(0, above=True, default=0.1)

    @property
    def sizes(self) -> tuple[int, ...]:
        """The spiking neurons, then the outputs."""
        return (self.hidden, self.outputs)

    def synapses(self, inputs: int) -> Iterable[tuple[int, int]]:
        """From inputs, constant 1 and spiking neurons to each spiking neuron, and from these to the outputs."""
        hidden = range(inputs + 1, inputs + 1 + self.hidden)
        outputs = range(hidden.stop, hidden.stop + self.outputs)
        return chain(product(range(hidden.stop), hidden), product(hidden, outputs))

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
