"""Signals of change: how a robot notices that its world is no longer the one in which it was evolved.

What every signal may use: the time, whether and for how long the robot has been away from the goal, and recent means
of its readings and live fitness. To add one: a file in
`change_signals/` with a function `change_signal(now, baseline)`, compiled, that returns a number which grows with the
change; the name of the file is its name.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim.compiled import compiled
from epuckhebb.sim.robot import STEP_S

RECENT_S = 5.0  # time constant of recent means


class Now(NamedTuple):
    """What a robot knows at a step.

    time_s: since birth. away_s: since birth, or since it was last at the goal. arrived: whether it ever was. recent:
    recent means of the readings, then of the live fitness, (inputs + 1,).
    """

    time_s: float
    away_s: float
    arrived: bool
    recent: NDArray[np.float64]


class NominalOfSide(NamedTuple):
    """The training world as a robot on one side remembers it (`epuckhebb.sim.adaptation.nominal`).

    time_to_goal_s: the slowest arrival; nan if it never arrived. away_s: the longest excursion from the goal
    afterwards. fitness: (seconds,) the least recent live fitness in each second. reading_mean, reading_spread:
    (2, inputs) of the network's inputs, without and with the lamp. patterns, lengths: (lights, patterns) and
    (patterns,) what the light looks like, and novelty: how unlike that it ever was (`epuckhebb.sim.adaptation
    .homeostasis`); empty if that is not remembered.
    """

    time_to_goal_s: float
    away_s: float
    fitness: NDArray[np.float64]
    reading_mean: NDArray[np.float64]
    reading_spread: NDArray[np.float64]
    patterns: NDArray[np.float64]
    lengths: NDArray[np.float64]
    novelty: float


def no_nominal(inputs: int) -> NominalOfSide:
    """What a robot remembers that has nothing to compare with."""
    return NominalOfSide(
        np.nan, 0.0, np.zeros(1), np.zeros((2, inputs)), np.ones((2, inputs)), np.zeros((0, 0)), np.zeros(0), np.inf
    )


def check_nominal(nominal: NominalOfSide, inputs: int) -> None:
    """Refuse a baseline that is not of a robot with so many readings.

    Raises:
        ValueError: it is not.
    """
    for name in ("reading_mean", "reading_spread"):
        if getattr(nominal, name).shape != (2, inputs):
            raise ValueError(
                f"a baseline of a robot with {inputs} readings has a {name} of shape (2, {inputs}), got "
                f"{getattr(nominal, name).shape}: it is of another robot"
            )
    if len(nominal.fitness) == 0:
        raise ValueError("a baseline remembers the live fitness of one second or more, got none")


ChangeSignal = Callable[[Now, NominalOfSide], float]


@compiled
def keep_recent(recent: NDArray[np.float64], readings: NDArray[np.float64], live_fitness: float, step: int) -> None:
    """Let this step's readings and live fitness F into the recent means, (inputs + 1,); the first step begins them."""
    share = 1.0 if step == 0 else STEP_S / (RECENT_S + STEP_S)
    inputs = recent.shape[0] - 1
    for i in range(inputs):
        recent[i] += share * (readings[i] - recent[i])
    recent[inputs] += share * (live_fitness - recent[inputs])
