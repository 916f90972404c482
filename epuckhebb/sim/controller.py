"""A controller, as tables name it: a plasticity rule, and an adaptation that decides when it acts."""

from dataclasses import dataclass, field

from epuckhebb.sim.adaptation.adaptation import Adaptation
from epuckhebb.sim.plasticity.control import Sign
from epuckhebb.sim.plasticity.rule import NO_RULE, NoRule, Rule

GA, HEBBIAN = "GA", "Hebbian"  # in the paper's words
CONTROLS = {Sign.hebbian: HEBBIAN, Sign.anti: "anti-Hebbian", Sign.shuffled: "shuffled signs"}


@dataclass(frozen=True, kw_only=True)
class Controller:
    """What controls a robot besides its genes.

    name: in tables. rule: how the weights change. adaptation: when they do, and what else happens then.
    """

    name: str = GA
    rule: Rule = NO_RULE
    adaptation: Adaptation = field(default_factory=Adaptation)

    @property
    def is_ga_alone(self) -> bool:
        """Whether it is the control: the network alone, without plasticity or adaptation."""
        return isinstance(self.rule, NoRule) and not self.adaptation.acts


GA_ALONE = Controller()
