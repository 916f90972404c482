"""Classes of which users write subclasses, such as a rule or a fitness: settings, checks, and calls from a kernel."""

import importlib
import inspect
import math
import pkgutil
from collections import namedtuple
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields
from enum import Enum
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, ClassVar, cast

import numpy as np
from numba import TypingError, types
from numba.extending import overload
from numpy.typing import NDArray

from epuckhebb.controller.compiling.errors import MUST_GIVE_A_NUMBER, failed
from epuckhebb.controller.compiling.kernel import BUILDING_BLOCK, compiled, compiled_checked, move_to_module, written
from epuckhebb.controller.compiling.readonly import readonly
from epuckhebb.controller.evolved import Evolved
from epuckhebb.controller.ranges import check

_OURS = Path(__file__).parents[1]
# By these, numba 0.68 writes into an array that is read-only (`findings/numba_readonly.sh`).
_WRITE_THROUGH = {"flat", "nditer", "ascontiguousarray", "asfortranarray", "fill_diagonal"}
_overload: Any = overload  # it has no type for options of compilers
namedtuple_of: Any = namedtuple  # mypy wants the names of the fields written out


class OwnClass:
    """A dataclass whose fields are its settings, with functions of which one at least is the user's.

    PART: what messages call it. KEY: names it in the configuration. METHODS: the names of these functions.
    ARGUMENTS: the names that the arguments of its only method may have.
    """

    PART: ClassVar[str]
    KEY: ClassVar[str]
    METHODS: ClassVar[tuple[str, ...]] = ()
    ARGUMENTS: ClassVar[Collection[str]] = ()

    def __post_init__(self) -> None:
        check(self, self.KEY.rpartition(".")[0])

    @property
    def name(self) -> str:
        """What it is called."""
        return class_name(type(self))

    @classmethod
    def settings(cls) -> tuple[str, ...]:
        """The names of the settings that are numbers, in the order in which a kernel has them."""
        return tuple(field.name for field in fields(cast(Any, cls)) if not isinstance(field.default, str | Enum))

    def numbers(self) -> tuple[float, ...]:
        """The settings that are numbers."""
        return tuple(float(getattr(self, name)) for name in self.settings())

    @classmethod
    def allowed_arguments(cls, method: str) -> Collection[str]:  # noqa: ARG003  # others need it
        """The names of the arguments that a method may have; none where they are fixed."""
        return cls.ARGUMENTS

    @classmethod
    def arguments(cls, method: str) -> tuple[str, ...]:
        """The names of the arguments of a method, in its order; a ValueError if one is unknown."""
        names, allowed = tuple(inspect.signature(getattr(cls, method)).parameters), cls.allowed_arguments(method)
        unknown = [name for name in names if allowed and name not in allowed]
        if unknown:
            raise ValueError(f"{cls.what()}: `{method}` takes {', '.join(unknown)}; known are {', '.join(allowed)}")
        return names

    @classmethod
    def check_class(cls) -> None:
        """Check a subclass; else a ValueError."""
        for name in ("evolved", "with_reward"):
            values = getattr(cls, name, {})
            if not isinstance(values, Mapping) or not all(isinstance(value, Evolved) for value in values.values()):
                raise ValueError(f"{cls.what()}: {name} must be a mapping of names to Evolved(...), got {values!r}")
        base = part_base(cls)
        methods = [name for name in cls.METHODS if getattr(cls, name, None) is not getattr(base, name, None)]
        if cls.METHODS and not methods:
            raise ValueError(f"{cls.what()} needs a method `{'` or `'.join(cls.METHODS)}`")
        for method in methods:
            cls.arguments(method)
        settings = {field.name for field in fields(cast(Any, cls))}
        for name, annotation in inspect.get_annotations(cls).items():
            if name not in settings and "ClassVar" not in str(annotation):
                raise ValueError(f"{cls.what()}: {name} is not a setting; write @dataclass above the class")

    @classmethod
    def what(cls) -> str:
        """It in messages."""
        return f"{cls.PART} {cls.__name__}"


@contextmanager
def calling(what: str) -> Iterator[None]:
    """Turn whatever a function of the user's raises into an error that names it and the line. what: it, in messages."""
    try:
        yield
    except KeyboardInterrupt:
        raise
    except BaseException as reason:  # it may even leave Python
        raise failed(what, reason) from reason


def part_names(package: ModuleType) -> list[str]:
    """The program's parts of a kind: the files of its package."""
    return sorted(file.name for file in pkgutil.iter_modules(package.__path__))


def load_class(package: ModuleType, name: str) -> Any:
    """The class of a part of the program. package: of its kind. name: of its file."""
    module = importlib.import_module(f"{package.__name__}.{name}")
    classes = [member for member in vars(module).values() if isinstance(member, type) and issubclass(member, OwnClass)]
    return next(member for member in classes if member.__module__ == module.__name__)


def part_base(kind: type[OwnClass]) -> type[OwnClass]:
    """The class of all parts of a kind."""
    return kind.__mro__[kind.__mro__.index(OwnClass) - 1]


def class_name(kind: type[OwnClass]) -> str:
    """What a class is called: as its file, if it is one of the program, or else as itself."""
    is_file = not is_user_class(kind) and kind.__module__ != part_base(kind).__module__
    return kind.__module__.rpartition(".")[2] if is_file else kind.__name__


def is_user_class(kind: type[OwnClass]) -> bool:
    """Whether a class is the user's."""
    return kind.__module__.partition(".")[0] != __name__.partition(".")[0]


def user_classes(parts: Iterable[object]) -> list[type[OwnClass]]:
    """The classes of those parts, or of these classes, that are the user's own."""
    kinds = [part if isinstance(part, type) else type(part) for part in parts]
    return [kind for kind in kinds if issubclass(kind, OwnClass) and is_user_class(kind)]


def stored(initial: Mapping[str, float], count: int) -> NDArray[np.void]:
    """The initial state of so many neurons or synapses, records with a field for each name."""
    names, values = list(initial) or ["nothing"], tuple(initial.values()) or (0.0,)
    return np.full(count, np.array(values, [(name, np.float64) for name in names]))


def number(value: float) -> float:
    """What a method of a user's gives, as a number; True counts as 1."""
    return float(value)


def _truth(value: Any) -> float:
    return 1.0 if value else 0.0


def _float(value: Any) -> float:
    return float(value)


def _number(value: Any) -> Callable[[Any], float]:
    """What `number` is in a kernel for a value of this type; a TypingError if it is no number."""
    if isinstance(value, types.Boolean | types.Integer | types.Float):
        return _truth if isinstance(value, types.Boolean) else _float
    description = "nothing, at least sometimes" if isinstance(value, types.NoneType | types.Optional) else value.name
    raise TypingError(f"{MUST_GIVE_A_NUMBER}, it gives {description}")


_overload(number, jit_options=BUILDING_BLOCK)(_number)


def _code_names(function: Any, seen: set[Any]) -> Iterator[str]:
    """The names in the code of a function, and of those that it calls by a global name."""
    plain = getattr(function, "py_func", function)
    if isinstance(plain, FunctionType) and plain not in seen:
        seen.add(plain)
        yield from plain.__code__.co_names
        for name in plain.__code__.co_names:
            yield from _code_names(plain.__globals__.get(name), seen)


def _is_foreign(function: Any) -> bool:
    """Whether a function is the user's."""
    return not Path(function.__code__.co_filename).is_relative_to(_OURS)


def building_block(function: Any) -> Any:
    """A method as a building block; one of the user's checks the bounds of arrays."""
    return (compiled_checked if _is_foreign(function) else compiled)(move_to_module(function, __name__))


def make_call(function: Any, names: Collection[str], how: Mapping[str, str], arguments: str, **parts: Any) -> Any:
    """A building block with these arguments, which calls a static method of a user's.

    Only what the method has as arguments is computed, so the call is written when these are known. It may write into
    its state, and into no array that it is handed. names: of those of the method. how: how to make each of them. parts:
    other names in `how`.
    """
    writing = sorted(_WRITE_THROUGH.intersection(_code_names(function, set()))) if _is_foreign(function) else []
    if writing:
        raise ValueError(f"`{function.__name__}` uses {', '.join(writing)}, which can write into arrays of others")
    call = f"function({', '.join(f'readonly({how[name]})' for name in names)})"
    return written(arguments, call, {"function": building_block(function), "readonly": readonly, "math": math, **parts})


def make_number_call(
    kind: type[OwnClass], function: Any, names: Collection[str], how: Mapping[str, str], arguments: str, numbers: str
) -> Any:
    """A building block that calls a method which gives a number; its `by` are settings. numbers: where these are."""
    parts = {"call": make_call(function, names, how, f"{arguments}, by"), "By": namedtuple_of("By", kind.settings())}
    return written(arguments, f"number(call({arguments}, By(*{numbers})))", {**parts, "number": number})
