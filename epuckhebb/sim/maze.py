"""A maze as data, seen from above: walls, where the robot starts, its goals and the arms that lead there.

X points to the robot's right and Y ahead of it at the start of the paper's maze, in metres. All walls are boxes with
sides along the axes. The paper's T-maze is here; others are files of `conf/maze/` with the keys that `Maze` has, and
`maze_from` makes a maze of what such a file holds.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim import mapping, random
from epuckhebb.sim.random import Stream

Side = Literal["left", "right"]
SIDES: tuple[Side, Side] = ("left", "right")
_LARGEST = 10.0  # m: the half side of the largest arena
GRID = 0.002  # m: of the places that are looked at for a way to the goal
_BYTES_PER_PLACE = 46.0  # of the grid, at most at one time
_SPARE = 0.001  # m: the physics lets a robot sink into a wall by about so much


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

    along: the axis along which the corridor runs, `x` or `y`. walls: where its two walls are on the other axis [m].
    between: where the obstacle's middle may be along the corridor [m]. length: its size along it [m]. depth: how far
    it juts in [m]. both: 0 for one obstacle, at either wall; else two, one at each wall, that jut in by so much [m]
    together.
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

    walls, obstacles: boxes by name; obstacles are there in the order given, as many as the scenario says.
    obstacle_counts: how many a scenario may have. niches: where random layouts put obstacles. start: of the robot.
    goals: of each side. goal_radius_m: at the goal when nearer than this. arms: of each side, the region in which the
    robot has turned the right way. arena_m: no robot gets farther from the middle than this along X or Y.

    Raises:
        ValueError: a box has no size, two boxes have one name, the start is in a wall, or something lies outside.
    """

    name: str
    walls: Mapping[str, Box]
    obstacles: Mapping[str, Box] = field(default_factory=dict)
    obstacle_counts: tuple[int, ...] = (0,)
    niches: tuple[Niche, ...] = ()
    start: Pose
    goals: Mapping[Side, Place]
    goal_radius_m: float = 0.05
    arms: Mapping[Side, Region]
    arena_m: float = 0.5

    def __post_init__(self) -> None:
        """Refuse mazes that cannot be."""
        if not 0 < self.arena_m <= _LARGEST:
            raise ValueError(f"maze.arena_m must be more than 0 and at most {_LARGEST:g}, got {self.arena_m}")
        if not (math.isfinite(self.goal_radius_m) and self.goal_radius_m > 0):
            raise ValueError(f"maze.goal_radius_m must be a number above 0, got {self.goal_radius_m}")
        twice = sorted(self.walls.keys() & self.obstacles.keys())
        if twice:
            raise ValueError(f"maze.walls and maze.obstacles must have different names, both have {', '.join(twice)}")
        if not self.walls:
            raise ValueError("maze.walls must hold one wall or more")
        for kind in ("walls", "obstacles"):
            for name, box in getattr(self, kind).items():
                if not (all(map(math.isfinite, box)) and box.width > 0 and box.height > 0):
                    raise ValueError(
                        f"maze.{kind}.{name} must be x, y, width and height in m, the sizes above 0, got {list(box)}"
                    )
        for kind in ("goals", "arms"):
            if set(getattr(self, kind)) != set(SIDES):
                raise ValueError(
                    f"maze.{kind} must have one for each of {', '.join(SIDES)}, got {list(getattr(self, kind))}"
                )
        for side in SIDES:
            region = self.arms[side]
            if not (region.left < region.right and region.bottom < region.top):
                raise ValueError(
                    f"maze.arms.{side} must have left below right and bottom below top, got {list(region)}"
                )
        for name, (x, y) in {"start": self.start[:2], **{f"goals.{side}": self.goals[side] for side in SIDES}}.items():
            if not (math.isfinite(x) and math.isfinite(y) and max(abs(x), abs(y)) < self.arena_m):
                raise ValueError(
                    f"maze.{name} must lie in the arena, within {self.arena_m} m of the middle, got {x}, {y}"
                )
        if not math.isfinite(self.start.heading):
            raise ValueError(f"maze.start.heading must be a finite number, got {self.start.heading}")
        if not self.obstacle_counts or not all(0 <= count <= len(self.obstacles) for count in self.obstacle_counts):
            raise ValueError(
                f"maze.obstacle_counts must lie between 0 and the {len(self.obstacles)} obstacles of the maze, "
                f"got {list(self.obstacle_counts)}"
            )
        for number, niche in enumerate(self.niches):
            if niche.along not in ("x", "y") or not niche.walls[0] < niche.walls[1]:
                raise ValueError(f"maze.niches[{number}] must run along x or y between two walls, the lower one first")

    def __hash__(self) -> int:
        """Mazes are compared by what they hold."""
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
)


_REQUIRED = ("name", "walls", "start", "goals", "arms")
_OPTIONAL = ("obstacles", "obstacle_counts", "niches", "goal_radius_m", "arena_m")
_LAMP = "lamp"  # a maze file may say where its lamp is; the scenario takes it from there


def maze_from(told: Mapping[str, Any], where: str = "maze") -> Maze:
    """A maze from plain mappings, as a file of `conf/maze/` holds it; `where` is its key in messages.

    Keys are those of `Maze`: boxes and goals by name with a key for each number, `start.heading_deg` in degrees,
    bounds of arms that are left out infinite, niches a list of mappings. A key `lamp` is left to the scenario.

    Raises:
        ValueError: a key is missing or not known, or a value is not what the maze needs.
    """
    found = mapping.keys(where, told, _REQUIRED, _OPTIONAL, ignored=[_LAMP])
    start = mapping.keys(f"{where}.start", found["start"], ("x", "y", "heading_deg"))
    x, y, heading_deg = (mapping.number(f"{where}.start.{key}", start[key]) for key in ("x", "y", "heading_deg"))
    values: dict[str, Any] = {
        "name": mapping.text(f"{where}.name", found["name"]),
        "walls": _boxes_from(f"{where}.walls", found["walls"]),
        "start": Pose(x, y, math.radians(heading_deg)),
        "goals": {
            side: Place(**_numbers(f"{where}.goals.{side}", place, Place._fields))
            for side, place in mapping.keys(f"{where}.goals", found["goals"], SIDES).items()
        },
        "arms": {
            side: _region_from(f"{where}.arms.{side}", region)
            for side, region in mapping.keys(f"{where}.arms", found["arms"], SIDES).items()
        },
    }
    for key in ("goal_radius_m", "arena_m"):
        if key in found:
            values[key] = mapping.number(f"{where}.{key}", found[key])
    if "obstacles" in found:
        values["obstacles"] = _boxes_from(f"{where}.obstacles", found["obstacles"])
    if "obstacle_counts" in found:
        key = f"{where}.obstacle_counts"
        counts = mapping.items(key, found["obstacle_counts"])
        values["obstacle_counts"] = tuple(mapping.whole(f"{key}[{n}]", count) for n, count in enumerate(counts))
    if "niches" in found:
        key = f"{where}.niches"
        niches = mapping.items(key, found["niches"])
        values["niches"] = tuple(_niche_from(f"{key}[{n}]", niche) for n, niche in enumerate(niches))
    return Maze(**values)


def _numbers(where: str, told: object, names: tuple[str, ...]) -> dict[str, float]:
    """A finite number for each of the names."""
    found = mapping.keys(where, told, names)
    return {name: mapping.number(f"{where}.{name}", found[name]) for name in names}


def _boxes_from(where: str, told: object) -> dict[str, Box]:
    return {
        name: Box(**_numbers(f"{where}.{name}", box, Box._fields)) for name, box in mapping.mapping(where, told).items()
    }


def _region_from(where: str, told: object) -> Region:
    found = mapping.keys(where, told, (), Region._fields)
    return Region(**{name: mapping.bound(f"{where}.{name}", value) for name, value in found.items()})


def _niche_from(where: str, told: object) -> Niche:
    found = mapping.keys(where, told, ("along", "walls", "between", "length", "depth"), ("both",))
    values: dict[str, Any] = {"along": mapping.text(f"{where}.along", found["along"])}
    for key in ("walls", "between", "length", "depth"):
        values[key] = tuple(mapping.row(f"{where}.{key}", found[key], ("from", "to")))
    if "both" in found:
        values["both"] = mapping.number(f"{where}.both", found["both"])
    return Niche(**values)


def random_obstacles(maze: Maze, layout: int) -> list[Box]:
    """Obstacles in the niches of a maze, at random, each from a wall; the same for the same number of the layout."""
    rng = random.rng(layout, Stream.layout)

    def between(low: float, high: float) -> float:
        return low + (high - low) * rng.random()

    placed = []
    for niche in maze.niches:
        low, high = niche.walls
        if niche.both:
            first = between(*niche.depth)
            for wall, depth, inwards in ((low, first, 1), (high, niche.both - first, -1)):
                placed.append(
                    _in_corridor(
                        niche, between(*niche.between), wall + inwards * depth / 2, depth, between(*niche.length)
                    )
                )
        else:
            length, depth = between(*niche.length), between(*niche.depth)
            across = low + depth / 2 if rng.random() < 0.5 else high - depth / 2
            placed.append(_in_corridor(niche, between(*niche.between), across, depth, length))
    return placed


def _in_corridor(niche: Niche, along: float, across: float, depth: float, length: float) -> Box:
    return Box(along, across, length, depth) if niche.along == "x" else Box(across, along, depth, length)


def edges(placed: list[Box]) -> NDArray[np.float64]:
    """Boxes as (boxes, 4): left, right, bottom and top edge [m]."""
    rows = [(b.x - b.width / 2, b.x + b.width / 2, b.y - b.height / 2, b.y + b.height / 2) for b in placed]
    return np.array(rows, float).reshape(-1, 4)


def boxes(maze: Maze, obstacles: int = 0, layout: int = 0) -> NDArray[np.float64]:
    """The walls and the first so many obstacles of a layout: (boxes, 4) left, right, bottom and top edge [m]."""
    return edges([*maze.walls.values(), *(obstacles_of(maze, layout)[:obstacles])])


def obstacles_of(maze: Maze, layout: int) -> list[Box]:
    """All obstacles of a layout: 0 as the maze has them, k > 0 at random, the k-th way."""
    return random_obstacles(maze, layout) if layout else list(maze.obstacles.values())


def added(before: NDArray[np.float64], after: NDArray[np.float64]) -> NDArray[np.float64]:
    """The boxes of `after` (boxes, 4) that are not among those of `before`."""
    known = (after[:, None] == before).all(axis=2).any(axis=1)
    new: NDArray[np.float64] = after[~known]
    return new


def gap(x: float, y: float, walls: NDArray[np.float64]) -> float:
    """Distance [m] from a point to the nearest box of `walls` (boxes, 4); 0 inside one."""
    return float(_gaps(np.array([x]), np.array([y]), walls)[0, 0])


def check_reachable(maze: Maze, goals: Mapping[Side, Place], obstacles: int, layout: int, radius: float) -> None:
    """Refuse a maze in which a robot of this radius [m] cannot stand at the start or get to a goal.

    Raises:
        ValueError: the start is in a wall, or no way leads to a goal.
    """
    _check_reachable(boxes(maze, obstacles, layout).tobytes(), maze, tuple(goals[side] for side in SIDES), radius)


@cache
def _check_reachable(walls: bytes, maze: Maze, goals: tuple[Place, ...], radius: float) -> None:
    placed = np.frombuffer(walls).reshape(-1, 4)
    here = gap(*maze.start[:2], placed)
    if here < radius - _SPARE:
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


def grid_bytes(arena_m: float) -> float:
    """How many bytes of memory it takes, about, to look for a way to the goals in an arena of this half side [m]."""
    return _BYTES_PER_PLACE * (2 * arena_m / GRID + 1) ** 2


def reachable(maze: Maze, walls: NDArray[np.float64], radius: float) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Where the middle of a robot of this radius [m] can get to from the start, among these walls (boxes, 4).

    Returns the places of a grid along X, which are those along Y too [m], and (x, y) whether each can be reached.
    """
    axis = np.arange(-maze.arena_m, maze.arena_m + GRID / 2, GRID)
    free = _gaps(axis, axis, walls) >= radius - _SPARE
    there = np.zeros_like(free)
    there[tuple(np.rint((np.array(maze.start[:2]) + maze.arena_m) / GRID).astype(int))] = True
    return axis, _flooded(free, there)


def _gaps(x: NDArray[np.float64], y: NDArray[np.float64], walls: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distances (x, y) from points of a grid to the nearest box."""
    nearest = np.full((len(x), len(y)), np.inf)
    for left, right, bottom, top in walls:
        beside = np.maximum(np.maximum(left - x, x - right), 0.0)
        before = np.maximum(np.maximum(bottom - y, y - top), 0.0)
        np.minimum(nearest, beside[:, None] ** 2 + before[None, :] ** 2, out=nearest)
    distances: NDArray[np.float64] = np.sqrt(nearest)
    return distances


def _flooded(free: NDArray[np.bool_], there: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """All free cells that can be reached from `there`, straight run by straight run."""
    while True:
        before = there.sum()
        for axis in (0, 1):
            walls_so_far = np.cumsum(~free, axis=axis)  # cells of one free run of a line share this number
            lines = np.moveaxis(walls_so_far, axis, 1), np.moveaxis(there & free, axis, 1)
            runs = lines[0] + np.arange(len(free))[:, None] * (free.shape[axis] + 1)
            reached = np.bincount(runs.ravel(), weights=lines[1].ravel()) > 0
            there = np.moveaxis(reached[runs], 1, axis) & free
        if there.sum() == before:
            return there
