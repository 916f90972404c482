"""A robot as data: a disc on two wheels, its light sensors, and its distance sensors with their curve.

The e-puck has eight places on its rim that feel both infra-red echoes and ambient light; its numbers are those of
Webots' model (version 1), which was calibrated on a real one. Robot frame: x forward, y left, in metres; angles
anticlockwise from x. The robots of `conf/robot/` have the keys that `Robot` has here, and `robot_from` makes a robot
of what such a file holds.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim import light, mapping
from epuckhebb.sim.compiled import compiled

STEP_S = 0.032  # one control step: sensing, acting, learning and physics


class Place(NamedTuple):
    """Where a sensor sits on the robot, x and y [m], and where it looks, azimuth [degrees]."""

    x: float
    y: float
    azimuth: float


class CurvePoint(NamedTuple):
    """What a distance sensor says at a distance [m]: its value, and its noise (standard deviation / value)."""

    distance: float
    value: float
    noise: float


_E_PUCK_PLACES = (  # of its eight infra-red sensors, which feel ambient light too
    Place(0.030, -0.010, -17.2),
    Place(0.022, -0.025, -45.9),
    Place(0.000, -0.031, -90.0),
    Place(-0.030, -0.015, -151.5),
    Place(-0.030, 0.015, 151.2),
    Place(0.000, 0.031, 90.0),
    Place(0.022, 0.025, 45.8),
    Place(0.030, 0.010, 17.1),
)
_E_PUCK_CURVE = (
    CurvePoint(0.000, 4095.00, 0.00200),
    CurvePoint(0.005, 2133.33, 0.00300),
    CurvePoint(0.010, 1465.73, 0.00700),
    CurvePoint(0.015, 601.46, 0.04060),
    CurvePoint(0.020, 383.84, 0.01472),
    CurvePoint(0.030, 234.93, 0.02410),
    CurvePoint(0.040, 158.03, 0.02870),
    CurvePoint(0.050, 120.00, 0.04225),
    CurvePoint(0.060, 104.09, 0.03065),
    CurvePoint(0.070, 67.19, 0.04897),
)


@dataclass(frozen=True, kw_only=True)
class Robot:
    """The body and the senses of a robot; the defaults are the e-puck's.

    radius_m, mass_kg, inertia_kg_m2 (about the vertical axis): of its disc. wheel_radius_m, axle_m (between the
    wheels), motor_limit_rad_s: of its drive. light_places: of its light sensors. distance_places: of its infra-red
    sensors or laser rays. distance_curve: value at each distance, from 0 on, linear between; beyond the last point the
    last value. stretch: how many times farther a wall seems than it is (the paper's walls are red and rough, and the
    e-puck's beams rise). reach_m: real distance beyond which nothing is felt. full_scale: the value that reads 1.

    Raises:
        ValueError: a value is outside the range named in the message.
    """

    name: str = "epuck"
    radius_m: float = 0.037
    mass_kg: float = 0.16
    inertia_kg_m2: float = 8.75e-5
    wheel_radius_m: float = 0.020
    axle_m: float = 0.052
    motor_limit_rad_s: float = 6.28
    light_places: tuple[Place, ...] = _E_PUCK_PLACES
    distance_places: tuple[Place, ...] = _E_PUCK_PLACES
    distance_curve: tuple[CurvePoint, ...] = _E_PUCK_CURVE
    stretch: float = 1.25 * 1.013  # red, rough walls look 1.25 times as far; the beams rise by 9.17 degrees
    reach_m: float = 0.056
    full_scale: float = 2000.0  # as in the published controller

    def __post_init__(self) -> None:
        """Refuse robots that cannot be."""
        for name in (
            "radius_m",
            "mass_kg",
            "inertia_kg_m2",
            "wheel_radius_m",
            "axle_m",
            "motor_limit_rad_s",
            "stretch",
            "reach_m",
            "full_scale",
        ):
            value = getattr(self, name)
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"robot.{name} must be a number above 0, got {value}")
        for name in ("light_places", "distance_places"):
            for number, place in enumerate(getattr(self, name)):
                if not all(map(math.isfinite, place)):
                    raise ValueError(f"robot.{name}[{number}] must be three finite numbers, got {list(place)}")
                if math.hypot(place.x, place.y) > self.radius_m + 1e-9:
                    raise ValueError(
                        f"robot.{name}[{number}] must lie on the robot, within {self.radius_m} m of its middle, "
                        f"got {list(place)}"
                    )
        if not self.light_places or not self.distance_places:
            raise ValueError("robot.light_places and robot.distance_places must hold one sensor or more each")
        distances = [point.distance for point in self.distance_curve]
        steps = [b - a for a, b in pairwise(distances)]
        if len(distances) < 2 or distances[0] != 0 or not all(step > 0 for step in steps):
            raise ValueError(
                f"robot.distance_curve must be two or more rows of growing distance, the first at 0, got {distances}"
            )
        if not all(math.isfinite(number) and number >= 0 for point in self.distance_curve for number in point):
            raise ValueError("robot.distance_curve must hold finite numbers, 0 or more")

    @property
    def lights(self) -> int:
        """How many light sensors it has; their readings come first among the network's inputs."""
        return len(self.light_places)

    @property
    def distances(self) -> int:
        """How many distance sensors it has; their readings come second."""
        return len(self.distance_places)

    @property
    def inputs(self) -> int:
        """How many readings the network gets."""
        return self.lights + self.distances

    @property
    def sensor_numbers(self) -> int:
        """How many numbers a sensor can have: a light and a distance sensor of the same number share a place."""
        return max(self.lights, self.distances)


EPUCK = Robot()


def robot_from(told: Mapping[str, Any], where: str = "robot") -> Robot:
    """A robot from plain mappings, as a file of `conf/robot/` holds it; `where` is its key in messages.

    Keys are those of `Robot`, all of them; places are lists of x, y [m] and azimuth [degrees], rows of the curve lists
    of distance [m], value and noise.

    Raises:
        ValueError: a key is missing or not known, or a value is not what the robot needs.
    """
    found = mapping.keys(where, told, [key.name for key in fields(Robot)])
    rows: dict[str, type[Place] | type[CurvePoint]] = {
        "light_places": Place,
        "distance_places": Place,
        "distance_curve": CurvePoint,
    }
    values: dict[str, Any] = {"name": mapping.text(f"{where}.name", found.pop("name"))}
    for key, value in found.items():
        if key in rows:
            kind = rows[key]
            listed = enumerate(mapping.items(f"{where}.{key}", value))
            values[key] = tuple(kind(*mapping.row(f"{where}.{key}[{n}]", row, kind._fields)) for n, row in listed)
        else:
            values[key] = mapping.number(f"{where}.{key}", value)
    return Robot(**values)


_Rays = NDArray[np.float64]


@compiled
def put_rays(x: float, y: float, cos: float, sin: float, places: NDArray[np.float64], rays: _Rays) -> None:
    """Put sensors into the maze. places: (4, n) x, y, look x, look y in the robot's frame.

    Fills `rays` (6, n): x, y [m], the unit vector each looks along, and 1 / its x and 1 / its y.
    """
    for i in range(places.shape[1]):
        rays[0, i] = x + (cos * places[0, i] - sin * places[1, i])
        rays[1, i] = y + (sin * places[0, i] + cos * places[1, i])
        rays[2, i] = cos * places[2, i] - sin * places[3, i]
        rays[3, i] = sin * places[2, i] + cos * places[3, i]
        rays[4, i], rays[5, i] = 1.0 / rays[2, i], 1.0 / rays[3, i]


@compiled
def cast(
    x: float,
    y: float,
    rays: _Rays,
    sensors: int,
    boxes: NDArray[np.float64],
    reach: float,
    distance: NDArray[np.float64],
) -> None:
    """How far each ray runs before it meets a wall: `distance` (n,) [m], infinite where it meets none.

    Boxes farther than `reach` [m] from a robot at (x, y) are left out. A ray that starts inside a box has distance 0.
    """
    for i in range(sensors):
        distance[i] = math.inf
    for box in range(boxes.shape[0]):
        left, right, bottom, top = boxes[box, 0], boxes[box, 1], boxes[box, 2], boxes[box, 3]
        if x < left - reach or x > right + reach or y < bottom - reach or y > top + reach:
            continue
        for i in range(sensors):
            # The ray is between left and right for one span of its length, between bottom and top for another.
            per_x, per_y = rays[4, i], rays[5, i]
            to_left, to_right = (left - rays[0, i]) * per_x, (right - rays[0, i]) * per_x
            to_bottom, to_top = (bottom - rays[1, i]) * per_y, (top - rays[1, i]) * per_y
            enter = max(min(to_left, to_right), min(to_bottom, to_top))
            leave = min(max(to_left, to_right), max(to_bottom, to_top))
            if leave >= max(0.0, enter):
                distance[i] = min(distance[i], max(0.0, enter))


def echo_of(robot: Robot) -> Callable[[float], tuple[float, float]]:
    """The function that gives a distance sensor's value, and its noise fraction, at a real distance [m]."""
    curve = np.array(robot.distance_curve, float)
    last, stretch, reach = len(curve) - 1, robot.stretch, robot.reach_m

    @compiled
    def echo(distance: float) -> tuple[float, float]:
        apparent = distance * stretch
        if not (distance <= reach and apparent < curve[last, 0]):
            return curve[last, 1], curve[last, 2]
        k = 0
        for row in range(1, last):
            k += apparent >= curve[row, 0]
        part = (apparent - curve[k, 0]) / (curve[k + 1, 0] - curve[k, 0])
        value = curve[k, 1] + part * (curve[k + 1, 1] - curve[k, 1])
        noise = curve[k, 2] + part * (curve[k + 1, 2] - curve[k, 2])
        return value, noise

    return echo


class SenseRoom(NamedTuple):
    """Workspace of `sense`: rays of each kind of sensor (6, n), and the distances of the second kind (n,)."""

    light_rays: NDArray[np.float64]
    distance_rays: NDArray[np.float64]
    distance: NDArray[np.float64]


def sense_room(robot: Robot) -> SenseRoom:
    """Workspace for a robot of this kind."""
    return SenseRoom(np.empty((6, robot.lights)), np.empty((6, robot.distances)), np.empty(robot.distances))


Sense = Callable[..., None]


def senses(robot: Robot) -> Sense:
    """The function that fills the network's inputs: light readings (1 = dark), then distance readings (1 = touching).

    `sense(x, y, cos, sin, walls, lit, noise, noise_level, room, readings)`: pose of the robot; walls (boxes, 4); the
    lights; standard normal numbers, one for each input; 1 for the sensors' own noise, 0 for none; workspace; and
    where the readings go.
    """
    light_places, distance_places = _places(robot.light_places), _places(robot.distance_places)
    lights, distances, full_scale = robot.lights, robot.distances, robot.full_scale
    reach = robot.radius_m + robot.reach_m
    shared = robot.light_places == robot.distance_places  # then the rays need to be put only once
    echo = echo_of(robot)

    @compiled
    def sense(
        x: float,
        y: float,
        cos: float,
        sin: float,
        walls: NDArray[np.float64],
        lit: light.Lights,
        noise: NDArray[np.float64],
        noise_level: float,
        room: SenseRoom,
        readings: NDArray[np.float64],
    ) -> None:
        put_rays(x, y, cos, sin, distance_places, room.distance_rays)
        cast(x, y, room.distance_rays, distances, walls, reach, room.distance)
        if shared:
            rays = room.distance_rays
        else:
            rays = room.light_rays
            put_rays(x, y, cos, sin, light_places, rays)
        for i in range(lights):
            dark = light.reading(light.irradiance(rays[0, i], rays[1, i], rays[2, i], rays[3, i], lit))
            readings[i] = min(1.0, max(0.0, dark * (1.0 + noise_level * light.NOISE * noise[i])))
        for i in range(distances):
            value, fraction = echo(room.distance[i])
            noisy = value * (1.0 + noise_level * fraction * noise[lights + i])
            readings[lights + i] = min(1.0, max(0.0, noisy / full_scale))

    return sense


def blinding(robot: Robot) -> Callable[[NDArray[np.float64], NDArray[np.int64]], None]:
    """The function that makes the sensors of these numbers blind: they feel the dark, and no wall."""
    lights, distances = robot.lights, robot.distances

    @compiled
    def blind(readings: NDArray[np.float64], numbers: NDArray[np.int64]) -> None:
        for k in range(numbers.shape[0]):
            number = numbers[k]
            if number < lights:
                readings[number] = 1.0
            if number < distances:
                readings[lights + number] = 0.0

    return blind


def largest_distance_reading(robot: Robot) -> Callable[[NDArray[np.float64]], float]:
    """The function that gives the largest of a robot's distance readings: how near the nearest wall is."""
    first, count = robot.lights, robot.distances

    @compiled
    def largest(readings: NDArray[np.float64]) -> float:
        most = float(readings[first])
        for i in range(first + 1, first + count):
            most = max(most, readings[i])
        return most

    return largest


def _places(places: tuple[Place, ...]) -> NDArray[np.float64]:
    """Sensors in the robot's frame, (4, n): x, y, and the unit vector each looks along."""
    azimuth = np.radians([place.azimuth for place in places])
    x, y = [place.x for place in places], [place.y for place in places]
    return np.array([x, y, np.cos(azimuth), np.sin(azimuth)])
