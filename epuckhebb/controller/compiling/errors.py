"""Why a user's part does not compile, in ten lines."""

import inspect
import re
from collections.abc import Callable
from typing import Any

_LINES = 10  # of a message, at most
_COLOUR = re.compile(r"\x1b\[[0-9;]*m")  # numba colours its messages where it can
_MAKES_AN_ARRAY = "Only accept returning of array passed into the function"  # what it says without memory of its own


class NotCompiledError(ValueError):
    """A plasticity rule or another part cannot be compiled; the message says why."""


def explained(what: str, function: Callable[..., Any], error: Exception, stores: str = "") -> NotCompiledError:
    """The error of a part that does not compile: numba's last reason for the innermost function.

    what: the part, for example `rule oja`. function: its compiled function. stores: the name of its state, if any.
    """
    text = _COLOUR.sub("", str(error))
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    causes = [number for number, line in enumerate(lines) if line.startswith("Rejected as")]
    reason = [line for line in lines[causes[-1] + 1 if causes else 0 :] if "Failed in nopython mode" not in line]
    reason = reason[: next((number for number, line in enumerate(reason) if line.startswith("During: Pass")), None)]
    if isinstance(error, KeyError) and stores:
        reason = [f"`{stores}` has no {text}"]
    if _MAKES_AN_ARRAY in text:
        instead = f": put what it stores into `{stores}`" if stores else ""
        reason = [f"it makes an array, and `{function.__name__}` has only numbers{instead}"]
    heading = f"{what} of {inspect.getsourcefile(function)} does not compile:"
    return NotCompiledError("\n".join([heading, *dict.fromkeys(reason)][:_LINES]))
