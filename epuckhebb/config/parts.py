"""The kinds of parts that have classes (rules, fitnesses, sensors, ...), and how one is found by its name.

A part of the program is a file of its kind's package, named by the part; one of the user's is `FILE.py:NAME`. All are
checked and made in the same way.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import ModuleType
from typing import Any

from epuckhebb.adaptation import change_signals
from epuckhebb.adaptation.change_signal import ChangeSignal
from epuckhebb.config.plugins import class_named
from epuckhebb.config.values import part_settings
from epuckhebb.controller import wirings
from epuckhebb.controller.own_class import OwnClass, load_class, part_names
from epuckhebb.controller.plasticity import rules
from epuckhebb.controller.plasticity.rule import Rule
from epuckhebb.controller.wiring import LAYERS, Wiring
from epuckhebb.evolution import optimizers
from epuckhebb.evolution.optimizer import Optimizer
from epuckhebb.flock import couplings
from epuckhebb.flock.coupling import Coupling
from epuckhebb.runtime import ConfigError, refusing
from epuckhebb.tmaze import physics, tasks
from epuckhebb.tmaze.fitness import Signal
from epuckhebb.tmaze.own_fitness import Fitness
from epuckhebb.tmaze.own_sensor import Sensor
from epuckhebb.tmaze.physics_engine import Physics
from epuckhebb.tmaze.task import Task

NONE, PAPER = "none", "paper"
GENETIC = "ga"  # the optimizer whose settings are a group of their own


@dataclass(frozen=True, kw_only=True)
class Layers:
    """The network without a wiring. layers: None where they follow from the genome, or from the robot."""

    layers: tuple[int, ...] | None = None


@dataclass(frozen=True)
class Kind:
    """A kind of part.

    base: of a user's class; its KEY names a part in the configuration. package: where the program's are, if it has any.
    besides: classes that are no file of the package, by name.
    """

    base: type[OwnClass]
    package: ModuleType | None = None
    besides: Mapping[str, type] = field(default_factory=dict)

    @property
    def group(self) -> str:
        """The group of the configuration that has its settings."""
        return self.base.KEY.rpartition(".")[0]

    @property
    def key(self) -> str:
        """The key there that names a part."""
        return self.base.KEY.rpartition(".")[2]

    @property
    def names(self) -> list[str]:
        """The parts that the program has."""
        return sorted([*self.besides, *(part_names(self.package) if self.package else ())])


KINDS = {
    "rule": Kind(Rule, rules),
    "fitness": Kind(Fitness, besides={PAPER: Fitness}),
    "wiring": Kind(Wiring, wirings, {LAYERS: Layers}),
    "sensor": Kind(Sensor),
    "task": Kind(Task, tasks),
    "physics": Kind(Physics, physics),
    "optimizer": Kind(Optimizer, optimizers),
    "coupling": Kind(Coupling, couplings),
    "change signal": Kind(ChangeSignal, change_signals),
}

PART_GROUPS = ("compare", *(kind.group.partition(".")[0] for kind in KINDS.values()))


def part_class(kind: str, name: Any, key: str) -> Any:
    """The class of a part by its name. key: what stands before the name in the configuration, for messages."""
    row, key = KINDS[kind], f"{key}.{KINDS[kind].key}"
    if ":" in str(name):
        part: Any = class_named(name, row.base, key)
        with refusing(lambda error: f"{key}={name}: {error}"):
            part.check_class()
        return part
    if name not in row.names:
        names = [
            *([NONE] if kind in ("rule", "change signal") else []),
            *row.names,
            f"or FILE.py:NAME, a {kind} of your own",
        ]
        raise ConfigError(f"{key} must be one of {', '.join(names)}, got {name!r}")
    if name in row.besides:
        return row.besides[name]
    assert row.package is not None  # it has the names
    return load_class(row.package, name)


def make_part(kind: str, settings: Mapping[str, Any], key: str) -> Any:
    """The part that settings below a key describe: the name of its class, and the settings that this has."""
    which = KINDS[kind].key
    name, own = settings.get(which), {one: value for one, value in settings.items() if one != which}
    part = part_class(kind, name, key)
    more = {"signal": Signal} if kind == "rule" and own.get("signal") in list(Signal) else {}
    values = part_settings(part, own, key, f"{kind} {name}", **more)
    try:
        return part(**values)
    except (Exception, SystemExit) as error:  # a user's own checks may even leave Python
        message = str(error).replace("hebbian.", f"{key}.", 1)
        raise ConfigError(message if key in message else f"{key}.{which}={name}: {message}") from error
