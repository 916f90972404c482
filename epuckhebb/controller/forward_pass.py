"""The forward pass, compiled: the drives of a group of neurons, their responses, and then the next group.

In layers, a group is a layer, and y = tanh(x W). Synapses that join all neurons of one row with all of another are a
block. A few blocks are written out one after the other with constant sizes; many are walked through.
"""

from collections.abc import Callable, Iterator
from functools import cache
from itertools import pairwise
from typing import Any

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import call_each, compiled, written
from epuckhebb.controller.compiling.simd import WIDTH, alike, plus, read, times, write
from epuckhebb.controller.network import GivenOutputs, Network, tanh
from epuckhebb.controller.own_class import make_number_call
from epuckhebb.controller.wiring import OF_NEURON


@cache
def forward_pass(network: Network) -> Callable[..., None]:
    """The function `forward(weights, activation, drive, neurons, substeps)` that passes inputs through a network.

    weights: (synapses,). activation: (neurons,), inputs and bias given, the rest filled. drive: (neurons,), workspace.
    neurons: of a wiring. substeps: (substeps, neurons), filled with the activations of each, unless there is one. The
    sizes are constants in the machine code.
    """
    first, outputs, is_wired = network.first_output, network.outputs, network.wiring is not None
    count, has_substeps, width = network.substeps, network.substeps > 1, network.neurons
    if isinstance(network, GivenOutputs):

        @compiled
        def copy_outputs(weights: Floats, activation: Floats, *_: Any) -> None:
            for k in range(outputs):
                activation[first + k] = weights[k]

        return copy_outputs

    functions: dict[str, Any] = {"respond": _responder(network)}
    ends = pairwise([*network.first_neuron[1:], network.neurons])
    calls = [call for begin, end in ends for call in _calls_of_group(network, begin, end, functions)]
    take_turns = written("weights, activation, drive, neurons", f"({', '.join(calls)},)", functions)

    @compiled
    def forward(weights: Floats, activation: Floats, drive: Floats, neurons: Any = None, substeps: Any = None) -> None:
        for number in range(count):
            take_turns(weights, activation, drive, neurons)
            if is_wired:
                for k in range(first, first + outputs):
                    activation[k] = min(max(activation[k], -1.0), 1.0)  # nan stays nan, whence the order
            if has_substeps:
                for k in range(width):
                    substeps[number, k] = activation[k]

    return forward


def _responder(network: Network) -> Callable[..., None]:
    """The function `respond(begin, end, drive, activation, neurons)` that gives neurons their activations."""
    first_neuron = network.first_neuron[1]
    of_one: Callable[..., float] = compiled(lambda j, _, drive, *__: tanh(drive[j]))
    if network.wiring is not None:
        kind = type(network.wiring)
        evolved = {name: f"neurons.parameters[{row}, j - first]" for row, name in enumerate(kind.evolved)}
        how, arguments = {**OF_NEURON, **evolved}, "j, first, drive, activation, neurons"
        of_one = make_number_call(kind, kind.neuron, kind.arguments("neuron"), how, arguments, "neurons.numbers")

    @compiled
    def respond(begin: int, end: int, drive: Floats, activation: Floats, neurons: Any) -> None:
        for j in range(begin, end):
            activation[j] = of_one(j, first_neuron, drive, activation, neurons)

    return respond


def _calls_of_group(network: Network, begin: int, end: int, functions: dict[str, Any]) -> Iterator[str]:
    """The calls that give the neurons from `begin` to before `end` their activations, written out.

    functions: those that are called, by name; one is added.
    """
    # The last vector may reach beyond a block, but only behind the group: its drives are being added up.
    blocks = [
        (pre, post, first, inputs, outputs, whole if post + outputs == end else outputs // WIDTH)
        for pre, post, first, inputs, outputs, whole in network.vectors
        if begin <= post < end
    ]
    size = end - begin
    # The first block sets the drives, if it reaches all of them; else one without synapses sets them to 0.
    if not blocks or (blocks[0][1], blocks[0][4]) != (begin, size):
        blocks = [(0, begin, 0, 0, size, size // WIDTH), *blocks]
    numbered = [(*block, int(number > 0)) for number, block in enumerate(blocks)]
    functions[f"add_to_{begin}"] = call_each(_add, numbered, "weights, activation, drive")
    yield f"add_to_{begin}(weights, activation, drive)"
    yield f"respond({begin}, {end}, drive, activation, neurons)"


def _add(
    pre: int,
    post: int,
    first: int,
    inputs: int,
    outputs: int,
    vectors: int,
    more: int,
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
