"""What someone does to a world by hand: puts the robot elsewhere, sets blocks down, lights the lamp, scales N, resets.

Here it is checked; `epuckhebb.sim.scenario` says what each means, and `epuckhebb.sim.session` does it.
"""

import math
from collections.abc import Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim.maze import Box, Maze, Pose, boxes
from epuckhebb.sim.reachable import GRID, SPARE, gap, reachable

MOST_BLOCKS = 20
SMALLEST_M, LARGEST_M = 0.005, 0.5  # sides of a block
_HIGHEST_RATE = 10_000.0  # times the base rate


def check_numbers(key: str, value: object) -> None:
    """Refuse what is not [x, y, heading], or a list of [x, y, width, height]."""
    rows = [value] if key == "put" else list(value) if isinstance(value, list | tuple) else [None]
    count, shape = (3, "[x, y, heading]") if key == "put" else (4, "a list of [x, y, width, height]")
    for row in rows:
        numbers = list(row) if isinstance(row, list | tuple) else []
        if len(numbers) != count or not all(_is_number(number) and math.isfinite(number) for number in numbers):
            raise ValueError(f"{key} must be {shape} in m and rad, got {value!r}")


def check_values(*, lamp_on: object, rate: object, reset: object) -> None:
    """Refuse a lamp that is neither lit nor out, a factor on N that cannot be, and a reset that is neither."""
    if not (lamp_on is None or isinstance(lamp_on, bool)):
        raise ValueError(f"lamp_on must be true, false, or null for what the side says, got {lamp_on!r}")
    if not (isinstance(rate, int | float) and not isinstance(rate, bool) and 0 <= rate <= _HIGHEST_RATE):
        raise ValueError(f"rate must be a number from 0 to {_HIGHEST_RATE:g}, the factor on N, got {rate!r}")
    if reset is not True and reset is not False:
        raise ValueError(f"reset must be true or false, got {reset!r}")


def check_placed(placed: Sequence[Box], maze: Maze) -> None:
    """Refuse too many blocks, blocks of no sensible size, and blocks outside the maze."""
    if len(placed) > MOST_BLOCKS:
        raise ValueError(f"placed must hold at most {MOST_BLOCKS} blocks, got {len(placed)}")
    for box in placed:
        if not all(SMALLEST_M <= side <= LARGEST_M for side in (box.width, box.height)):
            raise ValueError(f"placed: the sides of a block must be {SMALLEST_M:g} to {LARGEST_M:g} m, got {list(box)}")
        if max(abs(box.x), abs(box.y)) > maze.arena_m:
            raise ValueError(f"placed: the middle of a block must be in the maze, got {list(box)}")


def check_put(put: Pose, maze: Maze, radius: float, standing: NDArray[np.float64]) -> None:
    """Refuse a place where a robot of this radius [m] cannot stand, or that it could not get to from the start.

    standing: (boxes, 4), all that stands in the maze now.
    """
    axis, floor = _floor(maze, radius)
    places = [round((value + maze.arena_m) / GRID) for value in put[:2]]
    is_floor = all(0 <= place < len(axis) for place in places) and bool(floor[tuple(places)])
    if not is_floor or gap(put.x, put.y, standing) < radius - SPARE:
        raise ValueError(f"put: there is no room for the robot at {put.x:g}, {put.y:g}")


@cache
def _floor(maze: Maze, radius: float) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Where the middle of the robot can get to in a maze without obstacles."""
    return reachable(maze, boxes(maze), radius)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)
