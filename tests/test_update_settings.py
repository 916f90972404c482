"""Settings of the update that every rule has: normalised weights, averaged activations, slow updates."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cases import done, first_of
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from epuckhebb.config import EvaluateConfig, load
from epuckhebb.controller.genome import make_plan
from epuckhebb.controller.network import PAPER_NETWORK, Network, split_layers
from epuckhebb.controller.plasticity.rule import Normalise, Rule, Schedule
from epuckhebb.controller.plasticity.rules.bcm import BCM
from epuckhebb.controller.plasticity.rules.discrete import Discrete
from epuckhebb.controller.plasticity.rules.modulated import Modulated
from epuckhebb.controller.plasticity.update import _divide_by_largest, averaging
from epuckhebb.evolution.optimizer import initial
from epuckhebb.tmaze.batch import run_lifetimes
from epuckhebb.tmaze.individual import Controller, Individual
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.session import Session

SMALL = Network((16, 3, 2))
FILE = """
from dataclasses import dataclass
from epuckhebb import Rule
from epuckhebb.controller.plasticity.rule import Normalise

@dataclass(frozen=True, kw_only=True)
class Mine(Rule):
    normalise: Normalise = Normalise.length

    @staticmethod
    def synapse(pre, post):
        return pre * post
"""
IN_LAYERS = [
    BCM(N=0.002, normalise=Normalise.largest, average=7, every=5),
    Modulated(N=0.01, normalise=Normalise.length, average=4),
    Discrete(N=0.01, normalise=Normalise.none, every=3),
]


@dataclass(frozen=True, kw_only=True)
class Own(Rule):
    """A rule of the user's."""

    @staticmethod
    def synapse(pre, post, weight, step_s):
        return (pre * post - post * post * weight) * step_s


def plain_lifetime(session, rule):
    """Run a lifetime step by step beside a plain loop over layers; weights and weight change after each step."""
    weights, window, found, changes = session.life.weights.copy(), [], [], []
    for step in range(session.lifetime.steps):
        session.step()
        window = [*window, session.life.activation.copy()][-rule.average :]
        if (step + 1) % rule.every == 0:
            mean = sum(window) / len(window)
            for (first, then, *_), layer in zip(SMALL.connections, split_layers(SMALL, weights), strict=True):
                pre, post = mean[first:][: len(layer), None], mean[then:][None, : layer.shape[1]]
                direction = (pre * post - post * post * layer) * (0.032 * rule.every)
                layer[:] = np.clip(layer + rule.N * direction, -rule.w_max, rule.w_max)
                layer[:] = layer / np.abs(layer).max()
        assert session.life.weights.tobytes() == weights.tobytes()
        found.append(weights.copy())
        changes.append(session.life.tally[0]["weight_change"])
    return np.array(found), np.array(changes)


@given(average=st.integers(2, 70), every=st.integers(2, 20), seed=st.integers(0, 99))
@settings(max_examples=8)
def test_a_lifetime_is_bit_identical_to_a_plain_loop(average, every, seed):
    rule = Own(N=0.5, floor=1.0, normalise=Normalise.largest, average=average, every=every)  # so that N_e is N
    genes = np.random.default_rng(seed).uniform(-1, 1, SMALL.synapses)
    shared = {"genes": genes, "side": "left", "key": np.uint64(seed), "network": SMALL, "record": True}
    who, lifetime = Individual(controller=Controller(name="own", rule=rule), **shared), Lifetime(duration_s=2.0)
    session = Session(who, Scenario(), lifetime)
    weights, changes = plain_lifetime(session, rule)
    due = np.arange(every - 1, lifetime.steps, every)
    assert (np.flatnonzero(np.diff(weights, axis=0).any(axis=1)) + 1).tolist() == due.tolist()
    assert set(np.flatnonzero(np.diff(changes)) + 1) <= set(due)
    assert {np.abs(layer).max() for step in due for layer in split_layers(SMALL, weights[step])} == {1.0}
    (learnt, _), (genes_alone, _) = run_lifetimes([who, Individual(**shared)], Scenario(), lifetime)
    np.testing.assert_array_equal(learnt, session.outcome())
    assert genes_alone.weight_change_mean == 0


@given(weights=arrays(float, SMALL.synapses, elements=st.floats(-1e6, 1e6)), none=st.booleans())
def test_the_largest_weight_of_each_layer_is_1_unless_all_are_0(weights, none):
    weights[:51] *= not none
    before = weights.copy()
    for layer in SMALL.connections:
        _divide_by_largest(*layer, weights, np.empty(0), 2.0)
    for own, was in zip(split_layers(SMALL, weights), split_layers(SMALL, before), strict=True):
        assert np.abs(own).max() == was.any()
        np.testing.assert_array_equal(own, was / (np.abs(was).max() or 1.0))


@given(values=arrays(float, (30, 4), elements=st.floats(-1, 1)), steps=st.integers(1, 40))
def test_what_an_update_reads_is_the_mean_over_the_last_steps(values, steps):
    average, recent, mean = averaging(Schedule(averages=True)), np.zeros((steps, 4)), np.empty(4)
    for step, activation in enumerate(values):
        expected = values[max(0, step + 1 - steps) : step + 1].mean(axis=0)
        np.testing.assert_allclose(average(recent, activation, step, mean), expected, atol=1e-15)


@pytest.mark.parametrize("rule", first_of(IN_LAYERS), ids=lambda rule: type(rule).__name__)
def test_a_rule_with_these_settings_agrees_with_the_oracle(rule, beside_the_oracle, genomes):
    genes = initial(np.random.default_rng(3), 1, make_plan(PAPER_NETWORK, type(rule)))[0]
    genes[:234] = genomes[0]
    outcome, *_ = beside_the_oracle(genes, controller=Controller(name="own", rule=rule), seconds=20.0, gain=1.0)
    assert outcome.weight_change_mean > 0.1


@pytest.mark.usefixtures("here")
def test_each_rule_has_these_settings_and_the_defaults_of_its_class():
    Path("my_rules.py").write_text(FILE)
    for rule, normalise in (("paper", "none"), ("oja", "none"), ("discrete", "length"), ("my_rules.py:Mine", "length")):
        for words in ([], ["hebbian.normalise=largest", "hebbian.average=3", "hebbian.every=2"]):
            (found,) = load(EvaluateConfig, [f"hebbian.rule={rule}", *words]).controllers
            expected = ("largest", 3, 2) if words else (normalise, 1, 1)
            assert (found.rule.normalise.name, found.rule.average, found.rule.every) == expected


@pytest.mark.usefixtures("here")
def test_a_run_writes_them_down_and_its_weights_end_at_their_bound():
    own = ["hebbian.normalise=largest", "hebbian.every=2", "lifetime.duration_s=1", "repeats=1", "figures=none"]
    done("evaluate", *own, "hydra.run.dir=run")
    config = Path("run/.hydra/config.yaml").read_text()
    assert [line in config for line in ("  normalise: largest\n", "  average: 1\n", "  every: 2\n")] == [True] * 3
    rows = pd.read_csv("run/metrics.csv")
    assert (rows.saturated_fraction[rows.controller == "GA"] == 0).all()
    assert (rows.saturated_fraction[rows.controller == "Hebbian"] >= 5 / 234).all()
    done("rerun", "run", "-q")
