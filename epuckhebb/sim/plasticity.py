"""Hebbian plasticity, scaled by how well the robot is doing: the paper's equations, one function each.

    N_e   = N g max(0.2, F)            effective rate from the base rate N and the live fitness F; g is 1 in the paper
    C     = pre x post                 correlation of the two neurons that a connection joins
    T'    = 0.95 T + 0.05 C            trace: what has fired together lately
    W'    = clip(W + N_e S T', -2, 2)  weight; the sign S is 1, or of a control (see `Sign`)

Weights change after every control step, in all layers, and act from the next step on. They are a copy made at birth:
the genome is never written, so a robot forgets by being born again. With a signal of surprise, g is the need for
plasticity (`epuckhebb.sim.surprise`), and a robot forgets as soon as there is none.
"""

import math
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim.compiled import compiled
from epuckhebb.sim.controller import FIRST_NEURON, GENES, POST, PRE
from epuckhebb.sim.fitness import Signal
from epuckhebb.sim.surprise import Surprise

CHANGE_ROOM = 240  # numbers in the workspace of `learn`, a little more than there are genes


class Sign(Enum):
    """The sign S of the updates: Hebb's, and two controls that change the weights as much but not as Hebb said."""

    hebbian = "hebbian"
    anti = "anti"  # what fires together parts
    shuffled = "shuffled"  # a fixed random sign for each synapse


@dataclass(kw_only=True)
class Hebbian:
    """How plastic a robot is.

    name: what to call it. N: base rate, 0 for a robot that does not learn. trace_decay, trace_update: how long the
    trace lasts and how fast it takes up new correlations. w_max: bound of the weights. floor: the least factor on N,
    when fitness is low. signal: the live fitness that scales the rate. sign: `hebbian`, or a control.

    surprise: the signal of change that switches plasticity on; with `none` it is always on, and the rest is not used.
    tolerance, ramp: the signal up to which plasticity is off, and how far beyond it is fully on. spell_s, rest_s:
    plastic for so long, then living by the genes for so long, and again; 0: no rests. motor_noise: standard deviation
    of noise on both wheels' outputs while plastic, as far as the motors go.
    """

    name: str = "none"
    N: float = 0.0
    trace_decay: float = 0.95
    trace_update: float = 0.05
    w_max: float = 2.0
    floor: float = 0.2
    signal: Signal = Signal.behaviour
    sign: Sign = Sign.hebbian
    surprise: Surprise = Surprise.none
    tolerance: float = 0.0
    ramp: float = 0.0
    spell_s: float = 0.0
    rest_s: float = 0.0
    motor_noise: float = 0.0

    def __post_init__(self) -> None:
        """Refuse rates and bounds that cannot be.

        Raises:
            ValueError: a number is not finite or outside the range named in the message.
        """
        for name in ("N", "floor", "ramp", "spell_s", "rest_s", "motor_noise"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise ValueError(f"hebbian.{name} must be 0 or more, got {value}")
        for name in ("trace_decay", "trace_update"):
            value = getattr(self, name)
            if not 0 <= value <= 1:
                raise ValueError(f"hebbian.{name} must lie in [0, 1], got {value}")
        if not (math.isfinite(self.w_max) and self.w_max > 0):
            raise ValueError(f"hebbian.w_max must be more than 0, got {self.w_max}")
        if not math.isfinite(self.tolerance):
            raise ValueError(f"hebbian.tolerance must be a finite number, got {self.tolerance}")
        if self.rest_s > 0 and self.spell_s == 0:
            raise ValueError(f"hebbian.rest_s = {self.rest_s:g} needs hebbian.spell_s above 0: rests follow spells")
        if self.motor_noise > 0 and self.surprise is Surprise.none:
            raise ValueError("hebbian.motor_noise needs hebbian.surprise: it comes while the robot is surprised")


class Rule(NamedTuple):
    """The same as `Hebbian`, as numbers for the kernel."""

    rate: float
    trace_decay: float
    trace_update: float
    w_max: float
    floor: float
    surprise: int
    tolerance: float
    ramp: float
    spell_s: float
    rest_s: float
    motor_noise: float


def rule(hebbian: Hebbian) -> Rule:
    """The numbers of a plasticity rule, for the kernel."""
    return Rule(
        float(hebbian.N),
        float(hebbian.trace_decay),
        float(hebbian.trace_update),
        float(hebbian.w_max),
        float(hebbian.floor),
        int(hebbian.surprise),
        float(hebbian.tolerance),
        float(hebbian.ramp),
        float(hebbian.spell_s),
        float(hebbian.rest_s),
        float(hebbian.motor_noise),
    )


def signs(sign: Sign, rng: np.random.Generator) -> NDArray[np.float64]:
    """S for each synapse, (234,) of 1 and -1; `rng` is used for shuffled signs only."""
    if sign is Sign.shuffled:
        return rng.choice([-1.0, 1.0], GENES)
    return np.full(GENES, -1.0 if sign is Sign.anti else 1.0)


@compiled
def effective_rate(rate: float, need: float, fitness: float, floor: float) -> float:
    """N_e = N g max(0.2, F): a robot that does well learns fast, one that does badly still explores a little."""
    return rate * need * max(floor, fitness)


@compiled
def next_trace(trace: float, correlation: float, decay: float, update: float) -> float:
    """T' = 0.95 T + 0.05 C."""
    return decay * trace + update * correlation


@compiled
def next_weight(weight: float, rate: float, trace: float, w_max: float) -> float:
    """W' = clip(W + N_e T', -W_max, W_max), with N_e or -N_e as the rate."""
    return min(w_max, max(-w_max, weight + rate * trace))


@compiled
def correlate(activation: NDArray[np.float64], correlation: NDArray[np.float64]) -> None:
    """C = pre x post for every connection: how strongly its two neurons fire together. Fills `correlation` (234,)."""
    gene = 0
    for layer in range(len(POST)):
        pre, post = FIRST_NEURON[layer], FIRST_NEURON[layer + 1]
        for i in range(PRE[layer]):
            for j in range(POST[layer]):
                correlation[gene] = activation[pre + i] * activation[post + j]
                gene += 1


@compiled
def learn(
    weights: NDArray[np.float64],
    trace: NDArray[np.float64],
    genes: NDArray[np.float64],
    activation: NDArray[np.float64],
    rate: float,
    by: Rule,
    signs: NDArray[np.float64],
    correlation: NDArray[np.float64],
    change: NDArray[np.float64],
) -> float:
    """One plastic update of all weights, in place; returns the weight change, the sum of |W - W_gene|.

    weights, trace: (234,), updated. genes: (234,) weights at birth. activation: (43,). rate: N_e. signs: (234,)
    1 or -1. correlation (234,) and change (240,) are workspace.
    """
    correlate(activation, correlation)
    for k in range(GENES):
        trace[k] = next_trace(trace[k], correlation[k], by.trace_decay, by.trace_update)
        weights[k] = next_weight(weights[k], rate * signs[k], trace[k], by.w_max)
        change[k] = abs(weights[k] - genes[k])
    return _sum_by_halves(change)


@compiled
def _sum_by_halves(values: NDArray[np.float64]) -> float:
    """Sum of the first 234 of 240 numbers, in an order that the processor can do four at a time; spoils `values`.

    Each half is added to the other, four times over; the 15 sums that are left are added one by one.
    """
    for k in range(GENES, CHANGE_ROOM):
        values[k] = 0.0
    for k in range(15):
        values[k] = (_quarters(values, k) + _quarters(values, k + 30)) + (
            _quarters(values, k + 15) + _quarters(values, k + 45)
        )
    total = 0.0
    for k in range(15):
        total += values[k]
    return total


@compiled
def _quarters(values: NDArray[np.float64], k: int) -> float:
    """Sum of the numbers at place k of each quarter of 240, half added to half."""
    return float((values[k] + values[k + 120]) + (values[k + 60] + values[k + 180]))
