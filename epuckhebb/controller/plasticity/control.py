"""Controls of plasticity: updates as large as a rule's, in other directions. An effect they share is not the rule's.

A *yoked* lifetime takes the changes d of its weights from a *master* lifetime, that of the rule with the same genes,
world and noise, whatever its own activations are:

    d_k(t) = W_k(t + 1) - W_k(t)                    of the master, its bound included
    W_k'   = clip(W_k + s_k d_p(k), -W_max, W_max)  s: signs, p: synapses; 0 where d is 0

All random signs and places are those of a *draw*, whose number is a setting: another seed has the same.
"""

from collections.abc import Callable
from enum import Enum
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import compiled, nothing
from epuckhebb.controller.network import Network
from epuckhebb.controller.plasticity.weight_change import make_total, weight_change
from epuckhebb.controller.random import Stream, rng

DRAWS = 5  # of random signs and places
MOST_KEPT = 30_000_000  # weights of a master at all steps, which take 16 bytes each


class Sign(Enum):
    """The sign S of the updates: the rule's, or one of two controls."""

    hebbian = "hebbian"
    anti = "anti"  # what fires together comes apart
    shuffled = "shuffled"  # a fixed random sign for each synapse


class Control(Enum):
    """Whose changes the weights take: those of the rule, or, in a yoked lifetime, those of its master."""

    none = "none"
    yoked_sign = "yoked_sign"  # those of the same synapse, with a fixed random sign
    yoked_place = "yoked_place"  # those of another synapse of the same layer of connections


class Yoking(NamedTuple):
    """Which changes of its master a yoked lifetime takes.

    places: (synapses,) p, the synapse of the master. signs: (synapses,) s.
    """

    places: NDArray[np.int64]
    signs: Floats


class Track(NamedTuple):
    """What the updates of a lifetime do to its weights, or what those of its master did.

    follows: whether this lifetime is yoked. kept: (steps, 2, synapses), the weights before and after the updates of
    each step of the master; of the last step alone where no lifetime follows. yoking: of a yoked lifetime. bound: of
    the weights. path: (1,) sum of |d| over the steps so far and all weights.
    """

    follows: bool
    kept: Floats
    yoking: Yoking
    bound: float
    path: Floats


NO_YOKING = Yoking(np.empty(0, np.int64), np.empty(0))


def signs(sign: Sign, synapses: int, rng: np.random.Generator | None = None) -> Floats:
    """S for each synapse, (synapses,) of 1 and -1; shuffled signs need a generator."""
    if sign is Sign.shuffled:
        assert rng is not None
        return rng.choice([-1.0, 1.0], synapses)
    return np.full(synapses, -1.0 if sign is Sign.anti else 1.0)


def signs_of_draw(draw: int, genome: int) -> np.random.Generator:
    """The generator of the random signs of a draw. genome: a number of the genes, which have draws of their own.

    The draws are those that the seeds 1 to 5 had when a seed drew the signs, so that tables of seed 1 stay as they are.
    """
    return rng(1 + draw, Stream.shuffled_signs, genome)


def yoking(control: Control, network: Network, draw: int, genome: int) -> Yoking | None:
    """Which changes a yoked lifetime takes; yoked signs are the shuffled signs of the same draw.

    genome: as of `signs_of_draw`. None where nothing is yoked.
    """
    synapses = network.synapses
    if control is Control.none:
        return None
    if control is Control.yoked_sign:
        return Yoking(np.arange(synapses), signs(Sign.shuffled, synapses, signs_of_draw(draw, genome)))
    drawn = rng(draw, Stream.yoked_places, genome)
    layers = zip(network.first_synapse, network.shapes, strict=True)
    return Yoking(np.concatenate([first + drawn.permutation(n * m) for first, (n, m) in layers]), np.ones(synapses))


@cache
def make_tracking(network: Network) -> tuple[Callable[..., None], Callable[..., float]]:
    """The functions before and after the updates of a step, for lifetimes with a `Track`.

    `begin_updates(weights, track, step)` keeps the weights. `end_updates(weights, genes, track, step, change, before)`
    keeps them again, or moves those of a yoked lifetime; it returns the weight change, which is `before` if the
    lifetime is not yoked. change: workspace.
    """
    synapses, total = network.synapses, make_total(network)

    @compiled
    def begin_updates(weights: Floats, track: Track, step: int) -> None:
        if not track.follows:
            row = step % track.kept.shape[0]
            for k in range(synapses):
                track.kept[row, 0, k] = weights[k]

    @compiled
    def end_updates(weights: Floats, genes: Floats, track: Track, step: int, change: Floats, before: float) -> float:
        kept, bound, row = track.kept, track.bound, step % track.kept.shape[0]
        if not track.follows:
            for k in range(synapses):
                kept[row, 1, k] = weights[k]
                change[k] = abs(weights[k] - kept[row, 0, k])
            track.path[0] += total(change)
            return before
        for k in range(synapses):
            place, sign, weight = track.yoking.places[k], track.yoking.signs[k], weights[k]
            old, new = kept[row, 0, place], kept[row, 1, place]
            if new != old:  # in this order, a weight that is where the master's was goes where it went, to the bit
                weights[k] = min(max((weight - sign * old) + sign * new, -bound), bound)
            change[k] = abs(weights[k] - weight)
        track.path[0] += total(change)
        for k in range(synapses):
            change[k] = weight_change(weights[k], genes[k])
        return total(change)

    return begin_updates, end_updates


# For lifetimes without a `Track`.
NO_TRACKING: tuple[Callable[..., None], Callable[..., float]] = (
    nothing,
    compiled(lambda _weights, _genes, _track, _step, _change, before: before),
)
