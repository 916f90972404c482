"""A page to watch: recorded lifetimes side by side in the maze, and their networks as they adapt.

`page` fills the template `replay.html` beside this file with what was recorded. The page is one file that asks nothing
of any network; its policy forbids it to. All numbers are embedded as 16-bit integers times a step, at most 1000
samples of a lifetime, so that the four lifetimes of an evaluation take about 1.5 MB.
"""

import base64
import hashlib
import html
import json
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim.controller import GA, HEBBIAN, LAYERS, weights_at_birth
from epuckhebb.sim.epuck import AZIMUTH, PLACE_X, PLACE_Y, RADIUS, REACH, STEP_S, WHEEL_RADIUS
from epuckhebb.sim.lifetime import CONTACT, Samples
from epuckhebb.sim.maze import GOAL_RADIUS, GOALS, SIDES, START, WALLS, Side, boxes
from epuckhebb.sim.scenario import Scenario
from epuckhebb.study.evaluate import Traces
from epuckhebb.study.figures import controller_title

_MOST_SAMPLES = 1000  # of a lifetime; more are thinned out, and the page draws straight lines between them
_LARGEST = 32767  # of a 16-bit integer
_VIEW = (-0.456, 0.464, -0.456, 0.276)  # left, right, bottom, top [m]: the T, without the empty yard beyond it
_WHO = {GA: "without plasticity", HEBBIAN: "with plasticity"}
_NOTE = {
    GA: "its connections stay as they were at birth",
    HEBBIAN: "its connections change while it drives",
}


class Arrival(NamedTuple):
    """How a lifetime went: first time within 5 cm of the goal [s] or None, and the distance to it at the end [m]."""

    time: float | None
    final_distance: float

    @property
    def stayed(self) -> bool:
        """Whether the robot was at the goal at the last sample."""
        return self.final_distance < GOAL_RADIUS


def page(traces: Traces, genome: NDArray[np.float64], scenario: Scenario, title: str, *, gain_rad_s: float) -> str:
    """The HTML text of the page.

    genome: (234,), what the lifetimes began with. title: a line that says which run this is. gain_rad_s: wheel speed
    [rad/s] of a network output of 1.
    """
    template = Path(__file__).with_suffix(".html").read_text(encoding="utf-8")
    style, script = (
        re.findall(pattern, template, re.DOTALL)[0] for pattern in ("<style>(.*?)</style>", "<script>(.*?)</script>")
    )
    filling = {
        # Nothing may be fetched, and only this very style and script may act, whatever a title or a name says.
        "policy": f"default-src 'none'; img-src data:; style-src '{_hash(style)}'; script-src '{_hash(script)}'; "
        "base-uri 'none'; form-action 'none'",
        "title": html.escape(title),
        "data": json.dumps(_content(traces, genome, scenario, gain_rad_s), separators=(",", ":")).replace(
            "<", "\\u003c"
        ),
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda place: filling[place[1]], template)


def arrival(time: NDArray[np.float64], pose: NDArray[np.float64], side: Side) -> Arrival:
    """When and whether a robot arrived. time: (samples,) [s]. pose: (samples, 3) x, y [m], heading [rad]."""
    distance = np.hypot(*(pose[:, :2] - GOALS[side]).T)
    inside = np.flatnonzero(distance < GOAL_RADIUS)
    if not len(inside):
        return Arrival(None, float(distance[-1]))
    k = max(1, int(inside[0]))
    # Between two samples the robot drives straight on, near enough to find the step; metrics count its end.
    crossed = np.interp(-GOAL_RADIUS, -distance[k - 1 : k + 1], time[k - 1 : k + 1])
    return Arrival(math.ceil(crossed / STEP_S) * STEP_S, float(distance[-1]))


def outcome(side: Side, controllers: Sequence[str], arrivals: Sequence[Arrival]) -> str:
    """One plain sentence: who reached the goal of this side, and when."""
    goal = f"the goal on the {side}"
    lived = list(zip(controllers, arrivals, strict=True))
    stayed = [one for one in lived if one[1].stayed]
    others = [one for one in lived if not one[1].stayed]
    alone, both = len(lived) == 1, len(lived) == 2
    if alone and stayed:
        return f"The robot reached {goal} after {arrivals[0].time:.1f} s."
    if not others:
        told = f"{'Both' if both else 'All'} robots reached {goal}: "
    elif stayed:
        whom = " and the one ".join(_who(controller) for controller, _ in stayed)
        times = " and ".join(f"{arrived.time:.1f} s" for _, arrived in stayed)
        told = f"Only the robot {whom} reached {goal} and stayed there, after {times}; "
    else:
        passed = any(arrived.time is not None for arrived in arrivals)
        robots = "The robot never" if alone else "Neither robot" if both else "No robot"
        told = f"{robots} {'stayed at' if passed else 'reached'} {goal}: "
    who = [""] if alone else [f"{_who(controller)} " for controller, _ in others or stayed]
    return f"{told}{', '.join(map(_told, who, [arrived for _, arrived in others or stayed]))}."


def _who(controller: str) -> str:
    return _WHO.get(controller, f"with “{controller}”")


def _told(who: str, arrived: Arrival) -> str:
    away = f"ended {100 * arrived.final_distance:.0f} cm away"
    if arrived.time is None:
        return f"{who}it {away}"
    if arrived.stayed:
        return f"{who}after {arrived.time:.1f} s"
    return f"{who}it was there after {arrived.time:.1f} s but drove on and {away}"


def _content(traces: Traces, genome: NDArray[np.float64], scenario: Scenario, gain_rad_s: float) -> dict[str, Any]:
    controllers = list(dict.fromkeys(traces.controller))
    lifetime = {of: k for k, of in reversed(list(enumerate(zip(traces.controller, traces.side, strict=True))))}
    sides = [side for side in SIDES if side in traces.side]
    time = traces.samples.time[0]
    every = math.ceil(len(time) / _MOST_SAMPLES)
    interval = float(time[1] - time[0]) * every if len(time) > 1 else STEP_S
    birth = weights_at_birth(genome).astype(np.float32)
    lives, outcomes = {}, {}
    for side in sides:
        of_side = [Samples(*(array[lifetime[name, side]] for array in traces.samples)) for name in controllers]
        arrivals = [arrival(samples.time, samples.pose, side) for samples in of_side]
        outcomes[side] = outcome(side, controllers, arrivals)
        lives[side] = [
            {"arrival": arrived.time, "stayed": arrived.stayed, **_embedded(samples, birth, every)}
            for samples, arrived in zip(of_side, arrivals, strict=True)
        ]
    walls, obstacles = np.split(boxes(scenario.obstacles, scenario.layout), [len(WALLS)])
    return {
        "sides": sides,
        "controllers": [
            {"title": controller_title(name), "note": _NOTE.get(name, _NOTE[HEBBIAN])} for name in controllers
        ],
        "outcomes": outcomes,
        "samples": len(time[::every]),
        "interval": interval,  # s between samples
        "steps": round(interval / STEP_S),  # of 32 ms between samples
        "speed": 100 * gain_rad_s * WHEEL_RADIUS,  # cm/s of a wheel at a network output of 1
        "layers": LAYERS,
        "birth": [round(weight, 7) for weight in birth.tolist()],
        "robot": {
            "radius": RADIUS,
            "reach": REACH,
            "contact": CONTACT,
            "sensors": np.column_stack([PLACE_X, PLACE_Y, AZIMUTH]).tolist(),
        },
        "maze": {
            "view": _VIEW,
            "floor": _floor(),
            "walls": walls.tolist(),
            "obstacles": obstacles.tolist(),
            "start": START[:2],
            "goals": GOALS,
            "goalRadius": GOAL_RADIUS,
            "lamp": [scenario.lamp.x_m, scenario.lamp.y_m, scenario.lamp.beam_rad],
        },
        "lives": lives,
    }


def _floor() -> list[list[float]]:
    """Where a robot can be, as boxes left, right, bottom, top [m]: the crossbar and the stem."""
    edges = boxes(0)
    far, near, stem_left, stem_right, outer_left, outer_right, behind = edges[[0, 1, 3, 4, 5, 6, 8]]
    return [
        [outer_left[1], outer_right[0], near[3], far[2]],
        [stem_left[1], stem_right[0], behind[3], near[3]],
    ]


def _embedded(samples: Samples, birth: NDArray[np.float32], every: int) -> dict[str, Any]:
    """A lifetime as packed arrays, one sample in `every`; weights as their change since birth, which is far smaller."""
    columns = {
        "x": samples.pose[:, 0],
        "y": samples.pose[:, 1],
        "heading": samples.pose[:, 2],
        "sensors": samples.sensors,
        "left": samples.motors[:, 0],
        "right": samples.motors[:, 1],
        "fitness": samples.fitness,
        "surprise": np.nan_to_num(samples.surprise),
        "rate": samples.rate,
        "weightChange": samples.weight_change,
        "change": samples.weights - birth,
    }
    return {name: _packed(values[::every]) for name, values in columns.items()}


def _packed(values: NDArray[np.floating[Any]]) -> dict[str, Any]:
    """The values as little-endian 16-bit integers in base64, row by row, times `step`; no numbers if all are 0."""
    step = float(np.abs(values).max()) / _LARGEST
    if step == 0.0:
        return {"step": 0.0, "numbers": ""}
    return {"step": step, "numbers": base64.b64encode(np.rint(values / step).astype("<i2").tobytes()).decode()}


def _hash(text: str) -> str:
    return f"sha256-{base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()}"
