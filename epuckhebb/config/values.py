"""The one validator of settings: plain values, checked for the keys and types that dataclasses and records declare.

What a number may be is declared with its field (`epuckhebb.controller.ranges`), and checked when the class is made.
"""

import functools
import math
import re
from collections.abc import Mapping
from dataclasses import MISSING, fields, is_dataclass
from enum import Enum, EnumType
from typing import Any, Literal, cast, get_args, get_origin, get_type_hints

import msgspec

from epuckhebb.runtime import ConfigError, did_you_mean
from epuckhebb.tmaze.sensors import CurvePoint, Place

Plain = dict[str, Any]  # a configuration of plain values
_ROWS = (Place, CurvePoint)  # records that are written as lists of numbers
_EXPECTED = re.compile(r"Expected `([^`|]+).*`, got `.+`")  # of msgspec
_KINDS = {
    "float": "a number",
    "int": "a whole number",
    "bool": "true or false",
    "str": "a text",
    "array": "a list",
    "object": "settings",
}
NO_KEY = {"key": False}  # metadata of a field that is set in Python alone
_INFINITE = (math.inf, -math.inf)


@functools.cache
def field_types(kind: Any) -> dict[str, Any]:
    """The types of the fields of a dataclass by their names, not to be changed."""
    hints = get_type_hints(kind)
    return {field.name: hints[field.name] for field in fields(kind) if field.init and field.metadata.get("key", True)}


def default_values(kind: Any) -> Plain:
    """The defaults of a dataclass as plain values, without fields that have none."""
    defaults = {}
    for field in (one for one in fields(kind) if one.name in field_types(kind)):
        if field.default_factory is not MISSING:
            defaults[field.name] = plain_value(field.default_factory())
        elif field.default is not MISSING:
            defaults[field.name] = plain_value(field.default)
    return defaults


def plain_value(value: Any) -> Any:
    """A value as YAML has it: a dataclass as its settings, a member of an enum as its name."""
    if is_dataclass(value):
        return {name: plain_value(getattr(value, name)) for name in field_types(cast(Any, type(value)))}
    return value.name if isinstance(value, Enum) else value


def declared(kind: Any, given: object, key: str = "", owner: str = "") -> Plain:
    """Settings as plain values of the types that a dataclass declares. key, owner: as of `part_settings`."""
    values = part_settings(kind, given, key, owner or key)
    return {name: plain_value(value) for name, value in values.items()}


def make(kind: Any, values: Mapping[str, Any]) -> Any:
    """The dataclass of settings that `declared` has checked."""

    def made(inner: Any, value: Any) -> Any:
        if is_dataclass(inner) and value is not None:
            return make(inner, value)
        return inner[value] if isinstance(inner, EnumType) and value is not None else value

    return kind(**{name: made(without_none(field_types(kind)[name]), value) for name, value in values.items()})


def part_settings(kind: Any, given: object, key: str, owner: str, **others: Any) -> dict[str, Any]:
    """The settings below a key, as the dataclass of a part declares them.

    owner: what the part is called in messages. others: other types for some of its fields.
    """
    defaults = {
        field.name: None if field.default is MISSING else field.default
        for field in fields(kind)
        if not (field.default is field.default_factory is MISSING)
    }
    return record(key, given, {**field_types(kind), **others}, defaults, owner)


def record(
    where: str, value: object, kinds: Mapping[str, Any], defaults: Mapping[str, object], owner: str
) -> dict[str, Any]:
    """The values of keys with these types. defaults: of the keys that may be left out."""
    given: dict[str, Any] = converted(where, value, dict[str, Any])
    prefix = where and f"{where}."
    for key in given:
        if key not in kinds:
            first, dot, rest = key.partition(".")
            names = ", ".join(kinds) or "none"
            hint = f"; write {first}: {{{rest}: ...}}" if dot else did_you_mean(key, kinds)
            raise ConfigError(f"{prefix}{key} is no key{owner and f' of {owner}; it has {names}'}{hint}")
    for key in kinds:
        if key not in given and key not in defaults:
            raise ConfigError(f"{prefix}{key} is missing")
    return {
        key: item
        if item in _INFINITE and defaults.get(key) in _INFINITE
        else converted(f"{prefix}{key}", item, kinds[key])
        for key, item in given.items()
    }


def converted(where: str, value: object, kind: Any) -> Any:
    """A value as its declared type has it; that of a dataclass as `declared`. where: its key, for messages."""
    if value is None and type(None) in get_args(kind):
        return None
    kind = without_none(kind)
    inner = get_args(kind)
    if is_dataclass(kind):
        return declared(kind, value, where)
    if get_origin(kind) is Mapping:  # of names, or of certain ones
        names = get_args(inner[0]) or converted(where, value, dict[str, Any])
        return record(where, value, dict.fromkeys(names, inner[1]), {}, where)
    if get_origin(kind) is tuple and _is_record(inner[0]):
        return tuple(
            converted(f"{where}[{n}]", item, inner[0]) for n, item in enumerate(converted(where, value, list[Any]))
        )
    if _is_record(kind):
        return kind(**record(where, value, get_type_hints(kind), kind._field_defaults, kind.__name__))
    if names := inner if get_origin(kind) is Literal else getattr(kind, "__members__", ()):
        if (str(value) if isinstance(kind, EnumType) else value) not in names:
            raise ConfigError(f"{where} must be one of {', '.join(map(str, names))}; given was {value!r}")
        return kind[str(value)] if isinstance(kind, EnumType) else value
    if kind is str and isinstance(value, int | float):  # a name of digits
        return str(value)
    try:
        result = msgspec.convert(value, kind, dec_hook=lambda other, text: other(text))  # as Path, of a study
    except (msgspec.ValidationError, TypeError) as error:
        reason, _, place = str(error).partition(" - at `$")
        reason = _EXPECTED.sub(lambda found: f"it must be {_KINDS.get(found[1].strip(), found[1])}", reason)
        raise ConfigError(f"{where}{place.rstrip('`')}: {reason}; given was {value!r}") from error
    if not _is_finite(result):
        raise ConfigError(f"{where} must be finite, got {value!r}")
    return result


def without_none(kind: Any) -> Any:
    """The type of the values but None."""
    inner = [one for one in get_args(kind) if one is not type(None)]
    return inner[0] if len(inner) == 1 < len(get_args(kind)) else kind


def _is_record(kind: Any) -> bool:
    """Whether a type is a record whose fields have keys."""
    return hasattr(kind, "_fields") and kind not in _ROWS


def _is_finite(value: object) -> bool:
    """Whether a value, and all in it, is no infinite number."""
    if isinstance(value, tuple | list):
        return all(map(_is_finite, value))
    return not isinstance(value, float) or math.isfinite(value)
