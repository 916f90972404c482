"""ABCD: every synapse has an evolved rule of its own, and initial weights are random.

    D = eta (A x_j x_i + B x_j + C x_i + D0)    eta, A, B, C, D0 of each synapse

Source: Najarro & Risi, Meta-learning through Hebbian plasticity in random networks, NeurIPS 2020, equation 1. As there,
initial weights are uniform in +-0.1, drawn anew for each lifetime, or evolved (`initial_weights`). Their coefficients
start as N(0, 1) without bounds; here they start uniform in +-1 and stay within +-2, as all genes do. In some tasks they
divide the weights of a layer by the largest after each update; here all are clipped, as in the paper, and divided with
`normalise=largest`.
"""

from dataclasses import dataclass
from typing import ClassVar

from epuckhebb.controller.evolved import Evolved
from epuckhebb.controller.plasticity.four_terms import FourTerms
from epuckhebb.controller.plasticity.rule import InitialWeights

_EACH = Evolved("synapse", start=1.0, limit=2.0)


@dataclass(frozen=True, kw_only=True)
class ABCD(FourTerms):
    """Plasticity with five numbers a synapse, 1170 in the paper's network."""

    evolved: ClassVar = dict.fromkeys(("A", "B", "C", "D", "eta"), _EACH)

    initial_weights: InitialWeights = InitialWeights.random
