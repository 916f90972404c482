"""Surprise: how a robot notices that its world is no longer the one in which it was evolved, and what follows.

    lateness  = t / T                                  time lived over the remembered time to the goal
    shortfall = M(t) - F'                              remembered live fitness at this time, less the recent one
    novelty   = min over lamps of mean |s' - m| / (d + 0.01)    recent readings against the remembered, in spreads

    g   = clip((surprise - tolerance) / ramp, 0, 1)    need for plasticity
    N_e = N g max(0.2, F)                              the paper's rule is the case g = 1

F' and s' are recent means (5 s); T, M, m and d are remembered of the training world (`epuckhebb.sim.memory`). Novelty
knows only what the robot senses. Lateness needs a clock that knows when a trial began, the live fitness of `shortfall`
needs to know when the robot is in the correct arm, and only a supervisor can tell that the goal is reached.

To add a signal: a function here, its name in `Surprise` and `surprise`, and a file in `conf/hebbian/`.
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim.compiled import compiled
from epuckhebb.sim.controller import INPUTS
from epuckhebb.sim.epuck import STEP_S


class Surprise(IntEnum):
    """The signals of change; `none` is never asked, and plasticity is always on."""

    none = 0
    lateness = 1
    shortfall = 2
    novelty = 3


class Remembered(NamedTuple):
    """The training world as a robot on one side remembers it.

    time_to_goal: s, the slowest arrival; nan if it never arrived. fitness: (seconds,) the least recent live fitness
    in each second. reading_mean, reading_spread: (2, 16) of the network's inputs, without and with the lamp.
    """

    time_to_goal: float
    fitness: NDArray[np.float64]
    reading_mean: NDArray[np.float64]
    reading_spread: NDArray[np.float64]


NOTHING = Remembered(np.nan, np.zeros(1), np.zeros((2, INPUTS)), np.ones((2, INPUTS)))
RECENT_S = 5.0  # time constant of recent means
LEAST_SPREAD = 0.01  # of a reading: the noise of a light sensor
RECENT_ROOM = INPUTS + 1  # recent readings, then recent fitness

_LATENESS, _SHORTFALL = int(Surprise.lateness), int(Surprise.shortfall)


@compiled
def keep_recent(recent: NDArray[np.float64], activation: NDArray[np.float64], live_fitness: float, step: int) -> None:
    """Let this step's readings and live fitness F into the recent means, (17,); the first step begins them."""
    share = 1.0 if step == 0 else STEP_S / (RECENT_S + STEP_S)
    for i in range(INPUTS):
        recent[i] += share * (activation[i] - recent[i])
    recent[INPUTS] += share * (live_fitness - recent[INPUTS])


@compiled
def lateness(time: float, time_to_goal: float) -> float:
    """t / T: above 1 the robot is later than it ever was; nan, which is no surprise, if it never arrived."""
    return time / time_to_goal


@compiled
def shortfall(time: float, recent_fitness: float, remembered: NDArray[np.float64]) -> float:
    """M(t) - F': how much worse than it ever did at this time of its life; after the last second, than in that."""
    return float(remembered[min(int(time), remembered.shape[0] - 1)]) - recent_fitness


@compiled
def novelty(recent: NDArray[np.float64], mean: NDArray[np.float64], spread: NDArray[np.float64]) -> float:
    """Mean over the inputs of |s' - m| / (d + 0.01), against the memory, without or with the lamp, that it fits best."""
    least = np.inf
    for lamp in range(2):
        total = 0.0
        for i in range(INPUTS):
            total += abs(recent[i] - mean[lamp, i]) / (spread[lamp, i] + LEAST_SPREAD)
        least = min(least, total / INPUTS)
    return least


@compiled
def surprise(kind: int, time: float, recent: NDArray[np.float64], remembered: Remembered) -> float:
    """The signal of this kind at this time [s] of life."""
    if kind == _LATENESS:
        return lateness(time, remembered.time_to_goal)
    if kind == _SHORTFALL:
        return shortfall(time, recent[INPUTS], remembered.fitness)
    return novelty(recent, remembered.reading_mean, remembered.reading_spread)


@compiled
def need(signal: float, tolerance: float, ramp: float) -> float:
    """g = clip((surprise - tolerance) / ramp, 0, 1): 0 within what is tolerated, 1 from a ramp beyond it on."""
    if not signal > tolerance:
        return 0.0
    return min(1.0, (signal - tolerance) / ramp) if ramp > 0.0 else 1.0


@compiled
def resting(surprised_s: float, spell_s: float, rest_s: float) -> bool:
    """Whether a robot that has been surprised for so long rests: after each spell of plasticity, back to its genes."""
    return spell_s > 0.0 and surprised_s % (spell_s + rest_s) >= spell_s
