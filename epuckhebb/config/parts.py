"""Parts of the science that have classes: a rule, a fitness, a coupling, and others; each is found by its name.

A part of the program is a file of a package, named by the part; one of the user's is `FILE.py:NAME`.
"""

import importlib
import pkgutil
from collections.abc import Mapping
from dataclasses import dataclass
from types import ModuleType
from typing import Any

from epuckhebb.config.plugins import class_named
from epuckhebb.config.values import part_settings
from epuckhebb.controller import wirings
from epuckhebb.controller.own_class import OwnClass
from epuckhebb.controller.plasticity import rules
from epuckhebb.controller.plasticity.rule import Rule
from epuckhebb.controller.wiring import LAYERS, Wiring
from epuckhebb.evolution import optimizers
from epuckhebb.evolution.optimizer import Algorithm, Optimizer
from epuckhebb.flock import couplings
from epuckhebb.flock.coupling import Coupling
from epuckhebb.runtime import ConfigError
from epuckhebb.tmaze import physics, tasks
from epuckhebb.tmaze.fitness import Signal
from epuckhebb.tmaze.own_fitness import Fitness
from epuckhebb.tmaze.own_sensor import Sensor
from epuckhebb.tmaze.physics_engine import Physics
from epuckhebb.tmaze.task import Task

NONE, PAPER = "none", "paper"
GENETIC = "ga"  # the optimizer whose settings are a group of their own


@dataclass(frozen=True)
class _Kind:
    """A kind of part.

    which: its key that names the class. base: of all its classes. package: where the program's are. usual: the
    classes that are there besides, by their names. own: the base of a user's class, if that is another.
    """

    which: str
    base: type
    package: ModuleType | None = None
    usual: Mapping[str, type] | None = None
    own: type | None = None

    @property
    def is_open(self) -> bool:
        """Whether a user can bring a class."""
        return issubclass(self.base, OwnClass)

    @property
    def names(self) -> list[str]:
        """Those that the program has."""
        modules = pkgutil.iter_modules(self.package.__path__) if self.package else ()
        return sorted([*(self.usual or ()), *(module.name for module in modules)])


@dataclass(frozen=True, kw_only=True)
class Layers:
    """The network without a wiring. layers: None where they follow from the genome, or from the robot."""

    layers: tuple[int, ...] | None = None


_KINDS = {
    "rule": _Kind("rule", Rule, rules),
    "fitness": _Kind("function", Fitness, usual={PAPER: Fitness}),
    "wiring": _Kind("wiring", Wiring, wirings, {LAYERS: Layers}),
    "coupling": _Kind("coupling", Coupling, couplings),
    "optimizer": _Kind("algorithm", Algorithm, optimizers, own=Optimizer),
    "task": _Kind("kind", Task, tasks),
    "physics": _Kind("kind", Physics, physics),
    "sensor": _Kind("sensor", Sensor),
}


def part_names(kind: str) -> list[str]:
    """The parts of a kind (`rule`, `fitness`, `wiring`, `coupling`, ...: see `_KINDS`) that the program has."""
    return _KINDS[kind].names


def part_class(kind: str, name: Any, key: str) -> Any:
    """The class of a part by its name. key: what stands before the name in the configuration, for messages."""
    of, key = _KINDS[kind], f"{key}.{_KINDS[kind].which}"
    if of.is_open and ":" in str(name):
        found: Any = class_named(name, of.own or of.base, key)
        try:
            found.check_class()
        except ValueError as error:
            raise ConfigError(f"{key}={name}: {error}") from error
        return found
    if name not in of.names:
        own = f"{'an' if kind == 'optimizer' else 'a'} {kind} of your own, FILE.py:NAME"
        known = [NONE] * (kind == "rule") + of.names + [own] * of.is_open
        raise ConfigError(f"{key} must be one of {', '.join(known)}, got {name!r}")
    if of.usual and name in of.usual:
        return of.usual[name]
    assert of.package is not None  # it has the names
    module = importlib.import_module(f"{of.package.__name__}.{name}")
    classes = (one for one in vars(module).values() if isinstance(one, type) and issubclass(one, of.base))
    return next(one for one in classes if one.__module__ == module.__name__)


def part_from(kind: str, settings: Mapping[str, Any], key: str) -> Any:
    """The part that settings below a key describe: the name of its class, and the settings that this has."""
    which = _KINDS[kind].which
    name, own = settings.get(which), {one: value for one, value in settings.items() if one != which}
    made = part_class(kind, name, key)
    try:
        more = {"signal": Signal} if kind == "rule" else {}
        return made(**part_settings(made, own, key, f"{kind} {name}", **more))
    except ConfigError:
        raise
    except Exception as error:  # what a user's own checks may raise has no end
        message = str(error).replace("hebbian.", f"{key}.", 1)
        raise ConfigError(message if key in message else f"{key}.{which}={name}: {message}") from error
