"""The physical world: never through a wall, and the same as pymunk's own steps."""

import math

import numpy as np
import pymunk
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numba import njit

from epuckhebb.sim.epuck import AXLE, INERTIA, MASS, MOTOR_LIMIT, RADIUS, STEP_S, WHEEL_RADIUS
from epuckhebb.sim.maze import GOALS, START, boxes, in_correct_arm
from epuckhebb.sim.world import World, move


@njit
def drive(world, left, right):
    heading = world.state[2]
    move(world, math.cos(heading), math.sin(heading), left, right)


@njit
def gap(pose, walls):
    """Distance [m] from the robot's rim to the nearest wall, negative where it sinks in."""
    beside = np.maximum(np.maximum(walls[:, 0] - pose[0], pose[0] - walls[:, 1]), 0)
    before = np.maximum(np.maximum(walls[:, 2] - pose[1], pose[1] - walls[:, 3]), 0)
    return np.hypot(beside, before).min() - RADIUS


@njit
def least_gap(world, left, right, steps):
    least = np.inf
    for _ in range(steps):
        drive(world, left, right)
        least = min(least, gap(world.state, world.walls))
    return least


def commands(fastest):
    """Wheel speeds [rad/s] and how many steps each lasts."""
    wheel = st.floats(-fastest, fastest)
    return st.lists(st.tuples(wheel, wheel, st.integers(1, 120)), min_size=1, max_size=12)


@settings(deadline=None, max_examples=60)
@given(data=st.data(), fastest=st.sampled_from([1.0, 4.0, MOTOR_LIMIT]), obstacles=st.sampled_from([0, 2, 4]))
def test_no_command_drives_a_robot_farther_into_a_wall_than_one_step_takes_it(data, fastest, obstacles):
    world = World(boxes(obstacles))
    world.place_robot(START)
    one_step = fastest * WHEEL_RADIUS * STEP_S  # 0.64 mm as evaluated, 2.6 mm as evolved
    for left, right, steps in data.draw(commands(fastest)):
        assert least_gap(world.handles, left, right, steps) > -1.05 * one_step


@settings(deadline=None, max_examples=40)
@given(driven=commands(4.0))
def test_agrees_with_pymunk_stepping_always(driven):
    world, space = World(boxes(4)), pymunk.Space()
    world.place_robot(START)
    space.damping, space.collision_slop = 0, 1e-4
    for left, right, bottom, top in boxes(4).tolist():
        wall = pymunk.Poly(space.static_body, [(left, bottom), (right, bottom), (right, top), (left, top)])
        wall.friction = 0
        space.add(wall)
    body = pymunk.Body(MASS, INERTIA)
    body.position, body.angle = START[:2], START.heading
    disc = pymunk.Circle(body, RADIUS)
    disc.friction = 0
    space.add(body, disc)
    for left, right, steps in driven:
        for _ in range(steps):
            drive(world.handles, left, right)
            force = MASS * (WHEEL_RADIUS * (left + right) / 2) / STEP_S
            body.force = (force * math.cos(body.angle), force * math.sin(body.angle))
            body.torque = INERTIA * (WHEEL_RADIUS * (right - left) / AXLE) / STEP_S
            space.step(STEP_S)
            now = (*body.position, body.angle, *body.velocity, body.angular_velocity)
            np.testing.assert_allclose(world.handles.state[:6], now, rtol=0, atol=1e-9)


def test_a_new_robot_feels_nothing_of_the_last():
    fresh, used = World(boxes(0)), World(boxes(0))
    used.place_robot(START)
    for _ in range(400):
        drive(used.handles, 4.0, 3.7)
    for world in (fresh, used):
        world.place_robot(START)
        for _ in range(400):
            drive(world.handles, 3.9, 4.0)
    np.testing.assert_array_equal(fresh.handles.state, used.handles.state)


def test_straight_ahead_at_a_wheel_speed_of_1_is_2_cm_a_second():
    world = World(boxes(0))
    world.place_robot(START)
    for _ in range(101):  # the first step only takes up speed
        drive(world.handles, 1.0, 1.0)
    assert world.handles.state[1] - START.y == pytest.approx(0.020 * 100 * STEP_S, rel=1e-12)


@pytest.mark.parametrize(("side", "sign"), [("left", -1), ("right", 1)])
def test_the_correct_arm_is_the_one_with_the_goal(side, sign):
    goal_x = GOALS[side][0]
    assert in_correct_arm(sign * 0.09, 0.11, goal_x)
    assert not in_correct_arm(-sign * 0.09, 0.11, goal_x)
    assert not in_correct_arm(sign * 0.09, 0.09, goal_x)
    assert not in_correct_arm(sign * 0.07, 0.11, goal_x)


def test_obstacles_leave_3_mm_on_each_side():
    walls = boxes(4)
    left_arm_gap = walls[0, 2] - walls[9, 3]
    stem_gap = walls[12, 0] - walls[11, 1]
    assert left_arm_gap == pytest.approx(0.080, abs=5e-4)
    assert stem_gap == pytest.approx(0.080, abs=5e-4)
