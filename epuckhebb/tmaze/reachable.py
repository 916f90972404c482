"""Which places of a maze a robot can reach, and how far it is from the walls."""

from functools import cache

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.arrays import Floats
from epuckhebb.tmaze.maze import SIDES, Maze, Place, boxes

GRID = 0.002  # m: of the places that are searched for a way to the goal
SPARE = 0.001  # m: by about this much a robot sinks into a wall in the physics


def gap(x: float, y: float, walls: Floats) -> float:
    """Distance [m] from a point to the nearest box of `walls` (boxes, 4); 0 inside one."""
    return float(_gaps(np.array([x]), np.array([y]), walls)[0, 0])


@cache
def check_reachable(maze: Maze, goals: tuple[Place, Place], obstacles: int, layout: int, radius: float) -> None:
    """Check that a robot of this radius [m] fits at the start of a maze and can reach its goals; else a ValueError."""
    placed = boxes(maze, obstacles, layout)
    here = gap(*maze.start[:2], placed)
    if here < radius - SPARE:
        raise ValueError(
            f"maze.start = {maze.start.x:g}, {maze.start.y:g} of {maze.name} is in a wall or too near one: a robot of "
            f"radius {radius:g} m has {here:.3f} m to the nearest"
        )
    axis, reached = reachable(maze, placed, radius)
    for side, goal in zip(SIDES, goals, strict=True):
        near = np.hypot(axis[:, None] - goal.x, axis[None, :] - goal.y) < maze.goal_radius_m
        if not (reached & near).any():
            raise ValueError(
                f"the goal of the {side}, {goal.x:g}, {goal.y:g}, cannot be reached in maze {maze.name}: no way from "
                f"the start is wide enough for a robot of radius {radius:g} m"
            )


def reachable(maze: Maze, walls: Floats, radius: float) -> tuple[Floats, NDArray[np.bool_]]:
    """The places that the centre of a robot of this radius [m] can reach from the start among these walls (boxes, 4).

    Returns the coordinates of a grid along X and Y [m], and (x, y) whether each place can be reached.
    """
    axis = np.arange(-maze.arena_m, maze.arena_m + GRID / 2, GRID)
    free = _gaps(axis, axis, walls) >= radius - SPARE
    start = np.zeros_like(free)
    start[tuple(np.rint((np.array(maze.start[:2]) + maze.arena_m) / GRID).astype(int))] = True
    return axis, _flooded(free, start & free)


def _flooded(free: NDArray[np.bool_], reached: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """All free cells that straight runs along the axes lead to. scipy.ndimage takes a tenth of a start to load."""
    size = len(free)
    lines = [np.arange(size)[:, None], np.arange(size)[None, :]]
    # A number for each run, which its free cells share with no others.
    runs = [np.cumsum(~free, axis=axis) + lines[1 - axis] * (size + 1) for axis in (0, 1)]
    before = 0
    while reached.sum() > before:
        before = reached.sum()
        for run in runs:
            of_run = np.zeros(run.max() + 1, np.bool_)
            of_run[run[reached]] = True
            reached = of_run[run] & free
    return reached


def _gaps(x: Floats, y: Floats, walls: Floats) -> Floats:
    """Distances (x, y) from points of a grid to the nearest box."""
    nearest = np.full((len(x), len(y)), np.inf)
    for left, right, bottom, top in walls:
        beside = np.maximum(np.maximum(left - x, x - right), 0.0)
        before = np.maximum(np.maximum(bottom - y, y - top), 0.0)
        with np.errstate(over="ignore"):  # a wall may be so far away that the square of its distance is infinite
            np.minimum(nearest, beside[:, None] ** 2 + before[None, :] ** 2, out=nearest)
    distances: Floats = np.sqrt(nearest)
    return distances
