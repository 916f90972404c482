"""Weight change, the sum of |W - W_gene|, as in the paper; and the share of weights that end at their bound."""

from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import compiled
from epuckhebb.controller.network import Network

SATURATED = 0.995  # of w_max: a weight above it counts as saturated
_LANES = 16  # numbers that are added to each other first, so that the processor can do four sums at a time


def weight_change_workspace(network: Network) -> int:
    """The length of an array for the changes of all weights: whole groups of 16."""
    return -(-network.synapses // _LANES) * _LANES


def saturated_fraction(weights: Floats, w_max: float) -> Any:
    """The share of the weights, (..., synapses), whose absolute value is more than `SATURATED` times their bound."""
    return (np.abs(weights) > SATURATED * w_max).sum(axis=-1) / weights.shape[-1]


@compiled
def weight_change(weight: float, gene: float) -> float:
    """|W - W_gene| of one weight."""
    return abs(weight - gene)


@cache
def make_total(network: Network) -> Callable[[Floats], float]:
    """The function that adds up the changes of a network's weights; it overwrites the array that it receives.

    The processor can do four sums at a time in this order: one half is added to the other, four times over; the rest is
    added one by one.
    """
    used, length = network.synapses, weight_change_workspace(network)
    left = length // _LANES
    half, quarter, eighth = length // 2, length // 4, length // 8

    @compiled
    def quarters(values: Floats, k: int) -> float:
        return float((values[k] + values[k + half]) + (values[k + quarter] + values[k + half + quarter]))

    @compiled
    def total(values: Floats) -> float:
        for k in range(used, length):
            values[k] = 0.0
        for k in range(left):
            values[k] = (quarters(values, k) + quarters(values, k + eighth)) + (
                quarters(values, k + left) + quarters(values, k + eighth + left)
            )
        summed = 0.0
        for k in range(left):
            summed += values[k]
        return summed

    return total
