"""Random numbers: each draw has a place in a study, and depends on the seed and that place alone.

So results do not depend on the order of the work, on threads or on interruptions. Sensor noise depends on the key of a
lifetime and on the step, without a generator whose state could be shared. A robot has the same noise alone, in a block,
on any thread and after a pause.
"""

from collections.abc import Callable
from enum import IntEnum
from functools import cache
from statistics import NormalDist

import numpy as np

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import compiled


class Stream(IntEnum):
    """Uses of random numbers. These values are part of every result: never renumber; 8 is no longer used."""

    variation = 0
    training_noise = 1
    training_start = 2
    evaluation_noise = 3
    shuffled_signs = 4
    bootstrap = 5
    layout = 6
    nominal_noise = 7
    training_world = 9
    initial_weights = 10
    merging = 11
    switches = 12
    evaluation_task = 13
    training_task = 14
    flock = 15
    yoked_places = 16
    random_genome = 17
    reading_noise = 18
    environment_check = 19


def rng(seed: int, stream: Stream, *place: int) -> np.random.Generator:
    """A generator for one place in a study, for example (generation, individual, loop, side)."""
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(stream, *place))))


def key(seed: int, stream: Stream, *place: int) -> np.uint64:
    """The key of a lifetime's sensor noise."""
    sequence = np.random.SeedSequence(seed, spawn_key=(stream, *place))
    return np.uint64(sequence.generate_state(1, np.uint64)[0])


_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
_S30, _S27, _S31, _S16, _S11, _S4, _S52 = (np.uint64(shift) for shift in (30, 27, 31, 16, 11, 4, 52))
_LOW_16 = np.uint64(0xFFFF)
_A_DRAW = 4  # numbers that one draw of 64 bits gives


# The medians of 4096 equally likely slices of the normal distribution, scaled to variance 1; up to 3.7.
QUANTILES: Floats = np.array([NormalDist().inv_cdf((k + 0.5) / 4096) for k in range(4096)])
QUANTILES /= np.sqrt(np.mean(QUANTILES**2))


@compiled
def bits(key: np.uint64, number: np.uint64) -> np.uint64:
    """64 random bits: output `number` of the SplitMix64 generator (Steele et al. 2014) seeded with `key`."""
    z = key + (number + np.uint64(1)) * _GOLDEN
    z = (z ^ (z >> _S30)) * _MIX_1
    z = (z ^ (z >> _S27)) * _MIX_2
    return z ^ (z >> _S31)


@compiled
def uniform(key: np.uint64, number: int) -> float:
    """A number in [0, 1): the upper 53 bits of output `number` for this key."""
    return (bits(key, np.uint64(number)) >> _S11) * 2.0**-53


@compiled
def normal(key: np.uint64, number: int) -> float:
    """A standard normal number: the upper 12 bits of output `number` for this key give its place in `QUANTILES`."""
    return float(QUANTILES[bits(key, np.uint64(number)) >> _S52])


def noise_workspace_size(count: int) -> int:
    """The length of an array for `count` numbers: whole draws."""
    return -(-count // _A_DRAW) * _A_DRAW


@cache
def normal_numbers(count: int) -> Callable[[np.uint64, int, Floats], None]:
    """The function that fills an array of `noise_workspace_size(count)` with normal numbers for a key and a step.

    One draw of 64 bits gives four 12-bit places in `QUANTILES`.
    """
    draws = noise_workspace_size(count) // _A_DRAW
    per_step = np.uint64(draws)

    @compiled
    def fill(key: np.uint64, step: int, out: Floats) -> None:
        for draw in range(draws):
            z = bits(key, np.uint64(step) * per_step + np.uint64(draw))
            for k in range(_A_DRAW):
                out[_A_DRAW * draw + k] = QUANTILES[(z & _LOW_16) >> _S4]
                z >>= _S16

    return fill
