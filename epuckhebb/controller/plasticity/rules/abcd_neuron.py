"""Neuron-centric ABCD: a synapse's rule follows from evolved parameters of the two neurons that it joins.

    D = (eta_j + eta_i) / 2 (C_j C_i x_j x_i + A_j x_j + B_i x_i + D_j D_i)

Source: Ferigo, Cunegatti & Iacca, Neuron-centric Hebbian learning, GECCO 2024, equation 3. As there, every neuron has
numbers, sensors and bias too. The initial weights are evolved with them.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.evolved import Evolved
from epuckhebb.controller.plasticity.four_terms import FourTerms

_EACH = Evolved("neuron", start=1.0, limit=2.0)


@dataclass(frozen=True, kw_only=True)
class ABCDNeuron(FourTerms):
    """Plasticity with five numbers a neuron, 215 in the paper's network."""

    evolved: ClassVar = dict.fromkeys(("A", "B", "C", "D", "eta"), _EACH)

    @classmethod
    def express(cls, parameters: Mapping[str, Floats]) -> Mapping[str, Floats]:
        """The coefficients of each synapse, from the numbers of its neurons."""
        p = parameters
        eta = (p["eta_pre"] + p["eta_post"]) / 2.0
        return {
            "A": eta * p["C_pre"] * p["C_post"],
            "B": eta * p["A_pre"],
            "C": eta * p["B_post"],
            "D": eta * p["D_pre"] * p["D_post"],
        }
