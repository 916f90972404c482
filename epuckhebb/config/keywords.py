"""Writes the keywords and objects of the Python interface as overrides."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from epuckhebb.config.conf import groups
from epuckhebb.config.overrides import quoted
from epuckhebb.runtime.errors import ConfigError
from epuckhebb.sim.adaptation.adaptation import NONE, Adaptation
from epuckhebb.sim.own_fitness import Fitness
from epuckhebb.sim.plasticity.rule import Rule
from epuckhebb.sim.wiring import Wiring


def overrides_of(overrides: Sequence[Any], keys: Mapping[str, Any]) -> list[str]:
    """Overrides as on the command line, of texts and of keywords."""
    for override in overrides:
        if not isinstance(override, str) or "=" not in override:
            raise ConfigError(
                f"overrides are texts such as 'scenario=4obstacles', or keywords such as scenario='4obstacles'; got "
                f"{override!r}"
            )
    for key, value in keys.items():
        if key in groups("evaluate") and key != "change" and isinstance(value, list | tuple | np.ndarray):
            raise ConfigError(f"{key} must be one, got {value!r}; for several in turn: sweep(over={{{key!r}: [...]}})")
    words = [word for key, value in keys.items() for word in keyword_overrides(key, value)]
    return [*words, *overrides]


def keyword_overrides(key: str, value: Any) -> Iterator[str]:
    """The overrides that a keyword stands for: one, or those of the keys below it."""
    if isinstance(value, type):
        raise ConfigError(f"{key} must be an object or a name, got a class; give an object of it, with its settings")
    if isinstance(value, Rule | Fitness | Wiring):
        own = {Rule: "rule", Fitness: "function", Wiring: "wiring"}[type(value).__mro__[-2]]
        name = type(value).__name__
        raise ConfigError(f"{key} of this call cannot be an object; give its file: {key}={{'{own}': 'FILE.py:{name}'}}")
    if isinstance(value, Adaptation) and value.acts and value.name == NONE:
        raise ConfigError(f"{key} needs a name for tables and figures; give Adaptation(name='mine', ...)")
    if is_dataclass(value):
        value = {field.name: getattr(value, field.name) for field in fields(value)}
    if isinstance(value, Mapping):
        for name, inner in value.items():
            yield f"{key}.{name}={value_text(inner, f'{key}.{name}')}"
    else:
        yield f"{key}={value_text(value, key)}"


def value_text(value: Any, key: str) -> str:
    """A value as an override has it."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if value is None:
        return "null"
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, str | Path):
        return quoted(str(value))
    if isinstance(value, Mapping):
        return "{" + ",".join(f"{name}: {value_text(inner, f'{key}.{name}')}" for name, inner in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ",".join(value_text(inner, key) for inner in value) + "]"
    raise ConfigError(f"{key} must be text, a number, a list or settings, got {type(value).__name__}")
