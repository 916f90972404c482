"""Lists the groups of `conf/` and their choices. Completion and help need it, so it imports nothing heavy."""

import functools
import itertools
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from epuckhebb.runtime.resources import data_folder

TABLES = ("adaptation", "change", "method")  # groups of which the choices, or most of them, are the rows of one file
_PACKAGE_OF = "# @package"  # the first line of a file that also changes other groups
_ROW = re.compile(r'^((?:# .*\n)+)"?(\w+)"?:', re.MULTILINE)  # comments, and the name of what they describe


def groups(command: str) -> dict[str, list[str]]:
    """The configuration groups of a command and their choices, as the names of the files say."""
    defaults = command_file(command).read_text(encoding="utf-8")
    conf = data_folder("conf")
    names = sorted({*TABLES, *(path.name for path in conf.iterdir() if path.is_dir())})
    return {
        name: sorted([*(rows(name) if name in TABLES else ()), *(file.stem for file in (conf / name).glob("*.yaml"))])
        for name in names
        if f"- {name}:" in defaults
    }


def table_file(group: str) -> Path:
    """The file whose rows are the choices of a group of `TABLES`."""
    return data_folder("conf") / f"{group}s.yaml"


@functools.cache
def rows(group: str) -> dict[str, str]:
    """The choices of a group of `TABLES`, and what the comment above each says."""
    found = _ROW.findall(table_file(group).read_text(encoding="utf-8"))
    return {name: _comment(comment.splitlines()) for comment, name in found}


def first_comment(file: Path) -> str:
    """What the comment at the top of a file of `conf/` says, up to its first line that is none."""
    return _comment(file.read_text(encoding="utf-8").splitlines())


def _comment(lines: Sequence[str]) -> str:
    comments = itertools.takewhile(lambda line: line.startswith("# "), lines)
    return " ".join(line.removeprefix("# ").strip() for line in comments if not line.startswith(_PACKAGE_OF))


def command_file(command: str) -> Path:
    """The configuration file of a command; what is swept, or played with, is an evaluation."""
    return data_folder("conf") / f"{'evaluate' if command in ('sweep', 'play') else command}.yaml"


def keys_with_defaults(command: str) -> Iterator[tuple[str, Any]]:
    """The keys that are values, and their defaults."""
    import yaml

    primary = yaml.safe_load(command_file(command).read_text(encoding="utf-8"))
    chosen = {group: name for entry in primary["defaults"] if isinstance(entry, dict) for group, name in entry.items()}
    yield from flat({key: value for key, value in primary.items() if key != "hydra"})
    for group in groups(command):
        file = data_folder("conf") / group / f"{chosen.get(group)}.yaml"
        if group != "experiment" and file.is_file():
            values = yaml.safe_load(file.read_text(encoding="utf-8"))
            yield from flat(values.get(group, values), f"{group}.")  # a file may bring other groups, beside its own


def flat(node: dict[Any, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """The values of settings below their dotted keys, as overrides have them; not the list of defaults."""
    for key, value in node.items():
        if isinstance(value, dict):
            yield from flat(value, f"{prefix}{key}.")
        elif key != "defaults":
            yield f"{prefix}{key}", "null" if value is None else value
