"""From observations to readings and from outputs to actions, for the spaces of Gymnasium.

| space | readings | action |
| --- | --- | --- |
| Box | tanh((x - mean) / scale) of each number, mean 0 unless given | the outputs, from -1 to 1, between its bounds |
| Discrete, MultiDiscrete | for each number a 1 among zeros | for each number the place of the largest of its outputs |
| MultiBinary | its zeros and ones | 1 where an output is above 0 |
| Dict, Tuple | those of its parts, one after the other | of its parts |
| Readings, of compiled worlds | its numbers, as they are | – |
| Text | none | – |
"""

import math
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.arrays import Floats

_UNBOUNDED = 1e30  # bounds from here on are written for none, as the largest float32 is
_WIDE = 3.0  # scale of readings without bounds
RUNNING = "running"  # the scale that comes of what was read in training
_STILL = 1e-6  # deviation of a reading, as a share of its mean, up to which it never moved
_KINDS = ("Box", "Discrete", "MultiDiscrete", "MultiBinary", "Readings")
_TEXT = "Text"


def space_kind(space: Any) -> str:
    """The name of a space's class in Gymnasium, also of a class made from it; any space of strings is a Text."""
    if getattr(getattr(space, "dtype", None), "kind", "") == "U":
        return _TEXT
    names = [kind.__name__ for kind in type(space).__mro__]
    return next((name for name in names if name in (*_KINDS, "Dict", "Tuple", _TEXT)), names[0])


class Part(NamedTuple):
    """A part of a space that has no parts. path: the keys that lead to it; size: its readings, or its outputs."""

    path: tuple[Any, ...]
    space: Any
    size: int

    @property
    def kind(self) -> str:
        """The name of its class in Gymnasium."""
        return space_kind(self.space)

    @property
    def names(self) -> list[str]:
        """The name of each of its readings: a number, or where it is in an observation of parts."""
        if self.kind == "Readings":
            return list(self.space.names)
        path = ".".join(map(str, self.path))
        if not path or (self.kind == "Box" and self.space.shape) or self.kind in _KINDS[2:]:
            return [f"{path}{'.' * bool(path)}{number}" for number in range(self.size)]
        return [path] if self.kind == "Box" else [f"{path}={number}" for number in range(self.size)]


def space_parts(space: Any, what: str) -> list[Part]:
    """The parts of a space in its order, without texts.

    Raises:
        ValueError: it has parts of another kind. what: has the space, as the message says.
    """
    parts = [part for part in _walk(space, ()) if part.kind != _TEXT]
    for part in parts:
        if part.kind not in _KINDS:
            where = f"{'.'.join(map(str, part.path))} is" if part.path else "are"
            raise ValueError(f"{what} must be of {', '.join(_KINDS)}, Dict or Tuple of these; {where} of {part.kind}")
    if not parts:
        raise ValueError(f"{what} must hold numbers, and are of {space_kind(space)}")
    return parts


def text_places(space: Any) -> list[str]:
    """Where a space has texts, which are left out."""
    return [".".join(map(str, part.path)) for part in _walk(space, ()) if part.kind == _TEXT]


def _walk(space: Any, path: tuple[Any, ...]) -> Iterator[Part]:
    match space_kind(space):
        case "Dict":
            for key, inner in space.spaces.items():
                yield from _walk(inner, (*path, key))
        case "Tuple":
            for key, inner in enumerate(space.spaces):
                yield from _walk(inner, (*path, key))
        case _:
            yield Part(path, space, _size(space))


def _size(space: Any) -> int:
    match space_kind(space):
        case "Discrete":
            return int(space.n)
        case "MultiDiscrete":
            return int(space.nvec.sum())
        case "Box" | "MultiBinary" | "Readings":
            return int(max(1, np.prod(space.shape)))
    return 0


def _bounds(box: Any) -> tuple[Floats, Floats, NDArray[np.bool_], NDArray[np.bool_]]:
    """The bounds of a Box as float64, and where they are bounds."""
    low, high = np.asarray(box.low, np.float64), np.asarray(box.high, np.float64)
    return low, high, low > -_UNBOUNDED, high < _UNBOUNDED


class Reader:
    """The function from an observation to the readings, (readings,).

    names: of the readings. is_measured: which of them are numbers of a Box, and not zeros and ones. scale: of each of
    these; as given, or, also where it is `running`, the largest size within its bounds, or 3 without bounds; two lists
    are means and scales. reads_reward: whether a reward is the last of the readings.

    Raises:
        ValueError: the scale is nothing of this; it is `running` and nothing is scaled; an observation is another
            thing.
    """

    def __init__(
        self, space: Any, scale: Any = None, what: str = "observations", *, reads_reward: bool = False
    ) -> None:
        self._parts = space_parts(space, what)
        self.names = [name for part in self._parts for name in part.names]
        self.is_measured = np.repeat([part.kind == "Box" for part in self._parts], [part.size for part in self._parts])
        self.scale = np.concatenate([_usual_scale(part) for part in self._parts])
        mean = np.zeros(len(self.names))
        if isinstance(scale, str) and scale == RUNNING:
            if not self.is_measured.any():
                raise ValueError(f"environment.scale={RUNNING} is for numbers of a Box, and {what} hold none")
        elif scale is not None:
            mean, self.scale = np.where(self.is_measured, _scale(scale, len(self.names)), [[0.0], [1.0]])
        ends = np.cumsum([part.size for part in self._parts])
        self._readers = [
            (part.path, _reader(part, mean[end - part.size : end], self.scale[end - part.size : end]))
            for part, end in zip(self._parts, ends, strict=True)
        ]
        self.reads_reward = reads_reward
        if reads_reward:
            self.names, self.is_measured = [*self.names, "reward"], np.append(self.is_measured, False)
            self.scale = np.append(self.scale, 1.0)

    def __call__(self, observation: Any, reward: float = 0.0) -> Floats:
        """The readings of an observation, and a reward where it is one, (readings,)."""
        if not self._readers[0][0]:  # a space without parts
            readings = self._readers[0][1](observation)
        else:
            readings = np.concatenate([read(_inner(observation, path)) for path, read in self._readers])
        return np.append(readings, reward) if self.reads_reward else readings

    def values(self, observation: Any) -> Floats:
        """Each measured number of an observation before its scale, 0 elsewhere, (readings without the reward,)."""
        return np.concatenate(
            [
                np.ravel(_inner(observation, part.path)).astype(np.float64)
                if part.kind == "Box"
                else np.zeros(part.size)
                for part in self._parts
            ]
        )

    def frozen(self, moments: Floats) -> list[list[float]]:
        """The means and scales by moments of `values`: their deviations, and its own scale where nothing moved."""
        count, mean, squares = moments
        deviation = np.sqrt(squares / np.maximum(count, 1.0))
        scale = np.where(deviation > _STILL * np.abs(mean), deviation, self.scale[: len(mean)])
        return [mean.tolist(), scale.tolist()]


def _inner(observation: Any, path: tuple[Any, ...]) -> Any:
    """The part of an observation to which these keys lead."""
    part = observation
    for key in path:
        try:
            part = part[key]
        except (IndexError, KeyError, TypeError):
            raise ValueError(f"an observation must have {'.'.join(map(str, path))}, got {observation!r}") from None
    return part


def moments(values: Floats) -> Floats:
    """The number of rows, their mean, and the sum of squared differences from it: (3, columns)."""
    mean = values.mean(axis=0)
    return np.array([np.full(len(mean), len(values)), mean, ((values - mean) ** 2).sum(axis=0)])


def merged(a: Floats, b: Floats) -> Floats:
    """The moments of two sets of rows together, after Chan et al. 1979. a, b: as from `moments`."""
    count, apart = np.maximum(a[0] + b[0], 1.0), b[1] - a[1]
    squares = a[2] + b[2] + apart**2 * a[0] * b[0] / count
    return np.array([a[0] + b[0], a[1] + apart * b[0] / count, squares])


def _scale(value: Any, count: int) -> Floats:
    """The means and the scales, (2, count)."""
    pair = np.zeros((2, count))
    with suppress(TypeError, ValueError):  # of what is no array of numbers
        scale = np.asarray(value, np.float64)
        if scale.shape in ((), (count,), (2, count)):
            pair[0 if scale.ndim == 2 else 1 :] = scale
    if not (np.isfinite(pair).all() and (pair[1] > 0).all()):  # the scales are still 0 where it is none of these
        needed = f"a number above 0, or {count} of them, or a list of {count} means and one of such numbers"
        raise ValueError(f"environment.scale must be {needed}, or {RUNNING}, or null, got {value}")
    return pair


def _usual_scale(part: Part) -> Floats:
    if part.kind != "Box":
        return np.ones(part.size)
    low, high, has_low, has_high = _bounds(part.space)
    largest = np.maximum(np.abs(low), np.abs(high))
    return np.ravel(np.where(has_low & has_high & (largest > 0), largest, _WIDE))


def _reader(part: Part, mean: Floats, scale: Floats) -> Callable[[Any], Floats]:
    space, count = part.space, part.size
    if part.kind in ("Discrete", "MultiDiscrete"):
        sizes = np.ravel(space.n if part.kind == "Discrete" else space.nvec)
        lowest, first = np.broadcast_to(np.ravel(space.start), sizes.shape), np.cumsum(sizes) - sizes

        def placed(observation: Any) -> Floats:
            places, readings = np.asarray(observation).astype(np.int64).ravel() - lowest, np.zeros(count)
            if places.shape != sizes.shape or not ((places >= 0) & (places < sizes)).all():
                ends = f"{lowest.tolist()} to {(lowest + sizes - 1).tolist()}"
                raise ValueError(f"an observation must be from {ends}, got {observation!r}")
            readings[first + places] = 1.0
            return readings

        return placed
    shrink, is_box, is_moved = 1.0 / scale, part.kind == "Box", bool(mean.any())

    def shrunk(observation: Any) -> Floats:
        values = np.asarray(observation, np.float64).ravel()
        if values.shape != shrink.shape:
            raise ValueError(f"an observation must be of {count} numbers, got {observation!r}")
        # A copy, since faults change readings.
        readings: Floats = np.tanh((values - mean if is_moved else values) * shrink) if is_box else values.copy()
        if math.isnan(readings @ readings):  # the fastest way to find one
            raise ValueError(f"an observation must be of numbers, got {observation!r}")
        return readings

    return shrunk


def actor(space: Any) -> Callable[[Floats], Any]:
    """The function from the outputs, (outputs,), to an action; a ValueError for a text, or bounds on one side alone."""
    match space_kind(space):
        case "Dict":
            turns = dict(zip(space.spaces, _part_actors(list(space.spaces.values())), strict=True))
            return lambda outputs: {key: turn(outputs) for key, turn in turns.items()}
        case "Tuple":
            each = _part_actors(list(space.spaces))
            return lambda outputs: tuple(turn(outputs) for turn in each)
        case "Discrete":
            first = int(space.start)
            return lambda outputs: first + int(outputs.argmax())
        case "MultiDiscrete":
            ends, start, dtype = np.cumsum(space.nvec), space.start, space.dtype

            def place(outputs: Floats) -> Any:
                largest = [group.argmax() for group in np.split(outputs, ends[:-1])]
                return (start + np.reshape(largest, start.shape)).astype(dtype)

            return place
        case "MultiBinary":
            return lambda outputs: (outputs > 0).astype(space.dtype).reshape(space.shape)
        case "Text":
            raise ValueError(f"actions must be of {', '.join(_KINDS[:-1])}, Dict or Tuple of these, and one is a Text")
    return _box_actor(space)


def _part_actors(spaces: list[Any]) -> list[Callable[[Floats], Any]]:
    """For each space the function from all outputs to its action."""
    sizes = [sum(part.size for part in _walk(space, ())) for space in spaces]
    ends = np.cumsum(sizes).tolist()

    def part_actor(space: Any, begin: int, end: int) -> Callable[[Floats], Any]:
        turn = actor(space)
        return lambda outputs: turn(outputs[begin:end])

    return [part_actor(space, end - size, end) for space, size, end in zip(spaces, sizes, ends, strict=True)]


def _box_actor(space: Any) -> Callable[[Floats], Any]:
    low, high, has_low, has_high = _bounds(space)
    if (has_low != has_high).any():
        number = int(np.flatnonzero(has_low != has_high)[0])
        ends = f"{low.flat[number]:g} to {high.flat[number]:g}"
        raise ValueError(
            f"action {number} has a bound on one side alone ({ends}), and outputs go from -1 to 1; give an environment "
            "of your own that makes this one in gymnasium.wrappers.TransformAction(env, FUNCTION, Box(-1, 1, SHAPE))"
        )
    low, high = np.where(has_low, low, -1.0), np.where(has_low, high, 1.0)
    middle, half = (high + low) / 2.0, (high - low) / 2.0
    kind, is_whole = space.dtype, np.issubdtype(space.dtype, np.integer)
    if is_whole:
        return lambda outputs: np.asarray(np.rint(middle + outputs.reshape(middle.shape) * half), kind)
    if not middle.any() and middle.ndim == 1:
        return lambda outputs: (outputs * half).astype(kind)
    return lambda outputs: np.asarray(middle + outputs.reshape(middle.shape) * half, kind)


def unbounded(space: Any) -> list[int]:
    """The numbers of the outputs for actions of a Box that have no bounds."""
    places, begin = list[int](), 0
    for part in _walk(space, ()):
        if part.kind == "Box":
            places += (begin + np.flatnonzero(~_bounds(part.space)[2])).tolist()
        begin += part.size
    return places
