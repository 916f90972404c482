"""What a plasticity rule says: its settings, what each synapse keeps, what of it is evolved, and its update."""

import dis
import inspect
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields
from enum import Enum
from itertools import pairwise
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim.fitness import Signal
from epuckhebb.sim.network import Network
from epuckhebb.sim.plasticity.control import Sign

QUANTITIES = ("correlation", "pre", "post", "weight", "kept", "by")
TAKEN = (*QUANTITIES, "weights")  # names that nothing else can have; `weights` are those of the network
_LARGEST_WEIGHT = 1e6  # a neuron is at its limit from a drive of 20 on, and sums over larger weights say nothing


class Evolved(NamedTuple):
    """A parameter of a rule that is evolved with the weights.

    per: one for the whole `network`, for each `layer` of connections, or for each `synapse`. start: genes of the first
    generation are uniform in +-start. limit: genes are clipped to +-limit.
    """

    per: str = "network"
    start: float = 1.0
    limit: float = 1.0


@dataclass(frozen=True, kw_only=True)
class Rule:
    """A plasticity rule; subclasses add settings of their own as fields, and say what a synapse does.

    N: base rate, 0 for a robot that does not learn. floor: the least factor on N, when fitness is low. w_max: bound of
    the weights. signal: the live fitness that scales the rate. sign: of the updates, `hebbian` or a control.

    A subclass has a static method `synapse`, compiled by numba, which returns the direction of a weight's change; the
    program multiplies it by N_e, adds it to the weight and keeps that within +-w_max. Its arguments are any of these
    names, in any order:

        pre, post     activations x_j and x_i of the two neurons that the synapse joins
        correlation   their product
        weight        the weight as it is now
        kept          what this synapse keeps: numbers named in `kept`, to be read and set
        by            the rule's settings
        (a name in `evolved`: that parameter, as evolved)

    kept: name -> value at birth, of what each synapse keeps during a life. evolved: name -> `Evolved`.

    Raises:
        ValueError: a number is not finite or outside the range named in the message.
    """

    kept: ClassVar[Mapping[str, float]] = {}
    evolved: ClassVar[Mapping[str, Evolved]] = {}

    N: float = 0.0
    floor: float = 0.2
    w_max: float = 2.0
    signal: Signal = Signal.behaviour
    sign: Sign = Sign.hebbian

    def __post_init__(self) -> None:
        """Refuse what no rule can have."""
        for name, value in self.numbers().items():
            if not math.isfinite(value):
                raise ValueError(f"hebbian.{name} must be a finite number, got {value}")
        for name in ("N", "floor"):
            if getattr(self, name) < 0:
                raise ValueError(f"hebbian.{name} must be 0 or more, got {getattr(self, name)}")
        if not 0 < self.w_max <= _LARGEST_WEIGHT:
            raise ValueError(f"hebbian.w_max must be more than 0 and at most {_LARGEST_WEIGHT:g}, got {self.w_max}")

    @staticmethod
    def synapse(*_: Any) -> float:
        """The direction in which a weight goes; a subclass says it."""
        raise TypeError("a plasticity rule needs a static method `synapse`")

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
        ValueError: it asks for something that there is not.
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
    known = {*QUANTITIES, *rule.evolved}
    unknown = [name for name in names if name not in known]
    if unknown:
        raise ValueError(
            f"rule {rule.__name__}: `synapse` asks for {', '.join(unknown)}; it may ask for {', '.join(QUANTITIES)}"
            + (f", and what is evolved: {', '.join(rule.evolved)}" if rule.evolved else "")
        )
    has = {"by": rule.settings(), "kept": tuple(rule.kept)}
    for before, then in pairwise(dis.get_instructions(rule.synapse)):
        loaded = before.argval[-1] if isinstance(before.argval, tuple) else before.argval  # 3.13 may load two at once
        of_record = "LOAD_FAST" in before.opname and loaded in has and then.opname in ("LOAD_ATTR", "STORE_ATTR")
        if of_record and then.argval not in has[loaded]:
            raise ValueError(
                f"rule {rule.__name__}: `{loaded}` has no {then.argval}; it has {', '.join(has[loaded]) or 'nothing'}"
            )
    return names


def kept_at_birth(rule: type[Rule], network: Network) -> NDArray[np.void]:
    """What the synapses keep, (synapses,) records with a field for each name, as at birth."""
    names = list(rule.kept) or ["nothing"]
    values = tuple(rule.kept.values()) or (0.0,)
    return np.full(network.synapses, np.array(values, [(name, np.float64) for name in names]))


def evolved_sizes(rule: type[Rule], network: Network) -> dict[str, int]:
    """How many genes each evolved parameter of a rule takes.

    Raises:
        ValueError: one is evolved per something else than network, layer or synapse, or has the name of something
            else.
    """
    per = {"network": 1, "layer": len(network.post), "synapse": network.synapses}
    for name, evolved in rule.evolved.items():
        if evolved.per not in per:
            raise ValueError(f"rule {rule.__name__}: {name} is evolved per {evolved.per}, not one of {', '.join(per)}")
        if name in TAKEN:
            raise ValueError(
                f"rule {rule.__name__}: what is evolved cannot be called {name}, which means something else"
            )
    return {name: per[evolved.per] for name, evolved in rule.evolved.items()}


def coefficients(rule: type[Rule], network: Network, genes: Mapping[str, NDArray[np.float64]]) -> NDArray[np.float64]:
    """The evolved parameters as every synapse has them: (parameters, synapses). genes: by name of the parameter."""
    counts = [n * m for n, m in network.shapes]
    spread = np.empty((len(rule.evolved), network.synapses))
    for row, (name, evolved) in zip(spread, rule.evolved.items(), strict=True):
        row[:] = np.repeat(genes[name], counts) if evolved.per == "layer" else genes[name]
    return spread
