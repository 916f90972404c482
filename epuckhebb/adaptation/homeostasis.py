"""Homeostatic plasticity: the weights from all light sensors are scaled until the light looks as in training.

Synaptic scaling multiplies all synapses of one kind by one factor until the neuron is as active as usual (Turrigiano,
The self-tuning neuron, Cell 135, 2008). Here the factor is k. Usual are patterns of brightness from the training world.
The robot uses its senses alone: no clock, no goal signal.

    v = clip(k u, 0, 1)                 u: brightness, 1 - reading of the light sensors, smoothed over k steps
    t                                   the training pattern nearest in direction: largest v t / |t|
    n(k) = mean over 5 s of rms(t - v)  novelty with the scale k; n(1): without it
    dk/dt = 3 k  (t - v) k u / (v v)    while n(k) is more than it ever was in training; else k stays
    reading = 1 - v                     if n(k) < 0.7 n(1): the scale is used only if it makes the light familiar

Scaling the readings is scaling the first layer's weights w: w (1 - k u) = k w (1 - u) + (1 - k) w. A weight becomes
k w, and the neuron's bias changes by (1 - k) w. The weight change that is reported counts both.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from epuckhebb.adaptation.change_signal import PATTERNS, RECENT_S, NominalOfSide
from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import compiled
from epuckhebb.tmaze import light
from epuckhebb.tmaze.robot import STEP_S

# Chosen on champions 1 to 20, in the known changed worlds:
RATE_PER_S = 3.0  # how fast the scale follows
MAKES_FAMILIAR = 0.7  # share of the novelty that may be left with a scale that is used

EVERY = 4  # steps from one comparison to the next
LEAST, MOST = 0.05, 20.0  # scale; no light level of any scenario asks for more
_LARGEST_STEP = 0.2  # of log k
_SHARE = EVERY * STEP_S / (RECENT_S + EVERY * STEP_S)
_DARK = 1e-6  # keeps the length of a pattern from being 0
_SAMPLES = 8000  # from which the patterns are made: a quarter of twenty lifetimes, evenly spread


def light_patterns(lifetimes: Sequence[Floats]) -> tuple[Floats, float]:
    """What the light looks like in training: patterns of brightness, (64, lights), and the largest novelty n(1).

    The patterns are the centres of clusters (k-means) of the recorded brightness.

    lifetimes: (samples, lights) brightness each, recorded in the training world at every fourth step.
    """
    import warnings

    from scipy.cluster.vq import kmeans2  # takes a moment, and few runs need it

    sensed = np.concatenate(lifetimes)
    sensed = sensed[:: -(-len(sensed) // _SAMPLES)]
    first = sensed[np.linspace(0, len(sensed) - 1, PATTERNS).round().astype(int)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # a cluster that is empty stays where it is
        patterns, _ = kmeans2(sensed, first, minit="matrix")
    lengths = pattern_lengths(patterns)
    most = light.NOISE  # which a reading has in any case
    for bright in lifetimes:
        nearest = patterns[(bright @ patterns.T / lengths).argmax(axis=1)]
        novelty = math.nan
        # Smoothed over 5 s, as in a lifetime.
        for distance in np.sqrt(((nearest - bright) ** 2).mean(axis=1)):
            novelty = distance if math.isnan(novelty) else novelty + _SHARE * (distance - novelty)
            most = max(most, novelty)
    return patterns, float(most)


def pattern_lengths(patterns: Floats) -> Floats:
    """The lengths of patterns, (patterns, lights), never 0."""
    lengths: Floats = np.sqrt(_DARK + (patterns**2).sum(axis=1))
    return lengths


class HomeostasisState(NamedTuple):
    """What homeostasis carries from step to step.

    values: (3,) the scale k, the novelty n(k), the novelty n(1); these two nan at first. bright: (lights,) smoothed
    brightness, nan at first. alike: workspace.
    """

    values: Floats
    bright: Floats
    alike: Floats


def initial_homeostasis_state(lights: int) -> HomeostasisState:
    """The state before the first step."""
    return HomeostasisState(
        values=np.array([1.0, math.nan, math.nan]), bright=np.full(lights, math.nan), alike=np.zeros(PATTERNS)
    )


@compiled
def compare(bright: Floats, k: float, nominal: NominalOfSide, alike: Floats) -> tuple[float, float]:
    """The distance rms(t - v) of the scaled brightness from the nearest pattern, and how fast k would follow."""
    lights = bright.shape[0]
    for m in range(alike.shape[0]):
        alike[m] = 0.0
    for i in range(lights):
        v = min(1.0, k * bright[i])
        for m in range(alike.shape[0]):
            alike[m] += v * nominal.patterns[i, m]
    nearest = 0
    for m in range(alike.shape[0]):
        alike[m] /= nominal.lengths[m]
        if alike[m] > alike[nearest]:
            nearest = m
    squares, pull, length = 0.0, 0.0, _DARK
    for i in range(lights):
        v = min(1.0, k * bright[i])
        miss = nominal.patterns[i, nearest] - v
        squares += miss * miss
        pull += miss * k * bright[i]
        length += v * v
    return math.sqrt(squares / lights), pull / length


def homeostasis(lights: int, post: int) -> Callable[..., None]:
    """The function that scales the light readings of a robot, `scale(life, setup, step)`.

    lights: how many light sensors it has. post: how many neurons the first layer of connections leads to.
    """

    @compiled
    def follow(state: HomeostasisState, nominal: NominalOfSide) -> None:
        k = state.values[0]
        novelty, pull = compare(state.bright, k, nominal, state.alike)
        without = novelty if k == 1.0 else compare(state.bright, 1.0, nominal, state.alike)[0]
        first = math.isnan(state.values[1])
        state.values[1] = novelty if first else state.values[1] + _SHARE * (novelty - state.values[1])
        state.values[2] = without if first else state.values[2] + _SHARE * (without - state.values[2])
        if state.values[1] > nominal.novelty:
            step = min(_LARGEST_STEP, max(-_LARGEST_STEP, RATE_PER_S * EVERY * STEP_S * pull))
            state.values[0] = min(MOST, max(LEAST, k * math.exp(step)))

    @compiled
    def change_of_weights(weights: Floats, k: float) -> float:
        """The sum of |W - W_gene| that the scale k amounts to: of the weights, and of the biases."""
        change = 0.0
        for j in range(post):
            bias = 0.0
            for i in range(lights):
                weight = weights[i * post + j]
                change += abs(k - 1.0) * abs(weight)
                bias += (1.0 - k) * weight
            change += abs(bias)
        return change

    @compiled
    def scale(life: Any, setup: Any, step: int) -> None:
        readings, tally, state, nominal = life.activation, life.tally[0], life.adaptation.homeostasis, setup.nominal
        share = 1.0 / max(1.0, state.values[0])  # noise is smoothed as much as it is magnified
        for i in range(lights):
            u = 1.0 - readings[i]
            state.bright[i] = u if math.isnan(state.bright[i]) else state.bright[i] + share * (u - state.bright[i])
        if step % EVERY == 0:
            follow(state, nominal)
            tally.change_signal = state.values[1] / nominal.novelty
            familiar = state.values[1] < MAKES_FAMILIAR * state.values[2]
            tally.scale = state.values[0] if familiar else 1.0
            tally.scaling = change_of_weights(life.weights, tally.scale)
        if tally.scale != 1.0:
            for i in range(lights):
                readings[i] = 1.0 - min(1.0, tally.scale * state.bright[i])

    return scale
