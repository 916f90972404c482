"""Why a plasticity rule does not compile, in ten lines."""

import inspect
import re

from epuckhebb.sim.plasticity.rule import Rule

_LINES = 10  # of a message, at most
_COLOUR = re.compile(r"\x1b\[[0-9;]*m")  # numba colours its messages where it can
_MAKES_AN_ARRAY = "Only accept returning of array passed into the function"  # what it says without memory of its own


class RuleError(ValueError):
    """A plasticity rule cannot be compiled; the message says why."""


def explained(rule: type[Rule], error: Exception) -> RuleError:
    """The error of a rule that does not compile: numba's last reason for the innermost function."""
    text = _COLOUR.sub("", str(error))
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    causes = [number for number, line in enumerate(lines) if line.startswith("Rejected as")]
    reason = [line for line in lines[causes[-1] + 1 if causes else 0 :] if "Failed in nopython mode" not in line]
    reason = reason[: next((number for number, line in enumerate(reason) if line.startswith("During: Pass")), None)]
    if _MAKES_AN_ARRAY in text:
        reason = ["it makes an array, and a synapse has only numbers: put what it stores into `synapse_state`"]
    heading = f"rule {rule.__name__} of {inspect.getsourcefile(rule.synapse)} does not compile:"
    return RuleError("\n".join([heading, *dict.fromkeys(reason)][:_LINES]))
