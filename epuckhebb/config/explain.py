"""What Hydra and OmegaConf say is wrong, in the words of our own messages."""

import re

from hydra.errors import MissingConfigException, OverrideParseException

from epuckhebb.config.conf import groups, rows
from epuckhebb.config.schema import said
from epuckhebb.config.words import choices_of, near_keys
from epuckhebb.runtime.errors import did_you_mean, question

_EXTRAS = {"submitit": "slurm", "ray": "ray"}  # what is missing of Hydra's -> the extra of this package that has it
_KINDS = {"Float": "a number", "Integer": "a whole number", "Boolean": "true or false"}  # OmegaConf's words, and ours
_LEFT_OUT = ("object_type=", "reference_type=", "full_key:", "To append to your ")
_HOW_TO_WRITE = """
Settings are written KEY=VALUE, for example scenario=4obstacles or hebbian.N=0.002
Signs such as ~ need quotes within quotes, for example "genome='~/champion.npz'\""""


def explain(error: BaseException) -> str:
    """Hydra's message, made fit for a reader: the file and the key first, causes included, near names named."""
    if said(error) != str(error).splitlines()[0]:
        return said(error)
    if isinstance(error, MissingConfigException) and error.missing_cfg_file:
        return _missing(error, error.missing_cfg_file)
    if isinstance(error, OverrideParseException):
        return f"{error.override} cannot be read{_HOW_TO_WRITE}"
    whole = "\n".join(map(str, _causes(error)))
    lines = [line.strip() for line in whole.splitlines()]
    lines = list(dict.fromkeys(line for line in lines if line and not line.startswith(_LEFT_OUT)))
    several = re.search(r"Ambiguous value for argument '([^']*)'", whole)
    if several:
        return f"{several[1]} has several values; to do a run with each of them, add -m (--multirun)" + (
            f". A number is written {several[1].partition('=')[2].replace(',', '.')}"
            if re.search(r"=\d+,\d+$", several[1])
            else ""
        )
    key = re.search(r"full_key: (\S+)", whole)
    if not key:
        return "\n".join(lines)
    file = re.match(r"In '(\w+)/([^']+)'", whole)
    return _of_file(file[1], file[2], key[1], lines[-1]) if file else _of_key(key[1], lines[-1])


def _causes(error: BaseException) -> list[BaseException]:
    """An error and its causes; under a debugger, OmegaConf gives an error itself as its cause."""
    found = [error]
    while (cause := found[-1].__cause__) is not None and cause not in found:
        found.append(cause)
    return found


def _missing(error: MissingConfigException, missing: str) -> str:
    """What to say of a choice of a group that is not there."""
    group, _, name = missing.rpartition("/")
    launcher = _EXTRAS.get(name.partition("_")[0]) if group == "hydra/launcher" else None
    if launcher:
        return f'there is no {group}={name}\nThis launcher is a plug-in: pip install "epuckhebb[{launcher}]"'
    file = re.match(r"In '(\w+/[^']+)': Could not load", str(error))
    known = groups("evolve").get(group, groups("evaluate").get(group, []))
    if file:
        return f"{file[1]}.yaml: there is no {group}={name}, which its defaults name{did_you_mean(name, known, 3)}"
    options = list(error.options or known)
    changed = [f"{one}_{change}" for one in options for change in rows("change")] if group == "scenario" else []
    return (
        f"there is no {group}={name}{did_you_mean(name, [*options, *changed], 3)}\n{choices_of(group, options)}\n"
        f"Is it a file of yours, {group}/{name}.yaml? Then add --config-dir and the folder of {group}/"
    )


def _of_file(group: str, name: str, key: str, message: str) -> str:
    """What to say of a key in a file of a group."""
    file, unknown = f"{group}/{name}.yaml", re.match(r"Key '([^']+)' not in", message)
    if not unknown:
        return f"{file}: {_of_key(key, message)}"
    if unknown[1] == group == "experiment":
        return f"{file} must begin with the line `# @package _global_`: its keys are those of the whole configuration"
    if unknown[1] == group:
        return f"{file}: leave out the line `{group}:`, and begin the keys below it at the left edge"
    return f"{file}: there is no key {key}{question(near_keys('evaluate', key))}"


def _of_key(key: str, message: str) -> str:
    """What OmegaConf says of a key or its value."""
    kind = re.match(r"Value '(.*)' of type '\w+' could not be converted to (\w+)", message)
    if kind and kind[2] in _KINDS:
        return f"{key} must be {_KINDS[kind[2]]}, got {kind[1]}"
    if "is not Optional" in message or message.startswith("Incompatible value 'None'"):
        return f"{key} must have a value, got null"
    return f"there is no key {key}" if message.startswith("Key ") else f"{key}: {message}"
