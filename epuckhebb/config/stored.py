"""Reads a configuration that a run folder keeps."""

import copy
import functools
from collections.abc import Mapping
from typing import Any

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from epuckhebb.config.errors import explain
from epuckhebb.config.overrides import literal
from epuckhebb.config.plugins import own_references
from epuckhebb.config.schema import SCHEMAS, Config, Plain, typed
from epuckhebb.controller.wiring import LAYERS
from epuckhebb.runtime import ConfigError
from epuckhebb.tmaze.fitness import Signal
from epuckhebb.tmaze.own_fitness import PAPER_FITNESS

_STAND_IN = "oja"  # has no settings of its own, and cannot be taken for the paper's
_OPTIMIZER = "sep_cma_es"  # fits any training; stands for one of the user's
_OWN_SIGNAL = Signal.fitness.name


def from_values(values: Plain, schema: type[Config], source: str) -> Config:
    """The configuration of plain values, all names among them. source: where they come from, for messages."""
    try:
        cfg = as_config(values, schema.command)
    except Exception as error:  # what damaged settings may raise has no end
        reason = explain(error) if isinstance(error, OmegaConfBaseException) else error
        raise ConfigError(f"{source} cannot be used: {reason}") from error
    return typed(cfg, schema)


def as_config(held: Mapping[Any, Any], command: str) -> DictConfig:
    """The configuration of a command that these plain values are, all names among them; no text refers to another."""
    cfg = OmegaConf.merge(_keys_of(command), _literally(dict(held)))
    assert isinstance(cfg, DictConfig)
    return cfg


def value_as_declared(key: str, value: Any, command: str) -> Any:
    """A value of a key of a command, of the type that the schema declares: `as_config` without a copy of all keys."""
    if key not in _keys_of(command):  # is refused, with the same message
        return as_config({key: value}, command)[key]
    alone = DictConfig({key: _keys_of(command)._get_node(key)})  # a copy of it, with its type
    alone.merge_with({key: _literally(value)})
    return alone[key]


@functools.cache
def _keys_of(command: str) -> DictConfig:
    """The keys of a command with their types, made once: every job of a sweep has them."""
    schema = OmegaConf.structured(SCHEMAS[command])
    assert isinstance(schema, DictConfig)
    return schema


def _literally(value: Any) -> Any:
    """What was written down with all values in it: no text in it refers to another."""
    if isinstance(value, dict):
        return {str(key): _literally(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_literally(item) for item in value]
    return literal(value) if isinstance(value, str) else value


def _within(values: Plain, group: str) -> Plain:
    """The settings of a group; none where a damaged file has lost them, which the schema then refuses."""
    found = values.get(group)
    return found if isinstance(found, dict) else {}


def without_own_code(values: Plain) -> Plain:
    """Plain values with a part of the program in place of each of the user's own; nothing of theirs is loaded.

    It is for reading what a run recorded. Of a rule, names, rates, signs and adaptations stay. A rule that is scaled
    by a user's fitness is replaced, too.
    """
    values = copy.deepcopy(values)
    rules = [rule for rule in (values.get("hebbian"), *_within(values, "compare").values()) if isinstance(rule, dict)]
    rules = [rule for rule in rules if rule.get("signal") == _OWN_SIGNAL]
    rules += [part for part, key, *_ in own_references(values) if key == "rule"]
    for part in _within(values, "robot").get("sensors", []):
        name = part.pop("sensor").rpartition(":")[2]
        readings = part["readings"]
        part.clear()
        part.update(recorded=name, readings=readings)
    values["fitness"] = {"function": PAPER_FITNESS.name}
    if ":" in str(_within(values, "network").get("wiring")):
        values["network"] = {"wiring": LAYERS}  # a page has the neurons and synapses that were recorded
    if ":" in str(_within(values, "optimizer").get("algorithm")):
        values["optimizer"] = {"algorithm": _OPTIMIZER}
    for rule in rules:
        for key in [key for key in rule if key not in ("N", "sign", "name", "adaptation")]:
            del rule[key]
        rule["rule"] = _STAND_IN
    return values
