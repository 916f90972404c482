"""The network: layout of the genome, activations, and its own tanh."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuckhebb.controller.forward_pass import forward_pass
from epuckhebb.controller.network import PAPER_NETWORK, Network, split_layers, starting_weights, tanh

NETWORKS = [PAPER_NETWORK, Network((16, 3, 2)), Network((32, 7, 5, 8, 4, 2)), Network((2, 2))]


def test_layout_adds_up():
    assert PAPER_NETWORK.layers == (16, 7, 5, 8, 4, 2)
    assert PAPER_NETWORK.synapses == 234
    assert str(PAPER_NETWORK) == "16-7-5-8-4-2"
    for network in NETWORKS:
        assert sum(network.layers) + 1 == network.neurons
        assert network.first_output == network.neurons - 2
        assert tuple(np.cumsum([0] + [n * m for n, m in network.shapes])[:-1]) == network.first_synapse
        assert tuple(np.cumsum([0, *(n for n, _ in network.shapes)])) == network.first_neuron
        assert [layer.shape for layer in split_layers(network, np.zeros(network.synapses))] == network.shapes


@pytest.mark.parametrize("network", NETWORKS, ids=str)
def test_forward_is_tanh_of_x_times_w_layer_by_layer(network):
    rng, inputs = np.random.default_rng(1), network.inputs
    weights, activation = rng.uniform(-2, 2, network.synapses), np.zeros(network.neurons)
    activation[:inputs], activation[network.bias] = rng.random(inputs), 1.0
    forward_pass(network)(weights, activation, np.empty(network.neurons))
    x = np.append(activation[:inputs], 1.0)
    for layer, shape in enumerate(network.shapes):
        gene = network.first_synapse[layer]
        x = np.tanh(x @ weights[gene : gene + shape[0] * shape[1]].reshape(shape))
        np.testing.assert_allclose(activation[network.first_neuron[layer + 1] :][: shape[1]], x, rtol=0, atol=1e-14)


def test_a_bias_weight_acts_without_any_light_or_wall():
    weights, activation = np.zeros(PAPER_NETWORK.synapses), np.zeros(PAPER_NETWORK.neurons)
    activation[PAPER_NETWORK.bias] = 1.0
    weights[PAPER_NETWORK.bias * PAPER_NETWORK.post[0]] = 0.5  # to the first hidden neuron: the last row of its layer
    forward_pass(PAPER_NETWORK)(weights, activation, np.empty(PAPER_NETWORK.neurons))
    assert activation[PAPER_NETWORK.first_neuron[1]] == tanh(0.5)
    assert not activation[PAPER_NETWORK.first_neuron[1] + 1 :].any()


@given(st.floats(-1e300, 1e300))
def test_tanh_is_accurate_odd_and_bounded(x):
    assert abs(tanh(x) - math.tanh(x)) <= 5 * math.ulp(math.tanh(x))
    assert tanh(-x) == -tanh(x)
    assert abs(tanh(x)) <= 1


def test_weights_at_birth_are_a_clipped_copy():
    genome = np.linspace(-3, 3, 234)
    weights = starting_weights(genome)
    assert weights.max() == 2
    weights[:] = 0
    assert genome[0] == -3
