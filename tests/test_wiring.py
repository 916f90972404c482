"""Wirings: the compiled kernel beside plain Python, blocks of synapses, plasticity, pieces, and what is recorded."""

import itertools
import math
from pathlib import Path

import numpy as np
import pytest
from cases import first_of

from epuckhebb.controller.forward_pass import forward_pass
from epuckhebb.controller.genome import make_plan
from epuckhebb.controller.network import Network
from epuckhebb.controller.plasticity import update
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.controller.wiring import Wiring
from epuckhebb.controller.wirings.ctrnn import CTRNN
from epuckhebb.controller.wirings.elman import Elman
from epuckhebb.tmaze.individual import GA_ALONE, Controller, Individual
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.session import Session

LEARNING = Controller(name="Hebbian", rule=Paper(N=0.0005))


def network_of(wiring):
    return Network((16, *wiring.sizes), wiring=wiring)


def genes_of(network, seed=5):
    return np.random.default_rng(seed).uniform(-1, 1, make_plan(network).genes)


@pytest.mark.parametrize("controller", [GA_ALONE, LEARNING], ids=["GA", "Hebbian"])
@pytest.mark.parametrize("wiring", first_of([CTRNN(hidden=5), CTRNN(hidden=5, tau_gain_rad_s=0.0), Elman()]))
def test_a_wiring_agrees_with_the_oracle_step_by_step(beside_the_oracle, wiring, controller):
    network = network_of(wiring)
    genes = genes_of(network)
    # At a wall a recurrent network lets rounding errors grow from step to step; this ends before.
    outcome, samples, _ = beside_the_oracle(genes, "right", controller=controller, network=network, seconds=6, gain=2.0)
    assert samples.motors.std() > 0.05
    assert (outcome.weight_change_mean > 0.01) == (controller is LEARNING)


class Irregular(Wiring):
    """Synapses in any order, and rows of them that reach two groups."""

    sizes = (5, 4)
    neuron = staticmethod(lambda drive, before, number: math.tanh(drive) + 0.1 * before + 0.01 * number)

    def synapses(self, inputs):
        """Twenty at random, and then five rows."""
        numbers = np.random.default_rng(2).integers(0, 9, (20, 2)) + [0, inputs + 1]
        return [*map(tuple, numbers.tolist()), *itertools.product(range(3, 8), range(inputs + 3, inputs + 9))]


@pytest.mark.parametrize("wiring", [Irregular(), CTRNN(hidden=5), Elman(hidden=3)], ids=["irregular", "ctrnn", "elman"])
def test_synapses_in_blocks_are_bit_identical_to_one_by_one(monkeypatch, wiring):
    network = network_of(wiring)
    pre, post = network.joined
    rows = [(first, n * m) for _, _, first, n, m in network.connections]
    assert [first for first, _ in rows] == np.cumsum([0, *(count for _, count in rows)])[:-1].tolist()
    rng = np.random.default_rng(6)
    weights, seen = rng.uniform(-2, 2, network.synapses), rng.uniform(-1, 1, network.neurons)
    results, rooms = [], []
    for most in (1000, 0):
        monkeypatch.setattr("epuckhebb.controller.compiling.kernel.MOST_CALLS", most)
        genes = {name: np.full(size, 0.3) for name, size in wiring.parameter_sizes().items()}
        neurons, activation = wiring.initial(genes, 4.0, 0.032), seen.copy()
        neurons = neurons._replace(state=neurons.state.view(np.recarray))
        forward = forward_pass.__wrapped__(network)
        for _ in range(3):
            forward(weights, activation, np.empty(network.neurons), neurons)
        room = np.zeros((3, network.synapses))
        for quantity in range(3):
            update._filled.__wrapped__(network, quantity)(activation, room)
        results.append(activation.tobytes())
        rooms.append(room)
    assert results[0] == results[1]
    np.testing.assert_array_equal(rooms[0], rooms[1])
    np.testing.assert_array_equal(rooms[0], [activation[pre], activation[post], activation[pre] * activation[post]])


def test_groups_respond_in_turn_and_neurons_of_a_group_at_once():
    network = network_of(Irregular())
    (pre, post), rng = network.joined, np.random.default_rng(7)
    weights, activation = rng.uniform(-2, 2, network.synapses), rng.uniform(-1, 1, network.neurons)
    expected = activation.copy()
    for group in (range(17, 22), range(22, 26)):
        drives = {j: sum(weights[k] * expected[pre[k]] for k in np.flatnonzero(post == j)) for j in group}
        for j, drive in drives.items():
            expected[j] = math.tanh(drive) + 0.1 * expected[j] + 0.01 * (j - 17)
    expected[-2:] = np.clip(expected[-2:], -1, 1)
    forward_pass(network)(weights, activation, np.empty(network.neurons), network.wiring.initial({}, 4.0, 0.032))
    np.testing.assert_allclose(activation, expected, rtol=0, atol=1e-14)


@pytest.mark.parametrize(("tau_gain", "factor"), [(4.0, 4.0), (0.0, 1.0)])
def test_time_constants_follow_the_wheel_gain_if_they_are_to(tau_gain, factor):
    genes = {"tau": np.zeros(8), "bias": np.zeros(8)}
    steps = [CTRNN(tau_gain_rad_s=tau_gain).initial(genes, gain, 0.032).step_s for gain in (4.0, 1.0)]
    assert steps == [0.032, 0.032 / factor]


EXAMPLE = Path(__file__).parents[1] / "examples" / "own_controller" / "my_neurons.py"


def test_a_lifetime_in_pieces_is_the_same_and_reset_leaves_the_state_of_neurons():
    network = network_of(CTRNN(hidden=5))
    genes = genes_of(network)
    individual = Individual(genes=genes, side="left", key=np.uint64(2), network=network)
    whole, pieces = (Session(individual, Scenario(), Lifetime(duration_s=4, gain_rad_s=4)) for _ in range(2))
    whole.step(1000)
    while pieces.step(7):
        pass
    np.testing.assert_array_equal(whole.outcome(), pieces.outcome())
    assert (
        whole.life.neurons.state.tobytes()
        == pieces.life.neurons.state.tobytes()
        != bytes(len(whole.life.neurons.state.tobytes()))
    )
