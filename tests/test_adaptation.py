"""Signals of change, nominal statistics and the gate: no plasticity where nothing has changed."""

import math
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from cases import first_of
from hypothesis import given
from hypothesis import strategies as st

from epuckhebb.adaptation.adaptation import Adaptation, Exploration
from epuckhebb.adaptation.change_signal import SignalContext, no_nominal, signal_function, update_recent
from epuckhebb.adaptation.change_signals.late import Late
from epuckhebb.adaptation.change_signals.novelty import Novelty
from epuckhebb.adaptation.change_signals.shortfall import Shortfall
from epuckhebb.adaptation.exploration import wall_exploration
from epuckhebb.adaptation.gate import need, resting
from epuckhebb.adaptation.nominal import REPEATS, measure_nominal
from epuckhebb.adaptation.wall_following import _sensors, wall_following
from epuckhebb.controller.plasticity.control import Sign, signs
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.tmaze.batch import run_lifetimes
from epuckhebb.tmaze.fitness import Signal
from epuckhebb.tmaze.individual import GA_ALONE, Controller, Individual
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.light import Lamp
from epuckhebb.tmaze.maze import SIDES, T_MAZE
from epuckhebb.tmaze.robot import EPUCK, STEP_S
from epuckhebb.tmaze.scenario import Scenario

FAST = {"gain_rad_s": 4.0, "record_every": 1}
NOTHING = no_nominal(16, 8)
late, novelty, shortfall = (partial(signal_function(kind), state=None) for kind in (Late, Novelty, Shortfall))


def controller(N=0.0, signal=Signal.behaviour, sign=Sign.hebbian, **adaptation):
    return Controller(name="x", rule=Paper(N=N, signal=signal, sign=sign), adaptation=Adaptation(**adaptation))


@pytest.fixture(scope="module")
def champion(genomes):
    """A genome that reaches the left goal in the base world, and its nominal statistics at wheel gain 4."""
    for genome in genomes:
        nominal = measure_nominal(genome, Scenario(), 4.0)
        if nominal.success[0] == 1:
            return genome, nominal
    raise AssertionError("none of the checked genomes reaches the left goal")


def live(genome, controller, nominal=None, scenario=None, side="left", seconds=62, key=5):
    individual = Individual(
        genes=genome,
        side=side,
        controller=controller,
        key=np.uint64(key),
        record=True,
        nominal=None if nominal is None else nominal.statistics(side),
    )
    return run_lifetimes([individual], scenario or Scenario(), Lifetime(duration_s=seconds, **FAST))[0]


def context(time_s=0.0, away_s=0.0, arrived=False, recent=None):
    return SignalContext(time_s, away_s, arrived, np.zeros(17) if recent is None else recent)


def test_late_compares_with_the_way_there_and_then_with_excursions():
    def since(away, arrived, time_to_goal, longest):
        return late(
            context(away_s=away, arrived=arrived), NOTHING._replace(time_to_goal_s=time_to_goal, away_s=longest)
        )

    assert since(60.0, False, 50.0, 20.0) == 1.2
    assert since(30.0, True, 50.0, 20.0) == 1.5
    assert since(4.0, True, 50.0, 0.0) == 0.8  # five seconds away are not worth noticing
    for arrived in (False, True):
        assert math.isnan(since(60.0, arrived, math.nan, 0.0))


def test_shortfall_is_what_is_missing_at_this_time_of_a_lifetime():
    def short(time, recent):
        return shortfall(
            context(time, recent=np.append(np.zeros(16), recent)), NOTHING._replace(fitness=np.array([0.4, 0.6]))
        )

    assert short(0.9, 0.3) == pytest.approx(0.1)
    assert short(1.0, 0.3) == pytest.approx(0.3)
    assert short(99.0, 0.7) == pytest.approx(-0.1)


@pytest.mark.parametrize("inputs", [16, 32])
def test_novelty_counts_spreads_from_the_likelier_lamp(inputs):
    mean, spread = np.array([np.full(inputs, 0.2), np.full(inputs, 0.8)]), np.full((2, inputs), 0.09)
    nominal = no_nominal(inputs, 8)._replace(reading_mean=mean, reading_spread=spread)
    assert novelty(context(recent=np.full(inputs + 1, 0.7)), nominal) == pytest.approx(1.0)
    assert novelty(context(recent=np.full(inputs + 1, 0.2)), nominal) == pytest.approx(0.0)


def test_recent_means_begin_with_the_first_step_and_follow():
    recent = np.full(3, 7.0)
    update_recent(recent, np.array([0.2, 0.4]), 0.6, 0)
    np.testing.assert_allclose(recent, [0.2, 0.4, 0.6], rtol=1e-14)
    update_recent(recent, np.array([1.2, 0.4]), 0.6, 1)
    np.testing.assert_allclose(recent, [0.2 + 0.032 / 5.032, 0.4, 0.6], rtol=1e-14)


@given(st.floats(-10, 10), st.floats(-5, 5), st.one_of(st.floats(0.2, 1e9), st.just(math.inf)))
def test_need_is_nothing_up_to_the_threshold_and_grows_to_one(signal, threshold, slope):
    g = need(signal, threshold, slope)
    assert 0 <= g <= 1
    assert (g == 0) == (signal <= threshold) or g == pytest.approx(0)
    if signal >= threshold + 1 / slope and signal > threshold:
        assert g == pytest.approx(1.0, abs=1e-6)
    assert need(math.nan, threshold, slope) == 0


def test_spells_and_rests_take_turns():
    rests = [resting(second, 2.0, 3.0) for second in range(8)]
    assert rests == [False, False, True, True, True, False, False, True]
    assert not resting(1e9, 0.0, 0.0)


@pytest.mark.thorough
@pytest.mark.parametrize("signal", [one for one in Signal if one is not Signal.fitness])
@pytest.mark.parametrize("sign", [Sign.hebbian, Sign.anti])
def test_always_in_need_is_the_papers_rule_bit_for_bit(genomes, signal, sign):
    paper = {"N": 0.002, "signal": signal, "sign": sign}
    always_in_need = {"change_signal": "novelty", "threshold": -1.0}  # novelty is never negative, so g = 1
    of_updates = signs(sign, 234, np.random.default_rng(0))
    for genome in genomes[:3]:
        individuals = [
            Individual(
                genes=genome,
                side="right",
                controller=controller(**paper, **more),
                key=np.uint64(3),
                nominal=NOTHING,
                signs=of_updates,
                record=True,
            )
            for more in ({}, always_in_need)
        ]
        arguments = Scenario(obstacles=4), Lifetime(duration_s=8, **FAST)
        (one, by_paper), (other, by_need) = run_lifetimes(individuals, *arguments)
        assert math.isnan(one.time_to_goal)  # at the goal there is no need
        assert np.array(one).tobytes() == np.array(other).tobytes()
        for name in set(by_paper._fields) - {"change_signal"}:
            assert getattr(by_paper, name).tobytes() == getattr(by_need, name).tobytes(), name
        assert by_paper.weight_change[-1] > 0


def test_nothing_changed_nothing_learnt(champion):
    genome, nominal = champion
    eager = controller(0.01, change_signal="late", threshold=1.0001)
    for key in range(3):
        outcome, samples = live(genome, eager, nominal, key=key)
        without, alone = live(genome, GA_ALONE, key=key)
        if outcome.time_to_goal <= nominal.time_to_goal_s[0]:
            assert samples.pose.tobytes() == alone.pose.tobytes()
            assert outcome.weight_change_mean == without.weight_change_mean == 0


def test_a_late_robot_is_plastic_and_the_goal_resets_it(champion):
    genome, nominal = champion
    soon = controller(1e-4, change_signal="late", threshold=0.5)
    _, samples = live(genome, soon, nominal)
    goal = np.array(T_MAZE.goals["left"])
    at_goal = np.hypot(*(samples.pose[:, :2] - goal).T) < T_MAZE.goal_radius_m
    assert at_goal.any()
    before = ~np.logical_or.accumulate(at_goal)
    late = before & (samples.change_signal > 0.5)
    assert (samples.rate[late] > 0).all()
    assert (samples.rate[before & ~late] == 0).all()
    assert samples.weight_change[late].max() > 0
    assert (samples.weight_change[at_goal] == 0).all()
    genes = np.clip(genome, -2, 2).astype(np.float32)
    assert (samples.weights[at_goal] == genes).all()


@pytest.mark.parametrize(
    ("change_signal", "threshold"), first_of([("late", 0.3), ("shortfall", 0.02), ("novelty", 0.6)])
)
@pytest.mark.parametrize(
    "fault",
    [
        {},
        {"dead_sensors": (0,)},
        {"left_wheel": 0.9},
        {"obstacles": 4, "layout": 2},
        {"changes": ({"at_s": 5, "light": 1.0}, {"at_s": 9, "right_wheel": 0.8})},
    ],
)
def test_agrees_with_the_oracle(champion, beside_the_oracle, change_signal, threshold, fault):
    genome, nominal = champion
    gated = controller(0.001, change_signal=change_signal, threshold=threshold, slope=5.0, active_s=2, rest_s=1)
    arguments = {"seconds": 16, "nominal": nominal.statistics("right"), "key": 5}
    _, samples, robot = beside_the_oracle(genome, "right", Scenario(**fault), gated, **arguments)
    assert samples.change_signal[-1] == pytest.approx(robot.change_signal, abs=1e-8)


@pytest.mark.thorough
def test_a_robot_with_24_rays_agrees_with_the_oracle(lidar, wide, beside_the_oracle):
    network, genes = wide
    nominal = measure_nominal(genes, Scenario(robot=lidar), 4.0, network=network)
    assert nominal.reading_mean.shape == (2, 32)
    gated = controller(0.001, change_signal="novelty", threshold=0.6, slope=2.0, active_s=4, rest_s=2)
    of_updates = signs(Sign.shuffled, network.synapses, np.random.default_rng(4))
    lamp = Lamp(towards_x=-1.0, towards_y=0.7, beam_rad=1.2)
    world = Scenario(robot=lidar, light=1.0, dead_sensors=(11, 3), lamp=lamp)
    arguments = {"seconds": 60, "nominal": nominal.statistics("right"), "network": network, "signs": of_updates}
    outcome, samples, robot = beside_the_oracle(genes, "right", world, gated, **arguments)
    assert samples.change_signal[-1] == pytest.approx(robot.change_signal, abs=1e-8)
    assert outcome.weight_change_mean > 0


def test_only_a_late_robot_has_motor_noise(champion):
    genome, nominal = champion
    early = controller(change_signal="late", threshold=2.0, motor_noise=2.0)
    noisy = controller(change_signal="late", threshold=0.2, motor_noise=2.0)
    _, alone = live(genome, GA_ALONE, seconds=20)
    assert live(genome, early, nominal, seconds=20)[1].pose.tobytes() == alone.pose.tobytes()
    _, samples = live(genome, noisy, nominal, seconds=20)
    parts = np.flatnonzero((samples.pose != alone.pose).any(axis=1))[0]
    assert samples.change_signal[parts - 3] <= 0.2 <= samples.change_signal[parts]
    assert samples.weight_change.max() == 0


def test_wheels_with_noise_turn_no_faster_than_the_motors_can(champion):
    genome, nominal = champion
    wild = controller(change_signal="late", threshold=0.0, motor_noise=1000.0)
    _, samples = live(genome, wild, nominal, seconds=10)
    driven = np.hypot(*np.diff(samples.pose[:, :2], axis=0).T)
    assert 0.9 < driven.max() / (EPUCK.motor_limit_rad_s * EPUCK.wheel_radius_m * STEP_S) < 1.001


def test_nominal_statistics_are_repeatable_and_plausible(champion):
    genome, nominal = champion
    again = measure_nominal(genome, Scenario(), 4.0, threads=2)
    for name, value in vars(nominal).items():
        np.testing.assert_array_equal(value, getattr(again, name))
    assert nominal.success.shape == (2,)
    assert 0 < nominal.time_to_goal_s[0] < 62.5
    assert nominal.fitness.shape == (2, 63)
    assert ((nominal.fitness >= 0) & (nominal.fitness <= 1)).all()
    assert ((nominal.reading_mean >= 0) & (nominal.reading_mean <= 1)).all()
    lit, unlit = nominal.reading_mean[1, :8].mean(), nominal.reading_mean[0, :8].mean()
    assert lit < unlit  # low when bright
    assert REPEATS == 10


def test_a_champion_that_never_arrives_is_never_late():
    nominal = measure_nominal(np.zeros(234), Scenario(), 4.0)
    assert np.isnan(nominal.time_to_goal_s).all()
    assert (nominal.away_s == 0).all()
    late = controller(0.1, change_signal="late")
    outcome, samples = live(np.zeros(234), late, nominal, seconds=10)
    assert outcome.weight_change_final == 0
    assert np.isnan(samples.change_signal).all()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"change_signal": "surprise"}, "late, novelty, shortfall"),
        ({"threshold": math.nan}, "adaptation.threshold"),
        ({"slope": 0.0}, "adaptation.slope"),
        ({"slope": -1.0}, "adaptation.slope"),
        ({"motor_noise": -1.0}, "adaptation.motor_noise"),
        ({"change_signal": "late", "rest_s": 3.0}, "adaptation.active_s"),
        ({"motor_noise": 1.0}, "adaptation.motor_noise"),
        ({"threshold": 1.0}, "adaptation.threshold"),
        ({"exploration": Exploration.wall_following}, "adaptation.exploration"),
    ],
)
def test_invalid_settings_are_refused(settings, message):
    with pytest.raises(ValueError, match=message):
        Adaptation(**settings)


def test_each_side_has_its_own_statistics(champion):
    _, nominal = champion
    for k, side in enumerate(SIDES):
        own = nominal.statistics(side)
        assert own.away_s == nominal.away_s[k]
        np.testing.assert_array_equal(own.fitness, nominal.fitness[k])


def test_wall_following_takes_the_nearer_wall_and_keeps_it():
    follow, readings = wall_following(EPUCK), np.zeros(16)
    front, ahead_left, side_left, ahead_right, side_right = (places[0] for places in _sensors(EPUCK))
    readings[[side_left, side_right, ahead_right]] = 0.5, 0.2, 0.4  # together the right is nearer
    hand = np.zeros(1)
    assert follow(readings, hand) == pytest.approx((5.0, 4.75))  # walls on both sides: turn by (0.5 - 0.4) / 2
    assert hand[0] == -1.0
    readings[[side_left, side_right, ahead_right]] = 0.9, 0.2, 0.0
    assert follow(readings, hand) == pytest.approx((5.0, 4.0))  # still the right: turn by 2 (0.3 - 0.2) to it
    assert hand[0] == -1.0
    hand[0], readings[[side_left, ahead_left]] = 0.0, (0.2, 0.0)
    follow(readings, hand)
    assert hand[0] == 1.0  # as near as the other
    readings[front] = 0.4
    assert follow(readings, hand) == pytest.approx((5.0, -5.0))  # on the spot, away from the left


def test_a_robot_that_explores_no_longer_forgets_its_wall():
    life = SimpleNamespace(
        tally=[SimpleNamespace(exploring=True, noise_left=0.5, noise_right=0.5)],
        activation=np.zeros(16),
        adaptation=SimpleNamespace(hand=np.ones(1)),
    )
    setup = SimpleNamespace(gain=2.0, adaptation=SimpleNamespace(motor_noise=0.0))
    explore = wall_exploration(lambda *_: (4.0, -3.0), 6.28)
    assert explore(life, setup, 0.1, 0.2) == (2.0, -1.5)  # rad/s over the wheel gain
    assert life.adaptation.hand[0] == 1.0
    life.tally[0].exploring = False
    assert explore(life, setup, 0.1, 0.2) == (0.1, 0.2)
    assert life.adaptation.hand[0] == 0.0
