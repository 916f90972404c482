"""A simple recurrent network (Elman 1990): a hidden layer that also receives its own activations of the step before.

    h = tanh(W x + V h' + b)    x: inputs, h': the hidden layer in the step before, b: weights of the constant 1
    out = tanh(U h)

Its memory is of steps, which are as long at any wheel gain.

Elman, J. L. (1990). Finding structure in time. Cognitive Science 14, 179-211.
"""

from dataclasses import dataclass

from epuckhebb.controller.hidden_layer import HiddenLayer
from epuckhebb.controller.network import tanh


@dataclass(frozen=True, kw_only=True)
class Elman(HiddenLayer):
    """A simple recurrent network. hidden: neurons of its hidden layer."""

    @staticmethod
    def neuron(drive: float) -> float:
        """The activation of a neuron."""
        return tanh(drive)
