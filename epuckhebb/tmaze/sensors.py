"""The inputs of a network, in groups: light sensors, distance sensors, a reward, and sensors of the user's own.

To add a kind of sensor on the rim, write a subclass of `RimSensors` with what it senses (`kernels`) and what a dead one
reads (`dead`). `Robot.sensors` has the groups of a robot, in the order of the network's inputs.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, ClassVar, NamedTuple

import numpy as np

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import compiled, nothing
from epuckhebb.controller.ranges import Range, check, check_value, within
from epuckhebb.tmaze import light


class Place(NamedTuple):
    """Where a sensor sits on the robot, x forward and y left [m], and where it looks, azimuth [degrees]."""

    x: float
    y: float
    azimuth: float


class CurvePoint(NamedTuple):
    """A point of a distance sensor's curve: distance [m], value, and noise (standard deviation / value)."""

    distance: float
    value: float
    noise: float


_E_PUCK_PLACES = (  # of its eight infra-red sensors, which also sense ambient light
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


class Goal(NamedTuple):
    """The goal of a robot, and its distance from the robot [m]."""

    x: float
    y: float
    distance: float


NO_GOAL = Goal(math.nan, math.nan, math.nan)


class Surroundings(NamedTuple):
    """What sensors can sense. x, y: the robot's place [m]. cos, sin: of its heading. walls: (boxes, 4) edges [m].

    lit: the lights. goal: of this lifetime. noise: standard normal numbers, one for each input. noise_level: 1 for the
    sensors' own noise, 0 for none.
    """

    x: float
    y: float
    cos: float
    sin: float
    walls: Floats
    lit: light.Lights
    noise: Floats
    noise_level: float
    goal: Goal


Irradiance = Callable[[Floats, int, light.Lights], float]  # on sensor i, by its ray
_in_plane: Irradiance = compiled(
    lambda rays, i, lit: light.irradiance(rays[0, i], rays[1, i], rays[2, i], rays[3, i], lit)
)


class Kernels(NamedTuple):
    """The functions of a group of sensors in a step; first all groups look, then all read.

    read(around, rays, scratch, readings): fills the readings. look(around, rays, scratch): slow work, into `scratch`,
    one number for each sensor. around: `Surroundings`. rays: (6, sensors) x, y [m], the unit
    vector along which each looks, and 1 over its x and its y.
    """

    read: Callable[[Surroundings, Floats, Floats, Floats], None]
    look: Callable[[Surroundings, Floats, Floats], None] = nothing


@dataclass(frozen=True, kw_only=True)
class InputGroup:
    """Inputs of a network of one kind. name: in the program. label, short: in pages and in figures."""

    name: ClassVar[str]
    label: ClassVar[str]
    short: ClassVar[str]

    @property
    def count(self) -> int:
        """The number of inputs."""
        return 1

    @property
    def labels(self) -> list[str]:
        """The name of each input, for pages."""
        return [self.label] if self.count == 1 else [f"{self.label} {number}" for number in range(self.count)]


@dataclass(frozen=True, kw_only=True)
class RewardInput(InputGroup):
    """The reward of a task, 1, -1 or 0 (`epuckhebb.tmaze.task`)."""

    name: ClassVar[str] = "reward"
    label: ClassVar[str] = "reward"
    short: ClassVar[str] = "reward "


@dataclass(frozen=True, kw_only=True)
class SensorGroup(InputGroup, ABC):
    """Sensors of one kind."""

    @abstractmethod
    def kernels(self, first: int, radius_m: float) -> Kernels:
        """The functions of these sensors. first: place of the first among the inputs. radius_m: of the robot."""


@dataclass(frozen=True, kw_only=True)
class RimSensors(SensorGroup):
    """Sensors on the rim of the robot. places: where they are. dead: what a dead one reads."""

    dead: ClassVar[float]

    places: tuple[Place, ...] = _E_PUCK_PLACES

    def __post_init__(self) -> None:
        if not self.places:
            raise ValueError(f"robot.{self.name}_places must hold one sensor or more")

    @property
    def count(self) -> int:
        """The number of sensors."""
        return len(self.places)


@dataclass(frozen=True, kw_only=True)
class LightSensors(RimSensors):
    """Sensors of ambient light, which read 1 in the dark."""

    name: ClassVar[str] = "light"
    label: ClassVar[str] = "light"
    short: ClassVar[str] = "ls"
    dead: ClassVar[float] = 1.0

    def kernels(self, first: int, radius_m: float, irradiance: Irradiance = _in_plane) -> Kernels:  # noqa: ARG002
        """The functions that fill its readings. irradiance: of the physics."""
        count = self.count

        @compiled
        def read(around: Surroundings, rays: Floats, scratch: Floats, readings: Floats) -> None:
            noise, noise_level = around.noise, around.noise_level
            for i in range(count):
                dark = light.reading(irradiance(rays, i, around.lit))
                readings[first + i] = min(1.0, max(0.0, dark * (1.0 + noise_level * light.NOISE * noise[first + i])))

        return Kernels(read)


@dataclass(frozen=True, kw_only=True)
class DistanceSensors(RimSensors):
    """Infra-red sensors or laser rays, which read 0 where no wall is near.

    curve: value at each distance, from 0 on, linear between; beyond the last point the last value. stretch: apparent
    over real distance (the paper's walls are red and rough, and the e-puck's beams rise). reach_m: real distance beyond
    which nothing is sensed. full_scale: the value that reads 1.
    """

    name: ClassVar[str] = "distance"
    label: ClassVar[str] = "distance"
    short: ClassVar[str] = "ps"
    dead: ClassVar[float] = 0.0

    curve: tuple[CurvePoint, ...] = _E_PUCK_CURVE
    # Red, rough walls look 1.25 times as far; the beams rise by 9.17 degrees.
    stretch: float = within(0, above=True, default=1.25 * 1.013)
    reach_m: float = within(0, above=True, default=0.056)
    full_scale: float = within(0, above=True, default=2000.0)  # as in the published controller

    def __post_init__(self) -> None:
        super().__post_init__()
        check(self, "robot")
        distances = [point.distance for point in self.curve]
        steps = [b - a for a, b in pairwise(distances)]
        if len(distances) < 2 or distances[0] != 0 or not all(step > 0 for step in steps):
            raise ValueError(f"robot.distance_curve must be rows of growing distance, the first at 0, got {distances}")
        ends = max(distances[-1] / self.stretch, DistanceSensors.reach_m)  # [m]: beyond, no reach does anything
        check_value("robot.reach_m", self.reach_m, Range(0, ends, above=True))

    def kernels(self, first: int, radius_m: float) -> Kernels:
        """The functions that fill its readings."""
        count, full_scale, reach, echo = self.count, self.full_scale, radius_m + self.reach_m, self.echo()

        @compiled
        def look(around: Surroundings, rays: Floats, scratch: Floats) -> None:
            cast(around.x, around.y, rays, count, around.walls, reach, scratch)

        @compiled
        def read(around: Surroundings, rays: Floats, scratch: Floats, readings: Floats) -> None:
            noise, noise_level = around.noise, around.noise_level
            for i in range(count):
                value, fraction = echo(scratch[i])
                noisy = value * (1.0 + noise_level * fraction * noise[first + i])
                readings[first + i] = min(1.0, max(0.0, noisy / full_scale))

        return Kernels(read, look)

    def echo(self) -> Callable[[float], tuple[float, float]]:
        """The function that gives a sensor's value and its noise fraction at a real distance [m]."""
        curve = np.array(self.curve, float)
        last, stretch, reach = len(curve) - 1, self.stretch, self.reach_m

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


@compiled
def put_rays(_space: Any, x: float, y: float, cos: float, sin: float, places: Floats, rays: Floats) -> None:
    """Put sensors into the plane. places: (4, n) x, y, look x, look y in the robot's frame.

    Fills `rays` (6, n): x, y [m], the unit vector each looks along, and 1 / its x and 1 / its y.
    """
    for i in range(places.shape[1]):
        rays[0, i] = x + (cos * places[0, i] - sin * places[1, i])
        rays[1, i] = y + (sin * places[0, i] + cos * places[1, i])
        rays[2, i] = cos * places[2, i] - sin * places[3, i]
        rays[3, i] = sin * places[2, i] + cos * places[3, i]
        rays[4, i], rays[5, i] = 1.0 / rays[2, i], 1.0 / rays[3, i]


@compiled
def cast(x: float, y: float, rays: Floats, count: int, boxes: Floats, reach: float, distance: Floats) -> None:
    """Fill `distance` [m]: how far the first `count` rays run to a wall; infinite if they meet none.

    Boxes farther than `reach` [m] from a robot at (x, y) are left out. A ray that starts inside a box has distance 0.
    """
    for i in range(count):
        distance[i] = math.inf
    for box in range(boxes.shape[0]):
        left, right, bottom, top = boxes[box, 0], boxes[box, 1], boxes[box, 2], boxes[box, 3]
        if x < left - reach or x > right + reach or y < bottom - reach or y > top + reach:
            continue
        for i in range(count):
            # The ray is between left and right for one span of its length, between bottom and top for another.
            per_x, per_y = rays[4, i], rays[5, i]
            to_left, to_right = (left - rays[0, i]) * per_x, (right - rays[0, i]) * per_x
            to_bottom, to_top = (bottom - rays[1, i]) * per_y, (top - rays[1, i]) * per_y
            enter = max(min(to_left, to_right), min(to_bottom, to_top))
            leave = min(max(to_left, to_right), max(to_bottom, to_top))
            if leave >= max(0.0, enter):
                distance[i] = min(distance[i], max(0.0, enter))
