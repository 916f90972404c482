"""Plain mappings, as a file of `conf/` holds them, read key by key: what is wrong is told with the key as it is typed.

The functions take `where`, the key so far (`maze.walls.stem_left`), and what stands there.
"""

import difflib
import math
from collections.abc import Iterable, Mapping, Sequence
from typing import Any


def mapping(where: str, told: object) -> Mapping[str, Any]:
    """What is told, if it is keys with values.

    Raises:
        ValueError: it is something else, or a key is not a text.
    """
    if not isinstance(told, Mapping):
        raise _wrong(where, "keys with values", told)
    for key in told:
        if not isinstance(key, str):
            raise _wrong(where, "keys that are texts (quote what looks like a number)", key)
    return told


def keys(
    where: str, told: object, required: Iterable[str], optional: Iterable[str] = (), ignored: Iterable[str] = ()
) -> dict[str, Any]:
    """What is told, if its keys are those required and perhaps some optional ones; without those that are ignored.

    Raises:
        ValueError: it has no keys, a key is not known, or one is missing.
    """
    required, optional, ignored = tuple(required), tuple(optional), tuple(ignored)
    found = mapping(where, told)
    known = (*required, *optional, *ignored)
    for key in found:
        if key not in known:
            near = difflib.get_close_matches(key, known, n=1)
            meant = f"did you mean {where}.{near[0]}?" if near else f"known are {', '.join(known)}"
            raise ValueError(f"{where}.{key} is not known; {meant}")
    for key in required:
        if key not in found:
            raise ValueError(f"{where}.{key} is missing")
    return {key: value for key, value in found.items() if key not in ignored}


def number(where: str, told: object) -> float:
    """What is told, if it is a finite number; a text that looks like one is not.

    Raises:
        ValueError: it is something else.
    """
    if isinstance(told, bool) or not isinstance(told, int | float) or not math.isfinite(told):
        raise _wrong(where, "a finite number", told)
    return float(told)


def bound(where: str, told: object) -> float:
    """What is told, if it is a number or infinite.

    Raises:
        ValueError: it is something else.
    """
    if isinstance(told, float) and math.isinf(told):
        return told
    return number(where, told)


def whole(where: str, told: object) -> int:
    """What is told, if it is a whole number.

    Raises:
        ValueError: it is something else.
    """
    if isinstance(told, bool) or not isinstance(told, int):
        raise _wrong(where, "a whole number", told)
    return told


def text(where: str, told: object) -> str:
    """What is told, if it is a text that is not empty.

    Raises:
        ValueError: it is something else.
    """
    if not isinstance(told, str) or not told:
        raise _wrong(where, "a text", told)
    return told


def items(where: str, told: object) -> Sequence[object]:
    """What is told, if it is a list.

    Raises:
        ValueError: it is something else.
    """
    if isinstance(told, str) or not isinstance(told, Sequence):
        raise _wrong(where, "a list", told)
    return told


def row(where: str, told: object, names: Sequence[str]) -> list[float]:
    """What is told, if it is a list of as many finite numbers as there are names for them.

    Raises:
        ValueError: it is something else.
    """
    if isinstance(told, str) or not isinstance(told, Sequence) or len(told) != len(names):
        raise _wrong(where, f"[{', '.join(names)}]", told)
    return [number(f"{where}[{place}]", value) for place, value in enumerate(told)]


def _wrong(where: str, wanted: str, told: object) -> ValueError:
    return ValueError(f"{where} must be {wanted}, got {told!r}")
