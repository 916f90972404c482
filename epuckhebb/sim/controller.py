"""A controller, as a column of a table names it: a plasticity rule, and the adaptation that is laid over it."""

from dataclasses import dataclass, field

from epuckhebb.sim.adaptation.adaptation import Adaptation
from epuckhebb.sim.plasticity.control import Sign
from epuckhebb.sim.plasticity.rule import NO_RULE, NoRule, Rule

GA, HEBBIAN = "GA", "Hebbian"  # in the paper's words
CONTROLS = {Sign.hebbian: HEBBIAN, Sign.anti: "anti-Hebbian", Sign.shuffled: "shuffled signs"}


@dataclass(frozen=True, kw_only=True)
class Controller:
    """What is done to a genome in its life.

    name: in tables. rule: how its weights change. adaptation: when they do, and what else happens then.
    """

    name: str = GA
    rule: Rule = NO_RULE
    adaptation: Adaptation = field(default_factory=Adaptation)

    @property
    def is_ga_alone(self) -> bool:
        """Whether it does nothing at all: the control that every other is paired with."""
        return isinstance(self.rule, NoRule) and not self.adaptation.acts


GA_ALONE = Controller()
