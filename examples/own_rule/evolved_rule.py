"""A rule with evolved parameters: the learning rate and the leak of each layer."""

from dataclasses import dataclass
from typing import ClassVar

from epuckhebb import Rule
from epuckhebb.controller.evolved import Evolved


@dataclass(frozen=True, kw_only=True)
class Layered(Rule):
    """Hebb's rule with a leak. grow, leak: one of each for a layer of synapses, evolved with the weights."""

    evolved: ClassVar = {"grow": Evolved(per="layer"), "leak": Evolved(per="layer")}

    @staticmethod
    def synapse(correlation, weight, grow, leak):
        """The direction of the weight's change."""
        return grow * correlation - abs(leak) * weight
