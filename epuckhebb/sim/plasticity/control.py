"""Controls of plasticity: updates as large as a rule's, in other directions. What they do, the rule did not do."""

from enum import Enum

import numpy as np
from numpy.typing import NDArray


class Sign(Enum):
    """The sign S of the updates: the rule's, and two controls that change the weights as much but not as it says."""

    hebbian = "hebbian"
    anti = "anti"  # what fires together parts
    shuffled = "shuffled"  # a fixed random sign for each synapse


def signs(sign: Sign, synapses: int, rng: np.random.Generator | None = None) -> NDArray[np.float64]:
    """S for each synapse, (synapses,) of 1 and -1; shuffled signs need a generator.

    Raises:
        ValueError: they have none.
    """
    if sign is Sign.shuffled:
        if rng is None:
            raise ValueError("shuffled signs need a random generator")
        return rng.choice([-1.0, 1.0], synapses)
    return np.full(synapses, -1.0 if sign is Sign.anti else 1.0)
