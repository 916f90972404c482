"""Figures of the maze and of what robots did in it."""

import io

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Rectangle
from numpy.typing import NDArray
from PIL import Image

from epuckhebb.sim.controller import GA, HEBBIAN
from epuckhebb.sim.epuck import RADIUS
from epuckhebb.sim.maze import GOAL_RADIUS, GOALS, SIDES, START, WALLS, Side, boxes
from epuckhebb.sim.scenario import Scenario
from epuckhebb.study.evaluate import Traces

SIDE_COLOUR = {"left": "#0072B2", "right": "#D55E00"}  # blue and red as in the paper, apart for the colour-blind too
_WALL, _OBSTACLE, _LAMP = "#4d4d4d", "#b07d62", "#E69F00"


def trajectories(traces: Traces, scenario: Scenario, title: str) -> bytes:
    """A PNG with one maze for each controller: both trials' paths, where they began, and how they ended."""
    controllers = list(dict.fromkeys(traces.controller))
    figure = Figure(figsize=(4.8 * len(controllers), 4.6))
    figure.subplots_adjust(left=0.135 / len(controllers), right=0.985, bottom=0.17, top=0.87, wspace=0.16)
    panels = figure.subplots(1, len(controllers), squeeze=False)[0]
    for axes, controller in zip(panels, controllers, strict=True):
        draw_maze(axes, scenario)
        for lifetime, side in enumerate(traces.side):
            if traces.controller[lifetime] == controller:
                _draw_path(axes, traces.samples.pose[lifetime], "left" if side == "left" else "right")
        axes.set_title(controller_title(controller), fontsize=11)
        axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14), ncols=2, fontsize=9, frameon=False)
    figure.suptitle(title, fontsize=11 if len(controllers) > 1 else 8)
    return to_png(figure)


def maze(scenario: Scenario) -> bytes:
    """A PNG of the maze with the robot at its start."""
    figure = Figure(figsize=(5.4, 4.8), layout="constrained")
    axes = figure.subplots()
    draw_maze(axes, scenario)
    axes.add_patch(Circle((START.x, START.y), RADIUS, facecolor="#009E73", edgecolor="black", zorder=3))
    axes.plot([START.x, START.x], [START.y, START.y + RADIUS], color="black", zorder=4)
    for side in SIDES:
        axes.annotate(f"goal\n({side})", GOALS[side], ha="center", va="center", fontsize=8)
    return to_png(figure)


def controller_title(controller: str) -> str:
    """What stands above a controller's panel."""
    return {GA: "GA alone", HEBBIAN: "GA with Hebbian plasticity"}.get(controller, f"GA with plasticity “{controller}”")


def draw_maze(axes: Axes, scenario: Scenario) -> None:
    """Walls, obstacles, lamp and goals, to scale [m]."""
    for box, (left, right, bottom, top) in enumerate(boxes(scenario.obstacles, scenario.layout).tolist()):
        is_wall = box < len(WALLS)
        axes.add_patch(
            Rectangle(
                (left, bottom),
                right - left,
                top - bottom,
                facecolor=_WALL if is_wall else _OBSTACLE,
                linewidth=0,
                zorder=1.5 if is_wall else 1.0,
            )
        )
    for side in SIDES:
        axes.add_patch(Circle(GOALS[side], GOAL_RADIUS, fill=False, linestyle=":", edgecolor=SIDE_COLOUR[side]))
    axes.plot(scenario.lamp.x_m, scenario.lamp.y_m, marker="*", markersize=11, color=_LAMP, markeredgewidth=0)
    axes.annotate(
        "lamp (on: go right)", (scenario.lamp.x_m, scenario.lamp.y_m), (9, -3), textcoords="offset points", fontsize=8
    )
    axes.set(xlim=(-0.46, 0.46), ylim=(-0.46, 0.3), aspect="equal", xlabel="X (m)", ylabel="Y (m)")
    axes.spines[["top", "right"]].set_visible(False)


def _draw_path(axes: Axes, pose: NDArray[np.float64], side: Side) -> None:
    goal = np.array(GOALS[side])
    arrived = np.hypot(*(pose[-1, :2] - goal)) < GOAL_RADIUS
    label = f"{side}: {'at the goal' if arrived else 'did not arrive'}"
    axes.plot(pose[:, 0], pose[:, 1], color=SIDE_COLOUR[side], linewidth=1.4, label=label)
    axes.add_patch(Circle((pose[-1, 0], pose[-1, 1]), RADIUS, fill=False, edgecolor=SIDE_COLOUR[side], linewidth=1.2))
    axes.plot(START.x, START.y, marker="o", markersize=4, color="black")


def to_png(figure: Figure) -> bytes:
    """The figure as PNG, without the program's name, so that the same figure gives the same bytes."""
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=120, metadata={"Software": None})
    return buffer.getvalue()


def small(png: bytes) -> bytes:
    """The same picture in 256 colours, a third of the size: for a report that holds many."""
    buffer = io.BytesIO()
    Image.open(io.BytesIO(png)).convert("RGB").quantize(256).save(buffer, format="png", optimize=True)
    return buffer.getvalue()
