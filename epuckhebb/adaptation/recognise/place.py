"""Recognising the dead end with the goal: by compass, lamp and walls, without the goal signal.

    here        walls on both sides of the corridor sensed within 60 steps, the end wall within 5 steps and nearer than
                66 mm, the open side not for 60 steps, the corridor 80 to 128 mm wide: for more than 6 steps
    withdrawn   after 15 steps without the end wall, or with a wall on the open side

The end is on the side that the lamp means in the training world if it counts as lit, else on the other.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.adaptation.change_signal import NominalOfSide
from epuckhebb.adaptation.recognise.compass import LIT, compass
from epuckhebb.adaptation.recognise.walls import AHEAD, BEHIND, FAR, LEFT, RIGHT, angle_between, walls
from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import compiled
from epuckhebb.tmaze.robot import Robot

# Chosen in the worlds that exist, on champions 1 to 20:
END_M, NARROWEST_M, WIDEST_M = 0.066, 0.080, 0.128
_RECENT, _FADED, _HOLD, _WITHDRAW = 5.0, 60.0, 6.0, 15.0  # steps
_STRAIGHT, _OPEN = math.radians(12.0), math.radians(160.0)

NOW = np.dtype(
    [
        ("step", np.int64),  # from the start of recognition: a calibration may come before
        ("heading", np.float64),  # rad since then, anticlockwise
        ("turning", np.float64),  # rad in the next step
        ("left", np.float64),  # commanded speed of the left wheel, rad/s
        ("right", np.float64),
        ("bearing", np.float64),  # where the sun stands, rad from the heading at the start; nan: no sun
        ("level", np.float64),  # of the sun, as it is believed to be
        ("lamp", np.float64),  # how much unexplained light there was; from LIT on it is lit
        ("steady", np.float64),  # steps for which it has looked like the end
        ("doubt", np.float64),  # steps for which it has not, since then
        ("here", np.float64),  # 1 while the robot recognises the goal
    ]
)


class PlaceState(NamedTuple):
    """What recognition carries from step to step.

    now: one record of `NOW`. dark, bright: of `compass`. echo, floor, wall, seen: of `walls`.
    """

    now: NDArray[np.void]
    dark: Floats
    bright: Floats
    echo: Floats
    floor: Floats
    wall: Floats
    seen: Floats


def initial_place_state(robot: Robot) -> PlaceState:
    """The state before the first step."""
    lights, distances = robot.light.count, robot.distance.count
    return PlaceState(
        now=np.zeros(1, NOW),
        dark=np.zeros(lights),
        bright=np.zeros(lights),
        echo=np.zeros(distances),
        floor=np.ones(distances),
        wall=np.zeros(4),
        seen=np.zeros(4),
    )


def can_recognise(robot: Robot) -> bool:
    """Whether a robot has light and infra-red sensors at the same places, four or more."""
    return robot.light.places == robot.distance.places and robot.light.count >= 4


def check_recognition(robot: Robot) -> None:
    """Check that a robot has the sensors to recognise a place: light and infra-red, at the same places all around.

    Raises:
        ValueError: it has not.
    """
    if not can_recognise(robot):
        raise ValueError(
            f"adaptation.recognise needs light and infra-red sensors at the same four places or more, and robot "
            f"{robot.name} has {robot.light.count} and {robot.distance.count}; give adaptation.recognise=false"
        )


def recognition(robot: Robot) -> Callable[..., bool]:
    """The function `recognised(place, readings, nominal)` of a robot: whether it believes to be at its goal.

    Raises:
        ValueError: the robot lacks the sensors.
    """
    check_recognition(robot)
    (turn, look), feel = compass(robot), walls(robot)
    count, first = robot.distance.count, robot.inputs_of(robot.distance).start
    azimuth = np.radians([place.azimuth for place in robot.distance.places])

    @compiled
    def looks_like_the_end(wall: Floats, seen: Floats, end: int) -> bool:
        width = wall[AHEAD] + wall[BEHIND]
        corridor = seen[AHEAD] < _FADED and seen[BEHIND] < _FADED and NARROWEST_M < width < WIDEST_M
        at_end = seen[end] < _RECENT and wall[end] < END_M and seen[LEFT + RIGHT - end] > _FADED
        return bool(corridor and at_end)

    @compiled
    def looks_wrong(now: Any, dark: Floats, floor: Floats, readings: Floats, end: int) -> bool:
        side, wrong = math.pi / 2.0 * (1 - end), False
        for i in range(count):
            above = readings[first + i] - floor[i]
            off = abs(angle_between(now.heading + azimuth[i] - side))
            wrong = wrong or (off < _STRAIGHT and above < FAR and dark[i] < 40.0) or (off > _OPEN and above > FAR)
        return wrong

    @compiled
    def recognised(place: PlaceState, readings: Floats, nominal: NominalOfSide) -> bool:
        now = place.now[0]
        step = now.step
        turn(now)
        look(now, place.dark, place.bright, readings, nominal, step)
        feel(now, place.echo, place.floor, place.wall, place.seen, readings, nominal, step)
        now.step += 1
        lit = now.lamp >= LIT
        end = LEFT if lit == (nominal.lamp_side > 0.0) else RIGHT
        now.steady = now.steady + 1.0 if looks_like_the_end(place.wall, place.seen, end) else 0.0
        if now.steady > _HOLD:
            now.here = 1.0
        if now.here > 0.0:
            now.doubt = now.doubt + 1.0 if looks_wrong(now, place.dark, place.floor, readings, end) else 0.0
            if now.doubt > _WITHDRAW:
                now.here, now.steady, now.doubt = 0.0, 0.0, 0.0
        return bool(now.here > 0.0)

    return recognised
