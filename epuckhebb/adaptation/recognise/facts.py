"""What recognition takes from the training world, measured in recorded lifetimes there, once, after evolution.

    sun     bearing and level for which min(1, level max(0, cos(bearing - heading - azimuth))) fits the light best
    lamp    the lifetimes with more light than this sun explains are those with the lamp; on which side is their goal
    echo    the median reading above the least, for each 3.5 mm of distance to the wall

The training world's supervisor knows poses and walls. In its lifetime afterwards, a robot does not.
"""

import math
from collections.abc import Sequence

import numpy as np

from epuckhebb.adaptation.recognise.compass import UNEXPLAINED
from epuckhebb.controller.arrays import Floats
from epuckhebb.tmaze.maze import SIDES
from epuckhebb.tmaze.samples import Samples
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.sensors import cast, put_rays

_SAMPLES = 250  # of a side that are looked at
_BINS, _ENOUGH = 16, 5  # of distance; readings that one needs


def measure_facts(sides: Sequence[Sequence[Samples]], world: Scenario) -> tuple[Floats, Floats]:
    """Facts of the training world for `NominalOfSide`: (3,) sun_bearing, sun_level, lamp_side; and (2, points) echo.

    sides: recorded lifetimes, left and right.
    """
    thinned = [_thin(samples) for samples in sides]
    lights = world.robot.inputs_of(world.robot.light)
    azimuth = np.radians([place.azimuth for place in world.robot.light.places])
    start = world.maze.start
    looks = [poses[:, 2, None] - start.heading + azimuth for poses, _ in thinned]
    bright = [1.0 - readings[:, lights] for _, readings in thinned]
    bearing, level = _sun(looks[0], bright[0])
    left_over = [u - _of_sun(bearing, level, look) for look, u in zip(looks, bright, strict=True)]
    lit = int(np.argmax([(u > UNEXPLAINED).mean() for u in left_over]))
    goal = world.goals_now[SIDES[lit]]
    aside = math.cos(start.heading) * (goal.y - start.y) - math.sin(start.heading) * (goal.x - start.x)
    return np.array([bearing, level, math.copysign(1.0, aside)]), _echo(thinned, world)


def _thin(samples: Sequence[Samples]) -> tuple[Floats, Floats]:
    poses, readings = (np.concatenate([getattr(one, name) for one in samples]) for name in ("pose", "sensors"))
    every = -(-len(poses) // _SAMPLES)
    return poses[::every], readings[::every]


def _of_sun(bearing: float, level: float, look: Floats) -> Floats:
    sunlit: Floats = np.minimum(1.0, level * np.maximum(0.0, np.cos(bearing - look)))
    return sunlit


def _sun(look: Floats, bright: Floats) -> tuple[float, float]:
    """The bearing and the level that fit best; a grid, made finer four times."""
    bearings, levels = np.arange(0.0, 2 * math.pi, math.radians(10)), np.geomspace(0.02, 4.0, 24)
    for _ in range(5):
        costs = [[((_of_sun(b, a, look) - bright) ** 2).sum() for a in levels] for b in bearings]
        b, a = np.unravel_index(np.argmin(costs), (len(bearings), len(levels)))
        bearing, level = float(bearings[b]), float(levels[a])
        step, ratio = bearings[1] - bearings[0], levels[1] / levels[0]
        bearings = bearing + np.linspace(-step, step, 9)
        levels = level * np.geomspace(1 / ratio, ratio, 9)
    return math.remainder(bearing, 2 * math.pi), level


def _echo(thinned: Sequence[tuple[Floats, Floats]], world: Scenario) -> Floats:
    """Readings above the least, falling, and the distances [m] that go with them."""
    robot = world.robot
    sensors, reach = robot.distance, robot.distance.reach_m
    azimuth = np.radians([place.azimuth for place in sensors.places])
    places = np.array([*np.array([place[:2] for place in sensors.places]).T, np.cos(azimuth), np.sin(azimuth)])
    rays, away, walls, found = np.empty((6, sensors.count)), np.empty(sensors.count), world.boxes, []
    with np.errstate(divide="ignore"):  # of rays along an axis
        for x, y, heading in np.concatenate([poses for poses, _ in thinned]):
            put_rays(x, y, math.cos(heading), math.sin(heading), places, rays)
            cast(x, y, rays, sensors.count, walls, robot.radius_m + reach, away)
            found.append(away.copy())
    distance = np.concatenate(found)
    reading = np.concatenate([readings[:, robot.inputs_of(sensors)] for _, readings in thinned]).ravel()
    above = reading - np.percentile(reading, 2)
    points: list[tuple[float, float]] = []
    for low in np.arange(_BINS) * reach / _BINS:
        inside = (distance >= low) & (distance < low + reach / _BINS)
        if inside.sum() >= _ENOUGH:
            point = float(np.median(above[inside])), float(np.median(distance[inside]))
            if not points or point[0] < points[-1][0] - 1e-6:
                points.append(point)
    return np.array(points).reshape(-1, 2).T.copy()
