"""Surprise: how a robot notices that its world is no longer the one in which it was evolved, and what follows.

    lateness  = away / longest away                    time since birth or since it left the goal, over the remembered
    shortfall = M(t) - F'                              remembered live fitness at this time, less the recent one
    novelty   = min over lamps of mean |s' - m| / (d + 0.01)    recent readings against the remembered, in spreads

    g   = clip((surprise - tolerance) / ramp, 0, 1)    need for plasticity; 0 at the goal
    N_e = N g max(0.2, F)                              the paper's rule is the case g = 1

F' and s' are recent means (5 s); M, m, d and the longest times away are remembered of the training world
(`epuckhebb.sim.memory`). Novelty knows only what the robot senses. The live fitness of `shortfall` knows when the robot
is in the correct arm; `lateness` has a clock and knows when the robot is at the goal: these need a supervisor, and so
does switching off there.

To add a signal: a function here, its name in `Surprise` and `surprise`, and a file in `conf/hebbian/`.
"""

import math
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

    time_to_goal: s, the slowest arrival; nan if it never arrived. away: s, the longest excursion from the goal
    afterwards. fitness: (seconds,) the least recent live fitness in each second. reading_mean, reading_spread: (2, 16)
    of the network's inputs, without and with the lamp.
    """

    time_to_goal: float
    away: float
    fitness: NDArray[np.float64]
    reading_mean: NDArray[np.float64]
    reading_spread: NDArray[np.float64]


NOTHING = Remembered(np.nan, 0.0, np.zeros(1), np.zeros((2, INPUTS)), np.ones((2, INPUTS)))
RECENT_S = 5.0  # time constant of recent means
LEAST_AWAY_S = 5.0  # an excursion from the goal that is not worth noticing
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
def lateness(away: float, arrived: bool, time_to_goal: float, longest_away: float) -> float:
    """Time away over the longest remembered: of the way to the goal until it arrives, of excursions afterwards.

    Above 1 the robot is later than it ever was; nan, which is no surprise, if it remembers no arrival.
    """
    if arrived and not math.isnan(time_to_goal):
        return away / max(longest_away, LEAST_AWAY_S)
    return away / time_to_goal


@compiled
def shortfall(time: float, recent_fitness: float, remembered: NDArray[np.float64]) -> float:
    """M(t) - F': how much worse than it ever did at this time of its life; after the last second, than in that."""
    return float(remembered[min(int(time), remembered.shape[0] - 1)]) - recent_fitness


@compiled
def novelty(recent: NDArray[np.float64], mean: NDArray[np.float64], spread: NDArray[np.float64]) -> float:
    """Mean over the inputs of |s' - m| / (d + 0.01), against the memory that fits best: without or with the lamp."""
    least = np.inf
    for lamp in range(2):
        total = 0.0
        for i in range(INPUTS):
            total += abs(recent[i] - mean[lamp, i]) / (spread[lamp, i] + LEAST_SPREAD)
        least = min(least, total / INPUTS)
    return least


@compiled
def surprise(
    kind: int, time: float, away: float, arrived: bool, recent: NDArray[np.float64], remembered: Remembered
) -> float:
    """The signal of this kind at this time [s] of life, after so long [s] away from the goal, once reached or not."""
    if kind == _LATENESS:
        return lateness(away, arrived, remembered.time_to_goal, remembered.away)
    if kind == _SHORTFALL:
        return shortfall(time, recent[INPUTS], remembered.fitness)
    return novelty(recent, remembered.reading_mean, remembered.reading_spread)


@compiled
def need(signal: float, tolerance: float, ramp: float) -> float:
    """The need g = clip((surprise - tolerance) / ramp, 0, 1): 0 within what is tolerated, 1 a ramp beyond it."""
    if not signal > tolerance:
        return 0.0
    return min(1.0, (signal - tolerance) / ramp) if ramp > 0.0 else 1.0


@compiled
def resting(surprised_s: float, spell_s: float, rest_s: float) -> bool:
    """Whether a robot that has been surprised for so long rests: after each spell of plasticity, back to its genes."""
    return spell_s > 0.0 and surprised_s % (spell_s + rest_s) >= spell_s
