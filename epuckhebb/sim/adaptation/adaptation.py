"""What is laid over a plasticity rule, put together: a record of settings, and the functions that a lifetime calls."""

import importlib
import math
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass, fields
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim.adaptation import change_signals as signals
from epuckhebb.sim.adaptation import exploration
from epuckhebb.sim.adaptation.change_signal import BaselineOfSide, ChangeSignal, Now, keep_recent
from epuckhebb.sim.adaptation.gate import need, resting
from epuckhebb.sim.compiled import compiled
from epuckhebb.sim.random import room_for_noise
from epuckhebb.sim.robot import STEP_S, Robot

NONE = "none"


@cache
def change_signals() -> tuple[str, ...]:
    """The names of all signals of change: the files of `change_signals/`."""
    return tuple(sorted(module.name for module in pkgutil.iter_modules(signals.__path__)))


def _signal(name: str) -> ChangeSignal:
    function: ChangeSignal = importlib.import_module(f"{signals.__name__}.{name}").change_signal
    return function


@dataclass(kw_only=True)
class Adaptation:
    """When plasticity acts, and what else happens then.

    name: what to call it. change_signal: the signal that opens the gate, `none` for a gate that is always open; with
    `none` the rest is not used. threshold, slope: the gate is closed up to the threshold, and opens by so much for
    each unit of the signal above it; inf: at once. active_s, rest_s: while the signal lasts, open for so long, then
    closed for so long, and again; active_s 0: no rests. motor_noise: standard deviation of noise on both wheels'
    outputs while the gate is open.

    Raises:
        ValueError: a value is outside the range named in the message.
    """

    name: str = NONE
    change_signal: str = NONE
    threshold: float = 0.0
    slope: float = math.inf
    active_s: float = 0.0
    rest_s: float = 0.0
    motor_noise: float = 0.0

    def __post_init__(self) -> None:
        """Refuse what cannot be."""
        allowed = (NONE, *change_signals())
        if self.change_signal not in allowed:
            raise ValueError(
                f"adaptation.change_signal must be one of {', '.join(allowed)}, got {self.change_signal!r}"
            )
        for name in ("active_s", "rest_s", "motor_noise"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise ValueError(f"adaptation.{name} must be 0 or more, got {value}")
        if not math.isfinite(self.threshold):
            raise ValueError(f"adaptation.threshold must be a finite number, got {self.threshold}")
        if not self.slope > 0:
            raise ValueError(f"adaptation.slope must be more than 0, inf for at once, got {self.slope}")
        if self.rest_s > 0 and self.active_s == 0:
            raise ValueError(
                f"adaptation.rest_s = {self.rest_s:g} needs adaptation.active_s above 0: rests follow active times"
            )
        if self.change_signal == NONE:
            unused = [field.name for field in fields(self)[2:] if getattr(self, field.name) != field.default]
            if unused:
                raise ValueError(
                    f"adaptation.{unused[0]} does nothing without a signal of change: give adaptation.change_signal, "
                    f"one of {', '.join(change_signals())}"
                )

    @property
    def needs_baseline(self) -> bool:
        """Whether it compares with what is remembered of the training world."""
        return self.change_signal != NONE


class Gate(NamedTuple):
    """The numbers of an `Adaptation`, for the kernel."""

    threshold: float
    slope: float
    active_s: float
    rest_s: float
    motor_noise: float


def gate_numbers(adaptation: Adaptation) -> Gate:
    """The numbers of an adaptation, for the kernel."""
    return Gate(*(float(getattr(adaptation, name)) for name in Gate._fields))


class AdaptationRoom(NamedTuple):
    """What an adaptation carries through a life besides its tally: recent means (inputs + 1,), and workspace."""

    recent: NDArray[np.float64]
    noise: NDArray[np.float64]


def adaptation_room(robot: Robot) -> AdaptationRoom:
    """Room for a robot at birth."""
    return AdaptationRoom(np.zeros(robot.inputs + 1), np.zeros(room_for_noise(16)))


class Hooks(NamedTuple):
    """The functions of an adaptation that a lifetime calls.

    open_gate(gate, tally, room, readings, fitness, baseline, at_goal, step, key): the need g for plasticity at this
    step. explore(gate, tally, output, wheel, gain): what a wheel gets of the network's output.
    """

    open_gate: Callable[..., float]
    explore: Callable[..., float]


@cache
def hooks(change_signal: str, robot: Robot) -> Hooks:
    """The functions for a signal of change; without one, they are nothing."""
    if change_signal == NONE:
        return Hooks(_always_open, _as_it_is)
    return Hooks(_gated_by(_signal(change_signal)), _noisy(robot.motor_limit_rad_s))


@compiled
def _always_open(
    gate: Gate,
    tally: Any,
    room: AdaptationRoom,
    readings: NDArray[np.float64],
    fitness: float,
    baseline: BaselineOfSide,
    at_goal: bool,
    step: int,
    key: np.uint64,
) -> float:
    return 1.0


@compiled
def _as_it_is(gate: Gate, tally: Any, output: float, noise: float, gain: float) -> float:
    return output


def _gated_by(signal: ChangeSignal) -> Callable[..., float]:
    @compiled
    def open_gate(
        gate: Gate,
        tally: Any,
        room: AdaptationRoom,
        readings: NDArray[np.float64],
        fitness: float,
        baseline: BaselineOfSide,
        at_goal: bool,
        step: int,
        key: np.uint64,
    ) -> float:
        keep_recent(room.recent, readings, fitness, step)
        tally.arrived = tally.arrived or at_goal
        tally.away_s = 0.0 if at_goal else tally.away_s + STEP_S
        now = Now(step * STEP_S, tally.away_s, tally.arrived, room.recent)
        tally.change_signal = signal(now, baseline)
        open_by = 0.0 if at_goal else need(tally.change_signal, gate.threshold, gate.slope)
        tally.late_s = tally.late_s + STEP_S if open_by > 0.0 else 0.0
        if resting(tally.late_s, gate.active_s, gate.rest_s):
            open_by = 0.0
        if gate.motor_noise > 0.0 and step % exploration.HELD == 0:
            exploration.draw(key, exploration.FAR + step, room.noise)
            tally.noise_left = gate.motor_noise * room.noise[0]
            tally.noise_right = gate.motor_noise * room.noise[1]
        return open_by

    return open_gate


def _noisy(motor_limit: float) -> Callable[..., float]:
    @compiled
    def explore(gate: Gate, tally: Any, output: float, noise: float, gain: float) -> float:
        if gate.motor_noise > 0.0 and tally.need > 0.0:
            return exploration.within_motor(output, noise, gain, motor_limit)
        return output

    return explore
