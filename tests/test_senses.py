"""Light, infra-red, rays and noise, against the figures of the e-puck and of Webots."""

import math

import numpy as np
import pymunk
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from epuckhebb.sim import epuck, noise
from epuckhebb.sim.light import Lamp, irradiance, lights, reading
from epuckhebb.sim.maze import START, boxes

WALLS = boxes(4)


def sensors(x, y, heading):
    rays = np.empty((6, 8))
    epuck.sensor_rays(x, y, math.cos(heading), math.sin(heading), rays)
    return rays


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
    assert epuck.echo(apparent / epuck.APPARENT_DISTANCE)[0] == pytest.approx(value, rel=1e-5)


@pytest.mark.parametrize("distance", [epuck.REACH, 0.06, math.inf])
def test_nothing_in_reach_gives_the_last_row(distance):
    assert epuck.echo(distance) == (67.19, 0.04897)


def test_a_robot_centred_in_the_corridor_feels_both_sides_alike():
    rays, distance = sensors(-0.25, 0.15990, 0.0), np.empty(8)
    epuck.cast(-0.25, 0.15990, rays, WALLS, distance)
    assert epuck.echo(distance[2])[0] / 2000 == pytest.approx(0.14, abs=0.005)
    assert epuck.echo(distance[2])[0] == pytest.approx(epuck.echo(distance[5])[0], rel=0.01)


@pytest.fixture(scope="module")
def space():
    space = pymunk.Space()
    for left, right, bottom, top in WALLS.tolist():
        space.add(pymunk.Poly(space.static_body, [(left, bottom), (right, bottom), (right, top), (left, top)]))
    return space


@given(x=st.floats(-0.4, 0.4), y=st.floats(-0.4, 0.4), heading=st.floats(-7, 7))
def test_rays_agree_with_pymunk(space, x, y, heading):
    rays, distance = sensors(x, y, heading), np.empty(8)
    epuck.cast(x, y, rays, WALLS, distance)
    for i in range(8):
        start = rays[:2, i]
        gap = space.point_query_nearest(tuple(start), 1.0, pymunk.ShapeFilter())
        assume(gap is not None and gap.distance > 1e-9)  # pymunk says nothing useful of a ray that starts in a wall
        hit = space.segment_query_first(
            tuple(start), tuple(start + epuck.REACH * rays[2:4, i]), 0, pymunk.ShapeFilter()
        )
        if hit is None:
            assert distance[i] > epuck.REACH - 1e-9
        else:
            assert distance[i] == pytest.approx(hit.alpha * epuck.REACH, abs=1e-9)


def test_noise_is_standard_normal_and_uncorrelated():
    draws, out = [], np.empty(16)
    for step in range(20_000):
        noise.normal_numbers(np.uint64(3), step, out)
        draws.append(out.copy())
    draws = np.array(draws)
    assert np.abs(draws.mean(axis=0)).max() < 4 / math.sqrt(len(draws))
    assert draws.std() == pytest.approx(1, abs=0.003)
    assert (draws**4).mean() == pytest.approx(3, abs=0.05)
    assert np.abs(np.corrcoef(draws.T) - np.eye(16)).max() < 0.035
    assert abs(np.corrcoef(draws[:-1].ravel(), draws[1:].ravel())[0, 1]) < 0.01


def test_noise_depends_on_key_and_step_alone():
    first, again, other = np.empty(16), np.empty(16), np.empty(16)
    noise.normal_numbers(np.uint64(5), 77, first)
    noise.normal_numbers(np.uint64(6), 77, other)
    noise.normal_numbers(np.uint64(5), 77, again)
    assert (first == again).all()
    assert (first != other).all()


def test_splitmix64_gives_its_published_numbers():
    # The first outputs of the reference implementation for the seed 1234567.
    expected = [6457827717110365317, 3203168211198807973, 9817491932198370423]
    assert [int(noise.bits(np.uint64(1234567), np.uint64(n))) for n in range(3)] == expected


@pytest.mark.parametrize(
    ("key", "value"), [("x_m", math.nan), ("beam_rad", 0.0), ("beam_rad", 4.0), ("intensity", -1.0)]
)
def test_impossible_lamps_are_refused_by_name(key, value):
    with pytest.raises(ValueError, match=rf"scenario\.lamp\.{key} must"):
        Lamp(**{key: value})
