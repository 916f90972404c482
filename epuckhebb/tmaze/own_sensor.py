"""A sensor of the user's own; in the inputs of the network it stands behind the light and distance sensors."""

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import compiled, nothing, written
from epuckhebb.controller.own_class import OwnClass, make_call, namedtuple_of, number
from epuckhebb.controller.ranges import within
from epuckhebb.tmaze.sensors import Kernels, SensorGroup, Surroundings

_OF_READ = {  # the arguments that `read` may have, and how the kernel has them
    "x": "around.x",
    "y": "around.y",
    "heading": "math.atan2(around.sin, around.cos)",
    "goal_x": "around.goal.x",
    "goal_y": "around.goal.y",
    "goal_distance": "around.goal.distance",
    "walls": "around.walls",
    "by": "by",
}


@dataclass(frozen=True, kw_only=True)
class Sensor(SensorGroup, OwnClass):
    """A sensor of the user's own; subclasses add settings as fields, and a static method `read`, compiled by numba.

    readings: the name of each reading. noise: standard deviation of the noise on each. `read` gives the reading, or as
    many as there are names, each from 0 to 1. Its arguments are any of these names, in any order:

        x, y, heading    of the robot, m and rad (0 along x, from -pi to pi)
        goal_x, goal_y   m, of the goal of this side; goal_distance: m from the goal
        walls            (boxes, 4) left, right, bottom, top, m
        by               the settings

    Raises:
        ValueError: the noise is no number of 0 or more.
    """

    PART: ClassVar[str] = "sensor"
    KEY: ClassVar[str] = "robot.sensors.sensor"
    METHODS: ClassVar[tuple[str, ...]] = ("read",)
    ARGUMENTS: ClassVar[Collection[str]] = _OF_READ
    readings: ClassVar[tuple[str, ...]] = ("reading",)
    read: ClassVar[Callable[..., Any] | None] = None

    noise: float = within(0, default=0.0)

    def __init_subclass__(cls) -> None:
        """Call the group as its class."""
        cls.name = cls.label = cls.short = cls.__name__

    @property
    def count(self) -> int:
        """The number of readings."""
        return len(self.readings)

    @property
    def labels(self) -> list[str]:
        """The name of each reading, for pages."""
        return [self.name if self.count == 1 else f"{self.name} {reading}" for reading in self.readings]

    def kernels(self, first: int, radius_m: float) -> Kernels:  # noqa: ARG002  # others need it
        """The functions that fill its readings, whose noise begins at place `first` among that of all readings."""
        noise, by = float(self.noise), namedtuple_of("By", self.settings())(*self.numbers())

        @compiled
        def put(k: int, value: float, around: Surroundings, scratch: Floats, readings: Floats) -> None:
            if not 0.0 <= value <= 1.0:
                scratch[k], value = value, 0.0  # is refused when the kernel has returned
            noisy = value + around.noise_level * noise * around.noise[first + k]
            readings[first + k] = min(1.0, max(0.0, noisy))

        parts = {"values": make_call(type(self).read, self.arguments("read"), _OF_READ, "around", by=by)}
        # The calls are written out, because the values of a tuple may be of several types.
        puts = ", ".join(f"put({k}, number(values[{k}]), around, scratch, readings)" for k in range(self.count))
        helpers = {"put": put, "number": number}
        parts["put_all"] = written("values, around, scratch, readings", f"({puts},)", helpers)
        values = "(values(around),)" if self.count == 1 else "values(around)"
        call = f"put_all({values}, around, scratch, readings)"
        return Kernels(written("around, rays, scratch, readings", call, parts), nothing)


def reading_names(groups: Sequence[SensorGroup]) -> str:
    """The readings of the user's sensors among the groups of a robot, with `, ` between."""
    return ", ".join(label for sensor in groups if isinstance(sensor, Sensor) for label in sensor.labels)
