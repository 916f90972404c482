"""The forward pass, compiled: the drives of a group of neurons, their responses, and then the next group.

In layers, a group is a layer, and y = tanh(x W). Synapses that join all neurons of one row with all of another are a
block. Blocks are written out one after the other with constant sizes. A list of synapses that makes many blocks is
walked through, one by one.
"""

from collections.abc import Callable
from functools import cache
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim.arrays import Floats
from epuckhebb.sim.compiling.kernel import compiled, in_turn
from epuckhebb.sim.compiling.simd import WIDTH, alike, plus, read, times, write
from epuckhebb.sim.network import GivenOutputs, Network, tanh
from epuckhebb.sim.own_class import number_of
from epuckhebb.sim.wiring import OF_NEURON, Neurons, Wiring

MOST_BLOCKS = 16  # that are written out


@cache
def forward_pass(network: Network) -> Callable[..., None]:
    """The function `forward(weights, activation, drive, neurons)` that passes inputs through a network.

    weights: (synapses,). activation: (neurons,), inputs and bias given, the rest filled. drive: (neurons,), workspace.
    neurons: of a wiring. The sizes are constants in the machine code.
    """
    left, right, is_wired = network.wheels, network.wheels + 1, network.wiring is not None
    if isinstance(network, GivenOutputs):

        @compiled
        def given(weights: Floats, activation: Floats, *_: Any) -> None:
            activation[left], activation[right] = weights[0], weights[1]

        return given

    respond = compiled(lambda j, _, drive, *__: tanh(drive[j])) if network.wiring is None else neuron_of(network.wiring)
    ends = pairwise([*network.first_neuron[1:], network.neurons])
    groups = {f"group_{k}": _group(network, begin, end, respond) for k, (begin, end) in enumerate(ends)}
    calls = ", ".join(f"{name}(weights, activation, drive, neurons)" for name in groups)
    take_turns = compiled(eval(f"lambda weights, activation, drive, neurons: ({calls},)", groups))

    @compiled
    def forward(weights: Floats, activation: Floats, drive: Floats, neurons: Neurons | None = None) -> None:
        take_turns(weights, activation, drive, neurons)
        if is_wired:
            activation[left] = min(max(activation[left], -1.0), 1.0)  # nan stays nan, whence the order
            activation[right] = min(max(activation[right], -1.0), 1.0)

    return forward


def neuron_of(wiring: Wiring) -> Callable[..., float]:
    """The function `respond(j, first, drive, activation, neurons)`: the activation of neuron j."""
    kind = type(wiring)
    evolved = {name: f"neurons.parameters[{row}, j - first]" for row, name in enumerate(kind.evolved)}
    how, given = {**OF_NEURON, **evolved}, "j, first, drive, activation, neurons"
    made: Callable[..., float] = number_of(kind, kind.neuron, kind.arguments(), how, given, "neurons.numbers")
    return made


def _group(network: Network, begin: int, end: int, respond: Callable[..., float]) -> Callable[..., None]:
    """The function that gives the neurons from `begin` to before `end` their activations."""
    own, (senders, receivers) = network.first_neuron[1], network.joined
    # The last vector may reach beyond a block, but only behind the group: its drives are being added up.
    blocks = [
        (pre, post, first, inputs, outputs, whole if post + outputs == end else outputs // WIDTH)
        for pre, post, first, inputs, outputs, whole in network.vectors
        if begin <= post < end
    ]
    if len(blocks) > MOST_BLOCKS:
        starts_at_0, add = True, _one_by_one(senders, receivers, (begin <= receivers) & (receivers < end))
    else:  # a first block that reaches the whole group sets its drives
        starts_at_0 = not blocks or (blocks[0][1], blocks[0][4]) != (begin, end - begin)
        numbered = [(*block, starts_at_0 or number > 0) for number, block in enumerate(blocks)]
        add = in_turn(_add, numbered, "weights, activation, drive")

    @compiled
    def group(weights: Floats, activation: Floats, drive: Floats, neurons: Any) -> None:
        if starts_at_0:
            for j in range(begin, end):
                drive[j] = 0.0
        add(weights, activation, drive)
        for j in range(begin, end):
            activation[j] = respond(j, own, drive, activation, neurons)

    return group


def _add(
    pre: int,
    post: int,
    first: int,
    inputs: int,
    outputs: int,
    vectors: int,
    more: bool,
    weights: Floats,
    activation: Floats,
    drive: Floats,
) -> None:
    """Set the drives of neurons to what a block of synapses passes on; add it to them if there is more."""
    for j in range(0, vectors * WIDTH, WIDTH):
        sums = read(drive, post + j) if more else alike(0.0)
        for i in range(inputs):
            sums = plus(sums, times(alike(activation[pre + i]), read(weights, first + i * outputs + j)))
        write(drive, post + j, sums)
    for j in range(vectors * WIDTH, outputs):
        summed = drive[post + j] if more else 0.0
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
