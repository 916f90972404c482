"""Four numbers at a time: what comes out for layers of any width, and that nothing beyond an array is touched."""

from dataclasses import dataclass

import numpy as np
import pytest
from cases import first_of

from epuckhebb.controller.compiling import simd
from epuckhebb.controller.compiling.kernel import kernel
from epuckhebb.controller.forward_pass import forward_pass
from epuckhebb.controller.genotype import Genotype
from epuckhebb.controller.network import Network, tanh
from epuckhebb.controller.own_class import stored
from epuckhebb.controller.plasticity.rule import Rule
from epuckhebb.controller.plasticity.update import StepContext, make_update, make_workspace

SPARE = 8


@dataclass(frozen=True, kw_only=True)
class Everything(Rule):
    """All that is worked out for a synapse from its two neurons, each with a factor of its own."""

    @staticmethod
    def synapse(correlation, pre, post):
        return correlation + 16.0 * pre + 256.0 * post


def one_step(weights, activation, state, genotype, context, numbers, workspace):
    forward(weights, activation, workspace.drive)  # noqa: F821  # a part
    return learn(weights, state, genotype, activation, 1.0, context, numbers, workspace)  # noqa: F821


def guarded(values):
    """An array of these numbers, and what is behind it in memory, which must stay 7."""
    memory = np.full(len(values) + SPARE, 7.0)
    memory[: len(values)] = values
    return memory[: len(values)], memory[len(values) :]


def expected_of(network, weights, activation):
    """The same by loops over single numbers, in the same order."""
    activation, weights = activation.copy(), weights.copy()
    change = np.empty(network.synapses)
    for pre, post, first, inputs, outputs in network.connections:
        for j in range(outputs):
            summed = 0.0
            for i in range(inputs):
                summed += activation[pre + i] * weights[first + i * outputs + j]
            activation[post + j] = tanh(summed)
        for i in range(inputs):
            for j in range(outputs):
                x, y = activation[pre + i], activation[post + j]
                change[first + i * outputs + j] = x * y + 16.0 * x + 256.0 * y
    return activation, weights + change


WIDTHS = [(4, 1, 3, 9, 5, 2), (2, 5, 9, 3, 1, 2), (1, 9, 2), (1, 5, 2), (1, 3, 2), (1, 1, 2), (1, 2)]


@pytest.mark.parametrize("network", first_of([Network(layers) for layers in WIDTHS]), ids=str)
def test_layers_of_any_width_are_bit_identical_to_single_numbers(network):
    rng = np.random.default_rng(2)
    made = kernel(
        one_step, (network, Everything), forward=forward_pass(network), learn=make_update(Everything, network)
    )
    seen = np.zeros(network.neurons)
    seen[: network.inputs], seen[network.bias] = rng.random(network.inputs), 1.0
    genes = rng.uniform(-2, 2, network.synapses)
    given = genes, seen, np.zeros(network.neurons)
    (weights, activation, drive), behind = zip(*map(guarded, given), strict=True)
    rows = np.full((4, network.synapses), 7.0)
    state, nothing, ones = stored(Everything.synapse_state, network.synapses), np.empty(0), np.ones(network.synapses)
    genotype = Genotype(genes, state, np.empty((0, network.synapses)), nothing, nothing, ones)
    workspace = make_workspace(network)._replace(drive=drive, synapses=rows[:3])
    numbers = Everything(N=1.0, w_max=1e6).numbers()
    made(weights, activation, state, genotype, StepContext(0.5, np.uint64(1), 0, 0.032), numbers, workspace)
    neurons, updated = expected_of(network, genes, seen)
    np.testing.assert_array_equal(activation, neurons)
    np.testing.assert_array_equal(weights, updated)
    for untouched in (*behind, rows[3]):
        assert (untouched == 7.0).all()


def test_a_vector_reads_no_number_that_is_not_there():
    """Compiled code does not check that, so it is asked of all networks of four layers up to ten neurons wide."""
    for one in range(1, 11):
        for other in range(1, 11):
            network = Network((1, one, other, 2))
            for _, post, first, inputs, outputs, count in network.vectors:
                end = max(outputs, count * simd.WIDTH)
                assert end - outputs < simd.WIDTH
                assert post + end <= network.neurons
                assert first + (inputs - 1) * outputs + end <= network.synapses
