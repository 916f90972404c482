"""Modulated plasticity: a neuron of the network's own says when to learn, and whether to learn or to unlearn.

    m = v . h + v0                                         h: the neurons of the layer before the wheels
    D = tanh(m / 2) eta (A x_j x_i + B x_j + C x_i + D0)   eta, A, B, C, D0: one set for the network

Where the network is told a reward r (`task=reversal`), the modulatory neuron hears it directly, m = v . h + v0 + vr r,
so that learning can wait for it. With theta for genes, which begin small,

    v, v0 = 0.2 theta    vr = 4 (1 + theta)    N eta = 10^(-2 + clip(theta, -1.5, 1))    (N = 0.003)

Without that path, a trial showed, nothing was learnt in the time that there is.

Source: Soltoggio, Bullinaria, Mattiussi, Durr & Floreano, Evolutionary advantages of neuromodulated plasticity in
dynamic, reward-based scenarios, ALIFE XI, 2008. There evolution adds modulatory neurons where it
likes; in a network of fixed shape there is one, and it reaches all synapses. Without modulation (tanh(..) = 1) theirs
is the control; here that is `abcd_shared` with one rule for each layer.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim.plasticity.rule import MODULATOR, REWARD, Evolved, Rule

_ONE = Evolved("network", start=0.5, limit=2.0)


def _mild(genes: NDArray[np.float64]) -> NDArray[np.float64]:
    return 0.2 * genes


def _strong(genes: NDArray[np.float64]) -> NDArray[np.float64]:
    return 4.0 * (1.0 + genes)


def _by_powers(genes: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(10.0 ** np.clip(genes, -1.5, 1.0) / 0.3)


@dataclass(frozen=True, kw_only=True)
class Modulated(Rule):
    """Plasticity at the bidding of a modulatory neuron, ten numbers in the paper's network, eleven with a reward.

    No live fitness scales the rate (`floor` is 1, the greatest that it can be): the modulatory neuron does. N holds at
    the gain of training.
    """

    evolved: ClassVar = {
        "v": Evolved(MODULATOR, start=0.5, limit=2.0),
        **dict.fromkeys(("A", "B", "C", "D", "eta"), _ONE),
    }
    with_reward: ClassVar = {
        "v": Evolved(MODULATOR, start=0.5, limit=2.0, value=_mild),
        "eta": _ONE._replace(value=_by_powers),
        "vr": Evolved(REWARD, start=0.5, limit=2.0, value=_strong),
    }
    coefficients: ClassVar = ("A", "B", "C", "D")

    N_gain_rad_s: float = 4.0
    floor: float = 1.0

    @classmethod
    def express(cls, parameters: Mapping[str, NDArray[np.float64]]) -> Mapping[str, NDArray[np.float64]]:
        """Eta in A, B, C and D."""
        return {name: parameters["eta"] * parameters[name] for name in cls.coefficients}

    @staticmethod
    def synapse(pre: float, post: float, A: float, B: float, C: float, D: float) -> float:
        """D = A x_j x_i + B x_j + C x_i + D0, which the modulatory neuron's output multiplies."""
        return (A * post + B) * pre + C * post + D
