"""A controller, as tables name it: a plasticity rule, and an adaptation that decides when it acts."""

from dataclasses import dataclass, field

from epuckhebb.adaptation.adaptation import Adaptation
from epuckhebb.controller.plasticity.control import Sign
from epuckhebb.controller.plasticity.rule import NO_RULE, NoRule, Rule

# Classes of knowledge, from less to more that is given; the last one is a robot without a network. No method has a
# sensor model any more; tables that were made before name it.
CLASSES = ("senses", "live fitness", "clock", "goal signal", "sensor model", "hand-written robot")
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

    @property
    def knowledge(self) -> tuple[str, ...]:
        """What it uses: its senses, what it is given, and what was written by hand."""
        synapse = self.rule.synapse.__code__
        takes_fitness = "fitness" in synapse.co_varnames[: synapse.co_argcount]
        learns_by_fitness = not isinstance(self.rule, NoRule) and (self.rule.floor < 1 or takes_fitness)
        return ("senses", *(["live fitness"] if learns_by_fitness else []), *self.adaptation.knowledge)

    @property
    def knowledge_class(self) -> str:
        """The one of `CLASSES` by which it is compared."""
        if self.adaptation.is_network_unused:
            return CLASSES[-1]
        return max((kind for kind in self.knowledge if kind in CLASSES), key=CLASSES.index)


GA_ALONE = Controller()
