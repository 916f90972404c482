"""Mazes and robots from plain mappings, as the files of `conf/maze/` and `conf/robot/` hold them.

The keys are the fields of `Maze`, of `Robot` and of its sensors, and the types of the fields say what may be there. A
message names the key as it is typed, what it must be, and what was given.
"""

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple, get_args, get_origin, get_type_hints

from epuckhebb.runtime.errors import did_you_mean
from epuckhebb.sim.maze import Maze, Pose
from epuckhebb.sim.robot import Robot
from epuckhebb.sim.sensors import CurvePoint, DistanceSensors, LightSensors, Place

_LAMP = "lamp"  # a maze file may say where its lamp is; the scenario takes it from there
_ROWS = (Place, CurvePoint)  # records that are written as lists of numbers
_OF_DISTANCE = {  # key of a robot's file -> field of its distance sensors
    "distance_places": "places",
    "distance_curve": "curve",
    "stretch": "stretch",
    "reach_m": "reach_m",
    "full_scale": "full_scale",
}
_WANTED = {float: "a finite number", int: "a whole number", str: "a text"}
_INFINITE = (math.inf, -math.inf)


class _Start(NamedTuple):
    """Where the robot starts, as a file has it."""

    x: float
    y: float
    heading_deg: float


def maze_from(value: object, where: str = "maze") -> Maze:
    """A maze: boxes and goals by name, `start.heading_deg` in degrees, bounds of arms infinite where they are left out.

    where: the key of the maze in messages. A key `lamp` is left to the scenario.
    """
    given = {key: item for key, item in _mapping(where, value).items() if key != _LAMP}
    optional = {
        field.name: field.default
        for field in dataclasses.fields(Maze)
        if not (field.default is field.default_factory is dataclasses.MISSING)
    }
    values = _record(where, given, {**get_type_hints(Maze), "start": _Start}, optional)
    x, y, heading_deg = values.pop("start")
    return Maze(**values, start=Pose(x, y, math.radians(heading_deg)))


def robot_from(value: object, where: str = "robot") -> Robot:
    """A robot, which needs all keys; places are lists of x, y [m], azimuth [degrees], points of the curve lists too.

    where: the key of the robot in messages.
    """
    distance = get_type_hints(DistanceSensors)
    kinds = {name: kind for name, kind in get_type_hints(Robot).items() if name != "sensors"}
    kinds["light_places"] = get_type_hints(LightSensors)["places"]
    kinds |= {key: distance[field] for key, field in _OF_DISTANCE.items()}
    values = _record(where, value, kinds)
    light = LightSensors(places=values.pop("light_places"))
    felt = DistanceSensors(**{field: values.pop(key) for key, field in _OF_DISTANCE.items()})
    return Robot(**values, sensors=(light, felt))


def _record(
    where: str, value: object, kinds: Mapping[str, Any], optional: Mapping[str, object] | None = None
) -> dict[str, Any]:
    """The values of keys with these types. optional: keys that may be left out, and their defaults."""
    given, defaults = _mapping(where, value), optional or {}
    for key in given:
        if key not in kinds:
            raise ValueError(f"{where}.{key} is not known; known are {', '.join(kinds)}{did_you_mean(key, kinds)}")
    for key in kinds:
        if key not in given and key not in defaults:
            raise ValueError(f"{where}.{key} is missing")
    return {
        key: item
        if item in _INFINITE and defaults.get(key) in _INFINITE
        else _converted(f"{where}.{key}", item, kinds[key])
        for key, item in given.items()
    }


def _converted(where: str, value: object, kind: Any) -> Any:
    """A value as its declared type has it."""
    origin, inner = get_origin(kind), get_args(kind)
    if kind in _WANTED:
        return _plain(where, value, kind)
    if kind in _ROWS:
        return kind(*_row(where, value, kind._fields))
    if origin is Mapping:  # of names, or of certain ones
        return _record(where, value, dict.fromkeys(get_args(inner[0]) or _mapping(where, value), inner[1]))
    if origin is tuple and inner[-1] is not Ellipsis:
        return tuple(_row(where, value, ("from", "to")))
    if origin is tuple:
        if isinstance(value, str) or not isinstance(value, Sequence):
            raise _wrong(where, "a list", value)
        return tuple(_converted(f"{where}[{place}]", item, inner[0]) for place, item in enumerate(value))
    return kind(**_record(where, value, get_type_hints(kind), kind._field_defaults))


def _mapping(where: str, value: object) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise _wrong(where, "keys with values", value)
    for key in value:
        if not isinstance(key, str):
            raise _wrong(where, "keys that are texts (quote what looks like a number)", key)
    return value


def _row(where: str, value: object, names: Iterable[str]) -> list[float]:
    """Numbers, one for each name."""
    names = tuple(names)
    if isinstance(value, str) or not isinstance(value, Sequence) or len(value) != len(names):
        raise _wrong(where, f"[{', '.join(names)}]", value)
    return [_plain(f"{where}[{place}]", number, float) for place, number in enumerate(value)]


def _plain(where: str, value: object, kind: type[Any]) -> Any:
    """A finite number, a whole number or a text that is not empty; a text that looks like a number is none."""
    fits = isinstance(value, int | float) and math.isfinite(value) if kind is float else isinstance(value, kind)
    if isinstance(value, bool) or not fits or value == "":
        raise _wrong(where, _WANTED[kind], value)
    return kind(value)


def _wrong(where: str, wanted: str, value: object) -> ValueError:
    return ValueError(f"{where} must be {wanted}, got {value!r}")
