"""Lists every group of settings, its choices and its keys, described by the comments in `conf/`."""

import functools
import typing
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, is_dataclass, replace
from enum import Enum
from pathlib import Path
from typing import Any

import yaml

from epuckhebb.config.parts import NONE, part_class
from epuckhebb.config.schema import SCHEMAS
from epuckhebb.runtime import ConfigError, conf, data_folder, did_you_mean

_NOT_KEYS = ("defaults", "hydra")
_WHOLE = ("maze", "robot")  # groups whose keys hold what a user names
_KINDS = {float: "number", int: "whole number", bool: "true or false", str: "text"}
_PLAIN = ("number", "text")  # need not be said


@dataclass(frozen=True)
class Key:
    """A key. name: dotted. default: as it stands in the file. description: what it is, and what may be given."""

    name: str
    default: str
    description: str


@dataclass(frozen=True)
class Group:
    """Settings that belong together.

    name: of the group, or of the command whose own keys they are. choices: the files of the group, and what each is.
    keys: of the choice `of`. more: those that only other choices have, by choice.
    """

    name: str
    choices: Mapping[str, str]
    of: str
    keys: list[Key]
    more: Mapping[str, list[Key]]


@functools.cache
def all_groups() -> tuple[Group, ...]:
    """The commands with their own keys, then the groups of all of them."""
    own = [
        Group(command, {}, "", list(_keys(_conf(f"{command}.yaml"), "", SCHEMAS[command])), {}) for command in SCHEMAS
    ]
    names = dict.fromkeys(name for command in SCHEMAS for name in conf.groups(command) if name != "experiment")
    return (*own, *map(_group, names))


def group_named(name: str) -> Group:
    """The group of a name; of the name of a key, its group with that key alone."""
    known = {group.name: group for group in all_groups()}
    if name not in known:
        for group in known.values():
            keys = [key for key in group.keys if key.name == name]
            others = ((choice, [key for key in own if key.name == name]) for choice, own in group.more.items())
            more = {choice: own for choice, own in others if own}
            if keys or more:
                return replace(group, choices={}, keys=keys, more=more)
        raise ConfigError(f"keys {name}: the group must be one of {', '.join(known)}{did_you_mean(name, known)}")
    return known[name]


def _conf(name: str) -> Path:
    return data_folder("conf") / name


def _group(name: str) -> Group:
    """A group of `conf/`; its first choice is the one that a command takes by itself and that has the most keys."""
    files = {file.stem: file for file in _conf(name).glob("*.yaml")}
    choices = {choice: conf.first_comment(file) for choice, file in files.items()}
    found = {choice: list(_keys(file, name, _schema(name, file))) for choice, file in files.items()}
    if name in conf.TABLES:
        choices |= conf.rows(name)
        found |= _of_rows(name)
    choices, found = dict(sorted(choices.items())), dict(sorted(found.items()))
    usual = max([choice for choice in _usual(name) if choice in found] or found, key=lambda choice: len(found[choice]))
    seen = {key.name for key in found[usual]}
    more = {}
    for choice, keys in found.items():
        own = [key for key in keys if key.name not in seen]
        seen |= {key.name for key in own}
        if own:
            more[choice] = own
    return Group(name, choices, usual, found[usual], more)


def _of_rows(name: str) -> Iterator[tuple[str, list[Key]]]:
    """The keys of each row of a table; a change has those of a scenario, an adaptation those of `none`."""
    text = _text(conf.table_file(name))
    root: Any = yaml.compose(text, Loader=yaml.SafeLoader)
    for row, settings in root.value:
        keys = _below(settings, f"{name}.", None, text.splitlines(), deep=True) if name == "method" else ()
        yield row.value, list(keys)


def _usual(name: str) -> list[str]:
    """The choices of a group that commands take by themselves."""
    entries = (entry for command in SCHEMAS for entry in yaml.safe_load(_text(_conf(f"{command}.yaml")))["defaults"])
    return [str(entry[name]) for entry in entries if isinstance(entry, dict) and name in entry]


def _schema(group: str, file: Path) -> Any:
    """The dataclass that knows the keys of a file, if one does."""
    held = yaml.safe_load(_text(file))
    if group == "hebbian":
        return part_class("rule", held["rule"], group) if held.get("rule", NONE) != NONE else None
    if group in ("task", "physics", "optimizer"):
        return part_class(group, held.get(group, held)["algorithm" if group == "optimizer" else "kind"], group)
    kinds = [typing.get_type_hints(schema).get(group) for schema in SCHEMAS.values()]
    one = next(kind for kind in kinds if kind is not None)
    return next((kind for kind in (one, *typing.get_args(one)) if is_dataclass(kind)), None)


def _keys(file: Path, group: str, schema: Any) -> Iterator[Key]:
    """The keys of a file of `conf/`, with what its comments say of them."""
    text = _text(file)
    root = yaml.compose(text, Loader=yaml.SafeLoader)
    assert isinstance(root, yaml.MappingNode)
    for key, value in root.value:
        if key.value == group and isinstance(value, yaml.MappingNode):  # the file changes other groups, too
            root = value
    prefix = f"{group}." if group else ""
    yield from _below(root, prefix, schema, text.splitlines(), deep=group not in _WHOLE)


def _below(node: yaml.MappingNode, prefix: str, schema: Any, lines: list[str], *, deep: bool) -> Iterator[Key]:
    kinds = typing.get_type_hints(schema) if schema is not None else {}
    for key, value in node.value:
        if key.value in _NOT_KEYS or (key.value == "name" and not deep):
            continue
        kind = kinds.get(key.value)
        inner = value.value if isinstance(value, yaml.MappingNode) else []
        if deep and inner and (is_dataclass(kind) or typing.get_origin(kind) is dict):
            within = kind if is_dataclass(kind) else None
            yield from _below(value, f"{prefix}{key.value}.", within, lines, deep=deep)
            continue
        yield Key(prefix + key.value, _default(value, lines), _described(_comment(lines, key, value), _kind(kind)))


def _default(value: yaml.Node, lines: list[str]) -> str:
    """A value as it stands in the file; of what takes several lines nothing."""
    first, last = value.start_mark, value.end_mark
    return lines[first.line][first.column : last.column] if first.line == last.line else ""


def _comment(lines: list[str], key: yaml.Node, value: yaml.Node) -> str:
    """The comment beside a key, and the comments by themselves below it."""
    line = key.start_mark.line
    one_line = value.start_mark.line == value.end_mark.line == line
    _, mark, text = lines[line][value.end_mark.column if one_line else key.end_mark.column :].partition("# ")
    if not mark:
        return ""
    column = lines[line].index(f"# {text}")
    parts = [text.strip()]
    for following in lines[line + 1 :]:
        if not following.startswith(" " * column + "# "):
            break
        parts.append(following.strip().removeprefix("# "))
    return " ".join(parts)


def _described(comment: str, kind: str) -> str:
    """What a comment says, and of what kind the value is, unless the comment names all that it may be."""
    known = kind in _PLAIN or all(one in comment for one in kind.split(", "))
    return comment if known or not comment else f"{comment.rstrip(';,')} ({kind})"


def _kind(kind: Any) -> str:
    """What a type stands for, in words; nothing if anything may be given."""
    if isinstance(kind, type) and issubclass(kind, Enum):
        return ", ".join(member.name for member in kind)
    if typing.get_origin(kind) in (list, dict):
        return "list" if typing.get_origin(kind) is list else ""
    named = [_KINDS[one] for one in (kind, *typing.get_args(kind)) if one in _KINDS]
    nothing = " or null" if type(None) in typing.get_args(kind) else ""
    return f"{named[0]}{nothing}" if named else ""


def _text(file: Path) -> str:
    return file.read_text(encoding="utf-8")
