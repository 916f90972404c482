"""What a lifetime starts with: the initial weights, and what synapses and neurons have of the genes."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.readonly import readonly
from epuckhebb.controller.genome import NEURON, WEIGHTS, GenomePlan
from epuckhebb.controller.network import Network, initial_weights_of
from epuckhebb.controller.plasticity.rule import (
    INITIAL_RANGE,
    InitialWeights,
    Rule,
    coefficients,
    modulatory_weights,
    values_of,
)
from epuckhebb.controller.plasticity.update import initial_lengths
from epuckhebb.controller.random import Stream, rng
from epuckhebb.controller.wiring import NO_NEURONS, Neurons


class Genotype(NamedTuple):
    """What a lifetime starts with and never changes.

    weights: (synapses,), the genes. synapse_state: (synapses,) records, the initial state of each synapse.
    coefficients: (names, synapses) from evolved parameters of the rule. modulatory: weights of its modulatory neuron,
    if any. lengths: (neurons,) of each neuron's incoming weights, if the rule keeps them. signs: (synapses,) of the
    updates. neurons: of a wiring.
    """

    weights: Floats
    synapse_state: NDArray[np.void]
    coefficients: Floats
    modulatory: Floats
    lengths: Floats
    signs: Floats
    neurons: Neurons = NO_NEURONS


def initial_state(
    genes: Floats,
    plan: GenomePlan,
    network: Network,
    rule: Rule,
    key: int,
    *,
    signs: Floats,
    synapse_state: NDArray[np.void],
    gain_rad_s: float,
    step_s: float,
) -> dict[str, Any]:
    """What a lifetime carries before its first step, by name.

    key: of random initial weights. synapse_state: as in `Genotype`. gain_rad_s, step_s: as a wiring has them.
    """
    parts, wiring = values_of(type(rule), network, plan.split(np.ascontiguousarray(genes, float))), network.wiring
    inherited, neurons = parts[WEIGHTS], NO_NEURONS
    if rule.initial_weights is InitialWeights.random:
        inherited = rng(key, Stream.initial_weights).uniform(-INITIAL_RANGE, INITIAL_RANGE, network.synapses)
    weights = initial_weights_of(inherited)
    if wiring is not None:
        neurons = wiring.initial({name: parts[NEURON + name] for name in wiring.evolved}, gain_rad_s, step_s)
    activation = np.zeros(network.neurons)
    activation[network.bias] = 1.0
    return {
        "genotype": readonly(
            Genotype(
                weights,
                synapse_state,
                coefficients(type(rule), network, parts),
                modulatory_weights(type(rule), parts, rule.reward),
                initial_lengths(rule, network, weights),
                np.ascontiguousarray(signs, float),
                neurons,
            )
        ),
        "weights": weights.copy(),
        "synapse_state": synapse_state.copy(),
        "activation": activation,
        "recent": np.zeros((rule.average, network.neurons)),
        "neurons": neurons._replace(state=neurons.state.copy()),
    }
