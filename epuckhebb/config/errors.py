"""Makes one line of what Hydra, OmegaConf and YAML say is wrong."""

import re
from collections.abc import Sequence

import yaml

from epuckhebb.runtime import did_you_mean
from epuckhebb.runtime.yaml_file import error_text

_KEY = "full_key:"  # before the key, on a line of its own
_NOISE = ("object_type=", "reference_type=", "provider=")  # lines that say nothing to a user
_WRONG = re.compile(r"Could not (?:find|load) '([\w/]+)/([^/']+)'|Error merging override [+~]*([^\s=]+)=")
_EXTRAS = {"submitit": "slurm", "ray": "ray"}  # launcher -> the extra of this package that has it


def explain(error: BaseException) -> str:
    """What Hydra, OmegaConf or YAML says is wrong, in one line: what they add about themselves is left out."""
    if isinstance(error, RecursionError):
        return "a file's defaults lead back to itself, or its settings stand too deep in one another"
    causes: list[BaseException] = [error]
    while (cause := causes[-1].__cause__) is not None and cause not in causes:  # one may be its own, in a debugger
        causes.append(cause)
    lines, keys = dict[str, None](), list[str]()
    for cause in causes:
        if isinstance(cause, yaml.MarkedYAMLError) and cause.problem_mark:
            return f"{cause.problem_mark.name}{error_text(cause)}"
        for line in map(str.strip, str(cause).partition("Config search path")[0].splitlines()):
            if line.startswith(_KEY):
                keys.append(line.removeprefix(_KEY).strip())
            elif line and not line.startswith(_NOISE) and not (" " in line and any(line in other for other in lines)):
                lines[line] = None  # a word alone is the name of a choice
    message = " ".join(lines) or type(error).__name__
    if keys and keys[0] not in message:
        message = f"{keys[0]}: {message}"
    message = re.sub(r"(In '\S+': )?Could not find '(\w+)/([^']+)' Available options in '\w+': (.*)", _choice, message)
    message = re.sub("Interpolation key '(.+)' not found", r"it refers to \1, which is missing", message)
    message = re.sub(
        "ValueError raised .*HydraConfig was not set", "${hydra:...} acts in hydra.* alone; list the values", message
    )
    message = re.sub("To append to your config .*", "keys of ga are those of optimizer=ga alone", message)
    launcher = re.search(rf"'hydra/launcher/({'|'.join(_EXTRAS)})(_\w+)?'", message)
    if launcher:
        message = message.removesuffix(".")
        message += f'; this launcher is a plug-in: pip install "epuckhebb[{_EXTRAS[launcher[1]]}]"'
    return message


def wrong_of(words: Sequence[str], error: BaseException) -> Sequence[str]:
    """The overrides that Hydra says are wrong; all of them where it names none."""
    if not (found := _WRONG.search(str(error))):
        return words
    key, value = found[1] or found[3], found[2] or ""
    return [word for word in words if word.lstrip("+~").partition("=")[0] == key and value in word] or words


def _choice(found: re.Match[str]) -> str:
    known = found[4].split()
    return f"must be one of {', '.join(known)}{did_you_mean(found[3], known)}"
