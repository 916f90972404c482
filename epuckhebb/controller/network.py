"""The network: layers of tanh neurons, by default 16-7-5-8-4-2, whose 234 weights are the genome.

The weights stand in the order of the genes: layer by layer, and within a layer one row for each presynaptic neuron with
its weights to all postsynaptic ones. The first layer has one more row, last, for the bias: a constant 1 beside the
sensors, the only bias there is. Activations of all neurons stand in one array, layer by layer; in the paper's network:

    0-15 sensors, 16 bias, 17-23, 24-28, 29-36, 37-40 hidden layers, 41 left wheel, 42 right wheel
"""

import math
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate, pairwise

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import compiled
from epuckhebb.controller.compiling.simd import WIDTH, whole
from epuckhebb.controller.wiring import MOST_SYNAPSES, Wiring, find_blocks

WEIGHT_LIMIT = 2.0  # weights are loaded clipped to +-2, the bound of plasticity in the paper
HIDDEN = (7, 5, 8, 4)  # the paper's hidden layers

_STEPS_PER_UNIT = 32
_TANH_IS_1 = 20.0  # from about 19 on, tanh is 1 to the last bit
_TANH = np.array([math.tanh(k / _STEPS_PER_UNIT) for k in range(int(_TANH_IS_1) * _STEPS_PER_UNIT + 1)])


@dataclass(frozen=True)
class Network:
    """The shape of a network.

    layers: how many neurons each layer has, sensors first, outputs last. rewarded: whether the last input is a
    reward. wiring: another than that of layers; then layers are the inputs and its groups.
    """

    layers: tuple[int, ...] = (16, *HIDDEN, 2)
    rewarded: bool = False
    wiring: Wiring | None = None

    def __post_init__(self) -> None:
        whole = all(isinstance(size, int) and size > 0 for size in self.layers)
        if self.wiring is None and (len(self.layers) < 2 or not whole):
            raise ValueError(f"network.layers must be two or more positive whole numbers, got {list(self.layers)}")
        if self.wiring is not None and (len(self.layers) < 2 or not whole or self.layers[-1] < self.wiring.outputs):
            sizes = f"positive whole numbers, the last {self.wiring.outputs} or more"
            raise ValueError(f"wiring {self.wiring.name}: `sizes` must be {sizes}, got {list(self.layers[1:])}")
        if self.synapses > MOST_SYNAPSES:
            which = "network.layers" if self.wiring is None else f"network.wiring={self.wiring.name}"
            raise ValueError(f"{which}: network {self} has {self.synapses} weights or more; at most {MOST_SYNAPSES}")

    @cached_property
    def inputs(self) -> int:
        """The number of inputs."""
        return self.layers[0]

    @cached_property
    def bias(self) -> int:
        """Where the constant 1 stands among the activations: after the inputs."""
        return self.inputs

    @cached_property
    def post(self) -> tuple[int, ...]:
        """How many postsynaptic neurons each layer of connections has."""
        return self.layers[1:]

    @cached_property
    def first_neuron(self) -> tuple[int, ...]:
        """Where each layer of neurons begins among the activations."""
        return tuple(accumulate((self.inputs + 1, *self.layers[1:-1]), initial=0))

    @cached_property
    def first_synapse(self) -> tuple[int, ...]:
        """Where each layer of connections begins among the weights."""
        return tuple(accumulate((n * m for n, m in self.shapes[:-1]), initial=0))

    @cached_property
    def shapes(self) -> list[tuple[int, int]]:
        """(presynaptic, postsynaptic) neurons of each layer of connections; the first counts the bias."""
        return list(zip((self.inputs + 1, *self.layers[1:-1]), self.post, strict=True))

    @cached_property
    def connections(self) -> list[tuple[int, ...]]:
        """Each layer of connections: its first presynaptic and postsynaptic neuron, its first synapse, its shape.

        Of a wiring, each block of synapses that join all of one row of neurons with all of another.
        """
        if self.wiring is not None:
            return find_blocks(*self.joined, self.first_neuron)
        return [
            (self.first_neuron[k], self.first_neuron[k + 1], self.first_synapse[k], *shape)
            for k, shape in enumerate(self.shapes)
        ]

    @cached_property
    def joined(self) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """The presynaptic and the postsynaptic neuron of each synapse, (synapses,) each."""
        if self.wiring is not None:
            return self.wiring.joined(self.inputs)
        pre = [np.repeat(np.arange(n) + first, m) for first, _, _, n, m in self.connections]
        post = [np.tile(np.arange(m) + first, n) for _, first, _, n, m in self.connections]
        return np.concatenate(pre), np.concatenate(post)

    @cached_property
    def vectors(self) -> list[tuple[int, ...]]:
        """`connections`, and how many vectors of four the postsynaptic neurons of each layer are taken in.

        The last vector may reach up to three numbers beyond the layer, into the next one's weights and neurons. Where
        these are not as many, and in layers of one or two, what is left by whole vectors is taken one by one.
        """
        layers: list[tuple[int, ...]] = []
        for pre, post, first, inputs, outputs in self.connections:
            end = whole(outputs)
            fits = post + end <= self.neurons and first + (inputs - 1) * outputs + end <= self.synapses
            layers.append((pre, post, first, inputs, outputs, (end if fits and outputs > 2 else outputs) // WIDTH))
        return layers

    @cached_property
    def neurons(self) -> int:
        """The number of activations, inputs and bias included."""
        return self.inputs + 1 + sum(self.layers[1:])

    @cached_property
    def outputs(self) -> int:
        """The number of outputs, the last activations."""
        return self.layers[-1] if self.wiring is None else self.wiring.outputs

    @cached_property
    def substeps(self) -> int:
        """How many times it runs in a control step."""
        return 1 if self.wiring is None else self.wiring.substeps

    @cached_property
    def first_output(self) -> int:
        """Where the first output stands among the activations."""
        return self.neurons - self.outputs

    @cached_property
    def synapses(self) -> int:
        """How many weights it has; 234 in the paper."""
        return len(self.joined[0]) if self.wiring is not None else sum(n * m for n, m in self.shapes)

    def __str__(self) -> str:
        """The layers, for example 16-7-5-8-4-2, and the wiring, if any."""
        return "-".join(map(str, self.layers)) + ("" if self.wiring is None else f" ({self.wiring.name})")


PAPER_NETWORK = Network()


@dataclass(frozen=True)
class GivenOutputs(Network):
    """No network: what decides from outside writes the outputs into the first weights."""


def starting_weights(weights: Floats) -> Floats:
    """The weights at the start of a lifetime: a copy of the inherited ones, clipped to +-2."""
    return np.minimum(np.maximum(weights, -WEIGHT_LIMIT), WEIGHT_LIMIT)  # np.clip takes three times as long


@compiled
def tanh(x: float) -> float:
    """Tanh x to within 4 units in the last place, at a quarter of the cost of the C library's.

    tanh(a + d) = (tanh a + tanh d) / (1 + tanh a tanh d), with tanh a from a table and four terms of the series of
    tanh d, |d| <= 1/64. It uses only + - * / and a table, so it is bit-identical on every processor.
    """
    size = min(_TANH_IS_1, abs(x))
    k = np.floor(size * _STEPS_PER_UNIT + 0.5)
    d = size - k / _STEPS_PER_UNIT
    square = d * d
    tanh_d = d * (1.0 + square * (-1.0 / 3.0 + square * (2.0 / 15.0 + square * (-17.0 / 315.0))))
    tanh_a = _TANH[np.uint32(np.int32(k))]  # 32 bits convert fast; an index without a sign needs no test for < 0
    return math.copysign((tanh_a + tanh_d) / (1.0 + tanh_a * tanh_d), x)


@compiled
def decayed(value: float, step_s: float, time_s: float) -> float:
    """What a step leaves of a value that decays with this time constant: value e^(-step / time); 0 below 1e-100.

    e^(-2x) = (1 - tanh x) / (1 + tanh x) is bit-identical on every processor. Numbers near the smallest are slow.
    """
    half = tanh(0.5 * step_s / time_s)
    left = value * ((1.0 - half) / (1.0 + half))
    return left if abs(left) > 1e-100 else 0.0


def split_layers(network: Network, values: Floats) -> list[Floats]:
    """Numbers of all synapses, (..., synapses), as one (..., presynaptic, postsynaptic) array for each layer."""
    bounds = [*network.first_synapse, network.synapses]
    return [
        values[..., a:b].reshape(*values.shape[:-1], n, m)
        for (a, b), (n, m) in zip(pairwise(bounds), network.shapes, strict=True)
    ]
