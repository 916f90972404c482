"""Lists the groups of `conf/` and their choices. Help needs it, so it imports nothing heavy.

A choice is a file of the group's folder, or a row of the table that the group has.
"""

import functools
import itertools
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from epuckhebb.runtime.resources import data_folder

TABLES = {  # groups of which the choices, or most of them, are the rows of one file
    "adaptation": "adaptations.yaml",
    "change": "changes.yaml",
    "environment": "environments.yaml",
    "flock": "flocks.yaml",
    "ga": "genetic_algorithms.yaml",
    "hebbian": "rules.yaml",
    "lifetime": "lifetimes.yaml",
    "method": "methods.yaml",
    "scenario": "scenarios.yaml",
    "training": "trainings.yaml",
}
NO_EFFECT = ("threads", "figures", "environment.processes")  # keys on which no result depends
_PACKAGE_OF = "# @package"  # the first line of a file that also changes other groups
_ROW = re.compile(r'^((?:# .*\n)*)"?(\w+)"?:', re.MULTILINE)  # comments, and the name of what they describe


@functools.cache
def groups(command: str) -> dict[str, list[str]]:
    """The configuration groups of a command and their choices, not to be changed."""
    defaults = command_file(command).read_text(encoding="utf-8")
    conf = data_folder("conf")
    names = sorted({*TABLES, *(path.name for path in conf.iterdir() if path.is_dir())})
    return {
        name: sorted([*(rows(name) if name in TABLES else ()), *(file.stem for file in (conf / name).glob("*.yaml"))])
        for name in names
        if f"- {name}:" in defaults
    }


def files(group: str) -> list[Path]:
    """The files of a group: its table, and those in its folder."""
    conf = data_folder("conf")
    table = [conf / TABLES[group]] if group in TABLES else []
    return [*table, *sorted((conf / group).glob("*.yaml"))]


def table(group: str, folder: Path | None = None) -> dict[str, Any]:
    """The rows of a group of `TABLES` in a folder, `conf/` unless given; not to be changed."""
    from epuckhebb.runtime import yaml_file

    file = (folder or data_folder("conf")) / TABLES[group]
    return yaml_file.read(file, is_table=True).settings if file.is_file() else {}


@functools.cache
def rows(group: str) -> dict[str, str]:
    """The choices of a group of `TABLES`, and what the comment above each says."""
    pairs = _ROW.findall(files(group)[0].read_text(encoding="utf-8"))
    return {name: _comment(comment.splitlines()) for comment, name in pairs}


def first_comment(file: Path) -> str:
    """What the comment at the top of a file of `conf/` says, up to its first line that is none."""
    return _comment(file.read_text(encoding="utf-8").splitlines())


def _comment(lines: Sequence[str]) -> str:
    comments = itertools.takewhile(lambda line: line.startswith("# "), lines)
    return " ".join(line.removeprefix("# ").strip() for line in comments if not line.startswith(_PACKAGE_OF))


def command_file(command: str) -> Path:
    """The configuration file of a command; what is swept, or played with, is an evaluation."""
    return data_folder("conf") / f"{'evaluate' if command in ('sweep', 'play') else command}.yaml"


def flat(node: Mapping[Any, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """The values of settings below their dotted keys, as overrides have them; not the list of defaults."""
    for key, value in node.items():
        if isinstance(value, Mapping):
            yield from flat(value, f"{prefix}{key}.")
        elif key != "defaults":
            yield f"{prefix}{key}", "null" if value is None else value


def without(settings: Mapping[str, Any], keys: Iterable[str]) -> dict[str, Any]:
    """Settings without some keys, which may be dotted."""
    left = dict(settings)
    for dotted in keys:
        group, _, key = dotted.partition(".")
        if not key:
            left.pop(group, None)
        elif isinstance(left.get(group), Mapping):
            left[group] = without(left[group], [key])
    return left
