"""Ranges of settings: declared with a field of a dataclass, and checked when an instance is made.

class Lamp:
    intensity: float = within(0, default=1.0)

    def __post_init__(self) -> None:
        check(self, "scenario.lamp")
"""

import math
from collections.abc import Mapping
from dataclasses import MISSING, dataclass, field, fields
from typing import Any

import numpy as np


@dataclass(frozen=True)
class Range:
    """Finite numbers from `low` to `high`. above, below: without `low`, without `high`."""

    low: float
    high: float = math.inf
    above: bool = False
    below: bool = False

    def __contains__(self, value: object) -> bool:
        """Whether a value is such a number."""
        if not isinstance(value, int | float | np.number) or isinstance(value, bool) or not math.isfinite(value):
            return False
        is_left_out = (self.above and value == self.low) or (self.below and value == self.high)
        return bool(self.low <= value <= self.high and not is_left_out)

    def __str__(self) -> str:
        """What a value must do, after `must`."""
        if self.low == -math.inf:
            return "be a finite number"
        if self.high == math.inf:
            return f"be more than {self.low:g}" if self.above else f"be {self.low:g} or more"
        return f"lie in {'(' if self.above else '['}{self.low:g}, {self.high:g}{')' if self.below else ']'}"


def within(
    low: float,
    high: float = math.inf,
    *,
    above: bool = False,
    below: bool = False,
    usual: float = math.inf,
    default: Any = MISSING,
) -> Any:
    """A field of a dataclass whose values lie in a range, or are lists of numbers that lie in it.

    usual: more than this is allowed, and may be a slip, as of a unit.
    """
    metadata = {"range": Range(low, high, above, below), "usual": usual}
    if isinstance(default, list):
        return field(default_factory=default.copy, metadata=metadata)
    return field(default=default, metadata=metadata)


def check(instance: Any, prefix: str = "") -> None:
    """Check all fields of a dataclass that have a range; else a ValueError. prefix: of its keys, if they have one.

    The default may lie outside, as inf for never. The name of a member of an enum becomes that member.
    """
    for setting in fields(instance):
        value, members = getattr(instance, setting.name), getattr(type(setting.default), "__members__", {})
        if members and type(value) is str:
            if value not in members:
                raise ValueError(
                    f"{prefix and f'{prefix}.'}{setting.name} must be one of {', '.join(members)}; got {value}"
                )
            object.__setattr__(instance, setting.name, members[value])
    names = [setting.name for setting in fields(instance)]
    check_values(type(instance), {name: getattr(instance, name) for name in names}, prefix)


def check_values(kind: Any, values: Mapping[str, Any], prefix: str = "") -> None:
    """Check those values that the fields of a dataclass give a range; else a ValueError.

    A subclass that gives a field another default keeps the range.
    """
    for setting in fields(kind):
        value, allowed = values.get(setting.name, setting.default), _declared(kind, setting.name, "range")
        if allowed is not None and value != setting.default:
            check_value(f"{prefix}.{setting.name}" if prefix else setting.name, value, allowed, setting.default)


def _declared(kind: type, name: str, what: str) -> Any:
    """What `within` says of a field, of the class that declares it; None if it says nothing."""
    for base in kind.__mro__:
        setting = getattr(base, "__dataclass_fields__", {}).get(name)
        if setting is not None and what in setting.metadata:
            return setting.metadata[what]
    return None


def unusual(instance: Any, prefix: str) -> list[str]:
    """A note for each field of a dataclass whose value is more than is usual. prefix: of its keys."""
    limits = {setting.name: _declared(type(instance), setting.name, "usual") for setting in fields(instance)}
    return [
        f"{prefix}.{name}={value:g} is far more than usual, which is at most {limit:g}: is its unit right?"
        for name, limit in limits.items()
        if limit is not None and isinstance(value := getattr(instance, name), int | float) and value > limit
    ]


def check_value(key: str, value: Any, allowed: Range, default: Any = MISSING) -> None:
    """Check a number, or each of a list; else a ValueError that names the key, what is allowed, and the value."""
    numbers = value if isinstance(value, list | tuple) else [value]
    if not all(number in allowed for number in numbers):
        besides = f", or {default}" if isinstance(default, int | float) and default not in allowed else ""
        raise ValueError(f"{key} must {allowed}{besides}, got {value}")
