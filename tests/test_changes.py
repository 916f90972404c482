"""A world that changes during a lifetime."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.tmaze.fitness import Signal
from epuckhebb.tmaze.individual import Controller
from epuckhebb.tmaze.maze import Pose, boxes, gap
from epuckhebb.tmaze.robot import EPUCK, STEP_S
from epuckhebb.tmaze.scenario import Scenario

LEARNING = Controller(name="x", rule=Paper(N=0.002, signal=Signal.final))
IN_THE_STEM = Pose(0.007, 0.02, np.pi / 2)  # between where two obstacles can be, 39 mm from one
SAME = {
    "light": 0.1,
    "lamp": {"x_m": 0.1},
    "obstacles": 0,
    "layout": 0,
    "goals": {"left": (-0.36, 0.155)},
    "dead_sensors": [],
    "distance_gain": 1.0,
    "distance_offset": 0.0,
    "sun_turn_deg": 0,
    "second_lamp": None,
    "left_distance_gain": 1.0,
    "crosstalk": 0.0,
    "sensor_levels": 0,
    "sensor_delay_steps": 0,
    "wheel_delay_steps": 0,
    "left_wheel": 1.0,
    "right_wheel": 1.0,
    "left_slip": 0.0,
    "right_slip": 0,
    "mass_ratio": 1.0,
    "wall_friction": 0.0,
}


def changed(*changes, **more):
    return Scenario(changes=changes, **more)


@pytest.mark.thorough
@given(
    times=st.lists(st.floats(0.001, 12), min_size=1, max_size=3, unique=True).map(sorted),
    keys=st.sets(st.sampled_from(list(SAME)), min_size=1),
    side=st.sampled_from(["left", "right"]),
)
def test_a_change_to_the_same_changes_nothing(genomes, run_lifetime, times, keys, side):
    changes = [{"at_s": at_s, **{key: SAME[key] for key in keys}} for at_s in times]
    settings = {"controller": LEARNING, "gain_rad_s": 4}
    plain, other = (
        run_lifetime(genomes[0], side, scenario=scenario, **settings) for scenario in (None, changed(*changes))
    )
    assert np.array(plain[0]).tobytes() == np.array(other[0]).tobytes()
    for name in set(plain[1]._fields) - {"phase_began"}:
        assert getattr(plain[1], name).tobytes() == getattr(other[1], name).tobytes()


# What changes; the sample that tells of it first; how many steps later that is; on which side.
EFFECTS = [
    ({"light": 1.0}, "sensors", 0, "left"),
    ({"lamp": {"intensity": 0.0}}, "sensors", 0, "right"),
    ({"lamp": {"towards_x": 1.0}}, "sensors", 0, "right"),
    ({"dead_sensors": [2]}, "sensors", 0, "left"),
    ({"distance_gain": 0.9}, "sensors", 0, "left"),
    ({"distance_offset": 0.01}, "sensors", 0, "left"),
    ({"sun_turn_deg": 10}, "sensors", 0, "left"),
    ({"second_lamp": [0.0, 0.3, 1.0]}, "sensors", 0, "left"),
    ({"sensor_levels": 16}, "sensors", 0, "left"),
    ({"obstacles": 4}, "sensors", 0, "left"),
    ({"goals": {"left": (-0.30, 0.155)}}, "fitness", 0, "left"),
    ({"left_wheel": 0.5}, "pose", 2, "left"),  # the command of a step moves the robot in the next
    ({"right_wheel": 0.0}, "pose", 2, "left"),
    ({"left_slip": 0.9999}, "pose", 2, "left"),
]


@pytest.mark.parametrize(("change", "seen_in", "later", "side"), EFFECTS)
@pytest.mark.parametrize("at_s", [0.016, 0.017, 1.0, 4.8])
def test_a_change_takes_effect_at_its_step_and_not_before(run_lifetime, constant, change, seen_in, later, side, at_s):
    step = math.ceil(at_s / STEP_S)
    settings = {"start": IN_THE_STEM, "controller": LEARNING, "noise": 0}
    still = constant(0.01, 0.01)
    _, plain = run_lifetime(still, side, scenario=Scenario(), **settings)
    _, other = run_lifetime(still, side, scenario=changed({"at_s": at_s, **change}), **settings)
    for one, two in zip(plain[:-1], other[:-1], strict=True):  # but for when each world began
        assert one[:step].tobytes() == two[:step].tobytes()
    one, two = getattr(plain, seen_in)[step:], getattr(other, seen_in)[step:]
    assert (one[later] != two[later]).any()
    assert one[:later].tobytes() == two[:later].tobytes()


def test_what_changes_after_the_end_changes_nothing(genomes, run_lifetime):
    for at_s in (8.0, 8.01, 1000.0):
        moved = changed({"at_s": at_s, "goals": {"left": (0.0, 0.155)}, "obstacles": 4, "light": 1.0})
        plain, other = (run_lifetime(genomes[0], scenario=scenario)[0] for scenario in (None, moved))
        assert np.array(plain).tobytes() == np.array(other).tobytes()


def test_success_is_measured_at_the_goal_of_the_end(run_lifetime):
    here = changed({"at_s": 4.0, "goals": {"left": IN_THE_STEM[:2]}})
    outcome, samples = run_lifetime(np.zeros(234), scenario=here, start=IN_THE_STEM, noise=0)
    assert outcome.success
    assert outcome.time_to_goal == pytest.approx(4.0 + STEP_S)
    assert outcome.final_distance == pytest.approx(0.0, abs=1e-12)
    assert len(samples.time) == 250


@pytest.mark.parametrize("right", [0.9, 0.6])
def test_new_walls_wait_until_the_robot_is_clear_of_them(run_lifetime, constant, right):
    before, after = boxes(Scenario().maze), boxes(Scenario().maze, 4)
    new = after[len(before) :]
    world = changed({"at_s": 0.5, "obstacles": 4, "light": 0.7})
    settings = {"start": Pose(0.02, 0.0, np.pi / 2), "gain_rad_s": 2.0, "noise": 0, "seconds": 12}
    _, alone = run_lifetime(constant(0.9, right), **settings)
    _, samples = run_lifetime(constant(0.9, right), scenario=world, **settings)
    step = math.ceil(0.5 / STEP_S)
    assert gap(*alone.pose[step, :2], new) < EPUCK.radius_m  # in the way
    assert (samples.sensors[step, :8] != alone.sensors[step, :8]).any()  # the light does not wait
    distances = np.array([gap(x, y, new) for x, y, _ in samples.pose])
    there = np.flatnonzero(
        (samples.pose != alone.pose).any(axis=1) | (samples.sensors != alone.sensors)[:, 8:].any(axis=1)
    )
    clear = np.flatnonzero(distances[step:] >= EPUCK.radius_m)
    appears = step + clear[0] if len(clear) else len(distances)
    assert len(there) == 0 or there[0] >= appears
    assert (distances[appears:] >= EPUCK.radius_m - 0.002).all()
    assert all(gap(x, y, before) >= EPUCK.radius_m - 0.002 for x, y, _ in samples.pose)


def test_a_robot_that_leans_on_an_old_wall_does_not_keep_new_ones_away(run_lifetime, constant):
    beneath = Pose(0.227, 0.1694, np.pi / 2)  # the far wall of an arm, where an obstacle comes from below
    world = changed({"at_s": 3.2, "obstacles": 2})
    _, samples = run_lifetime(constant(), scenario=world, start=beneath, gain_rad_s=4.0, noise=0)
    assert gap(*samples.pose[100, :2], boxes(world.maze)) < EPUCK.radius_m  # leans
    assert (samples.sensors[100, 8:] > samples.sensors[99, 8:] + 0.005).any()


def test_changes_agree_with_the_oracle(genomes, beside_the_oracle):
    world = changed(
        {"at_s": 4.0, "light": 1.0, "wall_friction": 0.3},
        {"at_s": 6.5, "lamp": {"y_m": 0.0, "towards_y": -0.3}, "dead_sensors": [7, 2]},
        {"at_s": 9.0, "obstacles": 4, "left_wheel": 0.8},
        {"at_s": 12.0, "goals": {"right": (0.2, 0.16)}, "dead_sensors": []},
        {"at_s": 15.0, "mass_ratio": 4.0, "right_slip": 0.5},
        {"at_s": 18.0, "mass_ratio": 1.0, "distance_gain": 1.3, "sensor_delay_steps": 20, "wheel_delay_steps": 5},
        {"at_s": 20.0, "obstacles": 2, "layout": 4, "light": 0.2},
    )
    outcome, *_ = beside_the_oracle(genomes[1], "right", world, LEARNING, seconds=40)
    assert outcome.weight_change_final > 0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ([{"at_s": 1.0, "maze": "other"}], r"changes\[0\] must have at_s and some of light, .* got .*maze"),
        ([{"at_s": 1.0}], r"changes\[0\] must have at_s"),
        ([{"at_s": 0.0, "light": 1.0}], r"changes\[0\].at_s must be more than 0, got 0.0"),
        ([{"at_s": 2, "light": 1.0}, {"at_s": 2, "light": 0.5}], r"changes\[1\].at_s must be more than 2"),
        ([{"at_s": 1, "light": -1}], r"changes\[0\]: scenario.light"),
        ([{"at_s": 1, "obstacles": 3}], r"changes\[0\]: scenario.obstacles must be one of 0, 2, 4 .* got 3"),
        ([{"at_s": 1, "lamp": {"brightness": 1}}], r"changes\[0\]: .*brightness"),
        ([{"at_s": 1, "goals": {"up": (0, 0)}}], r"changes\[0\]: goals must be {left"),
        (
            [{"at_s": 1, "dead_sensors": [1, 1]}],
            r"changes\[0\]: scenario.dead_sensors must be different whole numbers.* got \(1, 1\)",
        ),
    ],
)
def test_impossible_changes_are_refused(changes, message):
    with pytest.raises(ValueError, match=message):
        Scenario(changes=changes)


def test_phases_add_up():
    world = changed({"at_s": 1.0, "light": 1.0}, {"at_s": 2.0, "lamp": {"x_m": 0.05}}, {"at_s": 3.0, "light": 0.3})
    steps, worlds = zip(*world.phases, strict=True)
    assert steps == (0, 32, 63, 94)
    assert [(w.light, w.lamp.x_m) for w in worlds] == [(0.1, 0.1), (1.0, 0.1), (1.0, 0.05), (0.3, 0.05)]
    assert not any(w.changes for w in worlds)
