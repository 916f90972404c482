"""Two gates: one for exploration, which a signal of change opens, and one for plasticity. The paper has none.

    g = clip(slope (signal - threshold), 0, 1)      need; 0 at the goal, and during rests

Exploration also begins at a given time, if the robot has never been at its goal. Plasticity acts all the time, while
the gate of exploration is open, or at the goal alone, where the robot is given the goal signal.
"""

import math
from collections.abc import Callable
from enum import Enum
from typing import Any

from epuckhebb.adaptation import exploration
from epuckhebb.adaptation.change_signal import ChangeSignal, SignalContext, signal_function, update_recent
from epuckhebb.controller.compiling.kernel import compiled
from epuckhebb.controller.own_class import is_user_class
from epuckhebb.tmaze.robot import STEP_S

WAIT_S = 1.5  # of a halt that waits, without a goal signal: chosen for signals a second apart (docs/adaptations.md)


class PlasticWhen(Enum):
    """When plasticity acts: always, while late, or at the goal alone, by the goal signal."""

    always = "always"
    late = "late"
    goal_signal = "goal_signal"


class Stay(Enum):
    """What keeps a robot at the goal: nothing new, or a halt of its wheels, for good or for a time."""

    none = "none"
    halt = "halt"
    wait = "wait"

    @property
    def halts(self) -> bool:
        """Whether the wheels stop at the goal."""
        return self in (Stay.halt, Stay.wait)


@compiled
def need(signal: float, threshold: float, slope: float) -> float:
    """The need g: 0 up to the threshold (and where the signal is nan), then growing with the slope up to 1."""
    if not signal > threshold:
        return 0.0
    return min(1.0, (signal - threshold) * slope)


@compiled
def resting(late_s: float, active_s: float, rest_s: float) -> bool:
    """Whether plasticity rests, after a signal that has lasted for `late_s`; during rests the genes are back."""
    return active_s > 0.0 and late_s % (active_s + rest_s) >= active_s


def gates(kind: type[ChangeSignal], plastic_when: PlasticWhen, stay: Stay) -> Callable[..., float]:
    """The function that opens both gates, `open_gate` of `adaptation.Hooks`."""
    signal = signal_function(kind)
    always, at_the_goal = plastic_when is PlasticWhen.always, plastic_when is PlasticWhen.goal_signal
    halts, for_good, must_be_number = stay.halts, stay is Stay.halt, is_user_class(kind)

    @compiled
    def open_gate(life: Any, setup: Any, fitness: float, step: int) -> float:
        gate, nominal, state = setup.adaptation, setup.nominal, life.adaptation
        tally = life.tally[0]
        update_recent(state.recent, life.activation, fitness, step)
        at_goal = tally.goal_distance < setup.goal_radius
        tally.arrived = tally.arrived or at_goal
        tally.away_s = 0.0 if at_goal else tally.away_s + STEP_S
        time_s = step * STEP_S
        context = SignalContext(time_s, tally.away_s, tally.arrived, state.recent)
        tally.change_signal = signal(context, nominal, state.signal[0])
        if must_be_number and tally.failed_signal == 0 and math.isnan(tally.change_signal):
            tally.failed_signal = step + 1
        open_by = 0.0 if at_goal else need(tally.change_signal, gate.threshold, gate.slope)
        if time_s >= gate.start_by_s and not tally.arrived:
            open_by = 1.0
        tally.late_s = tally.late_s + STEP_S if open_by > 0.0 else 0.0
        if open_by > 0.0 and resting(tally.late_s, gate.active_s, gate.rest_s):
            open_by = 0.0
        if gate.motor_noise > 0.0 and step % exploration.HOLD == 0:
            exploration.draw(life.key[0], exploration.FAR + step, state.noise)
            tally.noise_left = gate.motor_noise * state.noise[0]
            tally.noise_right = gate.motor_noise * state.noise[1]
        tally.exploring = open_by > 0.0
        if halts:
            tally.halted = at_goal or (tally.halted and (for_good or tally.away_s < WAIT_S))
        if always:
            return 1.0
        if at_the_goal:
            return 1.0 if at_goal else 0.0
        return open_by

    return open_gate
