"""Random numbers: each draw has a place in a study, and depends on the seed and that place alone.

So results do not depend on the order of the work, on threads or on interruptions. Sensor noise depends on the key of a
lifetime and on the step, without a generator whose state could be shared. A robot has the same noise alone, in a block,
on any thread and after a pause.
"""

from collections.abc import Callable, Sequence
from enum import IntEnum
from functools import cache
from itertools import permutations
from statistics import NormalDist
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import compiled

_WORD = 0xFFFFFFFF


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
    environment = 20


def rng(seed: int, stream: Stream, *place: int) -> np.random.Generator:
    """A generator for one place in a study, for example (generation, individual, loop, side)."""
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(stream, *place))))


def key(seed: int, stream: Stream, *place: int) -> np.uint64:
    """The key of one place in a study, for example that of a lifetime's sensor noise (repeat, side)."""
    sequence = np.random.SeedSequence(seed, spawn_key=(stream, *place))
    return np.uint64(sequence.generate_state(1, np.uint64)[0])


def keys(seed: int, stream: Stream, places: Sequence[tuple[int, ...]]) -> NDArray[np.uint64]:
    """The key of each of many places, whose numbers are less than 2^32: all of them in the time of a few."""
    words = [np.full(1, seed >> shift & _WORD, np.uint32) for shift in range(0, max(128, seed.bit_length()), 32)]
    words += [np.full(1, stream, np.uint32), *np.array(places, np.uint32).T]
    constant = 0x43B0D7E5

    def scrambled(word: Any, factor: int = 0x931E8875) -> Any:
        nonlocal constant
        word, constant = word ^ np.uint32(constant), constant * factor & _WORD
        word = word * np.uint32(constant)
        return word ^ word >> 16

    def mixed(word: Any, addend: Any) -> Any:
        word = word * np.uint32(0xCA01F9DD) - scrambled(addend) * np.uint32(0x4973F715)
        return word ^ word >> 16

    # As NumPy's `SeedSequence` does it (O'Neill, "Developing a seed_seq alternative", 2015), for all places at once.
    pool = [scrambled(word) for word in words[:4]]
    for source, target in permutations(range(4), 2):
        pool[target] = mixed(pool[target], pool[source])
    for word in words[4:]:
        pool = [mixed(target, word) for target in pool]
    constant = 0x8B51F9DD
    halves = np.array([scrambled(word, 0x58F38DED) for word in pool[:2]], np.uint64)
    keys: NDArray[np.uint64] = halves[0] | halves[1] << np.uint64(32)
    return keys


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
def draw(random: NDArray[np.uint64]) -> float:
    """The next number in [0, 1) of a sequence. random: (1,), where the sequence stands; updated."""
    number = uniform(random[0], 0)
    random[0] += _GOLDEN
    return number


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
