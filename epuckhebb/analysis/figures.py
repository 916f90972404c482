"""Figures of the maze and of trajectories in it."""

import textwrap
from collections.abc import Iterable
from dataclasses import replace
from typing import Any, Literal, TypeVar

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties, findfont, get_font
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.patches import Circle, Rectangle
from matplotlib.patheffects import withStroke

from epuckhebb.analysis.evaluate import Traces
from epuckhebb.analysis.floor import view
from epuckhebb.analysis.moments import arrival, begins, timed_change_text, with_gaps
from epuckhebb.controller.plasticity.control import Sign
from epuckhebb.tmaze.individual import CONTROLS, GA, HEBBIAN
from epuckhebb.tmaze.maze import SIDES, Side, boxes
from epuckhebb.tmaze.samples import Samples
from epuckhebb.tmaze.scenario import Scenario

# Blue and orange (the paper: red), which colour-blind readers can distinguish.
SIDE_COLOUR = {"left": "#0072B2", "right": "#D55E00"}
_WALL, _OBSTACLE, _LAMP, _CHANGE = "#4d4d4d", "#b07d62", "#E69F00", "#222222"
_TITLES = {
    GA: "GA alone",
    HEBBIAN: "GA with Hebbian plasticity",
    CONTROLS[Sign.anti]: "GA with anti-Hebbian plasticity",
    CONTROLS[Sign.shuffled]: "GA with Hebbian plasticity, shuffled signs",
}
_GAP = "    "  # between two entries of a legend
_T = TypeVar("_T")
_PANEL, _HIGH, _LOW = 4.8, 5.6, 1.6  # inches: width of a panel, greatest and least height of its axes
_TOP, _BOTTOM, _LINE = 0.6, 0.78, 0.19  # inches: above the axes, below them, and a line of text


def trajectories(traces: Traces, scenario: Scenario, title: str) -> Figure:
    """One maze for each controller: the paths on both sides, their start and their end."""
    controllers = list(dict.fromkeys(traces.controller))
    axes_height = _axes_height(scenario)
    wide = max(_PANEL * len(controllers), 6.4 if scenario.changes else _PANEL)
    obstacles = _obstacles(scenario)
    signs = ["● start", "○ the robot at the end", "◌ goal", *([] if scenario.task.has_trials else ["★ lamp"])]
    signs += ["grey: walls", *(["brown: obstacles"] if any(obstacles.values()) else [])]
    signs += [] if all(obstacles.values()) else ["dashed brown: obstacles for a part of the lifetime"]
    lines = _lines(scenario, wide, signs)
    height, below = axes_height + _TOP + _BOTTOM + _LINE * len(lines), _BOTTOM + _LINE * len(lines)
    figure = Figure(figsize=(wide, height))
    figure.subplots_adjust(left=0.65 / wide, right=0.985, bottom=below / height, top=1 - _TOP / height, wspace=0.16)
    panels = figure.subplots(1, len(controllers), squeeze=False)[0]
    for axes, controller in zip(panels, controllers, strict=True):
        draw_maze(axes, scenario)
        for lifetime, side in enumerate(traces.side):
            if traces.controller[lifetime] == controller:
                samples = Samples(*(array[lifetime] for array in traces.samples))
                _draw_path(axes, samples, scenario, "left" if side == "left" else "right")
        axes.set_title(plain(controller_title(controller)), fontsize=11)
    size = 7.5 if any(len(label) > 24 for axes in panels for label in axes.get_legend_handles_labels()[1]) else 9
    for axes in panels:
        below_axes = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.44 / axes_height)}
        axes.legend(ncols=2, fontsize=size, frameon=False, columnspacing=1.5, **below_axes)
    figure.text(0.5, 0.07 / height, plain("\n".join(lines)), ha="center", va="bottom", fontsize=8.5)
    figure.suptitle(plain(title), fontsize=11 if len(controllers) > 1 else 8)
    return figure


def maze(scenario: Scenario) -> Figure:
    """The maze with the robot at its start."""
    lines = _lines(scenario, 5.4)
    height = _axes_height(scenario) + 0.8 + _LINE * len(lines)
    below = _LINE * len(lines) / height
    figure = Figure(figsize=(5.4, height), layout=ConstrainedLayoutEngine(rect=(0, below, 1, 1 - below)))
    axes = figure.subplots()
    draw_maze(axes, scenario)
    x, y, heading = scenario.maze.start
    ahead = scenario.robot.radius_m * np.array([np.cos(heading), np.sin(heading)])
    axes.add_patch(Circle((x, y), scenario.robot.radius_m, facecolor="#009E73", edgecolor="black", zorder=3))
    axes.plot([x, x + ahead[0]], [y, y + ahead[1]], color="black", zorder=4)
    for side in SIDES:
        axes.annotate(f"goal\n({side})", scenario.goals_now[side], ha="center", va="center", fontsize=8)
    figure.text(0.5, 0.07 / height, plain("\n".join(lines)), ha="center", va="bottom", fontsize=8.5)
    return figure


def _axes_height(scenario: Scenario) -> float:
    left, right, bottom, top = view(scenario)
    return min(_HIGH, max(_LOW, 4.0 * (top - bottom) / (right - left)))


def controller_title(controller: str) -> str:
    """The title of the panel of a controller."""
    return _TITLES.get(controller, f"GA with “{controller}”")


def plain(text: str) -> str:
    """The text as matplotlib shows it unchanged, not as mathematics; `?` for each sign that its font lacks."""
    signs = get_font(findfont(FontProperties())).get_charmap()
    return "".join(sign if sign == "\n" or ord(sign) in signs else "?" for sign in text).replace("$", r"\$")


def tidy(axes: Axes, grid: Literal["x", "y"] | None = None) -> None:
    """No frame above and at the right; a light grid across an axis, if one is named."""
    axes.spines[["top", "right"]].set_visible(False)
    if grid:
        axes.grid(axis=grid, color="#ddd", linewidth=0.6)
        axes.set_axisbelow(True)


def draw_maze(axes: Axes, scenario: Scenario) -> list[Artist]:
    """Walls, obstacles, lamp and goals, to scale [m]; returns them.

    Obstacles that are there for a part of the lifetime are lighter, with a dashed edge. A new place of a goal or a
    lamp has the number of the change.
    """
    worlds = [world for _, world in replace(scenario, hand=()).phases]  # changes by hand are too many for a picture
    wall: dict[str, Any] = {"facecolor": _WALL, "linewidth": 0, "zorder": 1.5}
    obstacle: dict[str, Any] = {"facecolor": _OBSTACLE, "linewidth": 0, "zorder": 1.0}
    for_a_part: dict[str, Any] = {
        "facecolor": to_rgba(_OBSTACLE, 0.35),
        "linewidth": 1.0,
        "linestyle": (0, (3, 2)),
        "zorder": 0.9,
    }
    looks = [(tuple(edges), wall) for edges in boxes(scenario.maze).tolist()]
    looks += [
        (edges, obstacle if always else {**for_a_part, "edgecolor": _OBSTACLE})
        for edges, always in _obstacles(scenario).items()
    ]
    drawn: list[Artist] = [
        axes.add_patch(Rectangle((left, bottom), right - left, top - bottom, **look))
        for (left, right, bottom, top), look in looks
    ]
    for side in SIDES:
        places = _numbered(world.goals_now[side] for world in worlds)
        for number, place in places:
            line = ":" if len(places) == 1 else "--"
            radius = scenario.maze.goal_radius_m
            drawn.append(axes.add_patch(Circle(place, radius, fill=False, linestyle=line, edgecolor=SIDE_COLOUR[side])))
            if number:
                drawn.append(_label(axes, f"◆{number}", place, (0, -3), SIDE_COLOUR[side], "center"))
    edges = view(scenario)
    lamps = _numbered((world.lamp.x_m, world.lamp.y_m, world.lamp.towards_x, world.lamp.towards_y) for world in worlds)
    for number, (x, y, towards_x, towards_y) in (
        () if scenario.task.has_trials else lamps
    ):  # there the lamp has no meaning
        drawn += axes.plot(x, y, marker="*", markersize=11, color=_LAMP, markeredgewidth=0)
        shines = np.array([towards_x, towards_y]) / np.hypot(towards_x, towards_y)
        from_it, to = (np.array([x, y]) + share * (edges[1] - edges[0]) * shines for share in (0.018, 0.04))
        drawn += axes.plot([from_it[0], to[0]], [from_it[1], to[1]], color=_LAMP, linewidth=1.6)
        on_the_right = shines[0] < 0.1 and x < edges[0] + 0.7 * (edges[1] - edges[0])  # the side with more space
        name = f"◆{number} lamp" if number else "lamp (on: go right)"
        drawn.append(
            _label(axes, name, (x, y), (9 if on_the_right else -9, -3), "black", "left" if on_the_right else "right")
        )
    axes.set(xlim=edges[:2], ylim=edges[2:], aspect="equal", xlabel="X (m)", ylabel="Y (m)")
    tidy(axes)
    return drawn


def _obstacles(scenario: Scenario) -> dict[tuple[float, ...], bool]:
    """The edges of all obstacles of a lifetime, but those placed by hand, and whether they are there all the time."""
    worlds = [world for _, world in replace(scenario, hand=()).phases]
    placed = [[tuple(edges) for edges in world.boxes[len(world.maze.walls) :].tolist()] for world in worlds]
    return {edges: all(edges in other for other in placed) for obstacles in placed for edges in obstacles}


def _numbered(values: Iterable[_T]) -> list[tuple[int, _T]]:
    """Each new value with the number of its change; 0 for the first."""
    first: dict[_T, int] = {}
    for number, value in enumerate(values):
        first.setdefault(value, number)
    return [(number, value) for value, number in first.items()]


def _label(
    axes: Axes, text: str, place: tuple[float, float], offset: tuple[float, float], colour: str, ha: str
) -> Artist:
    return axes.annotate(text, place, offset, textcoords="offset points", fontsize=8, color=colour, ha=ha)


def _draw_path(axes: Axes, samples: Samples, scenario: Scenario, side: Side) -> None:
    time, pose = samples.time, samples.pose
    end = "is rewarded first" if scenario.task.has_trials else arrival(samples, scenario, side).text
    radius, start = scenario.robot.radius_m, scenario.maze.start
    _, path = with_gaps(time, pose, scenario)
    axes.plot(path[:, 0], path[:, 1], color=SIDE_COLOUR[side], linewidth=1.4, label=f"{side}: {end}")
    axes.add_patch(Circle((pose[-1, 0], pose[-1, 1]), radius, fill=False, edgecolor=SIDE_COLOUR[side], linewidth=1.2))
    axes.plot(start.x, start.y, marker="o", markersize=4, color="black")
    near: list[tuple[float, float, list[str]]] = []  # changes at about the same place of the robot
    for number, (since, _) in enumerate([] if scenario.hand else begins(scenario, samples.phase_began)):
        if number and since is not None:
            x, y = (float(np.interp(since, time, pose[:, axis])) for axis in (0, 1))
            axes.plot(x, y, marker="D", markersize=5.5, color=SIDE_COLOUR[side], markeredgecolor="white", zorder=3)
            same = [numbers for x0, y0, numbers in near if np.hypot(x - x0, y - y0) < radius]
            if same:
                same[0].append(str(number))
            else:
                near.append((x, y, [str(number)]))
    for x, y, numbers in near:
        offset, ha = ((6, 5), "left") if side == "right" else ((-6, 5), "right")
        mark = _label(axes, ", ".join(numbers), (x, y), offset, _CHANGE, ha)
        mark.set(zorder=4, path_effects=[withStroke(linewidth=2, foreground="white")])


def _lines(scenario: Scenario, inches: float, signs: Iterable[str] = ()) -> list[str]:
    """The lines below a picture of this width: its changes, then the meaning of its signs."""
    changes = [f"◆{number} {timed_change_text(change)}" for number, change in enumerate(scenario.changes, 1)]
    changes += [f"{len(scenario.hand)} changes by hand"] if scenario.hand else []
    lines: list[str] = []
    for parts in (changes, signs):
        above = len(lines)
        for part in parts:
            if len(lines) > above and len(lines[-1]) + len(part) < 13 * inches:
                lines[-1] += f"{_GAP}{part}"
            else:
                lines += textwrap.wrap(part, round(13 * inches))
    return lines
