"""Sensor noise: standard normal numbers that depend on a key and a step, and on nothing else.

The key belongs to one lifetime (`epuckhebb.sim.streams.key`). There is no generator whose state could be
shared, so a robot hears the same noise alone, in a block, on any thread and after a restart.
"""

from statistics import NormalDist

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim.compiled import compiled

_GOLDEN = np.uint64(0x9E3779B97F4A7C15)
_MIX_1 = np.uint64(0xBF58476D1CE4E5B9)
_MIX_2 = np.uint64(0x94D049BB133111EB)
_S30, _S27, _S31, _S16, _S4 = (np.uint64(shift) for shift in (30, 27, 31, 16, 4))
_LOW_16 = np.uint64(0xFFFF)
_FOUR = np.uint64(4)


def _normal_quantiles(count: int) -> NDArray[np.float64]:
    """The middles of `count` equally likely slices of the normal distribution, scaled to variance 1."""
    quantiles: NDArray[np.float64] = np.array([NormalDist().inv_cdf((k + 0.5) / count) for k in range(count)])
    quantiles /= np.sqrt(np.mean(quantiles**2))
    return quantiles


QUANTILES = _normal_quantiles(4096)  # reaches 3.7 standard deviations


@compiled
def bits(key: np.uint64, number: np.uint64) -> np.uint64:
    """64 random bits: output `number` of the SplitMix64 generator (Steele et al. 2014) seeded with `key`."""
    z = key + (number + np.uint64(1)) * _GOLDEN
    z = (z ^ (z >> _S30)) * _MIX_1
    z = (z ^ (z >> _S27)) * _MIX_2
    return z ^ (z >> _S31)


@compiled
def normal_numbers(key: np.uint64, step: int, out: NDArray[np.float64]) -> None:
    """Fill `out` (16,) with standard normal numbers: one draw of 64 bits gives four 12-bit places in `QUANTILES`."""
    for draw in range(4):
        z = bits(key, np.uint64(step) * _FOUR + np.uint64(draw))
        for k in range(4):
            out[4 * draw + k] = QUANTILES[(z & _LOW_16) >> _S4]
            z >>= _S16
