"""Random streams: everything random has a place in a study, and its numbers depend on the seed and that place alone.

So nothing changes when work is done in another order, on more threads, or continued after an interruption.
"""

from enum import IntEnum

import numpy as np


class Stream(IntEnum):
    """What random numbers are for. The numbers are part of every result: never renumber."""

    variation = 0
    training_noise = 1
    training_start = 2
    evaluation_noise = 3
    shuffled_signs = 4
    bootstrap = 5
    layout = 6
    memory_noise = 7


def rng(seed: int, stream: Stream, *place: int) -> np.random.Generator:
    """A generator for one place in a study, for example (generation, individual, loop, side)."""
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(stream, *place))))


def key(seed: int, stream: Stream, *place: int) -> np.uint64:
    """The key of a lifetime's sensor noise (`epuckhebb.sim.noise`)."""
    sequence = np.random.SeedSequence(seed, spawn_key=(stream, *place))
    return np.uint64(sequence.generate_state(1, np.uint64)[0])
