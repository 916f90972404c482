"""Plain values of settings, converted to the types that dataclasses and records declare.

A message names the key as it is typed, what it must be, and what was given.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import MISSING, fields
from enum import Enum
from types import NoneType, UnionType
from typing import Any, get_args, get_origin, get_type_hints

from epuckhebb.runtime import ConfigError, did_you_mean
from epuckhebb.tmaze.sensors import CurvePoint, Place

_ROWS = (Place, CurvePoint)  # records that are written as lists of numbers
_WANTED = {float: "a finite number", int: "a whole number", bool: "true or false", str: "a text"}
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
    where: str, value: object, kinds: Mapping[str, Any], defaults: Mapping[str, object], owner: str = ""
) -> dict[str, Any]:
    """The values of keys with these types. defaults: of the keys that may be left out."""
    given = _mapping(where, value)
    for key in given:
        if key not in kinds:
            known = f"is no key of {owner}; it has" if owner else "is not known; known are"
            raise ConfigError(f"{where}.{key} {known} {', '.join(kinds) or 'none'}{did_you_mean(key, kinds)}")
    for key in kinds:
        if key not in given and key not in defaults:
            raise ConfigError(f"{where}.{key} is missing")
    return {
        key: item
        if item in _INFINITE and defaults.get(key) in _INFINITE
        else _converted(f"{where}.{key}", item, kinds[key])
        for key, item in given.items()
    }


def _converted(where: str, value: object, kind: Any) -> Any:
    """A value as its declared type has it."""
    origin, inner = get_origin(kind), get_args(kind)
    if isinstance(kind, UnionType):  # a type, or nothing
        return None if value is None else _converted(where, value, next(one for one in inner if one is not NoneType))
    if kind in _WANTED:
        return _plain(where, value, kind)
    if isinstance(kind, type) and issubclass(kind, Enum):
        name = value.name if isinstance(value, Enum) else value
        if name not in kind.__members__:
            raise _wrong(where, f"one of {', '.join(kind.__members__)}", value)
        return kind[str(name)]
    if kind in _ROWS:
        return kind(*row(where, value, kind._fields))
    if origin is Mapping:  # of names, or of certain ones
        return record(where, value, dict.fromkeys(get_args(inner[0]) or _mapping(where, value), inner[1]), {})
    if origin is tuple and inner[-1] is not Ellipsis:
        return tuple(row(where, value, ("from", "to")))
    if origin is tuple:
        if isinstance(value, str) or not isinstance(value, Sequence):
            raise _wrong(where, "a list", value)
        return tuple(_converted(f"{where}[{place}]", item, inner[0]) for place, item in enumerate(value))
    if hasattr(kind, "_field_defaults"):
        return kind(**record(where, value, get_type_hints(kind), kind._field_defaults))
    raise _wrong(where, str(kind), value)


def _mapping(where: str, value: object) -> Mapping[str, Any]:
    if not isinstance(value, Mapping):
        raise _wrong(where, "keys with values", value)
    for key in value:
        if not isinstance(key, str):
            raise _wrong(where, "keys that are texts (quote what looks like a number)", key)
    return value


def row(where: str, value: object, names: Iterable[str]) -> list[float]:
    """Finite numbers, one for each name."""
    names = tuple(names)
    if isinstance(value, str) or not isinstance(value, Sequence) or len(value) != len(names):
        raise _wrong(where, f"[{', '.join(names)}]", value)
    return [_plain(f"{where}[{place}]", number, float) for place, number in enumerate(value)]


def _plain(where: str, value: object, kind: type[Any]) -> Any:
    """A finite number, a whole number, true or false, or a text; a text that looks like a number is none."""
    fits = isinstance(value, int | float) and math.isfinite(value) if kind is float else isinstance(value, kind)
    if not fits or (isinstance(value, bool) and kind is not bool):
        raise _wrong(where, _WANTED[kind], value)
    return kind(value)


def _wrong(where: str, wanted: str, value: object) -> ConfigError:
    return ConfigError(f"{where} must be {wanted}, got {value!r}")
