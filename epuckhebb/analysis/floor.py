"""The part of a maze that a picture shows: the floor that a robot can cover, and the walls around it."""

import math
from functools import cache
from itertools import groupby, pairwise

import numpy as np
from numpy.typing import NDArray

from epuckhebb.tmaze.maze import Maze, boxes
from epuckhebb.tmaze.reachable import GRID, reachable
from epuckhebb.tmaze.scenario import Scenario

_ROUND = 0.02  # m: edges of a picture are multiples of this
_THICK = 0.06  # m of a wall are shown, or, if that is more,
_THICK_PART = 0.08  # this share of the floor's size


@cache
def floor(maze: Maze, radius: float) -> NDArray[np.float64]:
    """The floor of a maze without obstacles, as boxes: all that the body of a robot of this radius [m] can cover.

    Returns (boxes, 4): left, right, bottom and top edge [m]. They meet without gaps, and reach up to 1 mm into walls.
    """
    walls = boxes(maze)
    axis, middles = reachable(maze, walls, radius)
    wide, covered = math.ceil(radius / GRID), middles
    for _ in range(2):  # along each axis
        padded = np.pad(covered, ((wide, wide), (0, 0)))
        covered = np.lib.stride_tricks.sliding_window_view(padded, 2 * wide + 1, axis=0).max(axis=-1).T
    for left, right, bottom, top in walls:
        covered[np.ix_((left < axis) & (axis < right), (bottom < axis) & (axis < top))] = False
    ends = np.diff(np.pad(covered, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    runs = [tuple(pairwise(np.flatnonzero(column).tolist()))[::2] for column in ends]  # of each column, along Y
    floors = []
    for alike, group in groupby(enumerate(runs), key=lambda column: column[1]):  # neighbouring columns
        (first, _), *_, (last, _) = [*group] * 2
        left, right = axis[first] - GRID / 2, axis[last] + GRID / 2
        floors += [(left, right, axis[low] - GRID / 2, axis[high - 1] + GRID / 2) for low, high in alike]
    return np.array(floors)


def view(scenario: Scenario) -> tuple[float, float, float, float]:
    """Left, right, bottom and top edge [m] of a picture of a maze: its floor, the walls around it, and its lamps."""
    ground = floor(scenario.maze, scenario.robot.radius_m)
    walls = boxes(scenario.maze)
    edges = []
    for side, sign in ((0, -1), (1, 1), (2, -1), (3, 1)):
        across = [2, 3] if side < 2 else [0, 1]  # edges along this side
        edge = (sign * ground[:, side]).max()
        outermost = ground[sign * ground[:, side] > edge - GRID]
        thickest = max(_THICK, _THICK_PART * float(np.ptp(ground)))
        for wall in walls:
            along = np.minimum(wall[across[1]], outermost[:, across[1]]) - np.maximum(
                wall[across[0]], outermost[:, across[0]]
            )
            near, far = sorted(sign * wall[[side // 2 * 2, side // 2 * 2 + 1]])
            if (along > GRID).any() and near <= edge + GRID < far:
                edge = max(edge, min(far, near + thickest))
        edges.append(sign * edge)
    left, right, bottom, top = edges
    for _, world in scenario.phases:
        x, y = world.lamp.x_m, world.lamp.y_m
        if max(abs(x), abs(y)) <= scenario.maze.arena_m:
            left, right, bottom, top = min(left, x), max(right, x), min(bottom, y), max(top, y)
    outwards = ((math.floor, left), (math.ceil, right), (math.floor, bottom), (math.ceil, top))
    left, right, bottom, top = (round(whole(edge / _ROUND) * _ROUND, 6) for whole, edge in outwards)
    return left, right, bottom, top
