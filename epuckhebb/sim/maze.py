"""The T-maze seen from above: a stem, a crossbar, two dead ends, and the obstacles that may narrow them.

X points to the robot's right and Y ahead of it at the start, in metres. All walls are boxes with sides along the axes.
Positions and sizes are those of the world file published with the paper (there x, z with z = -Y).
"""

import math
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim import streams
from epuckhebb.sim.compiled import compiled
from epuckhebb.sim.streams import Stream

Side = Literal["left", "right"]
SIDES: tuple[Side, Side] = ("left", "right")
OBSTACLE_COUNTS = (0, 2, 4)


class Pose(NamedTuple):
    """Where the robot's centre is, x and y [m], and where it looks, heading [rad], anticlockwise from X."""

    x: float
    y: float
    heading: float


class Box(NamedTuple):
    """A wall or an obstacle: its centre x, y [m] and its size along X and along Y [m]."""

    x: float
    y: float
    width: float
    height: float


START = Pose(0.007, -0.35, math.pi / 2)
GOALS: dict[Side, tuple[float, float]] = {"left": (-0.36, 0.155), "right": (0.36, 0.155)}
GOAL_RADIUS = 0.05  # m: at the goal when nearer than this, as in the published code

WALLS = (
    Box(-0.002842, 0.242401, 0.90, 0.06),  # crossbar, far side
    Box(-0.244, 0.082401, 0.40, 0.05),  # crossbar, near side, left
    Box(0.261, 0.082401, 0.40, 0.05),  # crossbar, near side, right
    Box(-0.07, -0.173, 0.05, 0.50),  # stem, left
    Box(0.087, -0.181, 0.05, 0.50),  # stem, right
    Box(-0.432842, 0.002401, 0.03, 0.90),  # outer left: the left dead end
    Box(0.437158, 0.002401, 0.03, 0.90),  # outer right: the right dead end
    Box(-0.002842, 0.432401, 0.90, 0.03),  # outer far
    Box(-0.002842, -0.437599, 0.90, 0.03),  # outer near: behind the start
)
OBSTACLES = (
    Box(-0.114, -0.067599, 0.05, 0.40),  # juts 24.6 mm into the left arm
    Box(0.226, -0.067599, 0.05, 0.40),  # juts 24.6 mm into the right arm
    Box(-0.234, 0.032401, 0.40, 0.05),  # juts 11 mm into the stem from the left
    Box(0.246, 0.032401, 0.40, 0.05),  # juts 16 mm into the stem from the right
)
_STEM = (-0.045, 0.062)  # m: x of the stem's walls
_CROSSBAR = (0.107401, 0.212401)  # m: y of the crossbar's walls
_JUTTING = 0.025  # m: of an obstacle into the crossbar; 80 mm stay free, as in the paper
_JUTTING_BOTH = 0.027  # m: of the stem's two together, for the same reason


def moved_obstacles(layout: int) -> tuple[Box, ...]:
    """Two obstacles in the arms and two in the stem, at random, each from a wall: the corridors stay 80 mm wide."""
    rng = streams.rng(layout, Stream.layout)
    placed = []
    for arm in (-1, 1):
        width, depth = rng.uniform(0.03, 0.10), rng.uniform(0.010, _JUTTING)
        y = _CROSSBAR[0] + depth / 2 if rng.random() < 0.5 else _CROSSBAR[1] - depth / 2
        placed.append(Box(arm * rng.uniform(0.15, 0.27), y, width, depth))
    left = rng.uniform(0.005, 0.022)
    for wall, depth, inwards in zip(_STEM, (left, _JUTTING_BOTH - left), (1, -1), strict=True):
        placed.append(Box(wall + inwards * depth / 2, rng.uniform(-0.22, 0.05), depth, rng.uniform(0.03, 0.10)))
    return tuple(placed)


def boxes(obstacles: int, layout: int = 0) -> NDArray[np.float64]:
    """The walls and the first 0, 2 or 4 obstacles: (boxes, 4) left, right, bottom and top edge [m]."""
    placed = WALLS + (moved_obstacles(layout) if layout else OBSTACLES)[:obstacles]
    return np.array([(b.x - b.width / 2, b.x + b.width / 2, b.y - b.height / 2, b.y + b.height / 2) for b in placed])


@compiled
def in_correct_arm(x: float, y: float, goal_x: float) -> bool:
    """Whether the robot's centre has turned into the arm that leads to its goal."""
    return y > 0.10 and x * math.copysign(1.0, goal_x) > 0.08
