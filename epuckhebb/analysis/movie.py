"""Recorded lifetimes as a GIF: all trials at once, at sixteen times their speed, with a verdict at the end."""

import io
import itertools
import textwrap
from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from PIL import Image

from epuckhebb.analysis.charts import INK, SIDE
from epuckhebb.analysis.evaluate import Traces
from epuckhebb.analysis.figures import LAMP, OBSTACLE, OUTLINE, WALL, controller_title, draw_maze, floor_colour, view
from epuckhebb.analysis.image import house_style, plain
from epuckhebb.analysis.moments import arrival, insert_gaps, timed_change_text
from epuckhebb.tmaze.robot import STEP_S
from epuckhebb.tmaze.scenario import Scenario

_SPEED = 16  # s of a lifetime in a second of film
_FRAME_S, _LAST_S = 0.1, 4.0  # GIF counts in hundredths of a second
_PANEL, _MARGIN, _DPI = 3.6, 0.95, 100  # inches, inches above and below, pixels an inch


@house_style()
def gif(traces: Traces, scenario: Scenario, title: str) -> bytes:
    """An animated GIF that repeats."""
    worlds = [world for _, world in scenario.phases]
    palette = _palette(["white", INK, WALL, OBSTACLE, LAMP, *SIDE.values()], list(map(floor_colour, worlds)))
    frames = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in _frames(traces, scenario, title)]
    durations = [round(1000 * _FRAME_S)] * (len(frames) - 1) + [round(1000 * _LAST_S)]
    buffer = io.BytesIO()
    frames[0].save(buffer, "GIF", save_all=True, append_images=frames[1:], duration=durations, loop=0)
    return buffer.getvalue()


def _palette(names: list[str], floors: list[Any]) -> Image.Image:
    """The colours of a film, and steps between each two: the edges of what is drawn."""
    colours = np.array([*map(to_rgb, names), *floors[:4]])
    pairs = [(1 - part) * a + part * b for a, b in itertools.combinations(colours, 2) for part in (0.3, 0.6)]
    image = Image.new("P", (1, 1))
    image.putpalette(np.rint(255 * np.concatenate([colours, pairs])).astype(int).flatten().tolist()[:768])
    return image


def _frames(traces: Traces, scenario: Scenario, title: str) -> Iterator[Image.Image]:
    """The frames of the film: the maze is drawn once for each world, robots and paths on it at each moment."""
    controllers = list(dict.fromkeys(traces.controller))
    left, right, bottom, top = view(scenario.maze)
    size = (_PANEL * len(controllers), _PANEL * (top - bottom) / (right - left) + _MARGIN)
    figure = Figure(figsize=size, dpi=_DPI)
    canvas: Any = FigureCanvasAgg(figure)  # its methods have no types
    panels = dict(zip(controllers, figure.subplots(1, len(controllers), squeeze=False)[0], strict=True))
    radius, time = scenario.robot.radius_m, traces.samples.time[0]
    for controller, axes in panels.items():
        axes.set_title(plain(controller_title(controller)), fontsize=12)
    figure.suptitle(textwrap.fill(plain(title), 48 * len(controllers)), fontsize=8)
    clock = figure.supxlabel("0 s", fontsize=12, animated=True)
    moving: list[tuple[Any, ...]] = []
    for controller, side, samples in traces.lifetimes:
        axes = panels[controller]
        look: dict[str, Any] = {"color": SIDE[side], "animated": True}
        (trail,) = axes.plot([], [], linewidth=1.8, **look)
        body = axes.add_patch(Circle((0, 0), radius, alpha=0.85, zorder=3, **look))
        (nose,) = axes.plot([], [], color="white", linewidth=2.5, zorder=4, animated=True)
        stayed = arrival(samples, scenario, side).stayed
        ends_left = samples.pose[-1, 0] < (left + right) / 2
        x, look["ha"] = (left + 0.05, "left") if ends_left else (right - 0.05, "right")
        y = samples.pose[-1, 1] - (5.0 if side == "left" else 7.0) * radius
        text = "" if scenario.task.has_trials else f"{side} {'✓' if stayed else '✗'}"
        verdict = axes.text(x, y, text, fontsize=14, weight="bold", path_effects=[OUTLINE], **look)
        moving.append((trail, body, nose, verdict, insert_gaps(time, samples.pose, scenario)))
    phases = [(step * STEP_S, world) for step, world in scenario.phases]
    shown, drawn, still = -1, list[Artist](), None
    ahead = np.array([0.2, 0.9]) * radius
    moments = np.arange(0.0, time[-1] + 1e-9, _SPEED * _FRAME_S).tolist()
    for now in [*moments, time[-1]]:
        phase = sum(since <= now for since, _ in phases) - 1
        if phase != shown:  # walls, obstacles and goals are drawn once for each world
            for artist in drawn:
                artist.remove()
            drawn = [artist for axes in panels.values() for artist in draw_maze(axes, phases[phase][1])]
            for axes in panels.values():
                axes.set(xticks=[], yticks=[], xlabel="", ylabel="")
                axes.spines[:].set_visible(False)
            canvas.draw()
            still, shown = canvas.copy_from_bbox(figure.bbox), phase
        canvas.restore_region(still)
        changed = f"   ◆{phase} {timed_change_text(scenario.events[phase - 1][1])}" if phase else ""
        clock.set_text(plain(f"{now:.0f} s{changed}"))
        clock.draw(canvas.get_renderer())
        for trail, body, nose, verdict, (times, path) in moving:
            x, y, direction = (np.interp(now, times, column) for column in path.T)
            past = path[: np.searchsorted(times, now)]
            trail.set_data([*past[:, 0], x], [*past[:, 1], y])
            body.center = (x, y)
            nose.set_data(x + ahead * np.cos(direction), y + ahead * np.sin(direction))
            for artist in (trail, body, nose, *([verdict] if now == time[-1] else [])):
                artist.axes.draw_artist(artist)
        yield Image.fromarray(np.asarray(canvas.buffer_rgba())[:, :, :3].copy())
