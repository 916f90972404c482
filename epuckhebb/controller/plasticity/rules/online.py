"""Online evolution: a (1+1) evolution strategy tries other weights for a while, and keeps those that do better.

    W_child = W_parent + sigma n          n ~ N(0, 1) for each synapse, new for each window of time
    W_parent' = W_child if F_child > F_parent, else W_parent      F: mean live fitness of a window
    D = W_child - W

The first window tests the parent. At a rate of 1 the weights jump to the child's; below 1 they approach them.

Source: Bredeche, Haasdijk & Eiben, On-line, on-board evolution of robot controllers, 2009; and Chiang 2010 (GPIS), who
does it with rules. Bredeche et al. also test the parent again from time to time and change sigma; here both are left
out. With `adaptation=late` it acts while the robot is late; when the gate closes, the weights are reset to the genes.
"""

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from epuckhebb.controller.plasticity.rule import Rule
from epuckhebb.controller.random import normal
from epuckhebb.controller.ranges import within

_FAR = 2**52  # its random numbers lie where no other noise of a lifetime is
_MOST = 2**17  # synapses; each has a random number of its own at each step


@dataclass(frozen=True, kw_only=True)
class Online(Rule):
    """Trial and error with weights. window_s: how long each is tried [s]. sigma: standard deviation of a trial."""

    synapse_state: ClassVar = {"parent": 0.0, "child": 0.0, "best": -1.0, "summed": 0.0, "steps": 0.0, "windows": 0.0}

    N: float = 1.0
    floor: float = 1.0
    window_s: float = within(0, above=True, default=8.0)
    sigma: float = within(0, above=True, default=0.3)

    @staticmethod
    def synapse(
        weight: float,
        fitness: float,
        key: np.uint64,
        step: int,
        step_s: float,
        number: int,
        synapse_state: Any,
        by: Any,
    ) -> float:
        """D = W_child - W; at the end of a window a new child."""
        if synapse_state.windows == 0.0 and synapse_state.steps == 0.0:
            synapse_state.parent = weight
            synapse_state.child = weight
        synapse_state.summed += fitness
        synapse_state.steps += 1.0
        if synapse_state.steps >= math.floor(by.window_s / step_s + 1e-9):
            mean = synapse_state.summed / synapse_state.steps
            if mean > synapse_state.best:
                synapse_state.parent = synapse_state.child
                synapse_state.best = mean
            synapse_state.child = synapse_state.parent + by.sigma * normal(key, _FAR + step * _MOST + number)
            synapse_state.summed = 0.0
            synapse_state.steps = 0.0
            synapse_state.windows += 1.0
        return float(synapse_state.child - weight)
