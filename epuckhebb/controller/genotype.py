"""What a lifetime starts with: the initial weights, and what synapses and neurons have of the genes."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.readonly import map_arrays
from epuckhebb.controller.genome import NEURON, WEIGHTS, GenomePlan
from epuckhebb.controller.network import Network, starting_weights
from epuckhebb.controller.plasticity.rule import (
    INITIAL_RANGE,
    InitialWeights,
    Rule,
    coefficients,
    modulatory_weights,
    part_values,
)
from epuckhebb.controller.plasticity.update import initial_lengths
from epuckhebb.controller.random import Stream, rng
from epuckhebb.controller.wiring import NO_NEURONS


class Genotype(NamedTuple):
    """What a lifetime starts with and never changes.

    weights: (synapses,), the genes. synapse_state: (synapses,) records, the initial state of each synapse.
    coefficients: (names, synapses) from evolved parameters of the rule. modulatory: weights of its modulatory neuron,
    if any. lengths: (neurons,) of each neuron's incoming weights, if the rule keeps them. signs: (synapses,) of the
    updates.
    """

    weights: Floats
    synapse_state: NDArray[np.void]
    coefficients: Floats
    modulatory: Floats
    lengths: Floats
    signs: Floats


def initial_states(
    genes: Floats,
    plan: GenomePlan,
    network: Network,
    rule: Rule,
    keys: Sequence[int],
    *,
    synapse_state: NDArray[np.void],
    gain_rad_s: float,
    step_s: float,
) -> dict[str, Any]:
    """What lifetimes carry before their first step, by name; arrays have an axis of lifetimes in front.

    It has length 1 where all are alike. The genotype still lacks `synapse_state` and `signs`, which they share. genes:
    (lifetimes, genes). keys: of random initial weights. gain_rad_s, step_s: as a wiring has them.
    """
    kind, wiring, parts = type(rule), network.wiring, plan.split(np.ascontiguousarray(genes, float))
    inherited, neurons = parts[WEIGHTS], map_arrays(NO_NEURONS, lambda array: array[None])
    if rule.initial_weights is InitialWeights.random:
        drawn = [rng(key, Stream.initial_weights) for key in keys]
        inherited = np.array([one.uniform(-INITIAL_RANGE, INITIAL_RANGE, network.synapses) for one in drawn])
    weights = starting_weights(inherited)
    different = range(len(genes) if len(plan.parts) > 1 else 1)
    values = [part_values(kind, network, {name: part[k] for name, part in parts.items()}) for k in different]
    if wiring is not None:
        evolved = [{name: one[NEURON + name] for name in wiring.evolved} for one in values]
        every = [wiring.initial(one, gain_rad_s, step_s) for one in evolved]
        state, parameters = (np.array([getattr(one, name) for one in every]) for name in ("state", "parameters"))
        neurons = every[0]._replace(state=state, parameters=parameters)
    activation = np.zeros((1, network.neurons))
    activation[0, network.bias] = 1.0
    shared: Any = ()
    return {
        "genotype": Genotype(
            weights,
            shared,
            np.array([coefficients(kind, network, one) for one in values]),
            np.array([modulatory_weights(kind, one, rule.reward) for one in values]),
            np.array([initial_lengths(rule, network, one) for one in weights]),
            shared,
        ),
        "weights": weights,
        "synapse_state": synapse_state[None],
        "activation": activation,
        "neurons": neurons,
    }
