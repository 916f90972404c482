"""Surprise, memory and what follows: no plasticity where nothing has changed."""

import math

import numpy as np
import pytest
import reference
from hypothesis import given
from hypothesis import strategies as st

from epuckhebb.sim import surprise as signals
from epuckhebb.sim.epuck import MOTOR_LIMIT, STEP_S, WHEEL_RADIUS
from epuckhebb.sim.fitness import Signal
from epuckhebb.sim.lifetime import Life, Lifetime, live_block
from epuckhebb.sim.maze import GOAL_RADIUS, GOALS, SIDES
from epuckhebb.sim.memory import REPEATS, remember
from epuckhebb.sim.plasticity import Hebbian, Sign
from epuckhebb.sim.scenario import Scenario
from epuckhebb.sim.surprise import Remembered, Surprise

FAST = {"gain_rad_s": 4.0, "record_every": 1}


@pytest.fixture(scope="module")
def master(genomes):
    """A genome that reaches the left goal in the base world, and what it remembers at four times the pace."""
    for genome in genomes:
        memory = remember(genome, Scenario(), 4.0)
        if memory.success[0] == 1:
            return genome, memory
    raise AssertionError("none of the checked genomes reaches the left goal")


def live(genome, hebbian, memory=None, scenario=None, side="left", seconds=62, key=5):
    more = {} if memory is None else {"remembered": memory.of(side)}
    life = Life(genome=genome, side=side, hebbian=hebbian, key=np.uint64(key), record=True, **more)
    return live_block([life], scenario or Scenario(), Lifetime(duration_s=seconds, **FAST))[0]


def test_lateness_compares_with_the_way_there_and_then_with_excursions():
    assert signals.lateness(60.0, False, 50.0, 20.0) == 1.2
    assert signals.lateness(30.0, True, 50.0, 20.0) == 1.5
    assert signals.lateness(4.0, True, 50.0, 0.0) == 0.8  # five seconds away are not worth noticing
    for arrived in (False, True):
        assert math.isnan(signals.lateness(60.0, arrived, math.nan, 0.0))


def test_shortfall_is_what_is_missing_at_this_time_of_life():
    remembered = np.array([0.4, 0.6])
    assert signals.shortfall(0.9, 0.3, remembered) == pytest.approx(0.1)
    assert signals.shortfall(1.0, 0.3, remembered) == pytest.approx(0.3)
    assert signals.shortfall(99.0, 0.7, remembered) == pytest.approx(-0.1)


def test_novelty_counts_spreads_from_the_likelier_memory():
    mean, spread = np.array([np.full(16, 0.2), np.full(16, 0.8)]), np.full((2, 16), 0.09)
    assert signals.novelty(np.full(17, 0.7), mean, spread) == pytest.approx(1.0)
    assert signals.novelty(np.full(17, 0.2), mean, spread) == pytest.approx(0.0)


@given(st.floats(-10, 10), st.floats(-5, 5), st.floats(0, 5))
def test_need_is_nothing_within_tolerance_and_grows_to_one(signal, tolerance, ramp):
    need = signals.need(signal, tolerance, ramp)
    assert 0 <= need <= 1
    assert (need == 0) == (signal <= tolerance) or need == pytest.approx(0)
    if signal >= tolerance + ramp and signal > tolerance:
        assert need == pytest.approx(1.0, abs=1e-6)
    assert signals.need(math.nan, tolerance, ramp) == 0


def test_spells_and_rests_take_turns():
    resting = [signals.resting(second, 2.0, 3.0) for second in range(8)]
    assert resting == [False, False, True, True, True, False, False, True]
    assert not signals.resting(1e9, 0.0, 0.0)


@pytest.mark.parametrize("signal", list(Signal))
@pytest.mark.parametrize("sign", [Sign.hebbian, Sign.anti])
def test_always_in_need_is_the_papers_rule_bit_for_bit(genomes, signal, sign):
    paper = {"N": 0.002, "signal": signal, "sign": sign}
    never_content = {"surprise": Surprise.novelty, "tolerance": -1.0}  # novelty is never negative, so g = 1
    nothing = Remembered(math.nan, 0.0, np.zeros(1), np.zeros((2, 16)), np.ones((2, 16)))
    for genome in genomes[:3]:
        lives = [
            Life(genome=genome, side="right", hebbian=Hebbian(**paper, **more), key=np.uint64(3), remembered=nothing)
            for more in ({}, never_content)
        ]
        lives = [Life(**{**vars(life), "record": True}) for life in lives]
        (one, by_paper), (other, by_need) = live_block(lives, Scenario(obstacles=4), Lifetime(duration_s=8, **FAST))
        assert math.isnan(one.time_to_goal)  # at the goal there is no need
        assert np.array(one).tobytes() == np.array(other).tobytes()
        for name in set(by_paper._fields) - {"surprise"}:
            assert getattr(by_paper, name).tobytes() == getattr(by_need, name).tobytes(), name
        assert by_paper.weight_change[-1] > 0


def test_nothing_changed_nothing_learnt(master):
    genome, memory = master
    eager = Hebbian(N=0.01, surprise=Surprise.lateness, tolerance=1.0001)
    for key in range(3):
        outcome, samples = live(genome, eager, memory, key=key)
        without, alone = live(genome, Hebbian(), key=key)
        if outcome.time_to_goal <= memory.time_to_goal_s[0]:
            assert samples.pose.tobytes() == alone.pose.tobytes()
            assert outcome.weight_change_mean == without.weight_change_mean == 0


def test_late_is_plastic_and_the_goal_makes_forget(master):
    genome, memory = master
    soon = Hebbian(N=1e-4, surprise=Surprise.lateness, tolerance=0.5)
    _, samples = live(genome, soon, memory)
    goal = np.array(GOALS["left"])
    at_goal = np.hypot(*(samples.pose[:, :2] - goal).T) < GOAL_RADIUS
    assert at_goal.any()
    before = ~np.logical_or.accumulate(at_goal)
    late = before & (samples.surprise > 0.5)
    assert (samples.rate[late] > 0).all()
    assert (samples.rate[before & ~late] == 0).all()
    assert samples.weight_change[late].max() > 0
    assert (samples.weight_change[at_goal] == 0).all()
    birth = np.clip(genome, -2, 2).astype(np.float32)
    assert (samples.weights[at_goal] == birth).all()


@pytest.mark.parametrize(
    ("surprise", "tolerance"), [(Surprise.lateness, 0.3), (Surprise.shortfall, 0.02), (Surprise.novelty, 0.6)]
)
@pytest.mark.parametrize("fault", [{}, {"dead_sensor": 0}, {"left_wheel": 0.9}, {"obstacles": 4, "layout": 2}])
def test_agrees_with_the_oracle(master, surprise, tolerance, fault):
    genome, memory = master
    scenario = Scenario(**fault)
    hebbian = Hebbian(N=0.001, surprise=surprise, tolerance=tolerance, ramp=0.2, spell_s=2, rest_s=1)
    outcome, samples = live(genome, hebbian, memory, scenario, side="right", seconds=16)
    robot = reference.Robot(genome, scenario, "right", hebbian, gain=4, key=np.uint64(5), remembered=memory.of("right"))
    expected, steps = reference.live(robot, 500)
    np.testing.assert_allclose(samples.pose, [s[:3] for s in steps], rtol=0, atol=1e-7)
    np.testing.assert_allclose(samples.sensors, [s[3] for s in steps], rtol=0, atol=1e-6)
    np.testing.assert_allclose(samples.rate, [s[8] for s in steps], rtol=0, atol=1e-8)
    np.testing.assert_allclose(samples.weight_change, [s[9] for s in steps], rtol=1e-5, atol=1e-9)
    np.testing.assert_allclose(outcome, expected, rtol=1e-6, atol=1e-7)
    assert samples.surprise[-1] == pytest.approx(robot.surprise, abs=1e-6)


def test_motor_noise_shakes_only_the_surprised(master):
    genome, memory = master
    calm = Hebbian(surprise=Surprise.lateness, tolerance=2.0, motor_noise=2.0)
    shaken = Hebbian(surprise=Surprise.lateness, tolerance=0.2, motor_noise=2.0)
    _, alone = live(genome, Hebbian(), seconds=20)
    assert live(genome, calm, memory, seconds=20)[1].pose.tobytes() == alone.pose.tobytes()
    _, samples = live(genome, shaken, memory, seconds=20)
    parts = np.flatnonzero((samples.pose != alone.pose).any(axis=1))[0]
    assert samples.surprise[parts - 3] <= 0.2 <= samples.surprise[parts]
    assert samples.weight_change.max() == 0


def test_shaken_wheels_turn_no_faster_than_the_motors_can(master):
    genome, memory = master
    wild = Hebbian(surprise=Surprise.lateness, tolerance=0.0, motor_noise=1000.0)
    _, samples = live(genome, wild, memory, seconds=10)
    driven = np.hypot(*np.diff(samples.pose[:, :2], axis=0).T)
    assert 0.9 < driven.max() / (MOTOR_LIMIT * WHEEL_RADIUS * STEP_S) < 1.001


def test_memory_is_of_the_lives_it_was_made_of(master):
    genome, memory = master
    again = remember(genome, Scenario(), 4.0, threads=2)
    for name, value in vars(memory).items():
        np.testing.assert_array_equal(value, getattr(again, name))
    assert memory.success.shape == (2,)
    assert 0 < memory.time_to_goal_s[0] < 62.5
    assert memory.fitness.shape == (2, 63)
    assert ((memory.fitness >= 0) & (memory.fitness <= 1)).all()
    assert ((memory.reading_mean >= 0) & (memory.reading_mean <= 1)).all()
    lit, unlit = memory.reading_mean[1, :8].mean(), memory.reading_mean[0, :8].mean()
    assert lit < unlit  # low when bright
    assert REPEATS == 10


def test_a_champion_that_never_arrives_is_never_late():
    memory = remember(np.zeros(234), Scenario(), 4.0)
    assert np.isnan(memory.time_to_goal_s).all()
    assert (memory.away_s == 0).all()
    hebbian = Hebbian(N=0.1, surprise=Surprise.lateness)
    outcome, samples = live(np.zeros(234), hebbian, memory, seconds=10)
    assert outcome.weight_change_final == 0
    assert np.isnan(samples.surprise).all()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"tolerance": math.nan}, "hebbian.tolerance must be a finite number"),
        ({"ramp": -1.0}, "hebbian.ramp must be 0 or more"),
        ({"rest_s": 3.0}, "needs hebbian.spell_s"),
        ({"motor_noise": 1.0}, "needs hebbian.surprise"),
    ],
)
def test_what_cannot_be_is_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        Hebbian(**settings)


def test_the_sides_remember_apart(master):
    _, memory = master
    for k, side in enumerate(SIDES):
        own = memory.of(side)
        assert own.away == memory.away_s[k]
        np.testing.assert_array_equal(own.fitness, memory.fitness[k])
