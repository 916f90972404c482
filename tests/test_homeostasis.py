"""Homeostatic plasticity: weights from the light sensors are scaled until the light looks as in training."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
import reference
from cases import done

from epuckhebb.adaptation.adaptation import Adaptation
from epuckhebb.adaptation.homeostasis import PATTERNS, homeostasis, initial_homeostasis_state, light_patterns
from epuckhebb.adaptation.nominal import measure_nominal
from epuckhebb.controller.network import PAPER_NETWORK
from epuckhebb.tmaze.batch import run_lifetimes
from epuckhebb.tmaze.individual import GA_ALONE, Controller, Individual
from epuckhebb.tmaze.life import TALLY, Lifetime
from epuckhebb.tmaze.robot import EPUCK
from epuckhebb.tmaze.scenario import Scenario

BRIGHT = Scenario(name="highlight", experiment="light", light=1.0, paper_duration_s=40.0)
KEY = np.uint64(4)
HOMEOSTATIC = Controller(name="homeostasis", adaptation=Adaptation(name="homeostasis", homeostasis=True))


@pytest.fixture(scope="module")
def nominal(genomes):
    """Nominal statistics of a champion: ten lifetimes a side of ten seconds, at wheel gain 4."""
    return measure_nominal(genomes[0], BRIGHT, gain_rad_s=4.0)


def life(genes, nominal, scenario=BRIGHT, controller=HOMEOSTATIC, side="left", seconds=10.0):
    individual = Individual(
        genes=genes, side=side, key=KEY, controller=controller, nominal=nominal.statistics(side), record=True
    )
    return run_lifetimes([individual], scenario, Lifetime(duration_s=seconds, gain_rad_s=4, record_every=1))[0]


def test_where_nothing_has_changed_a_lifetime_is_bit_identical(genomes, nominal):
    for side in ("left", "right"):
        outcome, samples = life(genomes[0], nominal, side=side)
        alone, control = life(genomes[0], nominal, side=side, controller=GA_ALONE)
        assert samples.pose.tobytes() == control.pose.tobytes()
        np.testing.assert_array_equal(outcome, alone)
        assert outcome.weight_change_mean == 0
        assert 0 < np.nanmax(samples.change_signal) <= 1.1  # novelty over the largest in training


@pytest.mark.parametrize("level", [0.5, 0.3])
def test_in_dimmer_light_the_scale_is_as_much_larger(genomes, nominal, level):
    outcome, samples = life(genomes[0], nominal, replace(BRIGHT, light=level), seconds=20.0)
    lit = np.clip(genomes[0], -2, 2)[:56].reshape(8, 7)
    per_unit = np.abs(lit).sum() + np.abs(lit.sum(axis=0)).sum()
    assert 1 + outcome.weight_change_final / per_unit == pytest.approx(1 / level, rel=0.2)
    assert (samples.weights == samples.weights[0]).all()  # recorded without the scale
    assert samples.change_signal[0] > 3  # novelty over the largest in training


def test_the_scale_finds_the_level_of_the_light(nominal):
    """The patterns of training, in light of 0.4 times training's."""
    scale, state = homeostasis(8, 7), initial_homeostasis_state(EPUCK.light.count)
    tally, rng = np.zeros(1, TALLY).view(np.recarray), np.random.default_rng(3)
    tally["scale"] = 1.0
    for step in range(2000):
        seen = nominal.patterns[step // 50 % PATTERNS]
        readings = np.append(1 - 0.4 * seen + rng.normal(0, 0.003, 8), np.zeros(8))
        life = SimpleNamespace(
            activation=readings,
            tally=tally,
            adaptation=SimpleNamespace(homeostasis=state),
            weights=np.ones(PAPER_NETWORK.synapses),
        )
        scale(life, SimpleNamespace(nominal=nominal.statistics("left")), step)
    assert tally["scale"][0] == pytest.approx(2.5, rel=0.15)
    assert tally["scaling"][0] == pytest.approx(2 * 8 * 7 * (tally["scale"][0] - 1))  # weights of 1: 56, and 7 biases


def test_a_scale_that_explains_nothing_is_not_used(genomes, nominal):
    blind = replace(BRIGHT, dead_sensors=(2,))
    _, samples = life(genomes[0], nominal, blind)
    control = life(genomes[0], nominal, blind, controller=GA_ALONE)[1]
    assert np.nanmax(samples.change_signal) > 1  # it is novel
    assert samples.pose.tobytes() == control.pose.tobytes()


@pytest.mark.parametrize("world", [{"light": 0.3}, {"light": 0.6, "dead_sensors": (5,)}])
def test_agrees_with_the_oracle(genomes, nominal, world):
    world = replace(BRIGHT, **world)
    outcome, samples = life(genomes[0], nominal, world, side="right")
    robot = reference.Robot(
        genomes[0], world, "right", HOMEOSTATIC, gain=4, key=KEY, nominal=nominal.statistics("right")
    )
    expected, steps = reference.live(robot, len(samples.time))
    np.testing.assert_allclose(samples.sensors, [s[3] for s in steps], rtol=0, atol=1e-6)
    np.testing.assert_allclose(samples.pose, [s[:3] for s in steps], rtol=0, atol=1e-7)
    np.testing.assert_allclose(outcome[: len(expected)], expected, rtol=1e-6, atol=1e-7)


def test_patterns_are_centres_of_clusters(nominal):
    assert nominal.patterns.shape == (PATTERNS, 8)
    assert 0.01 <= nominal.novelty < 0.3
    few = [np.full((5, 2), [0.5, 0.0]), np.full((3, 2), [0.25, 0.25])]
    patterns, novelty = light_patterns(few)
    assert {tuple(pattern) for pattern in patterns.tolist()} <= {(0.5, 0.0), (0.25, 0.25)}
    assert novelty == 0.01  # at least the noise of a light sensor


@pytest.mark.usefixtures("here")
def test_as_a_user_meets_it():
    words = ["scenario=lowlight", "adaptation=homeostasis", "repeats=1", "lifetime.duration_s=2", "hydra.run.dir=run"]
    done("evaluate", *words)
    rows = pd.read_csv("run/metrics.csv")
    assert set(rows.controller) == {"GA", "homeostasis"}
