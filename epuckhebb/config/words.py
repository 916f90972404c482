"""The words of a call, KEY=VALUE, before Hydra composes anything of them: what is no key, and what is like it."""

import functools
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import ChoiceSweep, Glob, Override, Sweep
from hydra.errors import HydraException
from omegaconf import OmegaConf

from epuckhebb.config.build import not_its_settings
from epuckhebb.config.conf import groups, keys_with_defaults
from epuckhebb.config.parts import GENETIC
from epuckhebb.config.schema import OPEN, SCHEMAS
from epuckhebb.runtime.errors import ConfigError, near, question
from epuckhebb.runtime.resources import data_folder

_BOTH = ("evaluate", "evolve")  # a misspelt key of one may be a key of the other
_MANY, _SOME = 30, 4  # choices that are no longer listed in a message, and how many of them are
_OF_ANY_KEYS = [group for group in OPEN if "." not in group]
_FEW = 3  # names in a question


def check_words(command: str, words: list[str], config_dir: str | None = None) -> None:
    """Refuse what is no text, what is no key, `changed`, and what Hydra ends with a traceback.

    That is a group that is given something else than a name, and settings of the GA for another optimizer.
    """
    for word in words:
        if any("\ud800" <= sign <= "\udfff" for sign in word):
            raise ConfigError(
                f"{word!r} has signs that are no text in the encoding of this system, {sys.getfilesystemencoding()}; "
                "set PYTHONUTF8=1 if it is UTF-8"
            )
    try:
        overrides = OverridesParser.create().parse_overrides([word for word in words if not word.startswith("-")])
    except HydraException:
        return  # Hydra will say what is wrong with it
    choices = groups(command)
    named = [one.value() for one in overrides if one.key_or_group in ("optimizer", "optimizer.algorithm")]
    optimizer = named[-1] if named else GENETIC
    for override in overrides:
        key = override.key_or_group
        if key.partition(".")[0] == GENETIC and isinstance(optimizer, str) and optimizer != GENETIC:
            raise not_its_settings(optimizer)
        if key == "changed":
            raise ConfigError("changed is filled in by the program, with what differs from the named scenario")
        value: Any = override.value()
        if isinstance(value, ChoiceSweep) and any(isinstance(one, Sweep | Glob) for one in value.list):
            raise ConfigError(f"{override.input_line}: a list of values has no ranges in it; give one range, or values")
        if key in choices or "/" in key:
            _check_choice(override, choices)
        elif _is_key(command, key):
            continue
        elif _is_folder(key, config_dir):
            _check_choice(override, choices)
        else:
            raise ConfigError(no_key(command, key, value))


def _check_choice(override: Override, choices: Mapping[str, Sequence[str]]) -> None:
    """Refuse what is no name of a choice of a group, nor its settings; nothing but a name can be deleted, either."""
    key, value = override.key_or_group, override.value()
    whole = override.is_delete() and value is None
    settings = isinstance(value, dict) and key == "change"
    if whole or settings or override.is_sweep_override() or isinstance(value, str):
        return
    if isinstance(value, list) and not override.is_delete():
        if all(isinstance(name, str) for name in value):
            return
        quoted = ",".join(f"'{name}'" for name in value)
        raise ConfigError(f'{override.input_line}: names that are numbers need quotes, "{key}=[{quoted}]"')
    raise ConfigError(f"{override.input_line}: {choices_of(key, choices.get(key, []))}")


def choices_of(group: str, known: Sequence[str]) -> str:
    """What to say of the choices that a group has."""
    if len(known) > _MANY:
        some = ", ".join(known[:_SOME])
        return (
            f"{group} must be one of its {len(known)} choices, for example {some}; `epuckhebb keys {group}` lists all"
        )
    return f"{group} must be one of {', '.join(known)}" if known else f"{group} must be the name of a file"


def _is_folder(key: str, config_dir: str | None) -> bool:
    """Whether a key is a group that no command has by itself: of a file's, or of the user's."""
    if any(key in known_keys(command) for command in SCHEMAS):
        return False
    return any((Path(folder) / key).is_dir() for folder in (data_folder("conf"), config_dir) if folder)


def _is_key(command: str, key: str) -> bool:
    """Whether the schema has a key, or does not know what is below it."""
    known = known_keys(command)
    below = tuple(f"{open_}." for open_ in (*OPEN, "hydra"))
    return key in known or key == "hydra" or key.startswith(below)


def no_key(command: str, key: str, value: Any = None) -> str:
    """What to say of a key that is not there: whose key it is, or which are like it."""
    owners = [other for other in SCHEMAS if key in known_keys(other)]
    if owners and command not in owners:
        example = f": epuckhebb evaluate genome=latest {key}=..." if owners == ["evaluate"] else ""
        return (
            f"there is no key {key} of `epuckhebb {command}`\n"
            f"{key} is a key of `epuckhebb {'` and `epuckhebb '.join(owners)}`; give it there{example}"
        )
    of_value = [f"{group}={value}" for group, choices in groups(command).items() if value in choices]
    if value not in (None, "none") and len(of_value) == 1:
        return f"there is no key {key}{question(of_value)}"
    return f"there is no key {key}{question(near_keys(command, key))}"


def near_keys(command: str, key: str) -> list[str]:
    """The keys that are like one that is not there: those whose last part is most like its, of a group like its."""
    group, _, last = key.rpartition(".")
    commands = _BOTH if command in _BOTH else (command,)
    known = sorted({name for one in commands for name in (*known_keys(one), *dict(keys_with_defaults(one)))})
    of_last = near(last, [name.rpartition(".")[2] for name in known], 1)
    names = [name for name in known if name.rpartition(".")[2] in of_last]
    open_ = [f"{one}.{last}" for one in near(group, _OF_ANY_KEYS, 1)]  # the schema does not know what is below these
    return near(key, [*open_, *names], 1) if group else names[:_FEW]


@functools.cache
def known_keys(command: str) -> frozenset[str]:
    """All keys and groups of a command that the schema knows, as they are written in an override."""
    schema = OmegaConf.to_container(OmegaConf.structured(SCHEMAS[command]))
    assert isinstance(schema, dict)
    return frozenset([*keys_below(schema), *groups(command)])


def keys_below(node: Mapping[Any, Any], prefix: str = "") -> Iterator[str]:
    """All keys of plain settings, dotted; of a list, only its own."""
    for key, value in node.items():
        yield f"{prefix}{key}"
        if isinstance(value, dict):
            yield from keys_below(value, f"{prefix}{key}.")
