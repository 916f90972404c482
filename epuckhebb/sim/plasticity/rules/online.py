"""Evolution in life: a (1+1) evolution strategy tries other weights for a while, and keeps those that do better.

    W_child = W_parent + sigma n          n ~ N(0, 1) for each synapse, new for each window of time
    W_parent' = W_child if F_child > F_parent, else W_parent      F: mean live fitness of a window
    D = W_child - W

The first window is the parent's own. D with a rate of 1 is a jump; below 1 the weights approach the child's.

Source: what GPIS does with rules (Chiang 2010), done with weights, as in Bredeche, Haasdijk & Eiben, On-line, on-board
evolution of robot controllers, 2009. Theirs also tries the parent again from time to time and changes sigma; here both
are left out. Laid over a champion with `adaptation=late`, it acts while the robot no longer copes; what was found is
forgotten with all that was learnt.
"""

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from epuckhebb.sim.plasticity.rule import Rule
from epuckhebb.sim.random import normal
from epuckhebb.sim.robot import STEP_S

_FAR = 2**52  # its numbers are drawn where no other noise of a lifetime is
_MOST = 2**17  # synapses, of which each has a number of its own at each step


@dataclass(frozen=True, kw_only=True)
class Online(Rule):
    """Trial and error with weights. window_s: how long each is tried [s]. sigma: standard deviation of a trial."""

    kept: ClassVar = {"parent": 0.0, "child": 0.0, "best": -1.0, "summed": 0.0, "steps": 0.0, "windows": 0.0}

    N: float = 1.0
    floor: float = 1.0
    window_s: float = 8.0
    sigma: float = 0.3

    def __post_init__(self) -> None:
        """Refuse trials that cannot be."""
        super().__post_init__()
        if self.window_s < STEP_S:
            raise ValueError(f"hebbian.window_s must be at least one step, {STEP_S} s, got {self.window_s}")
        if self.sigma <= 0:
            raise ValueError(f"hebbian.sigma must be more than 0, got {self.sigma}")

    @staticmethod
    def synapse(weight: float, fitness: float, key: np.uint64, step: int, number: int, kept: Any, by: Any) -> float:
        """D = W_child - W; at the end of a window another child."""
        if kept.windows == 0.0 and kept.steps == 0.0:
            kept.parent = weight
            kept.child = weight
        kept.summed += fitness
        kept.steps += 1.0
        if kept.steps >= math.floor(by.window_s / STEP_S + 1e-9):
            mean = kept.summed / kept.steps
            if mean > kept.best:
                kept.parent = kept.child
                kept.best = mean
            kept.child = kept.parent + by.sigma * normal(key, _FAR + step * _MOST + number)
            kept.summed = 0.0
            kept.steps = 0.0
            kept.windows += 1.0
        return float(kept.child - weight)
