"""Shared ABCD: all synapses of a layer have the same evolved rule; the initial weights are evolved with it.

    D = eta (A x_j x_i + B x_j + C x_i + D0) - leak (w - w0)    eta, A, B, C, D0 of each layer; w0: initial weight

Source: Pedersen & Risi, Evolving and merging Hebbian learning rules, GECCO 2021, in which synapses are
merged until many share a rule; here those of a layer do from the start. The leak is added here: one rule for many
synapses easily drives all of them to their bounds.
"""

from dataclasses import dataclass
from typing import ClassVar

from epuckhebb.controller.evolved import Evolved
from epuckhebb.controller.plasticity.four_terms import FourTerms

_EACH = Evolved("layer", start=1.0, limit=2.0)


@dataclass(frozen=True, kw_only=True)
class ABCDShared(FourTerms):
    """Plasticity with five numbers a layer, 25 in the paper's network."""

    evolved: ClassVar = dict.fromkeys(("A", "B", "C", "D", "eta"), _EACH)

    leak: float = 3.0
