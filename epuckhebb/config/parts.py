"""Finds the class of a rule, a fitness, an optimizer, a task or a physics by its name."""

import importlib
import pkgutil
import types
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from epuckhebb.config.plugins import Base, class_named
from epuckhebb.evolution import optimizers
from epuckhebb.evolution.optimizer import Optimizer
from epuckhebb.runtime.errors import ConfigError
from epuckhebb.runtime.resources import path_of
from epuckhebb.sim import physics, tasks
from epuckhebb.sim.own_fitness import Fitness, check_class
from epuckhebb.sim.plasticity import rules as rule_files
from epuckhebb.sim.plasticity.rule import Rule, arguments_of
from epuckhebb.sim.space import Physics
from epuckhebb.sim.task import Task

NONE, PAPER = "none", "paper"
GENETIC = "ga"  # the optimizer whose settings are a group of their own


def rule_names() -> list[str]:
    """The rules that the program has."""
    return _names_in(rule_files)


def rule_class(where: str, key: str) -> type[Rule]:
    """The class of a rule, of the program's own or of a file."""
    if ":" not in where:
        if where not in rule_names():
            raise ConfigError(
                f"{key}.rule={where} must be one of {', '.join([NONE, *rule_names()])}, or a rule of your own, "
                "FILE.py:NAME"
            )
        return _class_of(rule_files, where, Rule, f"{key}.rule")
    kind = class_named(where, Rule, f"{key}.rule")
    try:
        arguments_of(kind)
    except ValueError as error:
        raise ConfigError(f"{key}.rule={where}: {error}") from error
    return kind


def fitness_class(where: str) -> type[Fitness]:
    """The class of a fitness: that of the paper, or one of a file."""
    key = "fitness.function"
    if where == PAPER:
        return Fitness
    if ":" not in where:
        raise ConfigError(f"{key} must be {PAPER}, or a fitness of your own, FILE.py:NAME, got {where!r}")
    kind = class_named(where, Fitness, key)
    try:
        check_class(kind)
    except ValueError as error:
        raise ConfigError(f"{key}={where}: {error}") from error
    return kind


def rule_file(settings: Mapping[str, Any]) -> Path | None:
    """The file of a user's own rule; None for a rule of the program."""
    file, colon, _ = str(settings.get("rule", "")).rpartition(":")
    return path_of(file, "hebbian.rule") if colon else None


def optimizer_names() -> list[str]:
    """The optimizers that the program has."""
    return _names_in(optimizers)


def optimizer_class(algorithm: Any) -> type[Optimizer]:
    """The class of the optimizer of this name, whose fields are its settings."""
    return _class_of(optimizers, algorithm, Optimizer, "optimizer.algorithm")  # type: ignore[type-abstract]


def task_names() -> list[str]:
    """The tasks that the program has."""
    return _names_in(tasks)


def task_class(name: Any) -> type[Task]:
    """The class of the task of this name, whose fields are its settings."""
    return _class_of(tasks, name, Task, "task.kind")


def physics_class(name: Any) -> type[Physics]:
    """The class of the physics of this name, whose fields are its settings."""
    return _class_of(physics, name, Physics, "physics.kind")  # type: ignore[type-abstract]


def _names_in(package: types.ModuleType) -> list[str]:
    return sorted(module.name for module in pkgutil.iter_modules(package.__path__))


def _class_of(package: types.ModuleType, name: Any, base: type[Base], key: str) -> type[Base]:
    """The subclass of a base that the module of this name has of its own."""
    known = _names_in(package)
    if name not in known:
        raise ConfigError(f"{key} must be one of {', '.join(known)}, got {name!r}")
    module = importlib.import_module(f"{package.__name__}.{name}")
    kinds = (kind for kind in vars(module).values() if isinstance(kind, type) and issubclass(kind, base))
    return next(kind for kind in kinds if kind.__module__ == module.__name__)
