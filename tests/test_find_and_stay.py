"""Find the goal and stay there: the goal signal and its faults, the two gates, a halt, and staying that is learnt."""

from dataclasses import replace

import numpy as np
import pytest
from cases import first_of

from epuckhebb.adaptation.adaptation import Adaptation, Exploration
from epuckhebb.adaptation.gate import PlasticWhen, Stay
from epuckhebb.adaptation.nominal import measure_nominal
from epuckhebb.config.compose import composed
from epuckhebb.config.schema import EvaluateConfig, typed
from epuckhebb.controller.plasticity.control import Sign
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.controller.random import Stream, key
from epuckhebb.runtime.errors import ConfigError
from epuckhebb.store.genome import load_genome
from epuckhebb.tmaze.batch import run_lifetimes
from epuckhebb.tmaze.individual import Controller, Individual
from epuckhebb.tmaze.maze import Place
from epuckhebb.tmaze.robot import STEP_S
from epuckhebb.tmaze.scenario import Scenario

KEY = key(1, Stream.evaluation_noise)
CHAMPION = load_genome("reference_2", "obstacles")
SECOND = round(1 / STEP_S)
HALT = ("adaptation=find_and_stay", "hebbian=paper", "hebbian.N=0")  # by the kernel that agrees with the oracle


def config(*overrides):
    return typed(composed("evaluate", [*overrides]), EvaluateConfig)


@pytest.fixture(scope="module")
def nominal():
    return measure_nominal(CHAMPION.weights, config("scenario=base").world)


def run(nominal, *overrides, side="right", world="scenario=base change=[lamp_gone]", seconds=250.0):
    """A lifetime; without its lamp the champion goes to the wrong end."""
    settings = config(*world.split(), *overrides)
    (controller,) = settings.controllers
    individual = Individual(
        genes=CHAMPION.genes,
        side=side,
        key=KEY,
        controller=controller,
        nominal=nominal.statistics(side),
        record=True,
    )
    lifetime = replace(settings.lifetime, record_every=1, duration_s=seconds)
    return run_lifetimes([individual], settings.world, lifetime)[0]


@pytest.mark.parametrize("stays", first_of([{"stay": Stay.halt}, {"plastic_when": PlasticWhen.goal_signal}]))
def test_agrees_with_the_oracle(beside_the_oracle, stays):
    finds = {"change_signal": "late", "exploration": Exploration.wall_following, "active_s": 10.0, "rest_s": 2.0}
    adaptation = Adaptation(threshold=1.2, start_by_s=4.0, **finds, **stays)
    controller = Controller(name="x", rule=Paper(N=0.01, sign=Sign.anti), adaptation=adaptation)
    near = Scenario(goals={"left": Place(0.0, -0.1), "right": Place(0.0, -0.1)})  # in the stem, on the way
    nominal = measure_nominal(CHAMPION.weights, Scenario(), 4.0).statistics("right")
    more = {"seconds": 12.0, "nominal": nominal, "signs": -np.ones(234)}
    _, samples, robot = beside_the_oracle(CHAMPION.genes, "right", near, controller, **more)
    assert robot.arrived
    assert (samples.weight_change[-1] > 0) == (adaptation.plastic_when is PlasticWhen.goal_signal)
    assert robot.halted == (adaptation.stay is Stay.halt)


def test_it_finds_the_goal_and_halts_there(nominal):
    alone, _ = run(nominal, "hebbian=paper", "hebbian.N=0")
    outcome, samples = run(nominal, *HALT)
    assert (alone.success, outcome.success) == (False, True)
    there = samples.time > outcome.time_to_goal + 0.2
    assert np.ptp(samples.pose[there], axis=0).max() < 1e-9
    assert not samples.weight_change.any()


@pytest.mark.thorough
def test_it_learns_to_stay_at_the_goal_alone_and_keeps_what_it_learns(nominal):
    outcome, samples = run(nominal, "adaptation=find_and_learn_to_stay")
    goal = config("scenario=base").world.goals_now["right"]
    here = np.hypot(samples.pose[:, 0] - goal.x, samples.pose[:, 1] - goal.y) < 0.05
    changed = np.abs(np.diff(samples.weight_change)) > 0
    assert outcome.success
    assert here[1:][changed].all()
    first = int(np.argmax(here))
    assert not samples.weight_change[:first].any()
    assert samples.weight_change[first + 1 :].min() > 0


@pytest.mark.thorough
@pytest.mark.parametrize(("when", "share"), [("always", 1.0), ("late", 0.5)])
def test_the_gate_of_plasticity_is_not_that_of_exploration(nominal, when, share):
    learns = ("adaptation=find", "hebbian=paper", "hebbian.N=0.0001", f"adaptation.plastic_when={when}")
    _, samples = run(nominal, *learns, seconds=60.0)
    plastic = (samples.rate > 0).mean()
    assert plastic == 1.0 if when == "always" else plastic < share
    _, silent = run(nominal, "adaptation=find", seconds=60.0)
    np.testing.assert_array_equal(silent.weight_change, 0)


def test_a_start_by_a_time_does_not_wait_for_lateness(nominal):
    never_late = replace(nominal, time_to_goal_s=np.array([1e6, 1e6]))
    _, early = run(never_late, *HALT, "adaptation.start_by_s=20", "adaptation.active_s=1000", seconds=40.0)
    _, never = run(never_late, *HALT, "adaptation.start_by_s=inf", seconds=40.0)
    same = (early.pose == never.pose).all(axis=1)
    assert same[: int(20 / STEP_S)].all()
    assert not same[int(21 / STEP_S) :].all()


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        (["adaptation=find_and_learn_to_stay", "hebbian=none"], "needs a plasticity rule"),
        (["adaptation=find", "adaptation.start_by_s=250"], "less than lifetime.duration_s"),
        (["adaptation=none", "adaptation.stay=halt"], "adaptation.stay does nothing without"),
        (["scenario.second_lamp=[1,2]"], "scenario.second_lamp must be"),
        (["scenario.start=[0,0]"], "scenario.start"),
        (["scenario.sensor_levels=1"], "sensor_levels must be 2 or more"),
        (["scenario.wheel_delay_steps=32"], "wheel_delay_steps must lie in"),
    ],
)
def test_refuses_what_cannot_be(overrides, words):
    with pytest.raises((ConfigError, ValueError), match=words):
        config(*overrides)
