"""The words of a call, KEY=VALUE: what is refused before Hydra composes anything of them, and what Hydra refuses."""

import functools
import re
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from hydra.core.override_parser.types import ChoiceSweep, Glob, Override, Sweep
from hydra.errors import MissingConfigException
from omegaconf import OmegaConf

from epuckhebb.config.build import not_its_settings
from epuckhebb.config.overrides import parsed
from epuckhebb.config.parts import GENETIC
from epuckhebb.config.schema import OPEN, SCHEMAS, said
from epuckhebb.runtime import ConfigError, conf, data_folder, did_you_mean, near, question

_WHOLE = {"network": "network.wiring={}", "compare": "compare=[{}]"}  # keys that are no groups; a name, as it is given
_BOTH = ("evaluate", "evolve")  # a misspelt key of one may be a key of the other
_BELOW = tuple(f"{key}." for key in (*OPEN, "hydra"))  # the schema does not know what keys there are
_MANY, _SOME = 30, 4  # choices that are no longer listed in a message, and how many of them are
_FEW = 3  # names in a question
_KINDS = {"Float": "a number", "Integer": "a whole number", "Boolean": "true or false"}  # OmegaConf's words, and ours
_EXTRAS = {"submitit": "slurm", "ray": "ray"}  # what is missing of Hydra's -> the extra of this package that has it


def check_words(command: str, words: Sequence[str], config_dir: str | None = None, *, several: bool = False) -> None:
    """Refuse what is no text, no key or no choice, and what Hydra ends with a traceback.

    several: whether a key may have several values, a job for each.
    """
    for word in words:
        if any("\ud800" <= sign <= "\udfff" for sign in word):
            raise ConfigError(f"{word!r} is no text in the encoding of this system, {sys.getfilesystemencoding()}")
    overrides = parsed(word for word in words if not word.startswith("-"))
    choices = conf.groups(command)
    named = [one.value() for one in overrides if one.key_or_group in ("optimizer", "optimizer.algorithm")]
    optimizer = named[-1] if named else GENETIC
    for override in overrides:
        key, value = override.key_or_group, override.value()
        if key.partition(".")[0] == GENETIC and isinstance(optimizer, str) and optimizer != GENETIC:
            raise not_its_settings(optimizer)
        if key == "changed":
            raise ConfigError("changed is filled in by the program, with what differs from the named scenario")
        if override.is_sweep_override() and not several:
            line = str(override.input_line)
            number = f". A number is written {line.replace(',', '.')}" if re.search(r"=\d+,\d+$", line) else ""
            raise ConfigError(f"{line} has several values; to do a run with each of them, add -m (--multirun){number}")
        if isinstance(value, ChoiceSweep) and any(isinstance(one, Sweep | Glob) for one in value.list):
            raise ConfigError(f"{override.input_line}: a list of values has no ranges in it; give one range, or values")
        if key in choices or "/" in key or _is_folder(key, config_dir):
            _check_choice(override, choices.get(key, []))
        elif key in _WHOLE and isinstance(value, str) and "{" not in value:
            raise ConfigError(f"{key} has settings, and no choices; give {_WHOLE[key].format(value)}")
        elif key not in known_keys(command) and key != "hydra" and not key.startswith(_BELOW):
            raise ConfigError(_no_key(command, key, value))


def _check_choice(override: Override, known: Sequence[str]) -> None:
    """Refuse what is no name of a choice of a group, nor its settings; nothing but a name can be deleted, either."""
    key, value = override.key_or_group, override.value()
    names = value if isinstance(value, list) and not override.is_delete() else [value]
    settings = isinstance(value, dict) and key == "change"
    if settings or override.is_sweep_override() or (override.is_delete() and value is None):
        return
    if isinstance(value, list) and known and key != "change":
        each = ",".join(map(str, value))
        raise ConfigError(
            f"{override.input_line}: {key} must be one choice; for a run with each of them: -m {key}={each}"
        )
    if not all(isinstance(name, str) for name in names):
        quoted = f"; names that are numbers need quotes, \"{key}=['30']\"" if isinstance(value, list) else ""
        raise ConfigError(f"{override.input_line}: {_choices_of(key, known)}{quoted}")


def _choices_of(group: str, known: Sequence[str]) -> str:
    """What to say of the choices that a group has."""
    if len(known) > _MANY:
        some = f"one of its {len(known)} choices, for example {', '.join(known[:_SOME])}"
        return f"{group} must be {some}; `epuckhebb keys {group}` lists all"
    changed = ", or one of these with changes, for example base_slip_left" if group == "scenario" else ""
    return f"{group} must be one of {', '.join(known)}{changed}" if known else f"{group} must be the name of a file"


def _is_folder(key: str, config_dir: str | None) -> bool:
    """Whether a key is a group that no command has by itself: of a file's, or of the user's."""
    if any(key in known_keys(command) for command in SCHEMAS):
        return False
    return any((Path(folder) / key).is_dir() for folder in (data_folder("conf"), config_dir) if folder)


def _no_key(command: str, key: str, value: Any) -> str:
    """What to say of a key that is not there: whose key it is, or which are like it."""
    owners = [other for other in SCHEMAS if key in known_keys(other)]
    if owners:
        example = f": epuckhebb evaluate genome=latest {key}=..." if owners == ["evaluate"] else ""
        return f"there is no key {key} of `epuckhebb {command}`; it is one of `epuckhebb {owners[0]}`{example}"
    of_value = [f"{group}={value}" for group, choices in conf.groups(command).items() if value in choices]
    like = of_value if value not in (None, "none") and len(of_value) == 1 else _near_keys(command, key)
    return f"there is no key {key}{question(like)}"


def _near_keys(command: str, key: str) -> list[str]:
    """The keys that are like one that is not there: those whose last part is most like its, of a group like its."""
    group, _, last = key.rpartition(".")
    commands = _BOTH if command in _BOTH else (command,)
    known = sorted({name for one in commands for name in (*known_keys(one), *dict(conf.keys_with_defaults(one)))})
    of_last = near(last, [name.rpartition(".")[2] for name in known], 1)
    names = [name for name in known if name.rpartition(".")[2] in of_last]
    open_ = [f"{one}.{last}" for one in near(group, [one for one in OPEN if "." not in one], 1)]
    return near(key, [*open_, *names], 1) if group else names[:_FEW]


@functools.cache
def known_keys(command: str) -> frozenset[str]:
    """All keys and groups of a command that the schema knows, as they are written in an override."""
    schema = OmegaConf.to_container(OmegaConf.structured(SCHEMAS[command]))
    assert isinstance(schema, dict)
    return frozenset([*keys_below(schema), *conf.groups(command)])


def keys_below(node: Mapping[Any, Any], prefix: str = "") -> Iterator[str]:
    """All keys of plain settings, dotted; of a list, only its own."""
    for key, value in node.items():
        yield f"{prefix}{key}"
        if isinstance(value, dict):
            yield from keys_below(value, f"{prefix}{key}.")


def explain(error: BaseException) -> str:
    """What Hydra or OmegaConf says is wrong, made fit for a reader: the file and the key first."""
    if said(error) != next(iter(str(error).splitlines()), ""):
        return said(error)
    if isinstance(error, MissingConfigException) and error.missing_cfg_file:
        return _missing(error, error.missing_cfg_file)
    causes = [error]
    while (cause := causes[-1].__cause__) is not None and cause not in causes:  # one may be its own, in a debugger
        causes.append(cause)
    whole = "\n".join(filter(None, map(str, causes))) or type(error).__name__
    found = re.search(r"(.*)\n *full_key: (\S+)", whole)
    if not found:
        return whole
    (message, key), file = found.groups(), re.match(r"In '(\w+)/([^']+)'", whole)
    where = f"{file[1]}/{file[2]}.yaml: " if file else ""
    kind = re.match(r"Value '(.*)' of type '\w+' could not be converted to (\w+)", message)
    if kind and kind[2] in _KINDS:
        return f"{where}{key} must be {_KINDS[kind[2]]}, got {kind[1]}"
    if "is not Optional" in message or "value 'None'" in message:
        return f"{where}{key} must have a value, got null"
    if not message.startswith("Key "):
        return f"{where}{key}: {message}"
    if file and re.match(rf"Key '{file[1]}' ", message):
        return (
            f"{where}leave out the line `{file[1]}:`, or begin with the line `# @package _global_` if keys of other "
            "groups follow"
        )
    return f"{where}there is no key {key}{question(_near_keys('evaluate', key)) if file else ''}"


def _missing(error: MissingConfigException, missing: str) -> str:
    """What to say of a choice of a group that is not there."""
    group, _, name = missing.rpartition("/")
    launcher = _EXTRAS.get(name.partition("_")[0]) if group == "hydra/launcher" else None
    if launcher:
        return f'there is no {group}={name}; this launcher is a plug-in: pip install "epuckhebb[{launcher}]"'
    known = list(error.options or conf.groups("evolve").get(group, conf.groups("evaluate").get(group, [])))
    changed = [f"{one}_{change}" for one in known for change in conf.rows("change")] if group == "scenario" else []
    file = re.match(r"In '(\w+/[^']+)': Could not load", str(error))
    return (
        f"{f'{file[1]}.yaml: ' if file else ''}there is no {group}={name}{did_you_mean(name, [*known, *changed], 3)}\n"
        f"{_choices_of(group, known)}\n"
        f"Is it a file of yours, {group}/{name}.yaml? Then add --config-dir and the folder of {group}/"
    )
