"""Light, infra-red, rays and noise, against the figures of the e-puck and of Webots."""

import math
from types import SimpleNamespace

import numba
import numpy as np
import pymunk
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from epuckhebb.controller import random
from epuckhebb.tmaze.light import Lamp, irradiance, lights, reading
from epuckhebb.tmaze.maze import T_MAZE, boxes
from epuckhebb.tmaze.physics.pymunk import PYMUNK
from epuckhebb.tmaze.robot import EPUCK, Robot
from epuckhebb.tmaze.senses import blinding, largest_distance_reading, sense_workspace, senses
from epuckhebb.tmaze.sensors import (
    CurvePoint,
    DistanceSensors,
    LightSensors,
    Place,
    cast,
    put_rays,
)

WALLS, START = boxes(T_MAZE, 4), T_MAZE.start
echo = EPUCK.distance.echo()
bits, normal_numbers = numba.njit(random.bits), numba.njit(random.normal_numbers(16))  # whole numbers wrap around


def placed(places):
    azimuth = np.radians([place.azimuth for place in places])
    return np.array([[p.x for p in places], [p.y for p in places], np.cos(azimuth), np.sin(azimuth)])


def sensors(x, y, heading, robot=EPUCK):
    rays = np.empty((6, robot.distance.count))
    with np.errstate(divide="ignore", over="ignore"):
        put_rays(None, x, y, math.cos(heading), math.sin(heading), placed(robot.distance.places), rays)
    return rays


def felt(x, y, heading, robot=EPUCK, walls=WALLS):
    """The rays of the distance sensors, and how far each runs."""
    rays, distance = sensors(x, y, heading, robot), np.empty(robot.distance.count)
    with np.errstate(invalid="ignore", over="ignore"):
        cast(x, y, rays, robot.distance.count, walls, robot.radius_m + robot.distance.reach_m, distance)
    return rays, distance


@pytest.mark.parametrize(
    ("level", "lamp", "on", "expected"),
    [
        (1.0, Lamp(), False, [0, 0, 0, 1, 1, 1, 1, 0.27]),
        (0.1, Lamp(), False, [0.85, 0.83, 0.87, 1, 1, 1, 1, 0.93]),
        (1.0, Lamp(), True, [0, 0, 0, 1, 1, 1, 0, 0]),
        (0.1, Lamp(), True, [0, 0, 0, 1, 1, 1, 0, 0]),
    ],
    ids=["bright", "dim", "bright with lamp", "dim with lamp"],
)
def test_light_readings_at_the_start(level, lamp, on, expected):
    lit, rays = lights(level, lamp, on), sensors(*START)
    seen = [reading(irradiance(*rays[:4, i], lit)) for i in range(8)]
    assert seen == pytest.approx(expected, abs=0.006)


def test_a_sensor_outside_the_beam_does_not_see_the_lamp():
    narrow = lights(0.0, Lamp(x_m=0.1, y_m=0.0, beam_rad=0.8), True)
    assert irradiance(-0.1, 0.0, 1.0, 0.0, narrow) > 2
    assert irradiance(0.05, 0.2, 0.0, -1.0, narrow) == 1.0


@pytest.mark.parametrize(
    ("apparent", "value"), [(0.0, 4095), (0.005, 2133.33), (0.0075, 1799.53), (0.03, 234.93), (0.0699999, 67.19)]
)
def test_echo_follows_the_table(apparent, value):
    assert echo(apparent / EPUCK.distance.stretch)[0] == pytest.approx(value, rel=1e-5)


@pytest.mark.parametrize("distance", [EPUCK.distance.reach_m, 0.06, math.inf])
def test_nothing_in_reach_gives_the_last_row(distance):
    assert echo(distance) == (67.19, 0.04897)


def test_a_robot_centred_in_the_corridor_feels_both_sides_alike():
    _, distance = felt(-0.25, 0.15990, 0.0)
    assert echo(distance[2])[0] / 2000 == pytest.approx(0.14, abs=0.005)
    assert echo(distance[2])[0] == pytest.approx(echo(distance[5])[0], rel=0.01)


@pytest.fixture(scope="module")
def space():
    space = pymunk.Space()
    for left, right, bottom, top in WALLS.tolist():
        space.add(pymunk.Poly(space.static_body, [(left, bottom), (right, bottom), (right, top), (left, top)]))
    return space


@pytest.mark.parametrize("kind", ["epuck", "lidar"])
@given(x=st.floats(-0.4, 0.4), y=st.floats(-0.4, 0.4), heading=st.floats(-7, 7))
def test_rays_agree_with_pymunk(space, lidar, kind, x, y, heading):
    robot = EPUCK if kind == "epuck" else lidar
    rays, distance = felt(x, y, heading, robot)
    for i in range(robot.distance.count):
        start = rays[:2, i]
        gap = space.point_query_nearest(tuple(start), 1.0, pymunk.ShapeFilter())
        assume(gap is not None and gap.distance > 1e-9)  # pymunk says nothing useful of a ray that starts in a wall
        hit = space.segment_query_first(
            tuple(start), tuple(start + robot.distance.reach_m * rays[2:4, i]), 0, pymunk.ShapeFilter()
        )
        if hit is None:
            assert distance[i] > robot.distance.reach_m - 1e-9
        else:
            assert distance[i] == pytest.approx(hit.alpha * robot.distance.reach_m, abs=1e-9)


def sensed(robot, x, y, heading, lit, level=0.0, walls=WALLS):
    readings, noise = np.zeros(robot.inputs), np.ones(random.noise_workspace_size(robot.inputs))
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        space, workspace = SimpleNamespace(walls=walls), sense_workspace(robot, PYMUNK)
        senses(robot, PYMUNK)(x, y, math.cos(heading), math.sin(heading), space, lit, noise, level, workspace, readings)
    return readings


def test_both_kinds_of_sensor_are_read_where_they_are(lidar):
    lit = lights(0.1, Lamp(), True)
    own, ring = sensed(EPUCK, *START, lit), sensed(lidar, *START, lit)
    assert own.shape == (16,)
    assert ring.shape == (32,)
    np.testing.assert_allclose(own[:8], ring[:8], rtol=0, atol=1e-15)  # its light sensors are the same
    _, distance = felt(*START, lidar)
    distances, values, _ = zip(*lidar.distance.curve, strict=True)
    expected = np.interp(distance, distances, values)
    np.testing.assert_allclose(ring[8:], expected, rtol=0, atol=1e-12)
    assert largest_distance_reading(lidar)(np.append(ring, 5.0)) == ring[8:].max()
    assert largest_distance_reading(EPUCK)(np.append(own, 5.0)) == own[8:].max()


def test_noise_is_a_share_of_what_is_read():
    lit = lights(0.1, Lamp(), False)
    still, noisy = sensed(EPUCK, *START, lit), sensed(EPUCK, *START, lit, 1.0)
    np.testing.assert_allclose(noisy[:8], np.minimum(1.0, still[:8] * 1.01), rtol=1e-12)
    fractions = [echo(d)[1] for d in felt(*START)[1]]
    np.testing.assert_allclose(noisy[8:], still[8:] * (1 + np.array(fractions)), rtol=1e-12)


def test_a_blind_place_feels_the_dark_and_no_wall(lidar):
    for numbers in ([], [0], [7, 2]):
        readings, expected = np.full(16, 0.5), np.full(16, 0.5)
        blinding(EPUCK)(readings, np.array(numbers, int))
        for number in numbers:
            expected[[number, 8 + number]] = 1.0, 0.0
        assert (readings == expected).all()
    readings = np.full(32, 0.5)
    blinding(lidar)(readings, np.array([20]))  # there is no light sensor of this number
    assert readings[28] == 0.0
    assert (np.delete(readings, 28) == 0.5).all()


AHEAD = Place(0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Robot(radius_m=0.0), r"robot\.radius_m must be more than 0, got 0.0"),
        (lambda: DistanceSensors(reach_m=math.inf), r"robot\.reach_m must"),
        (lambda: DistanceSensors(reach_m=0.1), r"robot\.reach_m must lie in \(0, 0\.056\]"),
        (lambda: DistanceSensors(reach_m=0.06), r"robot\.reach_m must lie in \(0, 0\.056\], got 0\.06"),
        (lambda: LightSensors(places=()), r"robot\.light_places must hold one sensor or more"),
        (
            lambda: Robot(sensors=(LightSensors(), DistanceSensors(places=(Place(0.05, 0.0, 0.0),)))),
            r"robot\.distance_places\[0\] is not within",
        ),
        (lambda: curved((0.0, 1.0, 0.0)), r"robot\.distance_curve must be rows of growing distance"),
        (lambda: curved((0.1, 1.0, 0.0), (0.2, 0.0, 0.0)), "the first at 0"),
        (lambda: Robot(sensors=(LightSensors(),)), "must be light, distance and perhaps others, each once, got"),
        (lambda: Robot(sensors=(LightSensors(), DistanceSensors(), LightSensors())), "each once, got"),
    ],
)
def test_impossible_robots_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def curved(*points):
    return DistanceSensors(curve=tuple(CurvePoint(*point) for point in points))


def test_noise_is_standard_normal_and_uncorrelated():
    draws, out = [], np.empty(16)
    for step in range(20_000):
        normal_numbers(np.uint64(3), step, out)
        draws.append(out.copy())
    draws = np.array(draws)
    assert np.abs(draws.mean(axis=0)).max() < 4 / math.sqrt(len(draws))
    assert draws.std() == pytest.approx(1, abs=0.003)
    assert (draws**4).mean() == pytest.approx(3, abs=0.05)
    assert np.abs(np.corrcoef(draws.T) - np.eye(16)).max() < 0.035
    assert abs(np.corrcoef(draws[:-1].ravel(), draws[1:].ravel())[0, 1]) < 0.01


def test_noise_depends_on_key_and_step_alone():
    first, again, other = np.empty(16), np.empty(16), np.empty(16)
    normal_numbers(np.uint64(5), 77, first)
    normal_numbers(np.uint64(6), 77, other)
    normal_numbers(np.uint64(5), 77, again)
    assert (first == again).all()
    assert (first != other).all()


def test_splitmix64_gives_its_published_numbers():
    # The first outputs of the reference implementation for the seed 1234567.
    expected = [6457827717110365317, 3203168211198807973, 9817491932198370423]
    assert [int(bits(np.uint64(1234567), np.uint64(n))) for n in range(3)] == expected


@pytest.mark.parametrize(
    ("key", "value"),
    [("x_m", math.nan), ("towards_y", math.inf), ("beam_rad", 0.0), ("beam_rad", 4.0), ("intensity", -1.0)],
)
def test_impossible_lamps_are_refused_by_name(key, value):
    with pytest.raises(ValueError, match=rf"scenario\.lamp\.{key} must"):
        Lamp(**{key: value})


def test_a_lamp_must_shine_some_way_and_its_length_does_not_matter():
    with pytest.raises(ValueError, match="must not both be 0"):
        Lamp(towards_x=0.0, towards_y=0.0)
    assert lights(0.1, Lamp(towards_x=-5.0), True) == lights(0.1, Lamp(), True)
    behind, ahead = (irradiance(0.0, 0.0, 0.0, 1.0, lights(0.0, Lamp(0.0), True)) for Lamp in (facing(1), facing(-1)))
    assert (behind, ahead) == (1.0, 3.0)


def facing(towards):
    return lambda x: Lamp(x_m=x, y_m=1.0, towards_x=0.0, towards_y=towards, beam_rad=0.5)
