"""The synapses of wirings with one recurrent hidden layer."""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import chain, product

from epuckhebb.controller.ranges import within
from epuckhebb.controller.wiring import Wiring


@dataclass(frozen=True, kw_only=True)
class HiddenLayer(Wiring):
    """A hidden layer that receives the inputs, the constant 1 and itself, and outputs that receive it alone."""

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
