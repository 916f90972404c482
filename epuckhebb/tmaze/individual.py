"""Who runs a lifetime: genes and their network, and a controller, which is a plasticity rule and an adaptation."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import compiled, nothing, one
from epuckhebb.controller.network import PAPER_NETWORK, Network
from epuckhebb.controller.plasticity.control import Control, Sign, Yoking
from epuckhebb.controller.plasticity.rule import NO_RULE, Acts, NoRule, Reward, Rule, receives_reward
from epuckhebb.controller.wiring import Wiring
from epuckhebb.tmaze.fitness import Signal, signal_number
from epuckhebb.tmaze.maze import Pose, Side
from epuckhebb.tmaze.robot import Robot

if TYPE_CHECKING:
    from epuckhebb.tmaze.scenario import Scenario

# Classes of knowledge, from less to more that is given; the last one is a robot without a network.
CLASSES = ("senses", "live fitness", "clock", "goal signal", "hand-written robot")
GA, HEBBIAN = "GA", "Hebbian"  # in the paper's words
CONTROLS = {Sign.hebbian: HEBBIAN, Sign.anti: "anti-Hebbian", Sign.shuffled: "shuffled signs"}
YOKED = {Control.yoked_sign: "yoked, signs", Control.yoked_place: "yoked, places"}


class Hooks(NamedTuple):
    """The functions of an adaptation that a lifetime calls.

    scale(life, setup, step): scales the light readings. open_gate(life, setup, fitness, step): the need g for
    plasticity at this step. explore(life, setup, left, right): the wheels' commands, from the network's outputs.
    resets: whether the weights become the genes where the gate closes.
    """

    scale: Callable[..., None]
    open_gate: Callable[..., float]
    explore: Callable[..., tuple[float, float]]
    resets: bool


_as_it_is = compiled(lambda _life, _setup, left, right: (left, right))
NO_HOOKS = Hooks(scale=nothing, open_gate=one, explore=_as_it_is, resets=False)


@dataclass(kw_only=True)
class NoAdaptation:
    """What a lifetime asks of an adaptation; this one does nothing. `epuckhebb.adaptation` has the others.

    name: in tables. acts: whether it does anything. is_gated: whether a signal of change opens and closes a gate.
    homeostasis: whether it scales the weights from the light sensors. is_network_unused: whether hand-written code
    alone drives.
    """

    name: str = "none"
    acts = is_gated = homeostasis = is_network_unused = False

    @property
    def knowledge(self) -> tuple[str, ...]:
        """What it is given or what was written by hand, beside its senses."""
        return ()

    @property
    def parts(self) -> tuple[Any, ...]:
        """What its functions are made from, besides the robot and the network."""
        return ()

    def check(self, rule: Rule, duration_s: float, wiring: Wiring | None) -> None:
        """Check that it goes with a rule, a lifetime's length and a network; else a ValueError."""

    def hooks(self, robot: Robot, post: int) -> Hooks:  # noqa: ARG002  # others need it
        """The functions that a lifetime calls. post: how many neurons the first layer of connections leads to."""
        return NO_HOOKS

    def numbers(self) -> Any:
        """The settings that these functions need, as numbers."""
        return ()

    def initial_state(self, robot: Robot) -> Any:  # noqa: ARG002  # others need it
        """What these functions store from step to step, before the first one."""
        return ()

    def no_nominal(self, robot: Robot) -> Any:  # noqa: ARG002  # others need it
        """Nominal statistics for an individual that has none."""
        return ()


@dataclass(frozen=True, kw_only=True)
class Controller:
    """What controls a robot besides its genes, as tables name it.

    name: in tables. rule: how the weights change. adaptation: when they do, and what else happens then.
    """

    name: str = GA
    rule: Rule = NO_RULE
    adaptation: NoAdaptation = field(default_factory=NoAdaptation)

    @property
    def is_ga_alone(self) -> bool:
        """Whether it is the control: the network alone, without plasticity or adaptation."""
        return isinstance(self.rule, NoRule) and not self.adaptation.acts

    @cached_property
    def without_control(self) -> "Controller":
        """The controller whose changes of the weights a yoked control takes; the same one each time."""
        return replace(self, rule=replace(self.rule, control=Control.none))

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

    def check(self, world: "Scenario", duration_s: float, wiring: Wiring | None) -> None:
        """Check that it goes with a world, a lifetime's length and a network; else a ValueError."""
        rule, robot, task = self.rule, world.robot, world.task
        signal_number(rule)
        if rule.signal == Signal.light_code and (robot.light.count, robot.distance.count) != (8, 8):
            raise ValueError(f"hebbian.signal=light_code needs eight sensors of each kind, unlike {robot.name}")
        if rule.signal == Signal.fitness and world.fitness.step is None:
            raise ValueError(f"hebbian.signal=fitness needs a fitness with a method `step`, got {world.fitness.name}")
        if task.has_trials and self.adaptation.acts:
            raise ValueError(f"adaptation={self.adaptation.name} needs one goal a lifetime, got task={task.name}")
        if rule.reward is not Reward.given and not (task.gives_reward and receives_reward(type(rule))):
            raise ValueError(f"hebbian.reward={rule.reward.name} does nothing with {rule.name} and task={task.name}")
        if rule.acts is Acts.before_change and not task.has_trials:
            raise ValueError(
                f"hebbian.acts=before_change needs a task of many trials, as task=reversal, got {task.name}"
            )
        rule.check_wiring(wiring)
        if rule.sign_draw and rule.sign is not Sign.shuffled and rule.control is Control.none:
            draws = f"hebbian.sign={Sign.shuffled.name}, or for a yoked hebbian.control"
            raise ValueError(f"hebbian.sign_draw={rule.sign_draw} is for {draws}; controller {self.name} has neither")
        self.adaptation.check(rule, duration_s, wiring)


GA_ALONE = Controller()


def has_control(controllers: Iterable[Controller]) -> bool:
    """Whether one of them is a control of plasticity: then the total change of the weights is measured for all."""
    rules = [controller.rule for controller in controllers]
    return any(rule.sign is not Sign.hebbian or rule.control is not Control.none for rule in rules)


@dataclass(frozen=True, kw_only=True)
class Individual:
    """What one lifetime needs besides its world: genes and their network, a side, a controller, a noise key, a start.

    genes: of all parts of the genome (`controller.genome`), 234 in the paper. key: of all noise. task_key: of the
    task's random numbers; individuals that are compared have the same, and so have both sides. start: None for the
    maze's. signs: of the plastic updates, (synapses,), None for the rule's sign; shuffled ones must be given. nominal:
    what an adaptation compares with. record: whether samples are recorded. previous: whose lifetime comes first, where
    the live fitness carries its history. yoking: of a yoked control, which changes of its master it takes.
    """

    genes: Floats
    side: Side
    key: np.uint64
    controller: Controller = GA_ALONE
    network: Network = PAPER_NETWORK
    start: Pose | None = None
    task_key: int = 0
    signs: Floats | None = None
    nominal: Any = None
    record: bool = False
    previous: "Individual | None" = None
    yoking: Yoking | None = None

    @property
    def master(self) -> "Individual | None":
        """Whose changes of the weights it takes, if it is a yoked control: the same, with the rule itself."""
        if self.controller.rule.control is Control.none:
            return None
        previous = self.previous and self.previous.master
        return replace(self, controller=self.controller.without_control, previous=previous, record=False)
