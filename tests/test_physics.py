"""The physical space: never through a wall, and the same as pymunk's own steps."""

import math

import numpy as np
import pymunk
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numba import njit

from epuckhebb.tmaze.maze import T_MAZE, Pose, boxes
from epuckhebb.tmaze.physics.pymunk import _CLEAR_FOR as CLEAR_FOR
from epuckhebb.tmaze.physics.pymunk import _CLEAR_STEPS as CLEAR_STEPS
from epuckhebb.tmaze.physics.pymunk import COLLISION_SLOP, PymunkSpace, mover, put_back
from epuckhebb.tmaze.robot import EPUCK, STEP_S

RADIUS, WHEEL_RADIUS, MOTOR_LIMIT = EPUCK.radius_m, EPUCK.wheel_radius_m, EPUCK.motor_limit_rad_s
START = T_MAZE.start
move = mover(EPUCK)


@njit
def drive(space, left, right):
    heading = space.state[2]
    move(space, math.cos(heading), math.sin(heading), left, right)


@njit
def put(space, start):
    put_back(space, start.x, start.y, start.heading)


@njit
def gap(pose, walls):
    """Distance [m] from the robot's rim to the nearest wall, negative where it sinks in."""
    beside = np.maximum(np.maximum(walls[:, 0] - pose[0], pose[0] - walls[:, 1]), 0)
    before = np.maximum(np.maximum(walls[:, 2] - pose[1], pose[1] - walls[:, 3]), 0)
    return np.hypot(beside, before).min() - RADIUS


@njit
def least_gap(space, left, right, steps):
    least = np.inf
    for _ in range(steps):
        drive(space, left, right)
        least = min(least, gap(space.state, space.walls))
    return least


def commands(fastest):
    """Wheel speeds [rad/s] and how many steps each lasts."""
    wheel = st.floats(-fastest, fastest)
    return st.lists(st.tuples(wheel, wheel, st.integers(1, 120)), min_size=1, max_size=12)


@given(
    data=st.data(),
    fastest=st.sampled_from([1.0, 4.0, MOTOR_LIMIT]),
    obstacles=st.sampled_from([0, 2, 4]),
    friction=st.sampled_from([0.0, 0.3]),
)
def test_no_command_drives_a_robot_farther_into_a_wall_than_one_step_takes_it(data, fastest, obstacles, friction):
    space = PymunkSpace(boxes(T_MAZE, obstacles), EPUCK, friction)
    space.place_robot(START)
    one_step = fastest * WHEEL_RADIUS * STEP_S  # 0.64 mm as evaluated, 2.6 mm as evolved
    for left, right, steps in data.draw(commands(fastest)):
        assert least_gap(space.handles, left, right, steps) > -1.05 * one_step


@given(driven=commands(4.0))
def test_is_bit_identical_to_pymunk_stepping_always_until_two_walls_are_touched_at_once(driven):
    space, plain = PymunkSpace(boxes(T_MAZE, 4), EPUCK), pymunk.Space()
    space.place_robot(START)
    plain.damping, plain.collision_slop = 0, 1e-4
    for left, right, bottom, top in boxes(T_MAZE, 4).tolist():
        wall = pymunk.Poly(plain.static_body, [(left, bottom), (right, bottom), (right, top), (left, top)])
        wall.friction = 0
        plain.add(wall)
    body = pymunk.Body(EPUCK.mass_kg, EPUCK.inertia_kg_m2)
    body.position, body.angle = START[:2], START.heading
    disc = pymunk.Circle(body, RADIUS)
    disc.friction = 0
    plain.add(body, disc)
    for left, right, steps in driven:
        for _ in range(steps):
            drive(space.handles, left, right)
            force = EPUCK.mass_kg * (WHEEL_RADIUS * (left + right) / 2) / STEP_S
            body.force = (force * math.cos(body.angle), force * math.sin(body.angle))
            body.torque = EPUCK.inertia_kg_m2 * (WHEEL_RADIUS * (right - left) / EPUCK.axle_m) / STEP_S
            plain.step(STEP_S)
            now = (*body.position, body.angle, *body.velocity, body.angular_velocity)
            touched = []
            body.each_arbiter(touched.append)
            if len(touched) > 1:  # pymunk solves two contacts in an order that depends on the past: docs/contribute.md
                return
            np.testing.assert_array_equal(space.handles.state[:6], now)


def test_a_robot_that_bumps_into_a_wall_moves_as_if_pymunk_were_never_skipped():
    """Beside one wall: two contacts are solved in an order that depends on the past. Bumps are 0 to 8 steps apart."""
    draw, wall, skipped = np.random.default_rng(3), np.array([[0.0, 0.1, -1.0, 1.0]]), 0
    skips, always = (PymunkSpace(wall, EPUCK, 0.1) for _ in range(2))
    for _ in range(60):
        start = Pose(-RADIUS - draw.uniform(0.0, 0.003), 0.0, draw.uniform(-0.5, 0.5))
        skips.place_robot(start)
        always.place_robot(start)
        for _ in range(8):
            left, right = draw.uniform(-4.0, 4.0, 2) + draw.choice([-2.0, 4.0])
            for _ in range(draw.integers(1, 9)):
                always.handles.state[CLEAR_FOR] = 0.0  # it never believes to be free
                skipped += skips.handles.state[CLEAR_FOR] >= CLEAR_STEPS
                drive(skips.handles, left, right)
                drive(always.handles, left, right)
                np.testing.assert_array_equal(skips.handles.state[:6], always.handles.state[:6])
    assert skipped > 300


def drive_into_a_wall(space):
    """Drive a robot from the start until it is so deep in a wall that pymunk will push it out in the next step."""
    space.place_robot(START)
    while gap(space.handles.state, space.handles.walls) > -COLLISION_SLOP:
        drive(space.handles, 4.0, 3.7)


@pytest.mark.parametrize("start", [START, None], ids=["at the start", "where it was"])
@pytest.mark.parametrize("way", ["a new lifetime", "a new trial"])
def test_a_robot_that_is_placed_feels_nothing_of_what_was_before(start, way):
    fresh, used = (PymunkSpace(boxes(T_MAZE, 0), EPUCK, 0.1) for _ in range(2))
    drive_into_a_wall(used)
    start = start or Pose(*used.handles.state[:3].tolist())
    fresh.place_robot(start)
    if way == "a new lifetime":
        used.place_robot(start)
    else:
        put(used.handles, start)
    for _ in range(400):
        for space in (fresh, used):
            drive(space.handles, 3.9, 4.0)
        np.testing.assert_array_equal(fresh.handles.state[:6], used.handles.state[:6])


def test_straight_ahead_at_a_wheel_speed_of_1_is_2_cm_a_second():
    space = PymunkSpace(boxes(T_MAZE, 0), EPUCK)
    space.place_robot(START)
    for _ in range(101):  # the first step only takes up speed
        drive(space.handles, 1.0, 1.0)
    assert space.handles.state[1] - START.y == pytest.approx(0.020 * 100 * STEP_S, rel=1e-12)


def test_friction_of_a_wall_holds_a_robot_back_and_turns_it():
    """A robot that heads 45 degrees into a wall on its right slides along it, by less the more the wall rubs."""
    slid, turned = [], []
    for friction in (0.0, 0.1, 0.3):
        space = PymunkSpace(np.array([[0.0, 0.1, -1.0, 1.0]]), EPUCK, friction)
        space.place_robot(Pose(-RADIUS, 0.0, math.pi / 4))
        for _ in range(20):
            drive(space.handles, 1.0, 1.0)
        slid.append(space.handles.state[1])
        turned.append(space.handles.state[2] - math.pi / 4)
    assert slid[0] == pytest.approx(0.020 * math.sqrt(0.5) * 19 * STEP_S, rel=0.05)
    assert slid[0] > slid[1] > slid[2] > 0
    assert 0 == turned[0] > turned[1] > turned[2]  # towards the wall


def test_a_space_takes_over_a_robot_as_it_moves():
    walls, path = boxes(T_MAZE, 0), []
    one, two = PymunkSpace(walls, EPUCK), PymunkSpace(walls, EPUCK)
    for change_at in (None, 57):
        space = one
        space.place_robot(START)
        for step in range(200):
            if step == change_at:
                two.take_over(one)
                space = two
            drive(space.handles, 3.0, 2.9)
        path.append(space.handles.state[:6].copy())
    np.testing.assert_allclose(path[0], path[1], rtol=0, atol=1e-12)


def test_a_space_takes_over_a_robot_that_leans_on_a_wall():
    walls, path = boxes(T_MAZE, 0), []
    one, two = PymunkSpace(walls, EPUCK), PymunkSpace(walls, EPUCK)
    for change_at in (None, 300):
        space = one
        space.place_robot(START)
        for step in range(500):
            if step == change_at:
                assert gap(space.handles.state, walls) < 0
                two.take_over(one)
                space = two
            drive(space.handles, 3.0, 2.7)
        path.append(space.handles.state[:6].copy())
    np.testing.assert_allclose(path[0], path[1], rtol=0, atol=1e-3)  # what it touched is found out anew
