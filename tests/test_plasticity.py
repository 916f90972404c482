"""The paper's equations, with its own worked examples, and three steps of every rule by hand."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuckhebb.controller.network import PAPER_NETWORK, Network
from epuckhebb.controller.plasticity.control import Sign, signs
from epuckhebb.controller.plasticity.rule import Rule
from epuckhebb.controller.plasticity.rules.bcm import BCM
from epuckhebb.controller.plasticity.rules.differential import Differential
from epuckhebb.controller.plasticity.rules.oja import Oja
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.controller.plasticity.update import StepContext, effective_rate, make_update, next_weight
from epuckhebb.controller.plasticity.weight_change import make_total, weight_change_workspace

RULES = (Paper, Oja, BCM, Differential)


@pytest.mark.parametrize(("fitness", "expected"), [(0.1, 0.0004), (0.9, 0.0018), (0.2, 0.0004), (-1.0, 0.0004)])
def test_effective_rate_as_in_the_papers_examples(fitness, expected):
    assert effective_rate(0.002, 1.0, fitness, 0.2) == pytest.approx(expected, rel=1e-15)


def traced(trace, correlation):
    return Paper.synapse(
        correlation, SimpleNamespace(trace=trace), SimpleNamespace(trace_decay=0.95, trace_update=0.05)
    )


def test_trace_keeps_95_percent_and_takes_up_5():
    assert traced(1.0, 0.0) == 0.95
    assert traced(0.0, 1.0) == 0.05


def test_trace_of_a_steady_correlation_converges_to_it():
    trace = 0.0
    for _ in range(400):
        trace = traced(trace, -0.3)
    assert trace == pytest.approx(-0.3, rel=1e-6)


def initial_state(rule):
    return SimpleNamespace(**rule.synapse_state)


def by(rule, **values):
    return SimpleNamespace(**dict(zip(rule.settings(), rule(**values).numbers(), strict=True)))


def test_three_steps_of_the_papers_rule():
    state, numbers = initial_state(Paper), by(Paper)
    assert Paper.synapse(0.4, state, numbers) == pytest.approx(0.02)
    assert Paper.synapse(-1.0, state, numbers) == pytest.approx(-0.031)  # 0.95 x 0.02 - 0.05
    assert Paper.synapse(0.0, state, numbers) == pytest.approx(-0.02945)
    assert state.trace == pytest.approx(-0.02945)


def test_three_steps_of_ojas_rule():
    assert Oja.synapse(0.5 * 0.8, 0.8, 1.5) == pytest.approx(0.4 - 0.64 * 1.5)
    assert Oja.synapse(-0.2 * 0.8, 0.8, -1.5) == pytest.approx(-0.16 + 0.96)
    assert Oja.synapse(0.6 * 0.5, 0.5, 0.6 / 0.5) == pytest.approx(0.0)  # at rest where w = x_j / x_i


def test_three_steps_of_the_bcm_rule():
    state, numbers = initial_state(BCM), by(BCM, threshold_time_s=0.064)  # half of the way in each step
    assert BCM.synapse(0.5 * 0.8, 0.8, state, 0.032, numbers) == pytest.approx(0.4 * (0.8 - 0.32))
    assert BCM.synapse(0.5 * 0.2, 0.2, state, 0.032, numbers) == pytest.approx(0.1 * (0.2 - 0.18))  # (0.32 + 0.04) / 2
    assert BCM.synapse(0.5 * -0.4, -0.4, state, 0.032, numbers) == pytest.approx(-0.2 * (-0.4 - 0.17))
    assert state.threshold == pytest.approx(0.17)


def test_three_steps_of_the_differential_rule():
    state, numbers = initial_state(Differential), by(Differential, trace_time_s=0.064)
    assert Differential.synapse(1.0, 0.0, state, 0.032, numbers) == pytest.approx(0.0)  # pre alone
    assert Differential.synapse(0.0, 1.0, state, 0.032, numbers) == pytest.approx(0.25)  # then post: strengthens
    assert Differential.synapse(1.0, 0.0, state, 0.032, numbers) == pytest.approx(-0.25)  # then pre after post: weakens
    assert (state.trace_pre, state.trace_post) == pytest.approx((0.625, 0.25))


@pytest.mark.parametrize("rule", [BCM, Differential])
def test_a_time_constant_of_0_is_refused(rule):
    (name,) = set(rule.settings()) - set(Rule.settings())
    with pytest.raises(ValueError, match=rf"hebbian\.{name}"):
        rule(**{name: 0.0})


def test_weight_is_clipped_at_w_max_and_nan_is_not_hidden():
    assert next_weight(1.9999, 1.0, 0.5, 2.0) == 2.0
    assert next_weight(-1.9999, 1.0, -0.5, 2.0) == -2.0
    assert next_weight(0.5, -1.0, 0.25, 2.0) == 0.25
    assert np.isnan(next_weight(0.5, 1.0, np.nan, 2.0))


class Told(Rule):
    """Says what it is given."""

    @staticmethod
    def synapse(correlation, pre, post, weight):
        return correlation + 10.0 * pre + 100.0 * post + 1000.0 * weight


@pytest.mark.parametrize("network", [PAPER_NETWORK, Network((3, 4, 2))], ids=str)
def test_every_synapse_gets_the_activations_of_its_two_neurons(network):
    activation = np.random.default_rng(0).normal(size=network.neurons)
    genes = np.random.default_rng(1).normal(size=network.synapses)
    weights = genes.copy()
    updated(Told, network, weights, genes, activation, rate=1.0, w_max=1e6)
    for layer, (pre, post) in enumerate(network.shapes):
        first, gene = network.first_neuron[layer], network.first_synapse[layer]
        x, y = activation[first : first + pre, None], activation[network.first_neuron[layer + 1] :][None, :post]
        here = slice(gene, gene + pre * post)
        expected = (x * y + 10 * x + 100 * y).ravel() + 1001 * genes[here]
        np.testing.assert_allclose(weights[here], expected, rtol=1e-12)


def initial_states(rule, network):
    return [initial_state(rule) for _ in range(network.synapses)]


def updated(rule, network, weights, genes, activation, rate, w_max, all_of=None, of_updates=None):
    """One update of all weights; the weight change."""
    of_updates = np.ones(network.synapses) if of_updates is None else of_updates
    return make_update(rule, network)(
        weights,
        initial_states(rule, network) if all_of is None else all_of,
        SimpleNamespace(weights=genes, coefficients=np.empty((0, network.synapses)), signs=of_updates),
        activation,
        rate,
        StepContext(0.5, np.uint64(1), 0, 0.032),
        rule(N=1.0, w_max=w_max).numbers(),
        SimpleNamespace(
            synapses=np.empty((3, network.synapses)), change=np.full(weight_change_workspace(network), 7.0)
        ),
    )


@given(
    rule=st.sampled_from(RULES),
    seed=st.integers(0, 2**32 - 1),
    rate=st.floats(0, 1e6),
    w_max=st.floats(1e-3, 10),
    sign=st.sampled_from(list(Sign)),
)
def test_weights_stay_within_bounds_and_change_is_the_sum_of_differences(rule, seed, rate, w_max, sign):
    rng, network = np.random.default_rng(seed), Network((16, 3, 2))
    genes = np.clip(rng.uniform(-2, 2, network.synapses), -w_max, w_max)
    weights, all_of = genes.copy(), initial_states(rule, network)
    activation, of_updates = np.tanh(rng.normal(size=network.neurons)), signs(sign, network.synapses, rng)
    for _ in range(2):
        change = updated(rule, network, weights, genes, activation, rate, w_max, all_of, of_updates)
        assert np.abs(weights).max() <= w_max
        assert change == pytest.approx(np.abs(weights - genes).sum(), rel=1e-12, abs=1e-300)
    if rate == 0:
        assert weights.tobytes() == genes.tobytes()


@pytest.mark.parametrize("layers", [(2, 2), (3, 2), (16, 2), (16, 3, 2), (16, 7, 5, 8, 4, 2), (40, 9, 2)])
def test_the_weight_change_adds_up_in_networks_of_all_sizes(layers):
    network = Network(layers)
    values = np.full(weight_change_workspace(network), np.nan)
    values[: network.synapses] = 2.0 ** np.arange(network.synapses).clip(max=40)
    expected = values[: network.synapses].sum()
    assert make_total(network)(values) == expected


def test_signs_of_the_controls():
    rng = np.random.default_rng(3)
    assert set(signs(Sign.hebbian, 234, rng)) == {1.0}
    assert set(signs(Sign.anti, 234, rng)) == {-1.0}
    shuffled = signs(Sign.shuffled, 234, rng)
    assert set(shuffled) == {-1.0, 1.0}
    assert 80 < (shuffled == 1).sum() < 154


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize(
    ("key", "value"),
    [("N", -1.0), ("N", float("nan")), ("floor", -0.1), ("w_max", 0.0), ("w_max", float("inf"))],
)
def test_invalid_rules_are_refused_by_name(rule, key, value):
    with pytest.raises(ValueError, match=rf"hebbian\.{key} .*{value}"):
        rule(**{key: value})


@pytest.mark.parametrize(("key", "value"), [("trace_decay", 1.1), ("trace_update", -0.1)])
def test_invalid_traces_are_refused_by_name(key, value):
    with pytest.raises(ValueError, match=rf"hebbian\.{key} .*{value}"):
        Paper(**{key: value})
