"""A page to watch: recorded lifetimes side by side in the maze, and their networks as they adapt.

`page` fills the template `replay.html` beside this file with what was recorded. The page is one file that asks nothing
of any network; its policy forbids it to. All numbers are embedded as 16-bit integers times a step, at most 1000
samples of a lifetime, so that the four lifetimes of an evaluation take about 1.5 MB.
"""

import base64
import html
import json
import math
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epuckhebb.analysis.evaluate import Traces
from epuckhebb.analysis.figures import controller_title
from epuckhebb.analysis.floor import floor, view
from epuckhebb.analysis.moments import Arrival, arrival, begins, put_back, told
from epuckhebb.analysis.page import policy
from epuckhebb.sim.controller import CONTROLS, GA, HEBBIAN
from epuckhebb.sim.life import Samples
from epuckhebb.sim.lifetime import CONTACT
from epuckhebb.sim.maze import SIDES, Side, boxes
from epuckhebb.sim.network import PAPER_NETWORK, Network, initial_weights_of
from epuckhebb.sim.robot import STEP_S
from epuckhebb.sim.scenario import Scenario
from epuckhebb.sim.sensors import Place, SensorGroup

__all__ = ["Arrival", "arrival", "outcome", "page"]

_MOST_SAMPLES = 1000  # of a lifetime; more are thinned out, and the page draws straight lines between them
_LARGEST = 32767  # of a 16-bit integer
_WHO = {GA: "without plasticity", HEBBIAN: "with plasticity"}
_STAYS = "its connections stay as they were at birth"
_LEARNS = "its connections change while it drives"
_WAYS = ((8, "front"), (31, "front {}"), (68, "{}, ahead"), (112, "{}"), (172, "back {}"), (180, "back"))  # degrees


def page(
    traces: Traces,
    genes: NDArray[np.float64],
    scenario: Scenario,
    title: str,
    *,
    gain_rad_s: float,
    network: Network = PAPER_NETWORK,
    found: Mapping[str, str] | None = None,
    notes: Sequence[str] = (),
) -> str:
    """The HTML text of the page.

    genes: what the lifetimes began with; the network's weights come first. title: a line that says which run this is.
    gain_rad_s: wheel speed [rad/s] of a network output of 1. network: what the genes are for. found: a sentence for
    each side on what a self-check found, if there was one. notes: lines that a reader must know beside the outcome.
    """
    template = Path(__file__).with_suffix(".html").read_text(encoding="utf-8")
    style, script = (
        re.findall(pattern, template, re.DOTALL)[0] for pattern in ("<style>(.*?)</style>", "<script>(.*?)</script>")
    )
    filling = {
        "policy": policy(style=style, script=script),
        "title": html.escape(title),
        "notes": "".join(f"<p>{html.escape(note)}</p>" for note in notes),
        "data": json.dumps(
            _content(traces, genes, scenario, gain_rad_s, network, found or {}), separators=(",", ":"), allow_nan=False
        ).replace("<", "\\u003c"),
    }
    return re.sub(r"\{\{(\w+)\}\}", lambda place: filling[place[1]], template)


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


def reversal_outcome(side: Side, controllers: Sequence[str], lives: Sequence[Samples]) -> str:
    """In plain sentences: which end was rewarded first, and how often each robot came to the rewarded one."""
    told = []
    for controller, samples in zip(controllers, lives, strict=True):
        begins = np.diff(samples.sensors[:, -1], prepend=0.0) * samples.sensors[:, -1] > 0
        good, all_ = (int(begins[samples.sensors[:, -1] > least].sum()) for least in (0, -2))
        told.append(f"the robot {_who(controller)} came to an end {all_} times, {good} of them to the rewarded one")
    return f"The end on the {side} is rewarded first; {'; '.join(told)}."


def _who(controller: str) -> str:
    known = controller if controller in CONTROLS.values() else f"“{controller}”"
    return _WHO.get(controller, f"with {known}")


def _told(who: str, arrived: Arrival) -> str:
    away = f"ended {100 * arrived.final_distance:.0f} cm away"
    if arrived.time is None:
        return f"{who}it {away}"
    if arrived.stayed:
        return f"{who}after {arrived.time:.1f} s"
    return f"{who}it was there after {arrived.time:.1f} s but drove on and {away}"


def _content(
    traces: Traces,
    genes: NDArray[np.float64],
    scenario: Scenario,
    gain_rad_s: float,
    network: Network,
    found: Mapping[str, str],
) -> dict[str, Any]:
    controllers = list(dict.fromkeys(traces.controller))
    lifetime = {of: k for k, of in reversed(list(enumerate(zip(traces.controller, traces.side, strict=True))))}
    sides = [side for side in SIDES if side in traces.side]
    time = traces.samples.time[0]
    every = math.ceil(len(time) / _MOST_SAMPLES)
    interval = float(time[1] - time[0]) * every if len(time) > 1 else STEP_S
    birth = initial_weights_of(genes[: network.synapses]).astype(np.float32)
    named = zip(traces.controller, traces.samples.weight_change, strict=True)
    changed = {name for name, weight_change in named if weight_change.any()}
    lives, outcomes = {}, {}
    has_trials = scenario.task.has_trials
    for side in sides:
        of_side = [Samples(*(array[lifetime[name, side]] for array in traces.samples)) for name in controllers]
        arrivals = [arrival(samples.time, samples.pose, scenario, side) for samples in of_side]
        said = reversal_outcome(side, controllers, of_side) if has_trials else outcome(side, controllers, arrivals)
        outcomes[side] = " ".join(filter(None, [said, found.get(side)]))
        lives[side] = [
            {
                "arrival": None if has_trials else arrived.time,
                "stayed": arrived.stayed and not has_trials,
                "putBack": np.ceil(put_back(samples.time, samples.pose, scenario) / every).astype(int).tolist(),
                "begins": [since for since, _ in begins(scenario, samples.time, samples.pose)],
                **_embedded(samples, birth, every),
            }
            for samples, arrived in zip(of_side, arrivals, strict=True)
        ]
    robot, maze, felt = scenario.robot, scenario.maze, scenario.robot.distance
    hebbian = {HEBBIAN, *CONTROLS.values()}
    return {
        "sides": sides,
        "controllers": [
            {"title": controller_title(name), "note": _LEARNS if name in changed else _STAYS} for name in controllers
        ],
        "hebbian": all(name in hebbian for name in controllers if name != GA),
        "outcomes": outcomes,
        "samples": len(time[::every]),
        "interval": interval,  # s between samples
        "steps": round(interval / STEP_S),  # of 32 ms between samples
        "speed": 100 * gain_rad_s * robot.wheel_radius_m,  # cm/s of a wheel at a network output of 1
        "layers": network.layers,
        "inputs": _inputs(scenario),
        "hasTrials": has_trials,
        "birth": [round(weight, 7) for weight in birth.tolist()],
        "robot": {
            "radius": robot.radius_m,
            "reach": min(felt.reach_m, felt.curve[-1].distance / felt.stretch),
            "contact": CONTACT,
            "lights": _placed(robot.light.places),
            "distances": _placed(felt.places),
        },
        "maze": {
            "view": view(scenario),
            "floor": np.round(floor(scenario), 6).tolist(),
            "walls": boxes(maze).tolist(),
            "start": maze.start[:2],
            "goalRadius": maze.goal_radius_m,
        },
        "worlds": [_world(world) for _, world in scenario.phases],
        "changes": [{"at": float(change["at_s"]), "told": told(change)} for change in scenario.changes],
        "lives": lives,
    }


def _world(world: Scenario) -> dict[str, Any]:
    """What can change in mid-life, as it is in this world."""
    lamp = world.lamp
    dead = " and ".join(map(str, world.dead_sensors))
    faults = [f"sensor{'s' if len(world.dead_sensors) > 1 else ''} {dead} blind"] if dead else []
    turning = (("left", world.left_wheel), ("right", world.right_wheel))
    slipping = (("left", world.left_slip), ("right", world.right_slip))
    faults += [f"{side} wheel at {100 * turns:g} %" for side, turns in turning if turns < 1]
    faults += [f"{side} wheel slips {100 * slip:g} % of the time" for side, slip in slipping if slip]
    if world.distance_gain != 1 or world.distance_offset:
        faults.append(f"distance readings times {world.distance_gain:g} plus {world.distance_offset:g}")
    if world.mass_ratio != 1:
        faults.append(f"{world.mass_ratio:g} times as heavy")
    if world.wall_friction:
        faults.append(f"wall friction {world.wall_friction:g}")
    return {
        "obstacles": boxes(world.maze, world.obstacles, world.layout)[len(world.maze.walls) :].tolist(),
        "goals": {side: list(map(float, goal)) for side, goal in world.goals_now.items()},
        "light": float(world.light),
        "lamp": {
            "x": lamp.x_m,
            "y": lamp.y_m,
            "towards": math.atan2(lamp.towards_y, lamp.towards_x),
            "beam": lamp.beam_rad,
            "intensity": lamp.intensity,
        },
        "dead": list(world.dead_sensors),
        "faults": ", ".join(faults),
    }


def _placed(places: Sequence[Place]) -> list[list[float]]:
    """Sensors as x, y [m] and azimuth [rad], in the robot's frame."""
    return [[place.x, place.y, math.radians(place.azimuth)] for place in places]


def _inputs(scenario: Scenario) -> list[str]:
    """What the network's inputs are, in words: sensors by the way they look."""
    names = []
    for group in scenario.groups:
        ways = _ways(group.places) if isinstance(group, SensorGroup) else []
        names += [f"{group.label}, {way}" for way in ways] or [group.label] * group.count
    return names


def _ways(places: Sequence[Place]) -> list[str]:
    """The ways in which sensors look, in words; in degrees too if words alone do not tell them apart."""
    ways = []
    for place in places:
        azimuth = (place.azimuth + 180) % 360 - 180
        way = next(way for limit, way in _WAYS if abs(azimuth) <= limit)
        ways.append(way.format("left" if azimuth > 0 else "right"))
    if len(set(ways)) == len(ways):
        return ways
    numbered = enumerate(zip(ways, places, strict=True))
    return [f"number {number}, {way} ({place.azimuth:.0f}°)" for number, (way, place) in numbered]


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
        "changeSignal": np.nan_to_num(samples.change_signal),
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
