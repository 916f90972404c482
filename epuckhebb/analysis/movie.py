"""Recorded lifetimes as a GIF or an MP4: all trials at once, at eight times their speed."""

import io
import tempfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Circle
from numpy.typing import NDArray
from PIL import Image

from epuckhebb.analysis.evaluate import Traces
from epuckhebb.analysis.figures import SIDE_COLOUR, controller_title, draw_maze, plain
from epuckhebb.analysis.floor import view
from epuckhebb.analysis.moments import timed_change_text, with_gaps
from epuckhebb.tmaze.robot import STEP_S
from epuckhebb.tmaze.scenario import Scenario

_SPEED = 8  # s of a lifetime in a second of film
_REST_S = 10.0  # s of lifetime shown after the last change and after the last robot stops
_HEIGHT, _PANEL_WIDTH, _LEAST_WIDTH, _DPI = 448, 480, 640, 100  # pixels; multiples of 16, as video codecs want

Track = Callable[[Sequence[float]], Iterable[float]]


def gif(traces: Traces, scenario: Scenario, title: str, track: Track = iter) -> bytes:
    """An animated GIF that repeats. track: wraps the moments to be drawn, to show progress."""
    frames_per_second, buffer = 12.5, io.BytesIO()  # GIF counts in hundredths of a second
    frames = map(Image.fromarray, _frames(traces, scenario, title, track, frames_per_second))
    duration = round(1000 / frames_per_second)
    next(frames).save(buffer, "GIF", save_all=True, append_images=frames, duration=duration, loop=0)
    return buffer.getvalue()


def mp4(traces: Traces, scenario: Scenario, title: str, track: Track = iter) -> bytes:
    """An MP4 film; needs imageio-ffmpeg. track: as of `gif`."""
    import imageio_ffmpeg

    frames_per_second = 25
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "film.mp4"
        size = (_width(traces), _HEIGHT)
        writer = imageio_ffmpeg.write_frames(str(path), size, fps=frames_per_second, ffmpeg_log_level="error")
        writer.send(None)
        for frame in _frames(traces, scenario, title, track, frames_per_second):
            writer.send(frame.tobytes())
        writer.close()
        return path.read_bytes()


def _frames(
    traces: Traces, scenario: Scenario, title: str, track: Track, frames_per_second: float
) -> Iterator[NDArray[np.uint8]]:
    """The pictures, (height, width, 3)."""
    controllers = list(dict.fromkeys(traces.controller))
    figure = Figure(figsize=(_width(traces) / _DPI, _HEIGHT / _DPI), dpi=_DPI, layout="constrained")
    canvas: Any = FigureCanvasAgg(figure)  # its methods have no types
    panels = dict(zip(controllers, figure.subplots(1, len(controllers), squeeze=False)[0], strict=True))
    for controller, axes in panels.items():
        axes.set_title(plain(controller_title(controller)), fontsize=11)
    heading = figure.suptitle("", fontsize=9)
    robot = scenario.robot
    moving: list[tuple[Any, Any, Any]] = []
    for controller, side in zip(traces.controller, traces.side, strict=True):
        axes, colour = panels[controller], SIDE_COLOUR[side]
        (trail,) = axes.plot([], [], color=colour, linewidth=1.4, animated=True)
        (nose,) = axes.plot([], [], color="white", linewidth=2.5, animated=True)
        body = axes.add_patch(Circle((0, 0), robot.radius_m, color=colour, alpha=0.85, animated=True))
        moving.append((trail, body, nose))
    heading.set_animated(True)
    left, right, bottom, top = view(scenario)
    time, pose = traces.samples.time[0], traces.samples.pose
    paths = [with_gaps(time, path, scenario) for path in pose]
    phases = [(step * STEP_S, world) for step, world in scenario.phases]
    still: Any = None
    shown, drawn = -1, list[Artist]()
    away = np.hypot(*np.moveaxis(pose[:, :, :2] - pose[:, -1:, :2], -1, 0)).max(axis=0) > 0.02
    rest = time[np.flatnonzero(away)[-1]] if away.any() else time[0]  # the last robot is within 2 cm of its end
    end = float(min(time[-1], max(rest, phases[-1][0]) + _REST_S)) + 1e-9
    for now in track(np.arange(0.0, end, _SPEED / frames_per_second).tolist()):
        phase = sum(since <= now for since, _ in phases) - 1
        if phase != shown:  # walls, obstacles and goals are drawn once for each world
            for artist in drawn:
                artist.remove()
            drawn = [artist for axes in panels.values() for artist in draw_maze(axes, phases[phase][1])]
            for axes in panels.values():
                axes.set(xlim=(left, right), ylim=(bottom, top))
            changed = f"   ◆{phase} {timed_change_text(scenario.events[phase - 1][1])}" if phase else ""
            heading.set_text(plain(f"{title}\n0 s"))
            canvas.draw()
            still, shown = canvas.copy_from_bbox(figure.bbox), phase
        canvas.restore_region(still)
        heading.set_text(plain(f"{title}\n{now:.0f} s{changed}"))
        heading.draw(canvas.get_renderer())
        for (trail, body, nose), (times, path) in zip(moving, paths, strict=True):
            x, y, heading_now = (np.interp(now, times, column) for column in path.T)
            past = path[: np.searchsorted(times, now)]
            trail.set_data([*past[:, 0], x], [*past[:, 1], y])
            body.center = (x, y)
            ahead = np.array([0.2, 0.9]) * robot.radius_m
            nose.set_data(x + ahead * np.cos(heading_now), y + ahead * np.sin(heading_now))
            for artist in (trail, body, nose):
                artist.axes.draw_artist(artist)
        yield np.asarray(canvas.buffer_rgba())[:, :, :3].copy()


def _width(traces: Traces) -> int:
    return max(_LEAST_WIDTH, _PANEL_WIDTH * len(set(traces.controller)))
