"""Signals of change: how a robot notices that its world is no longer the one in which it was evolved."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import ClassVar, NamedTuple

import numpy as np

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import compiled
from epuckhebb.controller.compiling.readonly import readonly
from epuckhebb.controller.own_class import OwnClass, make_call, number
from epuckhebb.tmaze.robot import STEP_S

RECENT_S = 5.0  # time constant of recent means
PATTERNS = 64  # of the light in training; chosen on champions 1 to 20, in the known changed worlds


_OF_SIGNAL = {  # the arguments that `signal` may have, and how the kernel has them
    "time_s": "now.time_s",
    "away_s": "now.away_s",
    "arrived": "now.arrived",
    "readings": "now.recent[:-1]",
    "fitness": "float(now.recent[now.recent.shape[0] - 1])",
    "nominal": "nominal",
    "state": "state",
}


class SignalContext(NamedTuple):
    """What a signal of change is made from at a step; recent: (inputs + 1,), of readings, then of the live fitness."""

    time_s: float
    away_s: float
    arrived: bool
    recent: Floats


@dataclass(frozen=True, kw_only=True)
class ChangeSignal(OwnClass):
    """A signal of change, a number that grows with the change. A signal has no settings; an adaptation has.

    A subclass has a static method `signal`, compiled by numba, whose arguments are any of these names, in any order:

        time_s       since the start, s
        away_s       since the start, or since the robot was last at the goal, s
        arrived      whether it ever was
        readings     recent means of the sensor readings
        fitness      the recent mean of the live fitness
        nominal      the same in the training world: `NominalOfSide`
        state        the numbers named in the class attribute `state`, to be read and set

    state: name -> initial value, of what the signal stores during a lifetime.
    """

    PART: ClassVar[str] = "change signal"
    KEY: ClassVar[str] = "adaptation.change_signal"
    METHODS: ClassVar[tuple[str, ...]] = ("signal",)
    ARGUMENTS: ClassVar[Collection[str]] = _OF_SIGNAL
    state: ClassVar[Mapping[str, float]] = {}
    signal: ClassVar[Callable[..., float] | None] = None


def signal_function(kind: type[ChangeSignal]) -> Callable[..., float]:
    """The function `signal(now, nominal, state)` of a kernel, of a `SignalContext`, a `NominalOfSide` and a record."""
    call = make_call(kind.signal, kind.arguments("signal"), _OF_SIGNAL, "now, nominal, state")
    return compiled(lambda now, nominal, state: number(call(now, nominal, state)))


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
    nominal: NominalOfSide = readonly(
        NominalOfSide(
            time_to_goal_s=np.nan,
            away_s=0.0,
            fitness=np.zeros(1),
            reading_mean=np.zeros((2, inputs)),
            reading_spread=np.ones((2, inputs)),
            patterns=np.zeros((lights, PATTERNS)),
            lengths=np.ones(PATTERNS),
            novelty=np.inf,
        )
    )
    return nominal


@compiled
def update_recent(recent: Floats, readings: Floats, live_fitness: float, step: int) -> None:
    """Update the recent means, (inputs + 1,), with this step's readings and live fitness F."""
    share = 1.0 if step == 0 else STEP_S / (RECENT_S + STEP_S)
    inputs = recent.shape[0] - 1
    for i in range(inputs):
        recent[i] += share * (readings[i] - recent[i])
    recent[inputs] += share * (live_fitness - recent[inputs])
