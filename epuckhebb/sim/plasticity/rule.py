"""What a plasticity rule says: its settings, what each synapse keeps, what of it is evolved, and its update."""

import dis
import inspect
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from enum import Enum
from itertools import pairwise
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim.digest import random_generator
from epuckhebb.sim.fitness import Signal
from epuckhebb.sim.network import Network
from epuckhebb.sim.plasticity.control import Sign

QUANTITIES = (
    "correlation",
    "pre",
    "post",
    "weight",
    "initial_weight",
    "fitness",
    "key",
    "step",
    "number",
    "kept",
    "by",
)
TAKEN = (*QUANTITIES, "weights")  # names that nothing else can have; `weights` are those of the network
MODULATOR, REWARD = "modulator", "reward"
INITIAL_RANGE = 0.1  # of weights that are drawn at birth; that of Najarro & Risi 2020
_LARGEST_WEIGHT = 1e6  # a neuron is at its limit from a drive of 20 on, and sums over larger weights say nothing


class Evolved(NamedTuple):
    """A parameter of a rule that is evolved with the weights.

    per: one for the whole `network`, for each `layer` of connections, for each `synapse`, or for each `neuron`, sensors
    and bias among them; or so many numbers for the whole network. `modulator`: the weights of a modulatory neuron, one
    from each neuron of the layer before the wheels, and its bias, last. `reward`: its weight from a reward that the
    network is told. start: genes of the first generation are uniform in +-start. limit: genes are clipped to +-limit.
    value: a function that makes the parameter of the genes; None where they are it.
    """

    per: str | int = "network"
    start: float = 1.0
    limit: float = 1.0
    value: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None = None


class InitialWeights(Enum):
    """Where the weights at birth come from: evolved, or random, drawn anew for each lifetime within +-0.1."""

    evolved = "evolved"
    random = "random"


class Reward(Enum):
    """How the modulatory neuron hears a reward: as it is told, or, as a control, inverted."""

    told = "told"
    inverted = "inverted"


@dataclass(frozen=True, kw_only=True)
class Rule:
    """A plasticity rule; subclasses add settings of their own as fields, and say what a synapse does.

    N: base rate, 0 for a robot that does not learn. N_gain_rad_s: wheel gain at which N holds; at another gain it is in
    proportion, so that a metre of way brings as many updates of the same size; 0 if N holds at any gain, as in the
    paper. floor: the least factor on N, when fitness is low. w_max: bound of the weights. signal: the live fitness that
    scales the rate. sign: of the updates, `hebbian` or a control. initial_weights: where the weights come from.
    reward: how a modulatory neuron hears a reward, as it is `told` or, as a control, `inverted`.

    A subclass has a static method `synapse`, compiled by numba, which returns the direction of a weight's change; the
    program multiplies it by N_e, adds it to the weight and keeps that within +-w_max. Its arguments are any of these
    names, in any order:

        pre, post     activations x_j and x_i of the two neurons that the synapse joins
        correlation   their product
        weight        the weight as it is now
        initial_weight      the weight at birth
        fitness       the live fitness, the same for all synapses
        key, step     of the lifetime's noise, and of this step; with `number`, the place of a random number
        number        of this synapse, from 0
        kept          what this synapse keeps: numbers named in `kept`, to be read and set
        by            the rule's settings
        (a name in `evolved`: that parameter, as evolved; if it is evolved per neuron, A_pre and A_post for A)

    kept: name -> value at birth, of what each synapse keeps during a life. evolved: name -> `Evolved`. A rule that
    evolves something per `modulator` has a modulatory neuron, and its updates are multiplied by that neuron's output.
    with_reward: what is evolved otherwise, or besides for each `reward`, where the network is told a reward.
    coefficients: names that `synapse` may ask for instead of those in `evolved`, if `express` makes others of them.
    keeps_lengths: whether the incoming weights of each neuron are scaled after each update, to the length, that is the
    root of the sum of their squares, that they had at birth.

    Raises:
        ValueError: a number is not finite or outside the range named in the message.
    """

    kept: ClassVar[Mapping[str, float]] = {}
    evolved: ClassVar[Mapping[str, Evolved]] = {}
    with_reward: ClassVar[Mapping[str, Evolved]] = {}
    coefficients: ClassVar[tuple[str, ...]] = ()
    keeps_lengths: ClassVar[bool] = False

    N: float = 0.0
    N_gain_rad_s: float = 0.0
    floor: float = 0.2
    w_max: float = 2.0
    signal: Signal = Signal.behaviour
    sign: Sign = Sign.hebbian
    initial_weights: InitialWeights = InitialWeights.evolved
    reward: Reward = Reward.told

    def __post_init__(self) -> None:
        """Validate the settings."""
        for name in ("N", "N_gain_rad_s", "floor", "w_max"):
            value = getattr(self, name)
            is_number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
            if not is_number:
                raise ValueError(f"hebbian.{name} must be a number, an int or a float, got {value!r}")
        for name, value in self.numbers().items():
            if not math.isfinite(value):
                raise ValueError(f"hebbian.{name} must be a finite number, got {value}")
        for name in ("N", "N_gain_rad_s", "floor"):
            if getattr(self, name) < 0:
                raise ValueError(f"hebbian.{name} must be 0 or more, got {getattr(self, name)}")
        if not 0 < self.w_max <= _LARGEST_WEIGHT:
            raise ValueError(f"hebbian.w_max must be more than 0 and at most {_LARGEST_WEIGHT:g}, got {self.w_max}")
        if self.reward is not Reward.told and not receives_reward(type(self)):
            raise ValueError(
                f"hebbian.reward={self.reward.name} does nothing with rule {name_of(type(self))}, which hears no reward"
            )

    @staticmethod
    def synapse(*_: Any) -> float:
        """The direction in which a weight goes; a subclass says it."""
        raise TypeError("a plasticity rule needs a static method `synapse`")

    @classmethod
    def express(cls, parameters: Mapping[str, NDArray[np.float64]]) -> Mapping[str, NDArray[np.float64]]:
        """What `synapse` may ask for, by name, (synapses,) each: made of the evolved parameters once, at birth.

        parameters: by name, (synapses,) each; (numbers, synapses) for those of which there are so many.
        """
        return parameters

    def pace(self, gain_rad_s: float) -> float:
        """The factor on N at a wheel gain [rad/s]."""
        return gain_rad_s / self.N_gain_rad_s if self.N_gain_rad_s else 1.0

    @classmethod
    def settings(cls) -> tuple[str, ...]:
        """The names of the settings that are numbers, in the order in which a kernel has them."""
        return tuple(field.name for field in fields(cls) if not isinstance(field.default, str | Enum))

    def numbers(self) -> dict[str, float]:
        """The settings that are numbers, by name."""
        return {name: float(getattr(self, name)) for name in self.settings()}

    def in_unit_interval(self, *names: str) -> None:
        """Refuse settings outside [0, 1].

        Raises:
            ValueError: one is.
        """
        for name in names:
            if not 0 <= getattr(self, name) <= 1:
                raise ValueError(f"hebbian.{name} must lie in [0, 1], got {getattr(self, name)}")


class NoRule(Rule):
    """No plasticity: the weights stay as they were at birth."""

    @staticmethod
    def synapse() -> float:
        """Nowhere."""
        return 0.0


NO_RULE = NoRule()


def asked(rule: type[Rule]) -> tuple[str, ...]:
    """The names of the arguments of a rule's `synapse`, in its order.

    Raises:
        ValueError: it asks for something that there is not, or the rule draws random numbers that no run can repeat.
    """
    if rule.synapse is Rule.synapse:
        raise ValueError(f"rule {rule.__name__} has no static method `synapse`, which says where a weight goes")
    known = {field.name for field in fields(rule)}
    for name, kind in inspect.get_annotations(rule).items():
        if name not in known and "ClassVar" not in str(kind):
            raise ValueError(
                f"rule {rule.__name__}: {name} is no setting yet; write @dataclass(frozen=True, kw_only=True) above it"
            )
    names = tuple(inspect.signature(rule.synapse).parameters)
    evolved = coefficient_names(rule)
    known = {*QUANTITIES, *evolved}
    unknown = [name for name in names if name not in known]
    if unknown:
        raise ValueError(
            f"rule {rule.__name__}: `synapse` asks for {', '.join(unknown)}; it may ask for {', '.join(QUANTITIES)}"
            + (f", and what is evolved: {', '.join(evolved)}" if evolved else "")
        )
    has = {"by": rule.settings(), "kept": tuple(rule.kept)}
    for before, then in pairwise(dis.get_instructions(rule.synapse)):
        loaded = before.argval[-1] if isinstance(before.argval, tuple) else before.argval  # 3.13 may load two at once
        of_record = "LOAD_FAST" in before.opname and loaded in has and then.opname in ("LOAD_ATTR", "STORE_ATTR")
        if of_record and then.argval not in has[loaded]:
            raise ValueError(
                f"rule {rule.__name__}: `{loaded}` has no {then.argval}; it has {', '.join(has[loaded]) or 'nothing'}"
            )
    for function in functions_of(rule):
        generator = random_generator(function)
        if generator is not None:
            raise ValueError(
                f"rule {rule.__name__}: {function.__name__} draws from {generator}, so no run could be repeated; "
                "ask for key, step and number in `synapse` and draw as rule `online` does, with epuckhebb.sim.random"
            )
    return names


def functions_of(rule: type[Rule]) -> tuple[Callable[..., Any], ...]:
    """The functions that make up a rule: how a weight changes, what is made of what evolved, and its initial values."""
    makers = (evolved.value for evolved in rule.evolved.values() if evolved.value is not None)
    return rule.synapse, rule.express.__func__, *makers  # type: ignore[attr-defined]  # of a class method


def coefficient_names(rule: type[Rule]) -> tuple[str, ...]:
    """The names by which `synapse` may ask for what is evolved."""
    if rule.coefficients:
        return rule.coefficients
    names: list[str] = []
    for name, evolved in rule.evolved.items():
        if evolved.per == "neuron":
            names += [f"{name}_pre", f"{name}_post"]
        elif evolved.per != MODULATOR and isinstance(evolved.per, str):
            names.append(name)
    return tuple(names)


def evolved_by(rule: type[Rule], network: Network) -> dict[str, Evolved]:
    """What of a rule is evolved with a network, by name."""
    return {**rule.evolved, **(rule.with_reward if network.rewarded else {})}


def values_of(
    rule: type[Rule], network: Network, genes: Mapping[str, NDArray[np.float64]]
) -> dict[str, NDArray[np.float64]]:
    """The values of all parts of a genome by name, where a rule says that they are not the genes themselves."""
    values = dict(genes)
    for name, evolved in evolved_by(rule, network).items():
        if evolved.value is not None:
            values[name] = evolved.value(genes[name])
    return values


def initial_synapse_state(rule: type[Rule], network: Network) -> NDArray[np.void]:
    """What the synapses keep, (synapses,) records with a field for each name, as at birth."""
    names = list(rule.kept) or ["nothing"]
    values = tuple(rule.kept.values()) or (0.0,)
    return np.full(network.synapses, np.array(values, [(name, np.float64) for name in names]))


def evolved_sizes(rule: type[Rule], network: Network) -> dict[str, int]:
    """How many genes each evolved parameter of a rule takes.

    Raises:
        ValueError: one is evolved per something that there is not, or has the name of something else.
    """
    per = {
        "network": 1,
        "layer": len(network.post),
        "synapse": network.synapses,
        "neuron": network.neurons,
        MODULATOR: network.layers[-2] + 1,
        REWARD: 1,
    }
    parameters = evolved_by(rule, network)
    for name, evolved in parameters.items():
        if evolved.per not in per and not (isinstance(evolved.per, int) and evolved.per > 0):
            raise ValueError(
                f"rule {rule.__name__}: {name} is evolved per {evolved.per}, not one of {', '.join(per)}, or a number"
            )
        if name in TAKEN:
            raise ValueError(
                f"rule {rule.__name__}: what is evolved cannot be called {name}, which means something else"
            )
    return {
        name: evolved.per if isinstance(evolved.per, int) else per[evolved.per] for name, evolved in parameters.items()
    }


def coefficients(rule: type[Rule], network: Network, genes: Mapping[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    """What a rule's `synapse` may ask for of its evolved parameters, as every synapse has it: (names, synapses).

    genes: by name of the parameter.
    """
    names = coefficient_names(rule)
    spread = np.empty((len(names), network.synapses))
    if not names:
        return spread
    parameters: dict[str, NDArray[np.float64]] = {}
    for name, evolved in rule.evolved.items():
        if evolved.per == "layer":
            parameters[name] = np.repeat(genes[name], [n * m for n, m in network.shapes])
        elif evolved.per == "neuron":
            pre, post = neurons_of(network)
            parameters |= {f"{name}_pre": genes[name][pre], f"{name}_post": genes[name][post]}
        elif isinstance(evolved.per, int):
            parameters[name] = np.repeat(genes[name][:, None], network.synapses, axis=1)
        elif evolved.per != MODULATOR:
            parameters[name] = np.broadcast_to(genes[name], network.synapses)
    expressed = rule.express(parameters)
    for row, name in zip(spread, names, strict=True):
        row[:] = expressed[name]
    return spread


def neurons_of(network: Network) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The presynaptic and the postsynaptic neuron of each synapse, (synapses,) each."""
    pre = [np.repeat(np.arange(n) + first, m) for first, _, _, n, m in network.connections]
    post = [np.tile(np.arange(m) + first, n) for _, first, _, n, m in network.connections]
    return np.concatenate(pre), np.concatenate(post)


def modulatory_weights(
    rule: type[Rule], genes: Mapping[str, NDArray[np.float64]], reward: Reward = Reward.told
) -> NDArray[np.float64]:
    """The weights of a rule's modulatory neuron: from neurons, its bias, from a reward if it is told one; or none.

    genes: by name of the parameter. reward: how it hears one.
    """
    name = _modulator(rule)
    if name is None:
        return np.empty(0)
    of_reward = [genes[one] for one, evolved in rule.with_reward.items() if evolved.per == REWARD and one in genes]
    heard = -1.0 if reward is Reward.inverted else 1.0
    return np.concatenate([genes[name], *(heard * weight for weight in of_reward)])


def is_alike(rule: type[Rule]) -> bool:
    """Whether all synapses have the same coefficients."""
    return all(evolved.per not in ("layer", "synapse", "neuron") for evolved in rule.evolved.values())


def is_modulated(rule: type[Rule]) -> bool:
    """Whether a rule has a modulatory neuron."""
    return _modulator(rule) is not None


def receives_reward(rule: type[Rule]) -> bool:
    """Whether a rule has a modulatory neuron that hears a reward where the network is told one."""
    return any(evolved.per == REWARD for evolved in rule.with_reward.values())


def _modulator(rule: type[Rule]) -> str | None:
    return next((name for name, evolved in rule.evolved.items() if evolved.per == MODULATOR), None)


def name_of(rule: type[Rule]) -> str:
    """What a rule is called: as its file, if it is one of the program, or else as its class."""
    package, _, module = rule.__module__.rpartition(".")
    return module if package == f"{__package__}.rules" else rule.__name__
