"""Homeostatic plasticity: the synapses of all light sensors are scaled together until the light looks as at home.

Synaptic scaling multiplies all synapses of one kind by the same factor until the neuron's activity is what it is used
to (Turrigiano, The self-tuning neuron, Cell 135, 2008). Here the factor is k, and what the robot is used to is a set of
patterns of brightness that it remembers of home. It knows only what it senses: no clock, no goal, no model of a sensor.

    v = clip(k u, 0, 1)                 u: brightness, 1 - reading of the light sensors, smoothed over k steps
    t                                   the remembered pattern in whose direction v points best: largest v t / |t|
    n(k) = mean over 5 s of rms(t - v)  novelty with the scale k; n(1): without it
    dk/dt = 3 k  (t - v) k u / (v v)    while n(k) is more than it ever was at home; else the scale rests
    reading = 1 - v                     if n(k) < 0.7 n(1): only a scale that makes the light familiar is used

A scale of readings is one of the first layer's weights w: w (1 - k u) = k w (1 - u) + (1 - k) w, so w becomes k w, and
the neuron's bias changes by (1 - k) w. That is the weight change which is reported.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim import light
from epuckhebb.sim.adaptation.change_signal import RECENT_S, NominalOfSide
from epuckhebb.sim.compiled import compiled
from epuckhebb.sim.robot import STEP_S

# Chosen on champions 1 to 20, in the known changed worlds:
PATTERNS = 64  # that are remembered
RATE_PER_S = 3.0  # how fast the scale follows
MAKES_FAMILIAR = 0.7  # share of the novelty that may be left with a scale that is used

EVERY = 4  # steps from one comparison to the next
LEAST, MOST = 0.05, 20.0  # scale; no light level of any scenario asks for more
_LARGEST_STEP = 0.2  # of log k
_SHARE = EVERY * STEP_S / (RECENT_S + EVERY * STEP_S)
_DARK = 1e-6  # keeps the length of a pattern from being 0
_SAMPLES = 8000  # of which the patterns are made: a quarter of twenty lifetimes, evenly spread


def remember_patterns(lives: Sequence[NDArray[np.float64]]) -> tuple[NDArray[np.float64], float]:
    """What the light looks like at home: patterns of brightness, (64, lights), and the largest novelty there, n(1).

    The patterns are the centres of clusters of what was sensed (k-means), or what was sensed if that is less.

    lives: (samples, lights) brightness each, of lifetimes at home, recorded every fourth step.
    """
    import warnings

    from scipy.cluster.vq import kmeans2  # takes a moment, and few runs need it

    sensed = np.concatenate(lives)
    sensed = sensed[:: -(-len(sensed) // _SAMPLES)]
    first = sensed[np.linspace(0, len(sensed) - 1, PATTERNS).round().astype(int)]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # a cluster that is empty stays where it is
        patterns, _ = kmeans2(sensed, first, minit="matrix")
    lengths = lengths_of(patterns)
    most = light.NOISE
    for life in lives:
        nearest = patterns[(life @ patterns.T / lengths).argmax(axis=1)]
        novelty = math.nan
        for now in np.sqrt(((nearest - life) ** 2).mean(axis=1)):
            novelty = now if math.isnan(novelty) else novelty + _SHARE * (now - novelty)
            most = max(most, novelty)
    return patterns, float(most)


def lengths_of(patterns: NDArray[np.float64]) -> NDArray[np.float64]:
    """The lengths of patterns, (patterns, lights), never 0."""
    lengths: NDArray[np.float64] = np.sqrt(_DARK + (patterns**2).sum(axis=1))
    return lengths


def no_patterns(home: NominalOfSide, lights: int) -> NominalOfSide:
    """The baseline with room for patterns, all dark: for who is never to live with it."""
    return home._replace(patterns=np.zeros((lights, PATTERNS)), lengths=np.ones(PATTERNS))


def check_patterns(home: NominalOfSide, lights: int) -> None:
    """Refuse a baseline that does not tell what the light looks like at home, or is of another robot.

    Raises:
        ValueError: it does not, or is.
    """
    if home.patterns.shape != (lights, PATTERNS):
        raise ValueError(
            f"homeostasis needs a baseline with {PATTERNS} patterns of {lights} light sensors, got an array of shape "
            f"{home.patterns.shape}"
        )


class HomeostasisState(NamedTuple):
    """What homeostasis carries through a life.

    state: (3,) the scale k, the novelty n(k), the novelty n(1); nan before the first. bright: (lights,) smoothed
    brightness, nan before the first. alike: workspace.
    """

    state: NDArray[np.float64]
    bright: NDArray[np.float64]
    alike: NDArray[np.float64]


def initial_homeostasis_state(lights: int) -> HomeostasisState:
    """Room for a robot at birth."""
    return HomeostasisState(
        state=np.array([1.0, math.nan, math.nan]), bright=np.full(lights, math.nan), alike=np.zeros(PATTERNS)
    )


@compiled
def compare(
    bright: NDArray[np.float64], k: float, home: NominalOfSide, alike: NDArray[np.float64]
) -> tuple[float, float]:
    """How unlike the nearest pattern the brightness is with this scale, rms(t - v), and how fast k would follow."""
    lights = bright.shape[0]
    for m in range(alike.shape[0]):
        alike[m] = 0.0
    for i in range(lights):
        v = min(1.0, k * bright[i])
        for m in range(alike.shape[0]):
            alike[m] += v * home.patterns[i, m]
    nearest = 0
    for m in range(alike.shape[0]):
        alike[m] /= home.lengths[m]
        if alike[m] > alike[nearest]:
            nearest = m
    squares, pull, length = 0.0, 0.0, _DARK
    for i in range(lights):
        v = min(1.0, k * bright[i])
        miss = home.patterns[i, nearest] - v
        squares += miss * miss
        pull += miss * k * bright[i]
        length += v * v
    return math.sqrt(squares / lights), pull / length


def homeostasis(lights: int, post: int) -> Callable[..., None]:
    """The function that scales the light readings of a robot, `scale(readings, weights, tally, room, home, step)`.

    lights: how many light sensors it has. post: how many neurons the first layer of connections leads to.
    """

    @compiled
    def follow(room: HomeostasisState, home: NominalOfSide) -> None:
        k = room.state[0]
        novelty, pull = compare(room.bright, k, home, room.alike)
        without = novelty if k == 1.0 else compare(room.bright, 1.0, home, room.alike)[0]
        first = math.isnan(room.state[1])
        room.state[1] = novelty if first else room.state[1] + _SHARE * (novelty - room.state[1])
        room.state[2] = without if first else room.state[2] + _SHARE * (without - room.state[2])
        if room.state[1] > home.novelty:
            step = min(_LARGEST_STEP, max(-_LARGEST_STEP, RATE_PER_S * EVERY * STEP_S * pull))
            room.state[0] = min(MOST, max(LEAST, k * math.exp(step)))

    @compiled
    def change_of_weights(weights: NDArray[np.float64], k: float) -> float:
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
    def scale(
        readings: NDArray[np.float64],
        weights: NDArray[np.float64],
        tally: Any,
        room: HomeostasisState,
        home: NominalOfSide,
        step: int,
    ) -> None:
        over = 1.0 / max(1.0, room.state[0])  # noise is smoothed as much as it is magnified
        for i in range(lights):
            now = 1.0 - readings[i]
            room.bright[i] = now if math.isnan(room.bright[i]) else room.bright[i] + over * (now - room.bright[i])
        if step % EVERY == 0:
            follow(room, home)
            tally.change_signal = room.state[1] / home.novelty
            familiar = room.state[1] < MAKES_FAMILIAR * room.state[2]
            tally.scale = room.state[0] if familiar else 1.0
            tally.scaling = change_of_weights(weights, tally.scale)
        if tally.scale != 1.0:
            for i in range(lights):
                readings[i] = 1.0 - min(1.0, tally.scale * room.bright[i])

    return scale
