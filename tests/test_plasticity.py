"""The paper's equations, with its own worked examples."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from epuckhebb.sim.controller import FIRST_GENE, FIRST_NEURON, GENES, NEURONS, POST, PRE
from epuckhebb.sim.plasticity import (
    CHANGE_ROOM,
    Hebbian,
    correlate,
    effective_rate,
    learn,
    next_trace,
    next_weight,
    rule,
)


@pytest.mark.parametrize(("fitness", "expected"), [(0.1, 0.0004), (0.9, 0.0018), (0.2, 0.0004), (-1.0, 0.0004)])
def test_effective_rate_as_in_the_papers_examples(fitness, expected):
    assert effective_rate(0.002, 1.0, fitness, 0.2) == pytest.approx(expected, rel=1e-15)


def test_trace_keeps_95_percent_and_takes_up_5():
    assert next_trace(1.0, 0.0, 0.95, 0.05) == 0.95
    assert next_trace(0.0, 1.0, 0.95, 0.05) == 0.05


def test_trace_of_a_steady_correlation_converges_to_it():
    trace = 0.0
    for _ in range(400):
        trace = next_trace(trace, -0.3, 0.95, 0.05)
    assert trace == pytest.approx(-0.3, rel=1e-6)


def test_weight_is_clipped_at_w_max():
    assert next_weight(1.9999, 1.0, 0.5, 2.0) == 2.0
    assert next_weight(-1.9999, 1.0, -0.5, 2.0) == -2.0


def test_correlation_is_the_outer_product_of_each_layer():
    activation = np.random.default_rng(0).normal(size=NEURONS)
    correlation = np.empty(GENES)
    correlate(activation, correlation)
    for layer, (pre, post) in enumerate(zip(PRE, POST, strict=True)):
        first, gene = FIRST_NEURON[layer], FIRST_GENE[layer]
        outer = np.outer(activation[first : first + pre], activation[FIRST_NEURON[layer + 1] :][:post])
        np.testing.assert_array_equal(correlation[gene : gene + pre * post], outer.ravel())


@settings(deadline=None, max_examples=40)
@given(
    seed=st.integers(0, 2**32 - 1),
    rate=st.floats(0, 1e6),
    w_max=st.floats(1e-3, 10),
)
def test_weights_stay_within_bounds_and_change_is_the_sum_of_differences(seed, rate, w_max):
    rng = np.random.default_rng(seed)
    genes = np.clip(rng.uniform(-2, 2, GENES), -w_max, w_max)
    weights, trace = genes.copy(), rng.normal(size=GENES)
    by = rule(Hebbian(N=1.0, w_max=w_max))
    change = learn(
        weights,
        trace,
        genes,
        np.tanh(rng.normal(size=NEURONS)),
        rate,
        by,
        np.ones(GENES),
        np.empty(GENES),
        np.full(CHANGE_ROOM, 7.0),
    )
    assert np.abs(weights).max() <= w_max
    assert change == pytest.approx(np.abs(weights - genes).sum(), rel=1e-12, abs=1e-300)


@pytest.mark.parametrize(
    ("key", "value"),
    [("N", -1.0), ("N", float("nan")), ("floor", -0.1), ("trace_decay", 1.1), ("trace_update", -0.1), ("w_max", 0.0)],
)
def test_impossible_rules_are_refused_by_name(key, value):
    with pytest.raises(ValueError, match=rf"hebbian\.{key} must .*{value}"):
        Hebbian(**{key: value})
