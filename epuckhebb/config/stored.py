"""Reads a configuration that a run folder keeps."""

import copy
import functools
from typing import Any, cast

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from epuckhebb.config.errors import explain
from epuckhebb.config.overrides import literal
from epuckhebb.config.parts import KINDS, PAPER
from epuckhebb.config.schema import SCHEMAS, Config, Plain, typed
from epuckhebb.controller.wiring import LAYERS
from epuckhebb.runtime import ConfigError
from epuckhebb.tmaze.fitness import Signal
from epuckhebb.tmaze.physics.pymunk import PYMUNK
from epuckhebb.tmaze.tasks.trial import ONE_TRIAL

_RULE = "oja"  # stands for a user's: it has no settings of its own, and cannot be taken for the paper's
_SIGNAL = "late"
_STAND_INS = {
    "fitness": PAPER,
    "wiring": LAYERS,  # a page has the neurons and synapses that were recorded
    "task": ONE_TRIAL.name,
    "physics": PYMUNK.name,
    "optimizer": "sep_cma_es",  # fits any training
}


def from_values(values: Plain, schema: type[Config], source: str) -> Config:
    """The configuration of plain values, all names among them. source: where they come from, for messages."""
    try:
        cfg = OmegaConf.merge(_keys_of(cast(Any, schema)), _literally(values))
        assert isinstance(cfg, DictConfig)
    except Exception as error:  # what damaged settings may raise has no end
        reason = explain(error) if isinstance(error, OmegaConfBaseException) else error
        raise ConfigError(f"{source} cannot be used: {reason}") from error
    return typed(cfg, schema)


def value_as_declared(key: str, value: Any, command: str) -> Any:
    """A value of a key of a command, of the type that the schema declares."""
    keys: Any = OmegaConf.merge(_keys_of(SCHEMAS[command]), {key: _literally(value)})
    return keys[key]


@functools.cache
def _keys_of(schema: Any) -> DictConfig:
    """The keys of a command with their types, made once: every job of a sweep has them."""
    keys = OmegaConf.structured(schema)
    assert isinstance(keys, DictConfig)
    return keys


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
    for kind, stand_in in _STAND_INS.items():
        group, key = KINDS[kind].group, KINDS[kind].key
        if ":" in str(_within(values, group).get(key)):
            values[group] = {key: stand_in}
    for sensor in _within(values, "robot").get("sensors", []):
        readings, name = sensor["readings"], sensor.pop("sensor").rpartition(":")[2]
        sensor.clear()
        sensor.update(recorded=name, readings=readings)
    rules = [rule for rule in (values.get("hebbian"), *_within(values, "compare").values()) if isinstance(rule, dict)]
    for rule in [values, *rules]:
        if ":" in str(_within(rule, "adaptation").get("change_signal")):
            rule["adaptation"]["change_signal"] = _SIGNAL
    for rule in rules:
        if ":" in str(rule.get("rule")) or rule.get("signal") == Signal.fitness.name:
            for key in [key for key in rule if key not in ("N", "sign", "name", "adaptation")]:
                del rule[key]
            rule["rule"] = _RULE
    return values
