"""Reads the overrides of a command line as Hydra does, and writes values, and the keywords of Python, as overrides."""

import difflib
import functools
import glob
import itertools
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any, get_origin

import numpy as np
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import ChoiceSweep, Glob, IntervalSweep, Override, Sweep
from hydra.errors import HydraException
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from epuckhebb.adaptation.adaptation import NONE, Adaptation
from epuckhebb.config.plugins import object_text
from epuckhebb.config.schema import SCHEMAS
from epuckhebb.config.values import field_types, without_none
from epuckhebb.controller.own_class import OwnClass
from epuckhebb.runtime import ConfigError, conf, data_folder, did_you_mean
from epuckhebb.runtime.yaml_file import check_keys, check_numbers
from epuckhebb.tmaze.own_fitness import Fitness

RUN_DIR, SWEEP_DIR = "hydra.run.dir=", "hydra.sweep.dir="
_FORCED_DIR = re.compile(rf"^\+\+(?={RUN_DIR}|{SWEEP_DIR})")
_PLAIN = re.compile(r"[A-Za-z0-9_./:%@+-]+")  # what needs no quotes as the value of an override
_FROM_TO = re.compile(r"([^,]*?)(\d+),\.\.\.,\1(\d+)")  # of names that end in a number
_NUMBERED = ("genome", "start", "seed")  # keys of which the values between two need not be written out
OF_ENVIRONMENT = "_environment"  # ends the names of the configurations that are not of the maze
_ENVIRONMENT, _MAZE = "environment=", "environment=tmaze"
_MOST_JOBS = 100_000  # of one call
_RULES, _RULE = "hebbian", "hebbian.rule"
_CHOICES = re.compile(r"[\w.+\[\], -]+")  # plain names, one or several
_NAME = re.compile(r"[^\[\], ]+")
_MAY_BE_NONE = ("change", "experiment", "ga")  # groups of which null stands for no choice
ANY = "gym"  # the row of environments without one of their own


def parsed(words: Iterable[str]) -> list[Override]:
    """Overrides as Hydra reads them."""
    words = list(words)
    if any("\ud800" <= sign <= "\udfff" for sign in "".join(words)):
        raise ConfigError(f"{words!r}: this is no text in the encoding of this system")
    try:
        return list(OverridesParser.create().parse_overrides(words))
    except HydraException as error:
        given = str(getattr(error, "override", error))
        hint = "without spaces" if "=" in words else "of a text in a list 'KEY=[\"TEXT\"]'"
        raise ConfigError(f"{given} cannot be read; give KEY=VALUE, {hint}") from error


def readable(words: Iterable[Any]) -> list[str]:
    """Overrides in which a path or a name that Hydra cannot read, as one with an umlaut, stands in quotes.

    A comma separates values there, too. Lists, mappings and what begins with a quote stay as they are.
    `genome=reference_1,...,reference_20`, `genome=runs/mine/0,...,runs/mine/9` and `seed=1,...,20` get what is between;
    `genome=runs/mine/*` gets all champions there.
    """
    return list(map(_readable, words))


def _readable(word: str) -> str:
    word = _FORCED_DIR.sub("", word)
    key, _, value = word.partition("=")
    if key in _NUMBERED:
        value = _FROM_TO.sub(_fill_ranges, value)
        if "*" in value and value[0] not in "['\"":
            value = ",".join(quoted(path) for one in value.split(",") for path in _champions(key, one))
        word = f"{key}={value}"
    if not value or word.startswith("-") or value[0] in "[{'\"":
        return word
    try:
        parsed([word])
    except ConfigError:
        return f"{key}={','.join(map(quoted, value.split(',')))}"
    return word


def _fill_ranges(ends: re.Match[str]) -> str:
    """`reference_1,...,reference_3` with what is between."""
    return ",".join(f"{ends[1]}{number}" for number in range(int(ends[2]), int(ends[3]) + 1))


def _champions(key: str, pattern: str) -> list[str]:
    """The runs with a champion, and the champions' files, whose paths are like a pattern; `10` comes after `9`."""
    if "*" not in pattern:
        return [pattern]
    paths = glob.glob(pattern)  # noqa: PTH207  # a pattern may be absolute
    found = [path for path in paths if Path(path, "champion.npz").is_file() or path.endswith((".npz", ".npy"))]
    if not found:
        raise ConfigError(f"{key}={pattern}: no run with a champion, and no .npz or .npy file, is there")
    return sorted(found, key=lambda path: [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", path)])


def check_words(command: str, words: Sequence[str], *, several: bool = False) -> None:
    """Refuse keys that the schema does not know, and several values for a key unless there is a job for each."""
    choices, known = conf.groups(command), schema_keys(command)
    open_keys = tuple(f"{key}." for key, kind in known.items() if get_origin(kind) is dict or kind is Any)
    for override in parsed(word for word in words if not word.startswith("-")):
        key, line = override.key_or_group, str(override.input_line)
        if key not in choices and not key.startswith(("hydra.", "hydra/")):
            check_numbers(line)
            check_keys(line)
        if key == "changed":
            raise ConfigError("changed is filled in by the program, with what differs from the named scenario")
        value = override.value()
        if isinstance(value, IntervalSweep):
            raise ConfigError(f"{line} needs a sweeper that draws values, and the jobs here are listed; give a range")
        if override.is_sweep_override() and not several:
            raise ConfigError(f"{line} has several values; to do a run with each of them, add -m (--multirun)")
        if isinstance(value, Glob) or (
            isinstance(value, ChoiceSweep) and any(isinstance(one, Sweep | Glob) for one in value.list)
        ):
            raise ConfigError(f"{line}: patterns, and ranges in a list, are not read; give the values, or one range")
        if key not in known and key not in choices and not key.startswith(("hydra.", "hydra/", *open_keys)):
            verb, _, is_of_environment = command.partition("_")
            where = f"`epuckhebb {verb}`{' in an environment' if is_of_environment else ''}"
            hint = did_you_mean(key, [*known, *_below(key, choices)])
            if key.startswith("environment.") and not is_of_environment:
                hint = "; give environment=NAME, or genome=RUN of an evolution in one"
            raise ConfigError(f"there is no key {key} of {where}{hint}")


def _below(key: str, groups: Iterable[str]) -> list[str]:
    """The key below groups of a similar name: `hebian.N` may be that of `hebbian`, whose keys no schema knows."""
    first, dot, rest = key.partition(".")
    return [f"{group}.{rest}" for group in difflib.get_close_matches(first, groups) if dot and group != first]


@functools.cache
def schema_keys(command: str) -> dict[str, Any]:
    """The types of all keys of a command that the schema knows, dotted; what is below a mapping, it does not know."""
    return dict(_keys_below(SCHEMAS[command]))


def _keys_below(schema: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    for key, kind in field_types(schema).items():
        yield f"{prefix}{key}", kind
        if is_dataclass(inner := without_none(kind)):
            yield from _keys_below(inner, f"{prefix}{key}.")


def values_of(words: Iterable[str]) -> dict[str, Any]:
    """The values of overrides by key, where each sets one key."""
    return {word.key_or_group: word.value() for word in parsed(words)}


def quoted(text: str) -> str:
    """A text as the value of an override that means just this text: a `${` in it refers to nothing."""
    if _PLAIN.fullmatch(text):
        return text
    text = re.sub(r"(\\*)\$\{", lambda found: 2 * found[1] + "\\${", text)
    escaped = re.sub(r'(\\*)("|$)', lambda found: 2 * found[1] + found[2].replace('"', '\\"'), text)
    return f'"{escaped}"'


def override_value(override: str) -> str:
    """The text that an override gives to its key, without quotes."""
    value = parsed([override])[0].value()
    try:
        return str(OmegaConf.create({"value": value}).value)
    except OmegaConfBaseException:  # it refers to what only Hydra knows
        return str(value)


def alternatives(overrides: list[str]) -> dict[str, list[str]]:
    """For each key the overrides that it is to have in turn; a key that comes again replaces the earlier one."""

    def choices(override: Override) -> list[str]:
        if not override.is_discrete_sweep():
            return [override.input_line or ""]
        values = itertools.islice(override.sweep_string_iterator(), _MOST_JOBS + 1)  # a range may be endless
        return [f"{override.get_key_element()}={value}" for value in values]

    found = {override.get_key_element(): choices(override) for override in parsed(overrides)}
    if math.prod(map(len, found.values())) > _MOST_JOBS:
        raise ConfigError(f"{max(found, key=lambda key: len(found[key]))}: at most {_MOST_JOBS} jobs fit one call")
    return found


def hydra_arguments(command: str, words: Iterable[str]) -> tuple[str, list[str]]:
    """The name of the configuration of these overrides, which is another in an environment, and what Hydra is given.

    `environment=FILE.py:NAME` is an id, `change` is a key of an environment there, and a list below `compare` a mapping
    of names that have no settings, as the schema has it. `hebbian` and `hebbian.rule` are one choice.
    """
    words, result = _choose_rule([_quote_names(command, word) for word in words]), list[str]()
    named = [word for word in words if word.startswith(_ENVIRONMENT)][-1:]
    worlds = set(alternatives(named).get("environment", ()))
    if _MAZE in worlds and len(worlds) > 1:
        raise ConfigError(f"{named[0]}: {_MAZE} has keys of its own; give it in a call of its own")
    experiments = [override_value(word) for word in words if word.startswith("experiment=")]
    file = data_folder("conf") / "experiment" / f"{experiments[-1]}.yaml" if experiments else Path()
    if not named and file.is_file() and "override /environment:" in file.read_text(encoding="utf-8"):
        worlds.add("")
    if command in ("evolve", "evaluate") and worlds - {_MAZE}:
        command += OF_ENVIRONMENT
    for word in words:
        names = parsed([word])[0].value() if word.startswith("compare=[") else None
        if isinstance(names, list):
            result.append(f"compare={{{','.join(f'{quoted(str(name))}: null' for name in names)}}}")
        elif word.startswith("change=") and command.endswith(OF_ENVIRONMENT):
            result.append(f"environment.{word}")
        elif word.startswith(_ENVIRONMENT) and ".py:" in word:
            result += [f"{_ENVIRONMENT}{ANY}", f"environment.id={word.removeprefix(_ENVIRONMENT)}"]
        elif word.startswith("hydra.searchpath=") and isinstance(paths := parsed([word])[0].value(), list):
            folders = [str(path).removeprefix("file://") for path in paths]
            served = [one if "://" in one else f"choices://{Path(one).absolute()}" for one in folders]
            result.append(f"hydra.searchpath=[{','.join(map(quoted, served))}]")
        elif word != _MAZE:
            result.append(word)
    return command, result


def _quote_names(command: str, word: str) -> str:
    """An override in which names of choices that look like numbers, as `change=30` has, stand in quotes."""
    key, _, value = word.partition("=")
    if key not in conf.groups(command) or not _CHOICES.fullmatch(value):
        return word

    def name(found: re.Match[str]) -> str:
        text = found[0]
        is_none = text == "null" and key in _MAY_BE_NONE
        return text if is_none or isinstance(parsed([f"{key}={text}"])[0].value(), str) else f"'{text}'"

    return f"{key}={_NAME.sub(name, value)}"


def _choose_rule(words: list[str]) -> list[str]:
    """Overrides in which a rule is chosen by `hebbian` if it has a row there, and by `hebbian.rule` if it has none."""
    chosen = {key: [word for word in words if word.startswith(f"{key}=")] for key in (_RULES, _RULE)}
    for key, other in ((_RULE, _RULES), (_RULES, _RULE)):
        for word in chosen[key]:
            ((_, choices),) = alternatives([word]).items()
            values = [override_value(choice) for choice in choices]
            has_row = any(value in conf.groups("evaluate")[_RULES] for value in values)
            if has_row if key == _RULE else not has_row and all(".py:" in value for value in values):
                if chosen[other]:
                    raise ConfigError(f"{chosen[other][-1]} and {word} both choose the rule; give one of them")
                words = [f"{other}={one.partition('=')[2]}" if one == word else one for one in words]
    return words


def make_overrides(overrides: Sequence[Any], keys: Mapping[str, Any]) -> list[str]:
    """Overrides as on the command line, of texts and of keywords."""
    for override in overrides:
        if not isinstance(override, str) or "=" not in override:
            raise ConfigError(f"overrides are texts such as 'scenario=4obstacles', or keywords; got {override!r}")
    words = [word for key, value in keys.items() for word in _overrides_of_keyword(key, value)]
    return [*words, *readable(overrides)]


def _overrides_of_keyword(key: str, value: Any) -> Iterator[str]:
    """The overrides that a keyword stands for: one, or those of the keys below it."""
    if key == _ENVIRONMENT.rstrip("=") and (callable(value) or (isinstance(value, Mapping) and "id" in value)):
        yield f"{_ENVIRONMENT}{ANY}"
        value = {"id": value} if callable(value) else value
    kind = value if isinstance(value, type) else type(value)
    if f"{key}.function" == Fitness.KEY and issubclass(kind, Fitness):
        yield f"{Fitness.KEY}={quoted(object_text(kind))}"
        value = {} if value is kind else {field.name: getattr(value, field.name) for field in fields(value)}
    is_class = isinstance(value, type) and not key.startswith(_ENVIRONMENT.rstrip("="))
    if is_class or (isinstance(value, OwnClass) and key != "ga"):
        raise ConfigError(f"{key} must be a name or settings here, got {value}; of a part of your own: FILE.py:NAME")
    if isinstance(value, Adaptation) and value.acts and value.name == NONE:
        raise ConfigError(f"{key} needs a name for tables and figures; give Adaptation(name='mine', ...)")
    if is_dataclass(value):
        value = {field.name: getattr(value, field.name) for field in fields(value)}
    if isinstance(value, Mapping):
        for name, inner in value.items():
            yield f"{key}.{name}={value_text(inner, f'{key}.{name}')}"
    else:
        yield f"{key}={value_text(value, key)}"


def value_text(value: Any, key: str) -> str:
    """A value as an override has it. key: whose it is, for messages."""
    if isinstance(value, np.generic | np.ndarray):
        value = value.tolist()
    if value is None:
        return "null"
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, bool | int | float):
        return repr(value).lower()
    if isinstance(value, str | Path):
        return quoted(str(value))
    if callable(value) and key.startswith("environment."):
        return quoted(object_text(value))
    if isinstance(value, Mapping):
        return "{" + ",".join(f"{name}: {value_text(inner, f'{key}.{name}')}" for name, inner in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ",".join(value_text(inner, key) for inner in value) + "]"
    raise ConfigError(f"{key} must be text, a number, a list or settings, got {type(value).__name__}")


def format_overrides(settings: Mapping[str, Any]) -> list[str]:
    """Settings as they would be typed."""
    return [f"{key}={value_text(value, key)}" for key, value in settings.items()]
