"""Why a user's part does not compile, in ten lines."""

import inspect
import re
import traceback
from collections.abc import Sequence
from pathlib import Path
from typing import Any

_OURS = Path(__file__).parents[2]

_LINES = 10  # of a message, at most
_COLOUR = re.compile(r"\x1b\[[0-9;]*m")  # numba colours its messages where it can
_MAKES_AN_ARRAY = "Only accept returning of array passed into the function"  # what it says without memory of its own
_WRITES = "Cannot modify readonly array"
MUST_GIVE_A_NUMBER = "must give a number"


class PartError(ValueError):
    """A part of the user's failed, or gave what it may not give; the message says which, and what it gave."""


class NotCompiledError(PartError):
    """A plasticity rule or another part cannot be compiled; the message says why."""


def failed(what: str, error: BaseException) -> PartError:
    """The error of a part that raised another one: what it raised, and in which line. what: the part, in messages."""
    frames = traceback.extract_tb(error.__traceback__)
    lines = [frame.lineno for frame in frames if not Path(frame.filename).is_relative_to(_OURS)]
    where = f" in line {lines[0]}" if lines else ""
    return PartError(f"{what} failed{where}: {type(error).__name__}: {error}")


def explained(parts: Sequence[Any], error: Exception) -> PartError:
    """The error of compiled parts of the user's: what they raised, or why they do not compile.

    Then it is numba's last reason for the innermost function.
    """
    names = " or ".join(f"{part.KEY}={inspect.getsourcefile(part)}:{part.__name__}" for part in parts)
    modules = (str(frame.f_globals.get("__name__")) for frame, _ in traceback.walk_tb(error.__traceback__))
    if not any(module.startswith("numba.") for module in modules):  # machine code raised it, and no compiler
        return failed(names, error)
    text = _COLOUR.sub("", str(error))
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    causes = [number for number, line in enumerate(lines) if line.startswith("Rejected as")]
    reason = [line for line in lines[causes[-1] + 1 if causes else 0 :] if "Failed in nopython mode" not in line]
    reason = reason[: next((number for number, line in enumerate(reason) if line.startswith("During: Pass")), None)]
    if isinstance(error, KeyError):
        reason = [f"its state or its settings have no {text}"]
    if _MAKES_AN_ARRAY in text:
        reason = ["it makes an array, and may have only numbers: put what it stores into its state"]
    if _WRITES in text:
        reason = ["it writes into an array that it is handed, and others read it after it: write into its state"]
    if match := re.search(f"{MUST_GIVE_A_NUMBER}.*", text):
        reason = [f"{' or '.join(f'`{part.METHODS[0]}`' for part in parts if part.METHODS)} {match[0]}"]
    lines = [f"{names} does not compile:", *dict.fromkeys(reason)][:_LINES]
    return NotCompiledError((" " if len(lines) == 2 else "\n").join(lines))
