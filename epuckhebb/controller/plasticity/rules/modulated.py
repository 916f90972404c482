"""Modulated plasticity: a modulatory neuron decides when to learn, and in which direction.

    m = v . h + v0                                         h: the neurons of the layer before the wheels
    D = tanh(m / 2) eta (A x_j x_i + B x_j + C x_i + D0)   eta, A, B, C, D0: one set for the network

Where the network receives a reward r (`task=reversal`), the modulatory neuron receives it directly: m = v . h + v0 +
vr r. Then learning can wait for the reward. The genes theta start small, and

    v, v0 = 0.2 theta    vr = 4 (1 + theta)    N eta = 10^(-2 + clip(theta, -1.5, 1))    (N = 0.003)

In a first trial without this direct path, nothing was learnt.

Source: Soltoggio, Bullinaria, Mattiussi, Durr & Floreano, Evolutionary advantages of neuromodulated plasticity in
dynamic, reward-based scenarios, ALIFE XI, 2008. There evolution places modulatory neurons; in this network of fixed
shape there is one, which reaches all synapses. Their control has no modulation (tanh(..) = 1); here `abcd_shared` is
such a control, with one rule for each layer.
"""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from epuckhebb.controller.evolved import Evolved
from epuckhebb.controller.plasticity.four_terms import FourTerms
from epuckhebb.controller.plasticity.rule import MODULATOR, REWARD

_ONE = Evolved("network", start=0.5, limit=2.0)


@dataclass(frozen=True, kw_only=True)
class Modulated(FourTerms):
    """Plasticity scaled by a modulatory neuron, ten numbers in the paper's network, eleven with a reward."""

    evolved: ClassVar = {
        "v": Evolved(MODULATOR, start=0.5, limit=2.0),
        **dict.fromkeys(("A", "B", "C", "D", "eta"), _ONE),
    }
    with_reward: ClassVar = {
        "v": Evolved(MODULATOR, start=0.5, limit=2.0, value=lambda theta: 0.2 * theta),
        "eta": _ONE._replace(value=lambda theta: 10.0 ** np.clip(theta, -1.5, 1.0) / 0.3),
        "vr": Evolved(REWARD, start=0.5, limit=2.0, value=lambda theta: 4.0 * (1.0 + theta)),
    }

    @staticmethod
    def synapse(  # type: ignore[override]  # arguments go by name
        pre: float, post: float, A: float, B: float, C: float, D: float
    ) -> float:
        """D = A x_j x_i + B x_j + C x_i + D0, multiplied later by the modulatory neuron's output."""
        return (A * post + B) * pre + C * post + D
