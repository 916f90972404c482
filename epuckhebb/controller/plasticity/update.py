"""The plastic update, the same for all rules, after every control step and in force from the next one on.

    N_e = N s g m max(0.2, F)              effective rate; g: need for plasticity; s: wheel gain over that at which N
                                           holds; m: output of a modulatory neuron; all three are 1 in the paper
    W'  = clip(W + N_e S D, -W_max, W_max) D: the rule's direction; S: a sign, 1 but in controls

The weights are a copy of the genes. The genome is never written, so every lifetime starts from the genes. Settings of
all rules may normalise the weights after an update, average the activations that it reads over the last steps, and
leave out updates (`normalise`, `average`, `every`); a kernel has the code for those alone that are in use.
"""

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import call_each, compiled, nothing, one, written, zero
from epuckhebb.controller.compiling.simd import WIDTH, alike, read, times, write
from epuckhebb.controller.forward_pass import forward_pass
from epuckhebb.controller.network import Network, split_layers, tanh
from epuckhebb.controller.own_class import make_call, namedtuple_of, number
from epuckhebb.controller.plasticity.control import NO_TRACKING, make_tracking
from epuckhebb.controller.plasticity.rule import (
    EVERY_STEP,
    Normalise,
    NoRule,
    Rule,
    Schedule,
    coefficient_names,
    modulator_name,
    receives_reward,
)
from epuckhebb.controller.plasticity.weight_change import make_total, weight_change, weight_change_workspace

PRE, POST, CORRELATION = range(3)  # rows of the workspace of an update


@compiled
def effective_rate(rate: float, need: float, fitness: float, floor: float) -> float:
    """N_e = N g max(0.2, F): a robot with a high fitness learns fast, one with a low fitness slowly."""
    return rate * need * max(floor, fitness)


@compiled
def next_weight(weight: float, rate: float, direction: float, w_max: float) -> float:
    """W' = clip(W + N_e D, -W_max, W_max), with N_e or -N_e as the rate; nan stays nan, whence the order."""
    return min(max(weight + rate * direction, -w_max), w_max)


Fill = Callable[[Floats, Floats], None]


_FOURS: dict[int, Any] = {  # of a presynaptic neuron i and four postsynaptic ones from j on
    PRE: compiled(lambda activation, i, _: alike(activation[i])),
    POST: compiled(lambda activation, _, j: read(activation, j)),
    CORRELATION: compiled(lambda activation, i, j: times(alike(activation[i]), read(activation, j))),
}
_SINGLES: dict[int, Any] = {  # of one and one
    PRE: compiled(lambda activation, i, _: activation[i]),
    POST: compiled(lambda activation, _, j: activation[j]),
    CORRELATION: compiled(lambda activation, i, j: activation[i] * activation[j]),
}


@cache
def _filled(network: Network, quantity: int) -> Fill:
    """The function that writes x_j, x_i or their product for every synapse into its row of the workspace."""
    four, single = _FOURS[quantity], _SINGLES[quantity]

    def fill_layer(
        pre: int, post: int, first: int, inputs: int, outputs: int, vectors: int, activation: Floats, room: Floats
    ) -> None:
        row = room[quantity]
        for i in range(inputs):
            for j in range(0, vectors * WIDTH, WIDTH):  # what the last writes too much, the next i writes over
                write(row, first + i * outputs + j, four(activation, pre + i, post + j))
            for j in range(vectors * WIDTH, outputs):
                row[first + i * outputs + j] = single(activation, pre + i, post + j)

    fill: Fill = call_each(fill_layer, network.vectors, "activation, room")
    return fill


def _divide_by_largest(
    _pre: int, _post: int, first: int, inputs: int, outputs: int, weights: Floats, _lengths: Floats, _w_max: float
) -> None:
    """Divide the weights of one layer of connections by the largest, if that is above 0."""
    largest = 0.0
    for k in range(first, first + inputs * outputs):
        largest = max(largest, abs(weights[k]))
    if largest > 0.0:
        for k in range(first, first + inputs * outputs):
            weights[k] /= largest


def _restore_lengths(
    _pre: int, post: int, first: int, inputs: int, outputs: int, weights: Floats, lengths: Floats, w_max: float
) -> None:
    """Give the incoming weights of one layer of connections their initial length."""
    for j in range(outputs):
        squares = 0.0
        for i in range(inputs):
            squares += weights[first + i * outputs + j] * weights[first + i * outputs + j]
        scale = lengths[post + j] / np.sqrt(squares) if squares > 0.0 else 1.0
        for i in range(inputs):
            k = first + i * outputs + j
            weights[k] = min(max(weights[k] * scale, -w_max), w_max)


_NORMALISE = {Normalise.largest: _divide_by_largest, Normalise.length: _restore_lengths}


def initial_lengths(rule: Rule, network: Network, genes: Floats) -> Floats:
    """The length of each neuron's incoming weights, (neurons,); empty for a rule that does not keep it.

    genes: initial weights.
    """
    if rule.normalise is not Normalise.length:
        return np.empty(0)
    inputs = np.zeros(network.inputs + 1)
    return np.concatenate([inputs, *(np.linalg.norm(layer, axis=0) for layer in split_layers(network, genes))])


class StepContext(NamedTuple):
    """What of a step is the same for all synapses. fitness: live. key: of the lifetime's noise. step_s: length [s]."""

    fitness: float
    key: np.uint64
    step: int
    step_s: float


class Workspace(NamedTuple):
    """Temporary arrays of a step; lifetimes that run one after the other may share them."""

    drive: Floats
    substeps: Floats
    synapses: Floats
    change: Floats
    mean: Floats


def make_workspace(network: Network) -> Workspace:
    """Workspace for this network."""
    return Workspace(
        drive=np.empty(network.neurons),
        substeps=np.empty((network.substeps, network.neurons)),
        synapses=np.empty((3, network.synapses)),
        change=np.empty(weight_change_workspace(network)),
        mean=np.empty(network.neurons),
    )


Update = Callable[..., float]
Modulate = Callable[[Floats, Floats], float]


def make_modulation(rule: type[Rule], network: Network) -> Modulate:
    """The function `modulate(modulatory, activation)`: the factor on all updates of a step.

    It is the output tanh(m / 2) of a modulatory neuron, m = v . h + v0, h: the neurons of the layer before the wheels.
    With a reward input r, m = v . h + v0 + vr r if the rule has vr. 1 for a rule without a modulatory neuron.
    modulatory: v, v0, vr. activation: (neurons,).
    """
    if modulator_name(rule) is None:
        return one
    hidden, first = network.layers[-2], network.first_neuron[-2]
    rewarded, reward = network.rewarded and receives_reward(rule), network.inputs - 1

    @compiled
    def modulate(modulatory: Floats, activation: Floats) -> float:
        drive = float(modulatory[hidden])
        for k in range(hidden):
            drive += modulatory[k] * activation[first + k]
        if rewarded:
            drive += modulatory[hidden + 1] * activation[reward]
        return tanh(drive / 2.0)

    return modulate


_activation: Any = compiled(lambda _recent, activation, _step, _mean: activation)
_always: Any = compiled(lambda _step, _numbers: True)


def averaging(schedule: Schedule) -> Any:
    """The function `average(recent, activation, step, mean)`: what an update reads, (neurons,).

    recent: (steps, neurons), in which the activations of this step replace the oldest. mean: (neurons,), workspace.
    """
    if not schedule.averages:
        return _activation

    @compiled
    def average(recent: Floats, activation: Floats, step: int, mean: Floats) -> Floats:
        steps, neurons = recent.shape
        for j in range(neurons):
            recent[step % steps, j] = activation[j]
            mean[j] = 0.0
        count = min(steps, step + 1)
        for past in range(step + 1 - count, step + 1):  # from the oldest on
            for j in range(neurons):
                mean[j] += recent[past % steps, j]
        for j in range(neurons):
            mean[j] /= count
        return mean

    return average


def pausing(rule: type[Rule], schedule: Schedule) -> Any:
    """The function `is_due(step, numbers)`: whether a step has an update. numbers: the settings of the rule."""
    if not schedule.pauses:
        return _always
    index = rule.settings().index("every")
    return compiled(lambda step, numbers: (step + 1) % numbers[index] == 0.0)


def make_update(rule: type[Rule], network: Network, schedule: Schedule = EVERY_STEP) -> Update:
    """The function that updates all weights of a network once by a rule, and returns the weight change.

    The function is `learn(weights, synapse_state, genotype, activation, rate, now, numbers, workspace)`: weights
    (synapses,) and synapse_state are updated; genotype, workspace: records that hold what it reads; activation:
    (neurons,); rate: N_e; now: the step; numbers: the settings.
    """
    if rule is NoRule:
        return zero
    rule.check_class()
    names, By = rule.arguments("synapse"), namedtuple_of("By", rule.settings())
    evolved = coefficient_names(rule)
    # Whether all synapses have the same coefficients.
    alike = not {"layer", "synapse", "neuron"} & {parameter.per for parameter in rule.evolved.values()}
    how = {
        "correlation": f"room[{CORRELATION}, k]",
        "pre": f"room[{PRE}, k]",
        "post": f"room[{POST}, k]",
        "weight": "weights[k]",
        "initial_weight": "genotype.weights[k]",
        "fitness": "now.fitness",
        "key": "now.key",
        "step": "now.step",
        "step_s": "now.step_s * by.every" if schedule.pauses else "now.step_s",
        "number": "k",
        "synapse_state": "synapse_state[k]",
        "by": "by",
        **{name: f"alike[{row}]" if alike else f"genotype.coefficients[{row}, k]" for row, name in enumerate(evolved)},
    }
    arguments = "k, weights, synapse_state, genotype, alike, now, room, by"
    call = make_call(rule.synapse, names, how, arguments)
    direction = written(arguments, f"number(call({arguments}))", {"number": number, "call": call})
    # Coefficients that all synapses share are read once.
    read = "".join(f"coefficients[{row}, 0], " for row in range(len(evolved))) if alike and evolved else "0.0,"
    read_alike = written("coefficients", f"({read})", {})
    fill_pre = _filled(network, PRE) if "pre" in names else nothing
    fill_post = _filled(network, POST) if "post" in names else nothing
    fill_correlation = _filled(network, CORRELATION) if "correlation" in names else nothing
    normalises, normalise = schedule.normalise is not Normalise.none, nothing
    if normalises:
        normalise = call_each(_NORMALISE[schedule.normalise], network.connections, "weights, lengths, w_max")
    synapses, total = network.synapses, make_total(network)

    @compiled
    def learn(
        weights: Floats,
        synapse_state: NDArray[np.void],
        genotype: Any,
        activation: Floats,
        rate: float,
        now: StepContext,
        numbers: tuple[float, ...],
        workspace: Any,
    ) -> float:
        genes, signs, room, change = genotype.weights, genotype.signs, workspace.synapses, workspace.change
        by, alike = By(*numbers), read_alike(genotype.coefficients)
        fill_pre(activation, room)
        fill_post(activation, room)
        fill_correlation(activation, room)
        for k in range(synapses):
            towards = direction(k, weights, synapse_state, genotype, alike, now, room, by)
            weights[k] = next_weight(weights[k], rate * signs[k], towards, by.w_max)
            if not normalises:
                change[k] = weight_change(weights[k], genes[k])
        if normalises:
            normalise(weights, genotype.lengths, by.w_max)
            for k in range(synapses):
                change[k] = weight_change(weights[k], genes[k])
        return total(change)

    return learn


def controller_parts(rule: type[Rule], network: Network, schedule: Schedule) -> dict[str, Any]:
    """The parts of a step that act and learn, by their names in a page such as `epuckhebb.tmaze.lifetime`."""
    begin_updates, end_updates = make_tracking(network) if schedule.tracks else NO_TRACKING
    return {
        "SUBSTEPS": network.substeps,
        "HAS_RULE": rule is not NoRule,
        "forward": forward_pass(network),
        "average": averaging(schedule),
        "modulate": make_modulation(rule, network),
        "is_due": pausing(rule, schedule),
        "learn": make_update(rule, network, schedule),
        "begin_updates": begin_updates,
        "end_updates": end_updates,
    }
