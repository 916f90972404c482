"""Recorded lifetimes as a GIF: all trials at once, at eight times their speed."""

import io
from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from PIL import Image

from epuckhebb.analysis.evaluate import Traces
from epuckhebb.analysis.figures import SIDE_COLOUR, controller_title, draw_maze, plain
from epuckhebb.analysis.image import as_by_default
from epuckhebb.analysis.moments import timed_change_text, with_gaps
from epuckhebb.tmaze.robot import STEP_S
from epuckhebb.tmaze.scenario import Scenario

_SPEED = 8  # s of a lifetime in a second of film
_FRAME_S = 0.08  # GIF counts in hundredths of a second
_PANEL, _LEAST_WIDTH, _DPI = 4.8, 6.4, 100  # inches, inches, pixels an inch


@as_by_default()
def gif(traces: Traces, scenario: Scenario, title: str) -> bytes:
    """An animated GIF that repeats."""
    buffer, frames = io.BytesIO(), _frames(traces, scenario, title)
    more = {"save_all": True, "append_images": frames, "duration": round(1000 * _FRAME_S), "loop": 0}
    next(frames).save(buffer, "GIF", **more)
    return buffer.getvalue()


def _frames(traces: Traces, scenario: Scenario, title: str) -> Iterator[Image.Image]:
    controllers = list(dict.fromkeys(traces.controller))
    figure = Figure(figsize=(max(_LEAST_WIDTH, _PANEL * len(controllers)), _PANEL), dpi=_DPI, layout="constrained")
    canvas: Any = FigureCanvasAgg(figure)  # its methods have no types
    panels = dict(zip(controllers, figure.subplots(1, len(controllers), squeeze=False)[0], strict=True))
    for controller, axes in panels.items():
        axes.set_title(plain(controller_title(controller)), fontsize=11)
    heading = figure.suptitle("", fontsize=9)
    heading.set_animated(True)
    ahead = np.array([0.2, 0.9]) * scenario.robot.radius_m
    moving: list[tuple[Any, Any, Any]] = []
    for controller, side in zip(traces.controller, traces.side, strict=True):
        axes, colour = panels[controller], SIDE_COLOUR[side]
        (trail,) = axes.plot([], [], color=colour, linewidth=1.4, animated=True)
        (nose,) = axes.plot([], [], color="white", linewidth=2.5, animated=True)
        body = axes.add_patch(Circle((0, 0), scenario.robot.radius_m, color=colour, alpha=0.85, animated=True))
        moving.append((trail, body, nose))
    time = traces.samples.time[0]
    paths = [with_gaps(time, path, scenario) for path in traces.samples.pose]
    phases = [(step * STEP_S, world) for step, world in scenario.phases]
    still: Any = None
    shown, drawn = -1, list[Artist]()
    for now in np.arange(0.0, time[-1] + 1e-9, _SPEED * _FRAME_S).tolist():
        phase = sum(since <= now for since, _ in phases) - 1
        if phase != shown:  # walls, obstacles and goals are drawn once for each world
            for artist in drawn:
                artist.remove()
            drawn = [artist for axes in panels.values() for artist in draw_maze(axes, phases[phase][1])]
            changed = f"   ◆{phase} {timed_change_text(scenario.events[phase - 1][1])}" if phase else ""
            heading.set_text(plain(f"{title}\n0 s"))
            canvas.draw()
            still, shown = canvas.copy_from_bbox(figure.bbox), phase
        canvas.restore_region(still)
        heading.set_text(plain(f"{title}\n{now:.0f} s{changed}"))
        heading.draw(canvas.get_renderer())
        for (trail, body, nose), (times, path) in zip(moving, paths, strict=True):
            x, y, direction = (np.interp(now, times, column) for column in path.T)
            past = path[: np.searchsorted(times, now)]
            trail.set_data([*past[:, 0], x], [*past[:, 1], y])
            body.center = (x, y)
            nose.set_data(x + ahead * np.cos(direction), y + ahead * np.sin(direction))
            for artist in (trail, body, nose):
                artist.axes.draw_artist(artist)
        yield Image.fromarray(np.asarray(canvas.buffer_rgba())[:, :, :3].copy())
