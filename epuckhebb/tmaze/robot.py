"""A robot as data: a disc on two wheels and its groups of sensors.

The e-puck has eight places on its rim that sense both infra-red echoes and ambient light. Its numbers are those of
Webots' model (version 1), which was calibrated on a real one. Robot frame: x forward, y left, in metres; angles
anticlockwise from x. The robots of `conf/robot/` have the keys of `Robot` and of its groups.
"""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from epuckhebb.controller.ranges import check, within
from epuckhebb.tmaze.sensors import DistanceSensors, LightSensors, RimSensors, SensorGroup

STEP_S = 0.032  # one control step: sensing, acting, learning and physics
OUTPUTS = 2  # of a network: for the left and the right wheel


class Underside(NamedTuple):
    """The box below a robot: its length along x, width along y, height, and the height of its middle [m]."""

    length: float = 0.05
    width: float = 0.04
    height: float = 0.01
    middle: float = 0.0051


class Solid(NamedTuple):
    """What a robot is in three dimensions; heights are above the floor [m], the values are the e-puck's.

    mass_kg, inertia_kg_m2 (about x, y and z), centre_of_mass_m: of the body without its wheels. hull_m: bottom and top
    of its cylinder. motor_torque_n_m: the most of each motor.
    """

    mass_kg: float = 0.15
    inertia_kg_m2: tuple[float, ...] = (9.78585e-05, 8.64333e-05, 8.74869e-05)
    centre_of_mass_m: float = 0.015
    hull_m: tuple[float, float] = (0.0025, 0.0475)
    underside: Underside = Underside()
    wheel_mass_kg: float = 0.005
    wheel_width_m: float = 0.005
    motor_torque_n_m: float = 10.0
    sensor_height_m: float = 0.033


_E_PUCK_SOLID = Solid()


@dataclass(frozen=True, kw_only=True)
class Robot:
    """The body and the sensors of a robot; the defaults are the e-puck's.

    radius_m, mass_kg, inertia_kg_m2 (about the vertical axis): of its disc. wheel_radius_m, axle_m (between the
    wheels), motor_limit_rad_s: of its drive. sensors: groups in the order of the network's inputs, light and distance
    sensors included. Sensors of the same number in different groups share a place on the rim. solid: what
    three-dimensional physics needs, None if unknown.
    """

    name: str = "epuck"
    radius_m: float = within(0, above=True, default=0.037)
    mass_kg: float = within(0, above=True, default=0.16)
    inertia_kg_m2: float = within(0, above=True, default=8.75e-5)
    wheel_radius_m: float = within(0, above=True, default=0.020)
    axle_m: float = within(0, above=True, default=0.052)
    motor_limit_rad_s: float = within(0, above=True, default=6.28)
    solid: Solid | None = _E_PUCK_SOLID
    sensors: tuple[SensorGroup, ...] = (LightSensors(), DistanceSensors())

    def __post_init__(self) -> None:
        check(self, "robot")
        if self.solid is not None:
            low, high = self.solid.hull_m
            inertia = self.solid.inertia_kg_m2
            sizes = (*self.solid[:3:2], *inertia, *self.solid.underside, *self.solid[5:], high - low)
            if not (len(inertia) == 3 and low >= 0 and all(0 < size < math.inf for size in sizes)):
                raise ValueError(
                    "robot.solid must hold numbers above 0, three inertia_kg_m2, and hull_m from low to high"
                )
        names = [group.name for group in self.sensors]
        if not {LightSensors.name, DistanceSensors.name} <= set(names) or len(set(names)) < len(names):
            raise ValueError(f"robot.sensors must be light, distance and perhaps others, each once, got {names}")
        for group in self.sensors:
            for number, sensor in enumerate(group.places if isinstance(group, RimSensors) else ()):
                if math.hypot(sensor.x, sensor.y) > self.radius_m + 1e-9:
                    raise ValueError(
                        f"robot.{group.name}_places[{number}] is not within {self.radius_m} m: {list(sensor)}"
                    )

    @cached_property
    def light(self) -> LightSensors:
        """Its light sensors."""
        return next(group for group in self.sensors if isinstance(group, LightSensors))

    @cached_property
    def distance(self) -> DistanceSensors:
        """Its distance sensors."""
        return next(group for group in self.sensors if isinstance(group, DistanceSensors))

    def input_places(self, group: SensorGroup) -> slice:
        """Where the readings of a group are among the network's inputs."""
        names = [sensors.name for sensors in self.sensors]
        first = sum(sensors.count for sensors in self.sensors[: names.index(group.name)])
        return slice(first, first + group.count)

    @cached_property
    def inputs(self) -> int:
        """The number of sensor readings."""
        return sum(group.count for group in self.sensors)

    @property
    def sensor_numbers(self) -> int:
        """The count of the largest group: sensors of the same number share a place."""
        return max(group.count for group in self.sensors if isinstance(group, RimSensors))


EPUCK = Robot()
