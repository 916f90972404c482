"""Sensors of your own: a compass, the distance to the goal, and a dark patch on the floor."""

import math
from dataclasses import dataclass
from typing import ClassVar

from epuckhebb import Sensor


@dataclass(frozen=True, kw_only=True)
class Compass(Sensor):
    """Two readings: how far the robot looks to the north (along y), and to the east (along x); 0.5 is sideways."""

    readings: ClassVar = ("north", "east")
    noise: float = 0.02

    @staticmethod
    def read(heading):
        """Both readings, from 0 to 1."""
        return (1.0 + math.sin(heading)) / 2, (1.0 + math.cos(heading)) / 2


@dataclass(frozen=True, kw_only=True)
class GoalDistance(Sensor):
    """1 at the goal, 0 from `reach` [m] on."""

    reach: float = 1.0

    @staticmethod
    def read(goal_distance, by):
        """The reading, from 0 to 1."""
        return max(0.0, 1.0 - goal_distance / by.reach)


@dataclass(frozen=True, kw_only=True)
class FloorPatch(Sensor):
    """1 over a dark patch around (at_x, at_y) of this radius [m], else 0."""

    at_x: float = 0.0
    at_y: float = 0.0
    radius: float = 0.05

    @staticmethod
    def read(x, y, by):
        """The reading, 0 or 1."""
        return 1.0 if math.hypot(x - by.at_x, y - by.at_y) < by.radius else 0.0
