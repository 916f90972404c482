"""The replay page: recorded lifetimes side by side in the maze, and their networks as weights change.

`page` fills the template `replay.html` beside this file with the record. The page is one file that loads nothing; its
policy forbids it. Numbers are embedded as 16-bit integers times a step, at most 1000 samples of a lifetime. The four
lifetimes of an evaluation take about 1.5 MB.
"""

import base64
import html
import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epuckhebb.analysis.evaluate import Traces
from epuckhebb.analysis.figures import controller_title, view
from epuckhebb.analysis.moments import arrival, change_text, put_back
from epuckhebb.analysis.page import filled, policy
from epuckhebb.controller.network import PAPER_NETWORK, Network, starting_weights
from epuckhebb.tmaze.lifetime import CONTACT
from epuckhebb.tmaze.maze import SIDES, boxes
from epuckhebb.tmaze.robot import STEP_S
from epuckhebb.tmaze.samples import Samples
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.sensors import Place

_MOST_SAMPLES = 1000  # of a lifetime; of more, every so many-th is kept
_LARGEST = 32767  # of a 16-bit integer
_APART = (  # what is drawn, or named in the title, and what is no fault
    *("name", "experiment", "light", "obstacles", "layout", "goals", "lamp", "lamp_on", "placed"),
    *("rate", "put", "reset", "changes", "hand", "paper_N", "paper_duration_s"),
    *("maze", "robot", "task", "fitness", "physics"),
)


def page(
    traces: Traces,
    genes: NDArray[np.float64],
    scenario: Scenario,
    title: str,
    *,
    gain_rad_s: float,
    network: Network = PAPER_NETWORK,
    notes: Sequence[str] = (),
) -> str:
    """The HTML text of the page.

    genes: of these lifetimes, the weights first. title: a line that names the run. gain_rad_s: wheel gain, the wheel
    speed [rad/s] at a network output of 1. network: of these genes. notes: lines below it.
    """
    controllers = list(dict.fromkeys(traces.controller))
    recorded = {(name, side): samples for name, side, samples in reversed(traces.lifetimes)}
    sides = [side for side in SIDES if side in traces.side]
    time = traces.samples.time[0]
    every = math.ceil(len(time) / _MOST_SAMPLES)
    interval = float(time[1] - time[0]) * every if len(time) > 1 else STEP_S
    initial = starting_weights(genes[: network.synapses]).astype(np.float32)
    lifetimes = {}
    has_trials = scenario.task.has_trials
    for side in sides:
        of_side = [recorded[name, side] for name in controllers]
        arrivals = [arrival(samples, scenario, side) for samples in of_side]
        lifetimes[side] = [
            {
                "arrival": None if has_trials else arrived.time,
                "stayed": arrived.stayed and not has_trials,
                "resets": np.ceil(put_back(samples.time, samples.pose, scenario) / every).astype(int).tolist(),
                "begins": [None if math.isnan(since) else since for since in samples.phase_began.tolist()],
                **_embedded(samples, initial, every),
            }
            for samples, arrived in zip(of_side, arrivals, strict=True)
        ]
    content = {
        **fixed_facts(scenario, network, gain_rad_s, controllers),
        "sides": sides,
        "samples": len(time[::every]),
        "interval": interval,  # s between samples
        "steps": round(interval / STEP_S),  # of 32 ms between samples
        "initial": [round(weight, 7) for weight in initial.tolist()],
        "worlds": [world_facts(world) for _, world in scenario.phases],
        "changes": [
            {"at": float(change["at_s"]), "text": change_text(change), "byHand": where.startswith("scenario.hand")}
            for where, change in scenario.events
        ],
        "lifetimes": lifetimes,
    }
    return fill_page(Path(__file__).with_suffix(".html"), title, content, notes)


def fill_page(template: Path, title: str, content: Mapping[str, Any], notes: Sequence[str] = ()) -> str:
    """The HTML text of a page whose script reads its data from the page."""
    text, style, script = filled(template)
    filling = {
        "policy": policy(style=style, script=script),
        "title": html.escape(title),
        "notes": "".join(f"<p>{html.escape(note)}</p>" for note in notes),
        "data": json.dumps(content, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c"),
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda mark: filling[mark[1]], text)


def fixed_facts(scenario: Scenario, network: Network, gain_rad_s: float, controllers: Sequence[str]) -> dict[str, Any]:
    """What never changes on a page: robots, networks, the maze."""
    robot, maze, distance = scenario.robot, scenario.maze, scenario.robot.distance
    *layers, last = network.layers
    hidden = [last - network.outputs] if last > network.outputs else []  # of the last layer: drawn by themselves
    return {
        "controllers": [controller_title(name) for name in controllers],
        "speed": 100 * gain_rad_s * robot.wheel_radius_m,  # cm/s of a wheel at a network output of 1
        "layers": [*layers, *hidden, network.outputs],
        "wiring": "" if network.wiring is None else network.wiring.name,
        "spiking": sum(network.layers[1:]) - network.outputs if network.wiring and network.wiring.spikes else 0,
        "joined": None if network.wiring is None else np.array(network.joined).tolist(),
        "inputs": [label for group in scenario.groups for label in group.labels],
        "hasTrials": scenario.task.has_trials,
        "robot": {
            "radius": robot.radius_m,
            "reach": min(distance.reach_m, distance.curve[-1].distance / distance.stretch),
            "contact": CONTACT,
            "lights": _placed(robot.light.places),
            "distances": _placed(distance.places),
        },
        "maze": {
            "view": view(maze),
            "walls": boxes(maze).tolist(),
            "start": maze.start[:2],
            "goalRadius": maze.goal_radius_m,
        },
    }


def world_facts(world: Scenario) -> dict[str, Any]:
    """All of a world that can change during a lifetime."""
    lamp = world.lamp
    faults = {
        field.name: value
        for field in fields(world)
        if field.name not in _APART and (value := getattr(world, field.name)) not in (field.default, [])
    }
    return {
        "obstacles": world.boxes[len(world.maze.walls) :].tolist(),
        "goals": {side: list(map(float, goal)) for side, goal in world.goals_now.items()},
        "light": float(world.light),
        "lit": world.lamp_on,
        "lamp": {
            "x": lamp.x_m,
            "y": lamp.y_m,
            "towards": math.atan2(lamp.towards_y, lamp.towards_x),
            "beam": lamp.beam_rad,
            "intensity": lamp.intensity,
        },
        "dead": list(world.dead_sensors),
        "faults": change_text(faults),
    }


def _placed(places: Sequence[Place]) -> list[list[float]]:
    """Sensors as x, y [m] and azimuth [rad], in the robot's frame."""
    return [[sensor.x, sensor.y, math.radians(sensor.azimuth)] for sensor in places]


def _embedded(samples: Samples, initial: NDArray[np.float32], every: int) -> dict[str, Any]:
    """A lifetime as packed arrays, one sample in `every`; weights as their change."""
    columns = {
        "x": samples.pose[:, 0],
        "y": samples.pose[:, 1],
        "heading": samples.pose[:, 2],
        "sensors": samples.sensors,
        "left": samples.motors[:, 0],
        "right": samples.motors[:, 1],
        "fitness": samples.fitness,
        "changeSignal": np.nan_to_num(samples.change_signal),
        "rate": samples.rate,
        "weightChange": samples.weight_change,
        "change": samples.weights - initial,
    }
    if samples.activations.size:
        columns["activations"] = samples.activations
    return {name: packed(values[::every]) for name, values in columns.items()}


def packed(values: NDArray[np.floating[Any]]) -> dict[str, Any]:
    """The values as little-endian 16-bit integers in base64, row by row, times `step`; no numbers if all are 0."""
    step = float(np.abs(values).max()) / _LARGEST
    if step == 0.0:
        return {"step": 0.0, "numbers": ""}
    return {"step": step, "numbers": base64.b64encode(np.rint(values / step).astype("<i2").tobytes()).decode()}
