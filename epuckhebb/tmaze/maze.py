"""A maze as data, seen from above: walls, where the robot starts, its goals and the arms that lead there.

X points to the robot's right and Y ahead of it at the start of the paper's maze, in metres. All walls are boxes with
sides along the axes. The paper's T-maze is here; others are files of `conf/maze/` with the keys that `Maze` has.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

import numpy as np

from epuckhebb.controller import random
from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.random import Stream
from epuckhebb.controller.ranges import Range, check, check_value, within

Side = Literal["left", "right"]
SIDES: tuple[Side, Side] = ("left", "right")
_LARGEST = 10.0  # m: the half side of the largest arena


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


class Region(NamedTuple):
    """An open box: between left and right, and between bottom and top [m]; infinite where it has no bound."""

    left: float = -math.inf
    right: float = math.inf
    bottom: float = -math.inf
    top: float = math.inf


class Place(NamedTuple):
    """A point [m]."""

    x: float
    y: float


class Niche(NamedTuple):
    """Where an obstacle of a random layout may stand: against a wall of a corridor.

    along: the axis along which the corridor runs, `x` or `y`. walls: positions of its two walls on the other axis [m].
    between, length, depth: ranges of the obstacle's middle along the corridor, of its size along it, and of how far it
    juts in [m]. both: 0 for one obstacle, at either wall; else two, one at each wall, with this sum of depths [m].
    """

    along: str
    walls: tuple[float, float]
    between: tuple[float, float]
    length: tuple[float, float]
    depth: tuple[float, float]
    both: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Maze:
    """A maze.

    walls, obstacles: boxes by name; a scenario has the first few obstacles. obstacle_counts: how many a scenario may
    have, all among them. niches: where random layouts put obstacles. start: of the robot. goals: of each side.
    goal_radius_m: the robot is at the goal when nearer than this. arms: of each side, the region in which the robot has
    turned the right way. arena_m: half side; a robot farther from the middle is lost.
    wall_height_m: for three-dimensional physics.
    """

    name: str
    walls: Mapping[str, Box]
    obstacles: Mapping[str, Box] = field(default_factory=dict)
    obstacle_counts: tuple[int, ...] = (0,)
    niches: tuple[Niche, ...] = ()
    start: Pose
    goals: Mapping[Side, Place]
    goal_radius_m: float = within(0, above=True, default=0.05)
    arms: Mapping[Side, Region]
    arena_m: float = within(0, _LARGEST, above=True, default=0.5)
    wall_height_m: float | None = within(0, above=True, default=None)

    def __post_init__(self) -> None:
        check(self, "maze")
        for kind in ("walls", "obstacles"):
            for name, box in getattr(self, kind).items():
                check_value(f"maze.{kind}.{name}, its sizes,", box[2:], Range(0, above=True))
        arena = Range(-self.arena_m, self.arena_m, above=True, below=True)
        for name, point in {"start": self.start, **{f"goals.{side}": self.goals[side] for side in SIDES}}.items():
            check_value(f"maze.{name}", point[:2], arena)
        check_value("maze.obstacle_counts", self.obstacle_counts, Range(0, len(self.obstacles)))
        if max(self.obstacle_counts, default=0) < len(self.obstacles):
            raise ValueError(f"maze.obstacle_counts must reach {len(self.obstacles)}, got {list(self.obstacle_counts)}")
        for number, niche in enumerate(self.niches):
            if niche.along not in ("x", "y") or not niche.walls[0] < niche.walls[1]:
                raise ValueError(f"maze.niches[{number}] must run along x or y between two walls, the lower one first")

    def __hash__(self) -> int:
        """A hash of some of what mazes are compared by; mappings have none of their own."""
        return hash((self.name, tuple(self.walls.items()), tuple(self.obstacles.items()), self.start))


T_MAZE = Maze(
    # Positions and sizes are those of the world file published with the paper (there x, z with z = -Y).
    name="t_maze",
    walls={
        "crossbar_far": Box(-0.002842, 0.242401, 0.90, 0.06),
        "crossbar_near_left": Box(-0.244, 0.082401, 0.40, 0.05),
        "crossbar_near_right": Box(0.261, 0.082401, 0.40, 0.05),
        "stem_left": Box(-0.07, -0.173, 0.05, 0.50),
        "stem_right": Box(0.087, -0.181, 0.05, 0.50),
        "outer_left": Box(-0.432842, 0.002401, 0.03, 0.90),  # the left dead end
        "outer_right": Box(0.437158, 0.002401, 0.03, 0.90),  # the right dead end
        "outer_far": Box(-0.002842, 0.432401, 0.90, 0.03),
        "outer_near": Box(-0.002842, -0.437599, 0.90, 0.03),  # behind the start
    },
    obstacles={
        "arm_left": Box(-0.114, -0.067599, 0.05, 0.40),  # juts 24.6 mm into the left arm
        "arm_right": Box(0.226, -0.067599, 0.05, 0.40),  # juts 24.6 mm into the right arm
        "stem_from_left": Box(-0.234, 0.032401, 0.40, 0.05),  # juts 11 mm into the stem
        "stem_from_right": Box(0.246, 0.032401, 0.40, 0.05),  # juts 16 mm into the stem
    },
    obstacle_counts=(0, 2, 4),
    niches=(  # corridors stay 80 mm wide, as in the paper
        Niche("x", (0.107401, 0.212401), (-0.15, -0.27), (0.03, 0.10), (0.010, 0.025)),
        Niche("x", (0.107401, 0.212401), (0.15, 0.27), (0.03, 0.10), (0.010, 0.025)),
        Niche("y", (-0.045, 0.062), (-0.22, 0.05), (0.03, 0.10), (0.005, 0.022), 0.027),
    ),
    start=Pose(0.007, -0.35, math.pi / 2),
    goals={"left": Place(-0.36, 0.155), "right": Place(0.36, 0.155)},
    goal_radius_m=0.05,  # as in the published code
    arms={"left": Region(right=-0.08, bottom=0.10), "right": Region(left=0.08, bottom=0.10)},
    arena_m=0.5,
    wall_height_m=0.05,
)


def random_obstacles(maze: Maze, layout: int) -> list[Box]:
    """Random obstacles in the niches of a maze; the same for the same layout number."""
    rng = random.rng(layout, Stream.layout)

    def between(low: float, high: float) -> float:
        return low + (high - low) * rng.random()

    placed = []
    for niche in maze.niches:
        low, high = niche.walls
        if niche.both:
            first = between(*niche.depth)
            for wall, depth, inwards in ((low, first, 1), (high, niche.both - first, -1)):
                across = wall + inwards * depth / 2
                placed.append(_is_in_corridor(niche, between(*niche.between), across, depth, between(*niche.length)))
        else:
            length, depth = between(*niche.length), between(*niche.depth)
            across = low + depth / 2 if rng.random() < 0.5 else high - depth / 2
            placed.append(_is_in_corridor(niche, between(*niche.between), across, depth, length))
    return placed


def _is_in_corridor(niche: Niche, along: float, across: float, depth: float, length: float) -> Box:
    return Box(along, across, length, depth) if niche.along == "x" else Box(across, along, depth, length)


def edges(placed: list[Box]) -> Floats:
    """Boxes as (boxes, 4): left, right, bottom and top edge [m]."""
    rows = [(b.x - b.width / 2, b.x + b.width / 2, b.y - b.height / 2, b.y + b.height / 2) for b in placed]
    return np.array(rows, float).reshape(-1, 4)


def boxes(maze: Maze, obstacles: int = 0, layout: int = 0) -> Floats:
    """The walls and the first obstacles: (boxes, 4) left, right, bottom and top edge [m].

    layout: 0 for the obstacles of the maze, k > 0 for the k-th random layout.
    """
    placed = random_obstacles(maze, layout) if layout else list(maze.obstacles.values())
    return edges([*maze.walls.values(), *placed[:obstacles]])


def added(before: Floats, after: Floats) -> Floats:
    """The boxes of `after` (boxes, 4) that are not among those of `before`."""
    is_old = (after[:, None] == before).all(axis=2).any(axis=1)
    new: Floats = after[~is_old]
    return new


def is_reachable(goal: Place, near_m: float, start: Pose, walls: Floats, radius_m: float, arena_m: float) -> bool:
    """Whether walls leave a robot of this radius a way from its start to less than `near_m` from a goal.

    The robot counts as the square in its circle: so it is never False where there is a way, and may be True where a gap
    is too narrow by less than a third.
    """
    left, right, bottom, top = (walls + radius_m / math.sqrt(2.0) * np.array([-1.0, 1.0, -1.0, 1.0])).T
    ends = np.array([[*left, *right, -arena_m, arena_m], [*bottom, *top, -arena_m, arena_m]])
    xs, ys = map(np.unique, ends.clip(-arena_m, arena_m))
    x, y = (xs[1:] + xs[:-1])[:, None, None] / 2.0, (ys[1:] + ys[:-1])[None, :, None] / 2.0
    free = ~((left < x) & (x < right) & (bottom < y) & (y < top)).any(axis=2)
    reached = np.zeros_like(free)
    reached[np.searchsorted(xs, start.x) - 1, np.searchsorted(ys, start.y) - 1] = True
    last = ~reached
    while (last != reached).any():
        last = reached.copy()
        reached[1:] |= last[:-1]
        reached[:-1] |= last[1:]
        reached[:, 1:] |= last[:, :-1]
        reached[:, :-1] |= last[:, 1:]
        reached &= free
    beside = np.maximum(np.maximum(xs[:-1] - goal.x, goal.x - xs[1:]), 0.0)[:, None]
    ahead = np.maximum(np.maximum(ys[:-1] - goal.y, goal.y - ys[1:]), 0.0)
    return bool((reached & (np.hypot(beside, ahead) < near_m)).any())


def gap(x: float, y: float, walls: Floats) -> float:
    """Distance [m] from a point to the nearest box of `walls` (boxes, 4); 0 inside one."""
    left, right, bottom, top = walls.T
    beside = np.maximum(np.maximum(left - x, x - right), 0.0)
    ahead = np.maximum(np.maximum(bottom - y, y - top), 0.0)
    with np.errstate(over="ignore"):  # a wall may be so far away that the square of its distance is infinite
        return math.sqrt((beside**2 + ahead**2).min(initial=math.inf))
