"""A controller of your own: a ring of leaky neurons. Each receives all inputs and its two neighbours."""

from dataclasses import dataclass
from itertools import product
from typing import ClassVar

from epuckhebb import Evolved, Wiring, tanh


@dataclass(frozen=True, kw_only=True)
class Ring(Wiring):
    """hidden: neurons of the ring."""

    state: ClassVar = {"y": 0.0}
    evolved: ClassVar = {
        "tau": Evolved(per="neuron", value=lambda gene: 0.1 * 10**gene),  # 10 ms to 1 s
        "bias": Evolved(per="neuron"),
    }

    hidden: int = 8

    @property
    def sizes(self):
        """Two groups, which respond in turn: the ring, and the wheels."""
        return (self.hidden, 2)

    def synapses(self, inputs):
        """The presynaptic and the postsynaptic neuron of each synapse."""
        first = inputs + 1  # the constant 1 stands between the inputs and the neurons
        ring, wheels = range(first, first + self.hidden), range(first + self.hidden, first + self.hidden + 2)
        yield from product(range(inputs), ring)
        for place, neuron in enumerate(ring):
            yield ring[place - 1], neuron
            yield ring[(place + 1) % self.hidden], neuron
        yield from product(ring, wheels)

    @staticmethod
    def neuron(drive, state, tau, bias, step_s):
        """The activation of a neuron: its state y follows its drive with the time constant tau."""
        state.y += min(1.0, step_s / tau) * (drive - state.y)
        return tanh(state.y + bias)
