"""Makes one line of what Hydra, OmegaConf and YAML say is wrong."""

import re

import yaml

_NOISE = ("full_key:", "object_type=", "reference_type=", "provider=")  # lines that say nothing to a user
_EXTRAS = {"submitit": "slurm", "ray": "ray", "joblib": "parallel"}  # launcher -> the extra of this package that has it


def explain(error: BaseException) -> str:
    """What Hydra, OmegaConf or YAML says is wrong, in one line: what they add about themselves is left out."""
    if isinstance(error, RecursionError):
        return "a file's defaults lead back to itself, or its settings stand too deep in one another"
    lines: list[str] = []
    cause: BaseException | None = error
    while cause is not None and len(lines) < 50:  # an error may be its own cause, in a debugger
        if isinstance(cause, yaml.MarkedYAMLError) and cause.problem_mark:
            return f"{cause.problem_mark.name}{line_of(cause)}"
        told = str(cause).partition("Config search path")[0].splitlines()
        lines += [line.strip() for line in told if line.strip() and not line.strip().startswith(_NOISE)]
        key = getattr(cause, "full_key", None)
        if key and not any(str(key) in line for line in lines):
            lines.insert(0, f"{key}:")
        cause = cause.__cause__
    message = " ".join(dict.fromkeys(lines)) or type(error).__name__
    launcher = re.search(r"hydra/launcher/(\w+?)(_\w+)?'", message)
    if launcher and launcher[1] in _EXTRAS:
        message += f'; this launcher is a plug-in: pip install "epuckhebb[{_EXTRAS[launcher[1]]}]"'
    return message


def line_of(error: yaml.MarkedYAMLError) -> str:
    """The line of what is wrong in a YAML file, and what it is."""
    mark = error.problem_mark or error.context_mark
    reason = ", ".join(filter(None, (error.context, error.problem)))
    return f", line {mark.line + 1}: {reason}" if mark else f": {reason}"
