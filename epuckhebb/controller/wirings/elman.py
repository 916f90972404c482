"""A simple recurrent network (Elman 1990): a hidden layer that also receives its own activations of the step before.

    h = tanh(W x + V h' + b)    x: inputs, h': the hidden layer in the step before, b: weights of the constant 1
    out = tanh(U h)

Its memory is of steps, which are as long at any wheel gain.

Elman, J. L. (1990). Finding structure in time. Cognitive Science 14, 179-211.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import chain, product

from epuckhebb.controller.network import tanh
from epuckhebb.controller.ranges import within
from epuckhebb.controller.wiring import Wiring


@dataclass(frozen=True, kw_only=True)
class Elman(Wiring):
    """A simple recurrent network. hidden: neurons of its hidden layer."""

    hidden: int = within(1, default=8)

    @property
    def sizes(self) -> tuple[int, ...]:
        """The hidden layer, then the outputs."""
        return (self.hidden, self.outputs)

    def synapses(self, inputs: int) -> Iterable[tuple[int, int]]:
        """From inputs, constant 1 and hidden neurons to each hidden neuron, and from these to the outputs."""
        hidden = range(inputs + 1, inputs + 1 + self.hidden)
        outputs = range(hidden.stop, hidden.stop + self.outputs)
        return chain(product(range(hidden.stop), hidden), product(hidden, outputs))

    @staticmethod
    def neuron(drive: float) -> float:
        """The activation of a neuron."""
        return tanh(drive)
