"""Figures of the maze and of trajectories in it."""

import textwrap
from collections.abc import Iterable
from dataclasses import replace
from typing import Any, NamedTuple, TypeVar

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import to_rgb, to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from matplotlib.patheffects import withStroke
from numpy.typing import NDArray

from epuckhebb.analysis.charts import INK, SIDE
from epuckhebb.analysis.evaluate import Traces
from epuckhebb.analysis.image import house_style, plain
from epuckhebb.analysis.moments import arrival, insert_gaps, timed_change_text
from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.plasticity.control import Sign
from epuckhebb.tmaze.individual import CONTROLS, GA, HEBBIAN
from epuckhebb.tmaze.maze import SIDES, Maze, Side, boxes
from epuckhebb.tmaze.samples import Samples
from epuckhebb.tmaze.scenario import Scenario

WALL, OBSTACLE, LAMP = "#4d4d4d", "#b07d62", "#E69F00"
_TITLES = {
    GA: "GA alone",
    HEBBIAN: "GA with Hebbian plasticity",
    CONTROLS[Sign.anti]: "GA with anti-Hebbian plasticity",
    CONTROLS[Sign.shuffled]: "GA with Hebbian plasticity, shuffled signs",
}
_SIGNS = "● start    ○ the robot at the end    ◌ goal    ★ lamp    grey: walls    brown: obstacles (light: for a part)"
_PANEL = 4.2  # inches
_SQUARES, _THICK = 400, 0.06  # of a grid a side; m of a wall that are shown
_DIGITS = 6  # of metres: edges that are nearer to each other are one
_DIM, _SUNNY = (np.array(to_rgb(name)) for name in ("#d5dae3", "#fff3c4"))  # floor in no and in full light
OUTLINE = withStroke(linewidth=2, foreground="white")  # of letters
_T = TypeVar("_T")


@house_style()
def trajectories(traces: Traces, scenario: Scenario, title: str) -> Figure:
    """One maze for each controller: the paths on both sides, their start and their end."""
    controllers = list(dict.fromkeys(traces.controller))
    figure, panels = _mazes(scenario, len(controllers))
    for axes, controller in zip(panels, controllers, strict=True):
        for name, side, samples in traces.lifetimes:
            if name == controller:
                _draw_path(axes, samples, scenario, side)
        axes.set_title(plain(controller_title(controller)), fontsize=11)
        axes.legend(ncols=2, fontsize=8.5, loc="upper center", bbox_to_anchor=(0.5, -0.13))
    figure.suptitle(textwrap.fill(plain(title), 54 * len(controllers)))
    return figure


@house_style()
def maze(scenario: Scenario) -> Figure:
    """The maze with the robot at its start."""
    figure, (axes,) = _mazes(scenario, 1, "")
    x, y, heading = scenario.maze.start
    ahead = scenario.robot.radius_m * np.array([np.cos(heading), np.sin(heading)])
    axes.add_patch(Circle((x, y), scenario.robot.radius_m, facecolor="white", edgecolor=INK, zorder=3))
    axes.plot([x, x + ahead[0]], [y, y + ahead[1]], color="black", zorder=4)
    for side in SIDES:
        axes.annotate(f"goal\n({side})", scenario.goals_now[side], ha="center", va="center", fontsize=8)
    return figure


def _mazes(scenario: Scenario, panels: int, signs: str = _SIGNS) -> tuple[Figure, list[Axes]]:
    """Mazes side by side; below them the changes of the lifetime and the meaning of the signs."""
    left, right, bottom, top = view(scenario.maze)
    wide = max(_PANEL * panels, 6.4 if scenario.changes else _PANEL)
    changes = [f"◆{number} {timed_change_text(change)}" for number, change in enumerate(scenario.changes, 1)]
    changes += [f"{len(scenario.hand)} changes by hand"] if scenario.hand else []
    lines = [line for part in ("    ".join(changes), signs) for line in textwrap.wrap(part, round(13 * wide))]
    high = min(5.6, max(1.6, 3.4 * (top - bottom) / (right - left))) + (1.5 if signs else 0.6) + 0.19 * len(lines)
    figure = Figure(figsize=(wide, high))
    figure.supxlabel(plain("\n".join(lines)), fontsize=8.5)
    drawn = list(figure.subplots(1, panels, squeeze=False)[0])
    for axes in drawn:
        draw_maze(axes, scenario)
    return figure, drawn


def view(maze: Maze) -> tuple[float, float, float, float]:
    """Left, right, bottom and top edge [m] of a picture of a maze: where a robot can get to, and the walls around."""
    floor, walls = _floor(maze), boxes(maze)
    x, y = (
        edges[np.flatnonzero(reached)[[0, -1]] + [0, 1]]
        for edges, reached in ((floor.x, floor.reached.any(axis=0)), (floor.y, floor.reached.any(axis=1)))
    )
    low, high = np.array([x, y]).T
    left, bottom = np.maximum(low - _THICK, np.maximum(walls[:, [0, 2]].min(axis=0), -maze.arena_m)).tolist()
    right, top = np.minimum(high + _THICK, np.minimum(walls[:, [1, 3]].max(axis=0), maze.arena_m)).tolist()
    return left, right, bottom, top


class _Floor(NamedTuple):
    """The floor of a maze, divided into fields by the edges of its walls, and the fields that a robot can reach.

    x, y: edges of the fields [m]. free, reached: whether no wall is in a field, and whether a robot can get there from
    its start, (y, x).
    """

    x: Floats
    y: Floats
    free: NDArray[np.bool_]
    reached: NDArray[np.bool_]


def _floor(maze: Maze) -> _Floor:
    """The fields of the floor of a maze; reached ones spread from the start, field by field, in four directions."""
    walls, arena = np.round(boxes(maze), _DIGITS), maze.arena_m
    x, y = (np.unique(np.clip([-arena, *walls[:, sides].ravel(), arena], -arena, arena)) for sides in ([0, 1], [2, 3]))
    in_x, in_y = ((edges[1:] + edges[:-1]) / 2 for edges in (x, y))
    free = np.ones((len(in_y), len(in_x)), bool)
    for left, right, bottom, top in walls:
        free[np.ix_((bottom < in_y) & (in_y < top), (left < in_x) & (in_x < right))] = False
    reached, count = np.zeros_like(free), -1
    reached[np.searchsorted(y, maze.start.y) - 1, np.searchsorted(x, maze.start.x) - 1] = True
    while count < (count := int(reached.sum())):
        for way in (reached, reached.T, reached[::-1], reached.T[::-1]):
            way[1:] |= way[:-1]
            reached &= free
    return _Floor(x, y, free, reached)


def controller_title(controller: str) -> str:
    """The title of the panel of a controller."""
    return _TITLES.get(controller, f"GA with “{controller}”")


def floor_colour(world: Scenario) -> tuple[float, float, float]:
    """The floor, warmer in brighter sunlight: red, green and blue, from 0 to 1."""
    red, green, blue = (_DIM + min(1.0, world.light) * (_SUNNY - _DIM)).tolist()
    return red, green, blue


def draw_maze(axes: Axes, scenario: Scenario) -> list[Artist]:
    """Walls, obstacles, lamp and goals, to scale [m]; returns them.

    Obstacles are the darker, the more of the changes they stay. A new place of a goal or a lamp has the number of
    the change.
    """
    worlds = [world for _, world in replace(scenario, hand=()).phases]  # changes by hand are too many for a picture
    axes.set_facecolor(floor_colour(scenario))
    floor, arena = _floor(scenario.maze), scenario.maze.arena_m
    squares = np.linspace(-arena, arena, _SQUARES)
    fields = np.ix_(*(np.searchsorted(edges[1:-1], squares) for edges in (floor.y, floor.x)))
    beyond = np.zeros((_SQUARES, _SQUARES, 4))
    beyond[(floor.free & ~floor.reached)[fields]] = to_rgba("white")
    wall, obstacle = {"color": WALL, "zorder": 1.5}, {"color": OBSTACLE, "alpha": 1 / len(worlds)}
    looks: list[tuple[Any, Any]] = [(edges, wall) for edges in boxes(scenario.maze)]
    looks += [(edges, obstacle) for world in worlds for edges in world.boxes[len(world.maze.walls) :]]
    drawn: list[Artist] = [axes.imshow(beyond, extent=(-arena, arena, -arena, arena), origin="lower", zorder=1.2)]
    drawn += [
        axes.add_patch(Rectangle((left, bottom), right - left, top - bottom, linewidth=0, **look))
        for (left, right, bottom, top), look in looks
    ]
    for side in SIDES:
        look = {"fill": False, "linestyle": ":", "edgecolor": SIDE[side]}
        for number, position in _numbered(world.goals_now[side] for world in worlds):
            drawn.append(axes.add_patch(Circle(position, scenario.maze.goal_radius_m, **look)))
            if number:
                drawn.append(axes.annotate(f"◆{number}", position, color=SIDE[side], fontsize=8, ha="center"))
    left, right, bottom, top = view(scenario.maze)
    lamps = [] if scenario.task.has_trials else _numbered((world.lamp.x_m, world.lamp.y_m) for world in worlds)
    for number, (x, y) in lamps:
        drawn += axes.plot(x, y, marker="*", markersize=11, color=LAMP, markeredgewidth=0)
        name = f"◆{number} lamp" if number else "lamp\n(on: go right)"
        offset, ha = ((9, -3), "left") if x < left + 0.7 * (right - left) else ((-9, -3), "right")
        label = axes.annotate(name, (x, y), offset, textcoords="offset points", fontsize=8, ha=ha)
        label.set_path_effects([OUTLINE])
        drawn.append(label)
    axes.set(xlim=(left, right), ylim=(bottom, top), aspect="equal", xlabel="X (m)", ylabel="Y (m)")
    return drawn


def _numbered(values: Iterable[_T]) -> list[tuple[int, _T]]:
    """Each new value with the number of its change; 0 for the first."""
    first: dict[_T, int] = {}
    for number, value in enumerate(values):
        first.setdefault(value, number)
    return [(number, value) for value, number in first.items()]


def _draw_path(axes: Axes, samples: Samples, scenario: Scenario, side: Side) -> None:
    """Draw the path of a lifetime, its start, its end, and a mark at each change of the world."""
    time, pose = samples.time, samples.pose
    end = "is rewarded first" if scenario.task.has_trials else arrival(samples, scenario, side).text
    radius, start = scenario.robot.radius_m, scenario.maze.start
    _, path = insert_gaps(time, pose, scenario)
    axes.plot(path[:, 0], path[:, 1], color=SIDE[side], linewidth=1.4, label=f"{side}: {end}")
    axes.add_patch(Circle((pose[-1, 0], pose[-1, 1]), radius, fill=False, edgecolor=SIDE[side], linewidth=1.2))
    axes.plot(start.x, start.y, marker="o", markersize=4, color="black")
    offset, ha = ((6, 5), "left") if side == "right" else ((-6, 5), "right")
    for number, since in enumerate([] if scenario.hand else samples.phase_began):
        if number and not np.isnan(since):
            x, y = (float(np.interp(since, time, pose[:, axis])) for axis in (0, 1))
            axes.plot(x, y, marker="D", markersize=5.5, color=SIDE[side], markeredgecolor="white", zorder=3)
            mark = axes.annotate(str(number), (x, y), offset, textcoords="offset points", fontsize=8, ha=ha, zorder=4)
            mark.set_path_effects([OUTLINE])
