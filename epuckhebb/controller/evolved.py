"""A parameter of a rule or of a wiring that is evolved with the weights."""

from collections.abc import Callable
from typing import NamedTuple

from epuckhebb.controller.arrays import Floats


class Evolved(NamedTuple):
    """A parameter that is evolved with the weights.

    per: one for the whole `network`, for each `layer` of connections, for each `synapse`, or for each `neuron`, sensors
    and bias included; or this number of values for the whole network. `modulator`: the weights of a modulatory neuron,
    one from each neuron of the layer before the wheels, and its bias, last. `reward`: its weight from the reward input.
    A wiring has parameters per `network` and per `neuron`, its own neurons.
    start: genes of the first generation are uniform in +-start. limit: genes are clipped to +-limit. value: a function
    that turns the genes into the parameter; None where they are it.
    """

    per: str | int = "network"
    start: float = 1.0
    limit: float = 1.0
    value: Callable[[Floats], Floats] | None = None
