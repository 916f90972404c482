"""Mazes and robots from plain mappings, as the files of `conf/maze/` and `conf/robot/` hold them.

The keys are the fields of `Maze`, of `Robot` and of its sensors, and the types of the fields say what may be there.
"""

import math
from collections.abc import Mapping
from typing import Any, NamedTuple, get_type_hints

from epuckhebb.config.parts import part_from
from epuckhebb.config.values import converted, part_settings, record
from epuckhebb.runtime import ConfigError
from epuckhebb.tmaze.maze import Maze, Pose
from epuckhebb.tmaze.own_sensor import Sensor
from epuckhebb.tmaze.robot import Robot
from epuckhebb.tmaze.sensors import DistanceSensors, LightSensors

_LAMP = "lamp"  # a maze file may say where its lamp is; the scenario takes it from there
_OWN = "sensors"  # key of a robot's file: the user's own sensors
_OF_DISTANCE = {  # key of a robot's file -> field of its distance sensors
    "distance_places": "places",
    "distance_curve": "curve",
    "stretch": "stretch",
    "reach_m": "reach_m",
    "full_scale": "full_scale",
}


class _Start(NamedTuple):
    """Where the robot starts, as a file has it."""

    x: float
    y: float
    heading_deg: float


def maze_from(value: object) -> Maze:
    """A maze: boxes and goals by name, `start.heading_deg` in degrees, bounds of arms infinite if they are left out."""
    given = {key: item for key, item in value.items() if key != _LAMP} if isinstance(value, Mapping) else value
    values = part_settings(Maze, given, "maze", "a maze", start=_Start)
    x, y, heading_deg = values.pop("start")
    return Maze(**values, start=Pose(x, y, math.radians(heading_deg)))


def robot_from(value: object) -> Robot:
    """A robot, which needs all keys; places are lists of x, y [m], azimuth [degrees], points of the curve lists too.

    `sensors` may be left out: the user's own, each `sensor: FILE.py:NAME` with its settings.
    """
    distance = get_type_hints(DistanceSensors)
    kinds = {name: kind for name, kind in get_type_hints(Robot).items() if name != "sensors"}
    kinds["light_places"] = get_type_hints(LightSensors)["places"]
    kinds |= {key: distance[field] for key, field in _OF_DISTANCE.items()}
    kinds[_OWN] = list[Any]
    values = {"solid": None, _OWN: [], **record("robot", value, kinds, {_OWN: [], "solid": None}, "a robot")}
    own = values.pop(_OWN)
    light = LightSensors(places=values.pop("light_places"))
    felt = DistanceSensors(**{field: values.pop(key) for key, field in _OF_DISTANCE.items()})
    more = [_own_sensor(settings, f"robot.{_OWN}[{number}]") for number, settings in enumerate(own)]
    return Robot(**values, sensors=(light, felt, *more))


def _own_sensor(given: object, key: str) -> Sensor:
    """A sensor of the user's own."""
    values = dict(converted(key, given, dict[str, Any]))
    readings = values.pop("readings", None)
    sensor: Sensor = part_from("sensor", values, key)
    known = list(sensor.readings)
    if readings not in (None, known):
        raise ConfigError(f"{key}.readings must be left out, or {known}, got {readings}")
    return sensor
