"""Controls of plasticity: updates as large as a rule's, in other directions. An effect they share is not the rule's."""

from enum import Enum

import numpy as np

from epuckhebb.controller.arrays import Floats


class Sign(Enum):
    """The sign S of the updates: the rule's, or one of two controls."""

    hebbian = "hebbian"
    anti = "anti"  # what fires together comes apart
    shuffled = "shuffled"  # a fixed random sign for each synapse


def signs(sign: Sign, synapses: int, rng: np.random.Generator | None = None) -> Floats:
    """S for each synapse, (synapses,) of 1 and -1; shuffled signs need a generator."""
    if sign is Sign.shuffled:
        assert rng is not None
        return rng.choice([-1.0, 1.0], synapses)
    return np.full(synapses, -1.0 if sign is Sign.anti else 1.0)
