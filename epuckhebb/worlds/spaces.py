"""From observations to readings and from outputs to actions, for the spaces of Gymnasium.

A reading of a Box is tanh(x / scale); a Discrete observation is a 1 among zeros. An action of a Box is the outputs,
from -1 to 1, between its bounds; of a Discrete it is the place of the largest output.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.arrays import Floats

_KINDS = ("Box", "Discrete")
_UNBOUNDED = 1e30  # bounds from here on are written for none, as the largest float32 is
_WIDE = 3.0  # scale of readings without bounds


def size_of(space: Any, what: str) -> int:
    """How many readings or outputs a space needs; a ValueError if it is none of Box and Discrete. what: has it."""
    kind = type(space).__name__
    if kind not in _KINDS:
        raise ValueError(f"{what} must be of {' or '.join(_KINDS)}, and are of {kind}")
    return int(space.n if kind == "Discrete" else max(1, np.prod(space.shape)))


def _bounds(box: Any) -> tuple[Floats, Floats, NDArray[np.bool_], NDArray[np.bool_]]:
    """The bounds of a Box as float64, and where they are bounds."""
    low, high = np.asarray(box.low, np.float64), np.asarray(box.high, np.float64)
    return low, high, low > -_UNBOUNDED, high < _UNBOUNDED


def scale_of(space: Any, given: Any) -> Floats:
    """The scale of each reading, (readings,): as given, or its largest size within its bounds, or 3 without bounds.

    Raises:
        ValueError: what is given is no number above 0, nor one for each reading.
    """
    count = size_of(space, "observations")
    if given is not None:
        try:
            scale = np.asarray(given, np.float64)
        except (TypeError, ValueError):
            scale = np.zeros(())
        if scale.shape not in ((), (count,)) or not (np.isfinite(scale).all() and (scale > 0).all()):
            raise ValueError(f"environment.scale must be a number above 0, or {count} of them, or null, got {given}")
        return np.broadcast_to(scale, count)
    if type(space).__name__ == "Discrete":
        return np.ones(count)
    low, high, has_low, has_high = _bounds(space)
    largest = np.maximum(np.abs(low), np.abs(high))
    return np.ravel(np.where(has_low & has_high & (largest > 0), largest, _WIDE))


def reader(space: Any, scale: Floats) -> Callable[[Any], Floats]:
    """The function from an observation to the readings, (readings,); it raises a ValueError for any other thing."""
    count = len(scale)
    if type(space).__name__ == "Discrete":
        first, eye = int(space.start), np.eye(count)

        def place(observation: Any) -> Floats:
            number = int(observation) - first
            if not 0 <= number < count:
                raise ValueError(f"an observation must be from {first} to {first + count - 1}, got {observation!r}")
            return np.array(eye[number])

        return place
    shrink = 1.0 / scale

    def shrunk(observation: Any) -> Floats:
        values = np.asarray(observation, np.float64).ravel()
        if values.shape != shrink.shape:
            raise ValueError(f"an observation must be of {count} numbers, got {observation!r}")
        readings: Floats = np.tanh(values * shrink)
        if np.isnan(readings.sum()):
            raise ValueError(f"an observation must be of numbers, got {observation!r}")
        return readings

    return shrunk


def actor(space: Any) -> Callable[[Floats], Any]:
    """The function from the outputs, (outputs,), to an action; a ValueError for bounds on one side alone."""
    if type(space).__name__ == "Discrete":
        first = int(space.start)
        return lambda outputs: first + int(outputs.argmax())
    low, high, has_low, has_high = _bounds(space)
    if (has_low != has_high).any():
        place = int(np.flatnonzero(has_low != has_high)[0])
        ends = f"{low.flat[place]:g} to {high.flat[place]:g}"
        raise ValueError(
            f"action {place} has a bound on one side alone ({ends}), and outputs go from -1 to 1; give an environment "
            "of your own that makes this one in gymnasium.wrappers.TransformAction(env, FUNCTION, Box(-1, 1, SHAPE))"
        )
    low, high = np.where(has_low, low, -1.0), np.where(has_low, high, 1.0)
    middle, half = (high + low) / 2.0, (high - low) / 2.0
    kind, is_whole = space.dtype, np.issubdtype(space.dtype, np.integer)
    if is_whole:
        return lambda outputs: np.rint(middle + outputs.reshape(middle.shape) * half).astype(kind)
    if not middle.any() and middle.ndim == 1:
        return lambda outputs: (outputs * half).astype(kind)
    return lambda outputs: (middle + outputs.reshape(middle.shape) * half).astype(kind)


def unbounded(space: Any) -> list[int]:
    """The numbers of the actions of a Box that have no bounds."""
    return [] if type(space).__name__ == "Discrete" else np.flatnonzero(~_bounds(space)[2]).tolist()
