"""The pass through a wiring, compiled: the drives of a group of neurons, their responses, and then the next group.

Synapses that join all neurons of one row with all of another are a block. Blocks are written out one after the other
with constant sizes, as layers are. A list of synapses that makes many blocks is walked through, one by one.
"""

from collections import namedtuple
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim.arrays import Floats
from epuckhebb.sim.compiling.kernel import compiled, in_module, in_turn
from epuckhebb.sim.compiling.simd import WIDTH, alike, plus, read, times, write
from epuckhebb.sim.wiring import OF_NEURON, Neurons, Wiring

MOST_BLOCKS = 16  # that are written out
_namedtuple: Any = namedtuple  # mypy wants the names of the fields written out

Block = tuple[int, ...]  # first presynaptic and postsynaptic neuron, first synapse, how many rows and columns


def blocks_of(pre: NDArray[np.int64], post: NDArray[np.int64], begins: Sequence[int]) -> list[Block]:
    """The blocks of a list of synapses, in its order. begins: the first neuron of each group; none lies in two."""
    blocks: list[Block] = []
    first, count = 0, len(pre)
    while first < count:
        wide = 1
        while (
            first + wide < count
            and pre[first + wide] == pre[first]
            and post[first + wide] == post[first] + wide
            and post[first + wide] not in begins
        ):
            wide += 1
        row, high = np.arange(wide) + post[first], 1
        while True:
            here = slice(first + high * wide, first + (high + 1) * wide)
            if not (np.array_equal(post[here], row) and (pre[here] == pre[first] + high).all()):
                break
            high += 1
        blocks.append((int(pre[first]), int(post[first]), first, high, wide))
        first += high * wide
    return blocks


def wired_pass(
    wiring: Wiring,
    begins: Sequence[int],
    joined: tuple[NDArray[np.int64], NDArray[np.int64]],
    vectors: Sequence[tuple[int, ...]],
) -> Callable[..., None]:
    """The function `forward(weights, activation, drive, neurons)` that passes inputs through a wiring.

    begins: the first neuron of each group, and the end of the last. joined: the synapses. vectors: their blocks, each
    with its number of vectors of four.
    """
    respond, own = neuron_of(wiring), begins[0]

    def of_group(begin: int, end: int) -> Callable[..., None]:
        # The last vector may reach beyond a block, but only behind the group: its drives are being added up.
        blocks = [
            (pre, post, first, inputs, outputs, whole if post + outputs == end else outputs // WIDTH)
            for pre, post, first, inputs, outputs, whole in vectors
            if begin <= post < end
        ]
        add = in_turn(_add, blocks, "weights, activation, drive")
        if len(blocks) > MOST_BLOCKS:
            add = _one_by_one(*joined, (begin <= joined[1]) & (joined[1] < end))

        @compiled
        def group(weights: Floats, activation: Floats, drive: Floats, neurons: Neurons) -> None:
            for j in range(begin, end):
                drive[j] = 0.0
            add(weights, activation, drive)
            for j in range(begin, end):
                activation[j] = respond(j, own, drive, activation, neurons)

        return group

    groups = {f"group_{k}": of_group(*ends) for k, ends in enumerate(pairwise(begins))}
    calls = ", ".join(f"{name}(weights, activation, drive, neurons)" for name in groups)
    take_turns = compiled(eval(f"lambda weights, activation, drive, neurons: ({calls},)", groups))
    left, right = begins[-1] - 2, begins[-1] - 1

    @compiled
    def forward(weights: Floats, activation: Floats, drive: Floats, neurons: Neurons) -> None:
        take_turns(weights, activation, drive, neurons)
        activation[left] = min(max(activation[left], -1.0), 1.0)  # nan stays nan, whence the order
        activation[right] = min(max(activation[right], -1.0), 1.0)

    return forward


def neuron_of(wiring: Wiring) -> Callable[..., float]:
    """The function `respond(j, first, drive, activation, neurons)`: the activation of neuron j."""
    kind = type(wiring)
    given = {**OF_NEURON, **{name: f"neurons.parameters[{row}, j - first]" for row, name in enumerate(kind.evolved)}}
    values = ", ".join(given[name] for name in kind.arguments())
    neuron: Any = kind.neuron
    parts = {"neuron": compiled(in_module(neuron, __name__))}
    respond = compiled(eval(f"lambda j, first, drive, activation, neurons, by: neuron({values})", parts))
    parts = {"respond": respond, "By": _namedtuple("By", kind.settings())}
    call = "respond(j, first, drive, activation, neurons, By(*neurons.numbers))"
    made: Callable[..., float] = compiled(eval(f"lambda j, first, drive, activation, neurons: float({call})", parts))
    return made


def _add(
    pre: int,
    post: int,
    first: int,
    inputs: int,
    outputs: int,
    vectors: int,
    weights: Floats,
    activation: Floats,
    drive: Floats,
) -> None:
    """Add what one block of synapses passes on to the drives of its postsynaptic neurons."""
    for j in range(0, vectors * WIDTH, WIDTH):
        sums = read(drive, post + j)
        for i in range(inputs):
            sums = plus(sums, times(alike(activation[pre + i]), read(weights, first + i * outputs + j)))
        write(drive, post + j, sums)
    for j in range(vectors * WIDTH, outputs):
        summed = drive[post + j]
        for i in range(inputs):
            summed += activation[pre + i] * weights[first + i * outputs + j]
        drive[post + j] = summed


def _one_by_one(
    pre: NDArray[np.int64], post: NDArray[np.int64], own: NDArray[np.bool_]
) -> Callable[[Floats, Floats, Floats], None]:
    """The same for synapses in any order. own: which of them reach this group."""
    places = np.flatnonzero(own)
    senders, receivers, count = pre[places], post[places], len(places)

    @compiled
    def add(weights: Floats, activation: Floats, drive: Floats) -> None:
        for k in range(count):
            drive[receivers[k]] += activation[senders[k]] * weights[places[k]]

    return add
