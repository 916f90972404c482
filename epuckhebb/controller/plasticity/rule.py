"""A plasticity rule: its settings, the state of each synapse, its evolved parameters, and its update."""

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, ClassVar, NamedTuple

import numpy as np

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.readonly import readonly
from epuckhebb.controller.evolved import Evolved
from epuckhebb.controller.network import Network
from epuckhebb.controller.own_class import OwnClass, class_name
from epuckhebb.controller.plasticity.control import DRAWS, Control, Sign
from epuckhebb.controller.ranges import within
from epuckhebb.controller.wiring import Wiring

QUANTITIES = (  # the arguments that `synapse` may have beside the parameters that are evolved
    *("correlation", "pre", "post", "weight", "initial_weight", "fitness", "key", "step", "step_s", "number"),
    *("synapse_state", "by"),
)
TAKEN = (*QUANTITIES, "weights")  # names that no evolved parameter may have; `weights` are those of the network
MODULATOR, REWARD = "modulator", "reward"
INITIAL_RANGE = 0.1  # of random initial weights, as in Najarro & Risi 2020
_LARGEST_WEIGHT = 1e6  # a neuron is saturated from a drive of 20 on
_MOST_STEPS = 10_000  # to average over; 5 min in the maze


class InitialWeights(Enum):
    """Where the initial weights come from: evolved, or random, drawn anew for each lifetime within +-0.1."""

    evolved = "evolved"
    random = "random"


class Normalise(Enum):
    """What is done to the weights after each update, beside clipping them to `w_max`."""

    none = "none"
    largest = "largest"  # each layer of connections is divided by its largest absolute weight, if that is above 0
    length = "length"  # the incoming weights of each neuron get their initial length, the root of their squares' sum


class Acts(Enum):
    """When a rule acts, where a lifetime is many trials: in all, or, as a control, before the rewarded end changes."""

    always = "always"
    before_change = "before_change"


class Schedule(NamedTuple):
    """What of a rule's settings, besides its class, decides how its kernel is compiled.

    normalise: as in `Rule`. averages, pauses: whether `average` and `every` are more than 1. tracks: whether lifetimes
    have a `control.Track`. freezes: whether it does not act in all trials.
    """

    normalise: Normalise = Normalise.none
    averages: bool = False
    pauses: bool = False
    tracks: bool = False
    freezes: bool = False


EVERY_STEP = Schedule()


class Reward(Enum):
    """How the modulatory neuron receives a reward: as given, or, as a control, inverted."""

    given = "given"
    inverted = "inverted"


@dataclass(frozen=True, kw_only=True)
class Rule(OwnClass):
    """A plasticity rule; subclasses add settings as fields, and define what a synapse does.

    N: base rate, 0 for a robot that does not learn. N_gain_rad_s: wheel gain at which N holds; at another gain N is
    proportional to it, so that a robot learns as much on each metre; 0 if N holds at any gain, as in the paper. floor:
    the least factor on N, when fitness is low. w_max: bound of the weights. signal: the name of the live fitness that
    scales the rate, a number that the rule is given at each step. history_s, history_mean: of a live fitness that is a
    running mean, the time and the mean that it starts from; carries_history: whether a lifetime starts from where the
    one before ended. sign: of the updates, `hebbian` or a control. control: `none`, or a yoked control, whose weights
    change as those of the rule did in a lifetime before. sign_draw: which of five draws of random signs, or places, a
    control has. initial_weights: `evolved` or `random`. reward: how a modulatory neuron receives a reward, as `given`
    or, as a control, `inverted`. normalise: what is done to the weights after an update. average: the activations that
    an update reads, the modulatory neuron's inputs too, are means over so many steps, over fewer at the start of a
    lifetime. every: one step in so many has an update, the last of them. acts: `always`, or, as a control,
    `before_change`: the weights are frozen from the trial on with which the rewarded end first changes.

    A subclass has a static method `synapse`, compiled by numba, which returns the direction of a weight's change. The
    program multiplies it by N_e, adds it to the weight and clips that to +-w_max. The arguments of `synapse` are any of
    these names, in any order:

        pre, post        activations x_j and x_i of the two neurons that the synapse joins
        correlation      their product
        weight           the present weight
        initial_weight   the weight at the start of the lifetime
        fitness          the live fitness, the same for all synapses
        key, step        of the lifetime's noise, and of this step; with `number`, the place of a random number
        step_s           the time from one update to the next, s
        number           of this synapse, from 0
        synapse_state    the numbers named in the class attribute `synapse_state`, to be read and set
        by               the rule's settings
        (a name in `evolved`: that parameter; if it is evolved per neuron, A_pre and A_post for A)

    synapse_state: name -> initial value, of what each synapse stores during a lifetime. evolved: name -> `Evolved`. A
    rule with a parameter per `modulator` has a modulatory neuron, whose output multiplies all updates. with_reward:
    parameters that replace or join those in `evolved` where the network has a reward input. coefficients: the names
    that `express` returns, for `synapse` instead of those in `evolved`.
    """

    PART: ClassVar[str] = "rule"
    KEY: ClassVar[str] = "hebbian.rule"
    METHODS: ClassVar[tuple[str, ...]] = ("synapse",)
    synapse_state: ClassVar[Mapping[str, float]] = {}
    evolved: ClassVar[Mapping[str, Evolved]] = {}
    with_reward: ClassVar[Mapping[str, Evolved]] = {}
    coefficients: ClassVar[tuple[str, ...]] = ()
    synapse: ClassVar[Any] = None

    N: float = within(0, usual=1, default=0.0)
    N_gain_rad_s: float = within(0, default=0.0)
    floor: float = within(0, default=0.2)
    w_max: float = within(0, _LARGEST_WEIGHT, above=True, default=2.0)
    signal: str = "behaviour"
    history_s: float = within(0, default=500.0)
    history_mean: float = within(0, 1, default=0.5)
    carries_history: bool = False
    sign: Sign = Sign.hebbian
    control: Control = Control.none
    sign_draw: int = within(0, DRAWS - 1, default=0)
    initial_weights: InitialWeights = InitialWeights.evolved
    reward: Reward = Reward.given
    normalise: Normalise = Normalise.none
    average: int = within(1, _MOST_STEPS, default=1)
    every: int = within(1, default=1)
    acts: Acts = Acts.always

    def check_wiring(self, wiring: Wiring | None) -> None:
        """Refuse what works layer by layer for a wiring without layers; a ValueError."""
        needs = {"normalise": self.normalise is not Normalise.none, "control": self.control is Control.yoked_place}
        if wiring is not None and any(needs.values()):
            key = next(key for key, has in needs.items() if has)
            value = getattr(self, key).name
            raise ValueError(f"hebbian.{key}={value} needs layers, got network.wiring={wiring.name}")

    @classmethod
    def express(cls, parameters: Mapping[str, Floats]) -> Mapping[str, Floats]:
        """The coefficients for `synapse`, by name, (synapses,) each: made once from the evolved parameters.

        parameters: by name, (synapses,) each; (numbers, synapses) for a parameter of several numbers.
        """
        return parameters

    @classmethod
    def allowed_arguments(cls, method: str) -> Collection[str]:  # noqa: ARG003  # it has one
        """The names of the arguments that a method may have; none where they are fixed."""
        return [*QUANTITIES, *coefficient_names(cls)]


class NoRule(Rule):
    """No plasticity: the weights stay as they are."""

    @staticmethod
    def synapse() -> float:
        """D = 0."""
        return 0.0


NO_RULE = NoRule()


def make_schedule(rule: Rule) -> Schedule:
    """What decides, besides the class of a rule, how its kernel is compiled."""
    return Schedule(rule.normalise, rule.average > 1, rule.every > 1, freezes=rule.acts is Acts.before_change)


def weight_bound(rule: Rule) -> float:
    """The largest absolute value that a weight can have after an update; infinite where there is none."""
    if isinstance(rule, NoRule):
        return math.inf
    return 1.0 if rule.normalise is Normalise.largest else rule.w_max


def coefficient_names(rule: type[Rule]) -> tuple[str, ...]:
    """The arguments of `synapse` that are evolved parameters, or made from them."""
    if rule.coefficients:
        return rule.coefficients
    names: list[str] = []
    for name, evolved in rule.evolved.items():
        if evolved.per == "neuron":
            names += [f"{name}_pre", f"{name}_post"]
        elif evolved.per != MODULATOR and isinstance(evolved.per, str):
            names.append(name)
    return tuple(names)


def evolvable_parameters(rule: type[Rule], network: Network) -> dict[str, Evolved]:
    """The parameters of a rule that are evolved with a network, by name."""
    return {**rule.evolved, **(rule.with_reward if network.rewarded else {})}


def part_values(rule: type[Rule], network: Network, genes: Mapping[str, Floats]) -> dict[str, Floats]:
    """The values of all parts of a genome by name: the genes, or what `Evolved.value` makes of them."""
    values = dict(genes)
    for name, evolved in evolvable_parameters(rule, network).items():
        if evolved.value is not None:
            values[name] = evolved.value(readonly(genes[name]))
    return values


def evolved_sizes(rule: type[Rule], network: Network) -> dict[str, int]:
    """How many genes each evolved parameter of a rule takes."""
    check_layers(rule, network)
    per = {
        "network": 1,
        "layer": len(network.post),
        "synapse": network.synapses,
        "neuron": network.neurons,
        MODULATOR: network.layers[-2] + 1,
        REWARD: 1,
    }
    parameters = evolvable_parameters(rule, network)
    for name, evolved in parameters.items():
        if evolved.per not in per and not (isinstance(evolved.per, int) and evolved.per > 0):
            raise ValueError(f"rule {rule.__name__}: {name} is evolved per {evolved.per}, not {', '.join(per)}")
        if name in TAKEN:
            raise ValueError(f"rule {rule.__name__}: no parameter can be called {name}, which means something else")
    return {
        name: evolved.per if isinstance(evolved.per, int) else per[evolved.per] for name, evolved in parameters.items()
    }


def check_layers(rule: type[Rule], network: Network) -> None:
    """Refuse a rule that works layer by layer for a network without layers; a ValueError."""
    if network.wiring is None:
        return
    needs = [name for name, evolved in evolvable_parameters(rule, network).items() if evolved.per == "layer"]
    why = f"has {needs[0]} for each layer" if needs else ""
    why = "has a modulatory neuron, which receives the layer before the wheels" if modulator_name(rule) else why
    if why:
        raise ValueError(f"rule {class_name(rule)} {why}; network.wiring={network.wiring.name} has no layers")


def coefficients(rule: type[Rule], network: Network, genes: Mapping[str, Floats]) -> Floats:
    """The coefficients of every synapse, (names, synapses), from the values of the evolved parameters by name."""
    names = coefficient_names(rule)
    spread = np.empty((len(names), network.synapses))
    if not names:
        return spread
    parameters: dict[str, Floats] = {}
    for name, evolved in rule.evolved.items():
        if evolved.per == "layer":
            parameters[name] = np.repeat(genes[name], [n * m for n, m in network.shapes])
        elif evolved.per == "neuron":
            pre, post = network.joined
            parameters |= {f"{name}_pre": genes[name][pre], f"{name}_post": genes[name][post]}
        elif isinstance(evolved.per, int):
            parameters[name] = np.repeat(genes[name][:, None], network.synapses, axis=1)
        elif evolved.per != MODULATOR:
            parameters[name] = np.broadcast_to(genes[name], network.synapses)
    expressed = rule.express(parameters)
    for row, name in zip(spread, names, strict=True):
        row[:] = expressed[name]
    return spread


def modulatory_weights(rule: type[Rule], genes: Mapping[str, Floats], reward: Reward = Reward.given) -> Floats:
    """The weights of a rule's modulatory neuron: from neurons, its bias, from the reward input if any; or none."""
    name = modulator_name(rule)
    if name is None:
        return np.empty(0)
    of_reward = [genes[key] for key, evolved in rule.with_reward.items() if evolved.per == REWARD and key in genes]
    sign = -1.0 if reward is Reward.inverted else 1.0
    return np.concatenate([genes[name], *(sign * weight for weight in of_reward)])


def receives_reward(rule: type[Rule]) -> bool:
    """Whether a rule has a modulatory neuron that receives a reward where the network has that input."""
    return any(evolved.per == REWARD for evolved in rule.with_reward.values())


def modulator_name(rule: type[Rule]) -> str | None:
    """The name of the weights of a rule's modulatory neuron; None if it has none."""
    return next((name for name, evolved in rule.evolved.items() if evolved.per == MODULATOR), None)
