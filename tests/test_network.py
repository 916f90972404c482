"""The network: layout of the genome, activations, and its own tanh."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from epuckhebb.sim import controller
from epuckhebb.sim.controller import BIAS, FIRST_GENE, FIRST_NEURON, GENES, NEURONS, POST, PRE, forward, tanh


def test_layout_adds_up():
    assert GENES == 234
    assert sum(controller.LAYERS) + 1 == NEURONS
    assert tuple(np.cumsum([0] + [n * m for n, m in zip(PRE, POST, strict=True)])[:-1]) == FIRST_GENE
    assert tuple(np.cumsum([0, *PRE])) == FIRST_NEURON


def test_forward_is_tanh_of_x_times_w_layer_by_layer():
    rng = np.random.default_rng(1)
    weights, activation = rng.uniform(-2, 2, GENES), np.zeros(NEURONS)
    activation[:16], activation[BIAS] = rng.random(16), 1.0
    forward(weights, activation, np.empty(8))
    x = np.append(activation[:16], 1.0)
    for layer, shape in enumerate(zip(PRE, POST, strict=True)):
        gene = FIRST_GENE[layer]
        x = np.tanh(x @ weights[gene : gene + shape[0] * shape[1]].reshape(shape))
        np.testing.assert_allclose(activation[FIRST_NEURON[layer + 1] :][: shape[1]], x, rtol=0, atol=1e-14)


def test_a_bias_weight_acts_without_any_light_or_wall():
    weights, activation = np.zeros(GENES), np.zeros(NEURONS)
    activation[BIAS] = 1.0
    weights[BIAS * POST[0]] = 0.5  # from the bias to the first hidden neuron: the last row of the first layer
    forward(weights, activation, np.empty(8))
    assert activation[FIRST_NEURON[1]] == tanh(0.5)
    assert not activation[FIRST_NEURON[1] + 1 :].any()


@given(st.floats(-1e300, 1e300))
def test_tanh_is_accurate_odd_and_bounded(x):
    assert abs(tanh(x) - math.tanh(x)) <= 5 * math.ulp(math.tanh(x))
    assert tanh(-x) == -tanh(x)
    assert abs(tanh(x)) <= 1


def test_weights_at_birth_are_a_clipped_copy():
    genome = np.linspace(-3, 3, GENES)
    weights = controller.weights_at_birth(genome)
    assert weights.max() == 2
    weights[:] = 0
    assert genome[0] == -3
