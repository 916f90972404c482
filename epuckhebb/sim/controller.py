"""The controller: a 16-7-5-8-4-2 network of tanh neurons whose 234 weights are the genome.

The weights stand in the order of the genes: layer by layer, and within a layer one row for each presynaptic neuron with
its weights to all postsynaptic ones. The first layer has one more row, last, for the bias: a constant 1 beside the
sensors, the only bias there is. Activations of all neurons stand in one array, layer by layer:

    0-15 sensors, 16 bias, 17-23, 24-28, 29-36, 37-40 hidden layers, 41 left wheel, 42 right wheel
"""

import math

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim.compiled import compiled

LAYERS = (16, 7, 5, 8, 4, 2)
INPUTS, OUTPUTS = LAYERS[0], LAYERS[-1]
BIAS = INPUTS
PRE = (INPUTS + 1, *LAYERS[1:-1])  # presynaptic neurons of each layer of connections
POST = LAYERS[1:]  # postsynaptic ones
FIRST_NEURON = (0, 17, 24, 29, 37, 41)  # of each layer, in the array of activations; the last are the wheels
NEURONS = FIRST_NEURON[-1] + OUTPUTS
WHEELS = FIRST_NEURON[-1]
FIRST_GENE = (0, 119, 154, 194, 226)  # of each layer of connections
GENES = FIRST_GENE[-1] + PRE[-1] * POST[-1]  # 234
GENE_LIMIT = 2.0  # genes are loaded clipped to +-2, the bound of the weights

_STEPS_PER_UNIT = 32
_TANH_IS_1 = 20.0  # from about 19 on, tanh is 1 to the last bit
_TANH = np.array([math.tanh(k / _STEPS_PER_UNIT) for k in range(int(_TANH_IS_1) * _STEPS_PER_UNIT + 1)])


def weights_at_birth(genome: NDArray[np.float64]) -> NDArray[np.float64]:
    """A copy of the genome (234,), clipped to +-2: what plasticity changes and death forgets."""
    return np.clip(genome, -GENE_LIMIT, GENE_LIMIT)


@compiled
def tanh(x: float) -> float:
    """Tanh x to within 4 units in the last place, at a quarter of the cost of the C library's.

    tanh(a + d) = (tanh a + tanh d) / (1 + tanh a tanh d), with tanh a from a table and four terms of the series of
    tanh d, |d| <= 1/64. Only + - * / and a look-up, hence the same bits on every processor.
    """
    size = min(_TANH_IS_1, abs(x))
    k = np.floor(size * _STEPS_PER_UNIT + 0.5)
    d = size - k / _STEPS_PER_UNIT
    square = d * d
    tanh_d = d * (1.0 + square * (-1.0 / 3.0 + square * (2.0 / 15.0 + square * (-17.0 / 315.0))))
    tanh_a = _TANH[np.uint32(np.int32(k))]  # 32 bits convert fast; an index without a sign needs no test for < 0
    return math.copysign((tanh_a + tanh_d) / (1.0 + tanh_a * tanh_d), x)


@compiled
def forward(weights: NDArray[np.float64], activation: NDArray[np.float64], drive: NDArray[np.float64]) -> None:
    """Pass the sensor readings through the network: y = tanh(x W), layer by layer.

    weights: (234,). activation: (43,), sensors and bias given, the rest filled. drive: (8,) workspace, a layer's x W.
    """
    _fire(0, weights, activation, drive)
    _fire(1, weights, activation, drive)
    _fire(2, weights, activation, drive)
    _fire(3, weights, activation, drive)
    _fire(4, weights, activation, drive)


@compiled
def _fire(
    layer: int, weights: NDArray[np.float64], activation: NDArray[np.float64], drive: NDArray[np.float64]
) -> None:
    """Pass activations through one layer of connections."""
    pre, post, gene = FIRST_NEURON[layer], FIRST_NEURON[layer + 1], FIRST_GENE[layer]
    for j in range(POST[layer]):
        summed = 0.0
        for i in range(PRE[layer]):
            summed += activation[pre + i] * weights[gene + i * POST[layer] + j]
        drive[j] = summed
    for j in range(POST[layer]):
        activation[post + j] = tanh(drive[j])
