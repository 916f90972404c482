"""Plain values of settings, converted to the types that dataclasses and records declare."""

import math
import re
from collections.abc import Mapping
from dataclasses import MISSING, fields
from enum import EnumType
from typing import Any, get_args, get_origin, get_type_hints

import msgspec

from epuckhebb.runtime import ConfigError, did_you_mean
from epuckhebb.tmaze.sensors import CurvePoint, Place

_ROWS = (Place, CurvePoint)  # records that are written as lists of numbers
_EXPECTED = re.compile(r"Expected `(.+)`, got `.+`")  # of msgspec
_KINDS = {
    "float": "a number",
    "int": "a whole number",
    "bool": "true or false",
    "str": "a text",
    "array": "a list",
    "object": "settings",
}
_INFINITE = (math.inf, -math.inf)


def part_settings(kind: Any, given: object, key: str, owner: str, **others: Any) -> dict[str, Any]:
    """The settings below a key, as the dataclass of a part declares them.

    owner: what the part is called in messages. others: other types for some of its fields.
    """
    hints = {**get_type_hints(kind), **others}
    defaults = {
        field.name: None if field.default is MISSING else field.default
        for field in fields(kind)
        if not (field.default is field.default_factory is MISSING)
    }
    return record(key, given, {field.name: hints[field.name] for field in fields(kind)}, defaults, owner)


def record(
    where: str, value: object, kinds: Mapping[str, Any], defaults: Mapping[str, object], owner: str
) -> dict[str, Any]:
    """The values of keys with these types. defaults: of the keys that may be left out."""
    given: dict[str, Any] = converted(where, value, dict[str, Any])
    for key in given:
        if key not in kinds:
            names = ", ".join(kinds) or "none"
            raise ConfigError(f"{where}.{key} is no key of {owner}; it has {names}{did_you_mean(key, kinds)}")
    for key in kinds:
        if key not in given and key not in defaults:
            raise ConfigError(f"{where}.{key} is missing")
    return {
        key: item
        if item in _INFINITE and defaults.get(key) in _INFINITE
        else converted(f"{where}.{key}", item, kinds[key])
        for key, item in given.items()
    }


def converted(where: str, value: object, kind: Any) -> Any:
    """A value as its declared type has it. where: its key, for messages."""
    inner = get_args(kind)
    record_kind = next((one for one in (kind, *inner) if hasattr(one, "_fields") and one not in _ROWS), None)
    if get_origin(kind) is Mapping:  # of names, or of certain ones
        names = get_args(inner[0]) or converted(where, value, dict[str, Any])
        return record(where, value, dict.fromkeys(names, inner[1]), {}, where)
    if record_kind and get_origin(kind) is tuple:
        return tuple(
            converted(f"{where}[{n}]", item, record_kind) for n, item in enumerate(converted(where, value, list[Any]))
        )
    if record_kind and value is not None:
        return record_kind(
            **record(where, value, get_type_hints(record_kind), record_kind._field_defaults, record_kind.__name__)
        )
    try:
        result = msgspec.convert(value, kind)
    except (msgspec.ValidationError, TypeError) as error:
        reason, _, place = str(error).partition(" - at `$")
        reason = _EXPECTED.sub(lambda found: f"it must be {_KINDS.get(found[1], found[1])}", reason)
        allowed = f", it must be one of {', '.join(kind.__members__)}" if isinstance(kind, EnumType) else ""
        raise ConfigError(f"{where}{place.rstrip('`')}: {reason}{allowed}; given was {value!r}") from error
    if not _is_finite(result):
        raise ConfigError(f"{where} must be finite, got {value!r}")
    return result


def _is_finite(value: object) -> bool:
    """Whether a value, and all in it, is no infinite number."""
    if isinstance(value, tuple):
        return all(map(_is_finite, value))
    return not isinstance(value, float) or math.isfinite(value)
