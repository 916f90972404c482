"""Reads a configuration that a run folder keeps."""

import copy
import functools
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from epuckhebb.config import hand
from epuckhebb.config.errors import explain
from epuckhebb.config.overrides import literal
from epuckhebb.config.plugins import own_references
from epuckhebb.config.schema import SCHEMAS, Config, Plain, typed
from epuckhebb.runtime import ConfigError


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


def with_own_copies(values: Plain, run: Path, own_code: Mapping[str, Any]) -> Plain:
    """Plain values of a run with its own copies in place of the user's files. own_code: of its provenance."""
    values = copy.deepcopy(values)
    for part, key, file, name in own_references(values):
        part[key] = f"{(run / own_code[str(file)]['copy']).absolute()}:{name}"
    scenario = values.get("scenario")
    if isinstance(scenario, dict) and scenario.get("hand") is not None:
        scenario["hand"] = str((run / hand.NAME).absolute())
    return values
