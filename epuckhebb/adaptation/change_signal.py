"""Signals of change: how a robot notices that its world is no longer the one in which it was evolved.

A signal may use the time, how long the robot has been away from the goal, and recent means of its sensor readings and
live fitness (`SignalContext`). To add one, write a file in `change_signals/`, named as the signal, with a compiled
function `change_signal(context, nominal)`. It returns a number that grows with the change.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import compiled
from epuckhebb.tmaze.robot import STEP_S

RECENT_S = 5.0  # time constant of recent means
PATTERNS = 64  # of the light in training; chosen on champions 1 to 20, in the known changed worlds


class SignalContext(NamedTuple):
    """What a signal of change receives at a step.

    time_s: since the start. away_s: since the start, or since the robot was last at the goal. arrived: whether it ever
    was. recent: recent means of the sensor readings, then of the live fitness, (inputs + 1,).
    """

    time_s: float
    away_s: float
    arrived: bool
    recent: Floats


class NominalOfSide(NamedTuple):
    """Nominal statistics of the training world for one side (`epuckhebb.adaptation.nominal`).

    time_to_goal_s: the slowest arrival; nan if none. away_s: the longest excursion from the goal afterwards. fitness:
    (seconds,) the least recent live fitness in each second. reading_mean, reading_spread: (2, inputs) of the network's
    inputs, without and with the lamp. patterns, lengths: (lights, patterns) and (patterns,) of what the light looks
    like; novelty: the largest distance from these (`epuckhebb.adaptation.homeostasis`); empty if not measured.
    """

    time_to_goal_s: float
    away_s: float
    fitness: Floats
    reading_mean: Floats
    reading_spread: Floats
    patterns: Floats
    lengths: Floats
    novelty: float


def no_nominal(inputs: int, lights: int) -> NominalOfSide:
    """Nominal statistics for a robot that has none. inputs, lights: how many readings it has, how many of light."""
    return NominalOfSide(
        time_to_goal_s=np.nan,
        away_s=0.0,
        fitness=np.zeros(1),
        reading_mean=np.zeros((2, inputs)),
        reading_spread=np.ones((2, inputs)),
        patterns=np.zeros((lights, PATTERNS)),
        lengths=np.ones(PATTERNS),
        novelty=np.inf,
    )


ChangeSignal = Callable[[SignalContext, NominalOfSide], float]


@compiled
def update_recent(recent: Floats, readings: Floats, live_fitness: float, step: int) -> None:
    """Update the recent means, (inputs + 1,), with this step's readings and live fitness F."""
    share = 1.0 if step == 0 else STEP_S / (RECENT_S + STEP_S)
    inputs = recent.shape[0] - 1
    for i in range(inputs):
        recent[i] += share * (readings[i] - recent[i])
    recent[inputs] += share * (live_fitness - recent[inputs])
