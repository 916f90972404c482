"""A rule of which a part is evolved: how fast each layer learns, and how much it forgets."""

from dataclasses import dataclass
from typing import ClassVar

from epuckhebb import Rule
from epuckhebb.sim.plasticity.rule import Evolved


@dataclass(frozen=True, kw_only=True)
class Layered(Rule):
    """Hebb's rule with a leak. grow, leak: of each layer of synapses, evolved together with the weights."""

    evolved: ClassVar = {"grow": Evolved(per="layer"), "leak": Evolved(per="layer")}

    @staticmethod
    def synapse(correlation, weight, grow, leak):
        """The direction of the weight's change."""
        return grow * correlation - abs(leak) * weight
