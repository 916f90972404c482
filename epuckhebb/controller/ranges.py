"""Ranges of settings: declared with a field of a dataclass, and checked when an instance is made.

class Lamp:
    intensity: float = within(0, default=1.0)

    def __post_init__(self) -> None:
        check(self, "scenario.lamp")
"""

import math
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
        if self.high == math.inf:
            return f"be more than {self.low:g}" if self.above else f"be {self.low:g} or more"
        return f"lie in {'(' if self.above else '['}{self.low:g}, {self.high:g}{')' if self.below else ']'}"


def within(
    low: float, high: float = math.inf, *, above: bool = False, below: bool = False, default: Any = MISSING
) -> Any:
    """A field of a dataclass whose values lie in a range, or are None, or lists of numbers that lie in it."""
    return field(default=default, metadata={"range": Range(low, high, above, below)})


def check(instance: Any, prefix: str) -> None:
    """Check all fields of a dataclass that have a range; else a ValueError. prefix: of its keys."""
    for one in fields(instance):
        value = getattr(instance, one.name)
        if "range" in one.metadata and value is not None:
            check_value(f"{prefix}.{one.name}", value, one.metadata["range"])


def check_value(key: str, value: Any, allowed: Range) -> None:
    """Check a number, or each number of a list; else a ValueError that names the key, the value and the range."""
    numbers = value if isinstance(value, list | tuple) else [value]
    if not all(number in allowed for number in numbers):
        raise ValueError(f"{key} must {allowed}, got {value}")


def check_range(
    owner: object, group: str, *names: str, least: float = 0.0, most: float = math.inf, above: bool = False
) -> None:
    """Check that settings of a group of keys are finite numbers from `least` to `most`; above: more than `least`."""
    for name in names:
        check_value(f"{group}.{name}", getattr(owner, name), Range(least, most, above))
