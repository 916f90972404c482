"""Checks a class of a user, such as a rule or a fitness, before its functions are compiled into a kernel."""

import dis
import inspect
from collections.abc import Callable, Collection, Mapping
from dataclasses import fields
from enum import Enum
from itertools import pairwise
from typing import Any

from epuckhebb.sim.compiling.code_digest import random_generator


def number_settings(kind: type) -> tuple[str, ...]:
    """The names of the settings of a dataclass that are numbers, in the order in which a kernel has them."""
    return tuple(field.name for field in fields(kind) if not isinstance(field.default, str | Enum))


def check_fields(what: str, kind: Any) -> None:
    """Check that all annotations of a class are settings, so that nobody has left out `@dataclass`.

    Raises:
        ValueError: one is not.
    """
    known = {field.name for field in fields(kind)}
    for name, annotation in inspect.get_annotations(kind).items():
        if name not in known and "ClassVar" not in str(annotation):
            how = "frozen=True, kw_only=True" if kind.__dataclass_params__.frozen else "kw_only=True"  # as its base has
            raise ValueError(f"{what}: {name} is not a setting; write @dataclass({how}) above the class")


def arguments(
    what: str, function: Callable[..., Any], known: Collection[str], records: Mapping[str, tuple[str, ...]]
) -> tuple[str, ...]:
    """The names of the arguments of a static method, in its order.

    what: whose it is, for messages. known: names that it may have. records: what each argument that is a record holds.

    Raises:
        ValueError: an argument is unknown, or a record is asked for what it does not hold.
    """
    names = tuple(inspect.signature(function).parameters)
    unknown = [name for name in names if name not in known]
    if unknown:
        raise ValueError(
            f"{what}: `{function.__name__}` has the unknown arguments {', '.join(unknown)}; known are "
            + ", ".join(known)
        )
    for before, then in pairwise(dis.get_instructions(function)):
        loaded = before.argval[-1] if isinstance(before.argval, tuple) else before.argval  # 3.13 may load two at once
        of_record = "LOAD_FAST" in before.opname and loaded in records and then.opname in ("LOAD_ATTR", "STORE_ATTR")
        if of_record and then.argval not in records[loaded]:
            raise ValueError(
                f"{what}: `{loaded}` has no {then.argval}; it has {', '.join(records[loaded]) or 'nothing'}"
            )
    return names


def check_repeatable(what: str, function: Callable[..., Any], instead: str = "") -> None:
    """Check that a function draws no random numbers of its own. instead: what its author can do, for the message.

    Raises:
        ValueError: it does.
    """
    generator = random_generator(function)
    if generator is not None:
        raise ValueError(
            f"{what}: {function.__name__} draws from {generator}, so no run could be repeated"
            + (f"; {instead}" if instead else "")
        )
