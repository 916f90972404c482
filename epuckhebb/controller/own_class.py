"""Classes of which users write subclasses, such as a rule or a fitness: settings, checks, and calls from a kernel."""

import dis
import inspect
import math
from collections import namedtuple
from collections.abc import Callable, Collection, Mapping
from dataclasses import fields
from enum import Enum
from itertools import pairwise
from typing import Any, ClassVar, cast

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.compiling.code_digest import random_generator
from epuckhebb.controller.compiling.kernel import compiled, in_module

namedtuple_of: Any = namedtuple  # mypy wants the names of the fields written out
Functions = tuple[Callable[..., Any], ...]


class OwnClass:
    """A dataclass whose fields are its settings, with functions that a kernel calls. PART: what messages call it."""

    PART: ClassVar[str]

    @classmethod
    def settings(cls) -> tuple[str, ...]:
        """The names of the settings that are numbers, in the order in which a kernel has them."""
        return tuple(field.name for field in fields(cast(Any, cls)) if not isinstance(field.default, str | Enum))

    def numbers(self) -> tuple[float, ...]:
        """The settings that are numbers."""
        return tuple(float(getattr(self, name)) for name in self.settings())

    @classmethod
    def functions(cls) -> Functions:
        """All that the user wrote for it, on which results depend."""
        return ()

    @classmethod
    def check_class(cls, instead: str = "") -> None:
        """Check a subclass; else a ValueError. instead: what its author can do who wants random numbers."""
        what, of_dataclass = cls.what(), cast(Any, cls)
        known = {field.name for field in fields(of_dataclass)}
        for name, annotation in inspect.get_annotations(cls).items():
            if name not in known and "ClassVar" not in str(annotation):
                how = "frozen=True, kw_only=True" if of_dataclass.__dataclass_params__.frozen else "kw_only=True"
                raise ValueError(f"{what}: {name} is not a setting; write @dataclass({how}) above the class")
        for function in cls.functions():
            generator = random_generator(function)
            if generator is not None:
                advice = f"; {instead}" if instead else ""
                raise ValueError(
                    f"{what}: {function.__name__} draws from {generator}, so no run could be repeated{advice}"
                )

    @classmethod
    def what(cls) -> str:
        """It in messages."""
        return f"{cls.PART} {cls.__name__}"


def name_of(kind: type[OwnClass]) -> str:
    """What a class is called: as its file, if it is one of the program, or else as itself."""
    base = kind.__mro__[kind.__mro__.index(OwnClass) - 1]
    package, _, module = kind.__module__.rpartition(".")
    return module if package == f"{base.__module__}s" else kind.__name__


def stored(initial: Mapping[str, float], count: int) -> NDArray[np.void]:
    """The initial state of so many neurons or synapses, records with a field for each name."""
    names, values = list(initial) or ["nothing"], tuple(initial.values()) or (0.0,)
    return np.full(count, np.array(values, [(name, np.float64) for name in names]))


def arguments(
    what: str, function: Any, known: Collection[str], records: Mapping[str, tuple[str, ...]] | None = None
) -> tuple[str, ...]:
    """The names of the arguments of a static method, in its order.

    what: whose it is, for messages. known: names that it may have. records: what each argument that is a record holds.
    """
    names, records = tuple(inspect.signature(function).parameters), records or {}
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


def call_of(function: Any, names: Collection[str], how: Mapping[str, str], given: str, **parts: Any) -> Any:
    """A building block with the arguments `given`, which calls a static method of a user's.

    Only what the method has as arguments is computed, so the call is written when these are known. names: of its
    arguments. how: how to make each of them. parts: other names in `how`.
    """
    call = f"lambda {given}: function({', '.join(how[name] for name in names)})"
    return compiled(eval(call, {"function": compiled(in_module(function, __name__)), "math": math, **parts}))


def number_of(
    kind: type[OwnClass], function: Any, names: Collection[str], how: Mapping[str, str], given: str, numbers: str
) -> Any:
    """The same for a method that gives a number; its `by` is made of the settings. numbers: where these are."""
    parts = {"call": call_of(function, names, how, f"{given}, by"), "By": namedtuple_of("By", kind.settings())}
    return compiled(eval(f"lambda {given}: float(call({given}, By(*{numbers})))", parts))
