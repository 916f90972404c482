"""The controller as an object: the bits of the maze, a plain loop of NumPy, its cost, and what it refuses."""

import time

import gymnasium
import numpy as np
import pytest

import epuckhebb
from epuckhebb import Controller, Hebbian
from epuckhebb.controller.compiling.errors import PartError
from epuckhebb.controller.genome import make_plan
from epuckhebb.controller.network import Network, split_layers
from epuckhebb.controller.plasticity.rule import Normalise
from epuckhebb.controller.plasticity.rules.abcd import ABCD
from epuckhebb.controller.wirings.elman import Elman
from epuckhebb.gym import ID, evaluation_key

NETWORK = Network((17, 16, 6))
RULE = ABCD(N=0.05, floor=1.0, normalise=Normalise.largest)
GENES = np.random.default_rng(3).uniform(-1, 1, make_plan(NETWORK, ABCD).genes)


def in_numpy(seed):
    """A function that is the same controller in plain NumPy."""
    a, b, c, d, eta = (split_layers(NETWORK, row) for row in GENES[NETWORK.synapses :].reshape(5, -1))
    controller = Controller(GENES, NETWORK, RULE)
    controller.reset(seed)
    layers = split_layers(NETWORK, controller.weights.copy())

    def act(observation):
        activations = [np.append(observation, 1.0)]
        for weights in layers:
            activations.append(np.tanh(activations[-1] @ weights))
        for k, layer in enumerate(layers):
            pre, post = activations[k][:, None], activations[k + 1][None, :]
            layer[:] = np.clip(layer + RULE.N * eta[k] * (a[k] * pre * post + b[k] * pre + c[k] * post + d[k]), -2, 2)
            layer[:] = layer / np.abs(layer).max()
        return activations[-1]

    return act, layers


def test_it_acts_and_learns_as_plain_numpy_does():
    act, layers = in_numpy(seed=5)
    controller = Controller(GENES, NETWORK, RULE)
    controller.reset(seed=5)
    for observation in np.random.default_rng(0).normal(size=(50, 17)):
        np.testing.assert_allclose(controller.act(observation), act(observation), atol=1e-9)
    for own, expected in zip(split_layers(NETWORK, controller.weights), layers, strict=True):
        np.testing.assert_allclose(own, expected, atol=1e-9)
    assert controller.weight_change_mean > 1 > controller.saturated_fraction > 0


def test_a_step_costs_a_fifth_of_plain_numpy_and_at_most_7_us_of_cpu_time():
    act, _ = in_numpy(seed=1)
    controller, observation = Controller(GENES, NETWORK, RULE), np.zeros(17)
    controller.act(observation)

    def cost(step, count=2000):
        began = time.process_time()
        for _ in range(count):
            step(observation)
        return (time.process_time() - began) / count

    turns = [(cost(controller.act), cost(act)) for _ in range(5)]
    assert min(own / plain for own, plain in turns) < 0.2
    assert min(own for own, _ in turns) < 7e-6


def test_in_the_maze_it_is_bit_identical_to_evaluate():
    rule, words = Hebbian(N=0.01, floor=1.0), ["lifetime.duration_s=6", "lifetime.gain_rad_s=4"]
    result = epuckhebb.evaluate("reference", *words, hebbian=rule, repeats=1, seed=7, progress=False)
    genes = epuckhebb.load()
    environment = gymnasium.make(ID, overrides=words)
    observation, _ = environment.reset(seed=1, options={"side": "left", "key": evaluation_key(7, 0, "left")})
    controller, is_over = Controller(genes, rule=rule), False
    while not is_over:
        observation, _, is_over, *_ = environment.step(controller.act(observation))
    row = result.metrics[(result.metrics.side == "left") & (result.metrics.controller == "Hebbian")].iloc[0]
    assert (controller.weight_change, controller.weight_change_mean) == (
        row.weight_change_final,
        row.weight_change_mean,
    )
    assert controller.steps == 187


def test_a_lifetime_begins_anew_and_a_rate_of_0_freezes_the_weights():
    controller = Controller(GENES, NETWORK, RULE)
    first, again, other = (controller.reset(seed) or controller.weights.copy() for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert (first != other).any()
    controller.rate = 0.0
    controller.act(np.ones(17))
    np.testing.assert_array_equal(controller.weights, other)


def test_to_decide_and_to_learn_are_to_act():
    """In two halves, the reward of this step's own move can teach it."""
    network, rule = Network((3, 4, 2)), Hebbian(N=0.01)
    genes = np.random.default_rng(2).uniform(-1, 1, network.synapses)
    whole, halves, late = (Controller(genes, network, rule) for _ in range(3))
    for step, observation in enumerate(np.random.default_rng(3).uniform(-1, 1, (20, 3))):
        outputs = whole.act(observation, step / 20)
        np.testing.assert_array_equal(halves.decide(observation), outputs)
        late.decide(observation)
        halves.learn(step / 20)
        late.learn(step / 20, 0.5)
    np.testing.assert_array_equal(halves.weights, whole.weights)
    assert halves.weight_change_mean == whole.weight_change_mean
    assert not np.array_equal(late.weights, whole.weights)


def test_wirings_have_as_many_outputs_as_the_network_needs():
    network = Network((3, 5, 4), wiring=Elman(hidden=5, outputs=4))
    assert Controller(np.ones(network.synapses), network).act(np.ones(3)).shape == (4,)


def test_what_are_no_genes_is_refused():
    with pytest.raises(ValueError, match="genes"):
        Controller(np.ones(7), NETWORK, RULE)
    controller = Controller(np.full(GENES.shape, np.nan), NETWORK, RULE)
    controller.act(np.ones(17))
    with pytest.raises(PartError, match="nan"):
        controller.check()
