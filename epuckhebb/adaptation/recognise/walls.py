"""Where the walls are: their distances to the left, ahead, to the right and behind, as seen at the start.

An echo counts if it is above the least that its sensor ever read, within 20 degrees of one of the four directions, and
if the robot does not turn fast. Between echoes, the distances follow the wheels.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from epuckhebb.adaptation.change_signal import NominalOfSide
from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import compiled
from epuckhebb.tmaze.robot import STEP_S, Robot

LEFT, AHEAD, RIGHT, BEHIND = 0, 1, 2, 3  # directions, as seen at the start
FAR = 0.012  # of full scale above the least reading: a wall
_CONE = math.radians(20.0)
_FASTEST = 0.07  # rad in a step
_SHARE = 0.3  # of a new reading in the smoothed one
_FLOOR_FROM = 10  # step from which on the least reading is looked for


@compiled
def angle_between(angle: float) -> float:
    """An angle [rad] from -pi to pi."""
    return angle - 2.0 * math.pi * math.floor(angle / (2.0 * math.pi) + 0.5)


@compiled
def distance_of(echo: float, nominal: NominalOfSide) -> float:
    """How far a wall is [m] by its echo above the least reading, as it was in the training world."""
    curve = nominal.echo
    distance: float = curve[1, curve.shape[1] - 1]
    for k in range(1, curve.shape[1]):
        if echo >= curve[0, k]:
            share = (echo - curve[0, k]) / (curve[0, k - 1] - curve[0, k])
            distance = max(0.0, curve[1, k] + share * (curve[1, k - 1] - curve[1, k]))
            break
    return distance


def walls(robot: Robot) -> Callable[..., None]:
    """The function `feel(now, echo, floor, wall, seen, readings, nominal, step)` of a robot.

    echo, floor: (distances,) smoothed readings, and the least so far. wall: (4,) distance of the wall in each
    direction from the robot's centre [m]. seen: (4,) steps since it was sensed.
    """
    count, first = robot.distance.count, robot.inputs_of(robot.distance).start
    azimuth = np.radians([place.azimuth for place in robot.distance.places])
    ahead, aside = np.array([place[:2] for place in robot.distance.places]).T.copy()
    wheel_radius, radius = robot.wheel_radius_m, robot.radius_m

    @compiled
    def feel(
        now: Any,
        echo: Floats,
        floor: Floats,
        wall: Floats,
        seen: Floats,
        readings: Floats,
        nominal: NominalOfSide,
        step: int,
    ) -> None:
        moved = wheel_radius * (now.left + now.right) / 2.0 * STEP_S
        cos, sin = math.cos(now.heading), math.sin(now.heading)  # of the heading since the start: 0 looks ahead
        for k in range(4):
            towards = sin if k == LEFT else cos if k == AHEAD else -sin if k == RIGHT else -cos
            wall[k] = max(radius, wall[k] - moved * towards)
            seen[k] = 1e9 if step == 0 else seen[k] + 1.0
        for i in range(count):
            echo[i] = readings[first + i] if step == 0 else echo[i] + _SHARE * (readings[first + i] - echo[i])
            if step > _FLOOR_FROM:
                floor[i] = min(floor[i], echo[i])
        if abs(now.turning) > _FASTEST:
            return
        for i in range(count):
            above = readings[first + i] - floor[i]
            if above < FAR:
                continue
            for k in range(4):
                side = math.pi / 2.0 * (1 - k)
                off = angle_between(now.heading + azimuth[i] - side)
                if abs(off) < _CONE:
                    turned = now.heading - side
                    place = ahead[i] * math.cos(turned) - aside[i] * math.sin(turned)
                    wall[k] = place + distance_of(above, nominal) * math.cos(off)
                    seen[k] = 0.0

    return feel
