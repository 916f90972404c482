"""The controller: a 16-7-5-8-4-2 network of tanh neurons whose 234 weights are the genome.

In memory the weights are one table with a row for each presynaptic neuron and a lane for each postsynaptic one:

    rows  0-15  the sensors, row 16 the bias (always 1)   -> 7 neurons
    rows 17-23, 24-28, 29-36, 37-40  the hidden layers     -> 5, 8, 4 neurons and the 2 wheels

Every row has 8 lanes, as many as the widest layer needs. Lanes that a layer does not use hold weights of 0, which stay
0 under plasticity (their neuron is silent), so that no loop has to know how wide a layer is. Activations lie in one
array, 17 for the sensors and the bias, then 8 for each layer.
"""

import math

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim.compiled import compiled

LAYERS = (16, 7, 5, 8, 4, 2)
INPUTS, OUTPUTS = LAYERS[0], LAYERS[-1]
BIAS = INPUTS  # the row of the constant 1, the only bias: appended to the sensors, none in deeper layers
PRESYNAPTIC = (LAYERS[0] + 1, *LAYERS[1:-1])
GENES = sum(n * m for n, m in zip(PRESYNAPTIC, LAYERS[1:], strict=True))  # 234
LANES = max(LAYERS[1:])
ROWS = sum(PRESYNAPTIC)  # 41
FIRST_ROW = (0, 17, 24, 29, 37, 41)  # of each layer's weights; the last entry is the end of the table
FIRST_NEURON = (0, 17, 25, 33, 41, 49)  # of each layer's activations; the last entry is the left wheel
WHEELS = FIRST_NEURON[-1]
GENE_LIMIT = 2.0  # genes are loaded clipped to +-2, the bound of the weights


def _gene_places() -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Row and lane of each gene: layer by layer, within a layer (presynaptic, postsynaptic) row by row."""
    places = [
        (FIRST_ROW[layer] + i, j)
        for layer, (pre, post) in enumerate(zip(PRESYNAPTIC, LAYERS[1:], strict=True))
        for i in range(pre)
        for j in range(post)
    ]
    rows, lanes = np.array(places).T
    return rows, lanes


GENE_ROW, GENE_LANE = _gene_places()


def genome_to_weights(genome: NDArray[np.float64]) -> NDArray[np.float64]:
    """The weights at birth, (..., 41, 8), from genomes of shape (..., 234)."""
    weights = np.zeros((*genome.shape[:-1], ROWS, LANES))
    weights[..., GENE_ROW, GENE_LANE] = np.clip(genome, -GENE_LIMIT, GENE_LIMIT)
    return weights


def weights_to_genome(weights: NDArray[np.floating]) -> NDArray[np.floating]:
    """The 234 weights in the order of the genes, (..., 234), from weights of shape (..., 41, 8)."""
    return weights[..., GENE_ROW, GENE_LANE]


@compiled
def new_activation() -> NDArray[np.float64]:
    """Activations (57,) of a network at rest: sensors, bias, hidden neurons, wheels, and the unused lanes."""
    activation = np.zeros(WHEELS + LANES)
    activation[BIAS] = 1.0
    return activation


@compiled
def forward(weights: NDArray[np.float64], activation: NDArray[np.float64], drive: NDArray[np.float64]) -> None:
    """Pass the sensor readings in `activation` through the network; every neuron's activation is kept there.

    drive: (8,) workspace, the summed input of a layer's neurons.
    """
    for layer in range(len(LAYERS) - 1):
        pre, post, row = FIRST_NEURON[layer], FIRST_NEURON[layer + 1], FIRST_ROW[layer]
        for j in range(LANES):
            drive[j] = 0.0
        for i in range(FIRST_ROW[layer + 1] - row):
            for j in range(LANES):
                drive[j] += activation[pre + i] * weights[row + i, j]
        for j in range(LANES):
            activation[post + j] = math.tanh(drive[j])
