"""Completes keys, values and run folders for the Tab key. A shell waits for it, so it imports nothing heavy."""

import os
import re
import shlex
from collections.abc import Iterator
from pathlib import Path

from epuckhebb.cli.keys import known
from epuckhebb.runtime import LATEST, conf

_METHODS = "methods"  # the key of a leaderboard that names choices of the group method, one or more
_LIST = re.compile(r"\[(.*,)?")  # what stands before the last of several names


def complete_override(command: str, incomplete: str) -> list[str]:
    """Completions of an override. A key comes with its default, so that the shell adds no space after the `=`."""
    typed, only_value = _typed(incomplete)
    key, equals, value = typed.partition("=")
    if not equals:
        return [offer for offer in _offers(command) if offer.startswith(key)]
    before = _LIST.match(value) if key in ("change", _METHODS) else None
    names = before[0] if before else ""
    choices = _choices(command, key)
    found = [f"{key}={names}{one}" for one in choices if one.startswith(value.removeprefix(names))]
    return [offer.partition("=")[2] for offer in found] if only_value else found


def complete_sweep(incomplete: str) -> list[str]:
    """Completions of the name of a sweep."""
    return [name for name in conf.groups("sweep")["experiment"] if name.startswith(incomplete)]


def complete_run(incomplete: str) -> list[str]:
    """Completions of a run folder."""
    return [run for run in [LATEST, *_runs("*")] if run.startswith(incomplete)]


def complete_shown(incomplete: str) -> list[str]:
    """Completions of what `show` can tell of."""
    return [name for name in [LATEST, "reference", *_runs("*")] if name.startswith(incomplete)]


def complete_group(incomplete: str) -> list[str]:
    """Completions of a group of keys; a command stands for its own ones."""
    return [name for name in known() if name.startswith(incomplete)]


def _typed(incomplete: str) -> tuple[str, bool]:
    """The override so far, and whether the shell wants to have only what follows its `=`.

    bash takes `=` for a word of its own: of `scenario=ba` it hands over `ba`, and its line has the rest.
    """
    try:
        words = shlex.split(os.environ.get("COMP_WORDS", ""))[: int(os.environ.get("COMP_CWORD") or 0) + 1]
    except ValueError:  # an open quotation mark
        words = []
    if words and words[-1] == "=" and len(words) > 1:
        return f"{words[-2]}=", True
    if len(words) > 2 and words[-2] == "=":
        return f"{words[-3]}={incomplete}", True
    return incomplete, False


def _offers(command: str) -> Iterator[str]:
    for group, choices in conf.groups(command).items():
        key = _METHODS if group == "method" else group
        yield from (f"{key}={choice}" for choice in choices)
    for key, value in conf.keys_with_defaults(command):
        yield from (f"{key}=", f"{key}={value}")
    if command == "evolve":
        yield from (f"resume={run}" for run in [LATEST, *_runs("evolve")])


def _choices(command: str, key: str) -> list[str]:
    if key == _METHODS:
        return ["all", *conf.groups(command).get("method", [])]
    if key in conf.groups(command):
        return conf.groups(command)[key]
    if key in ("genome", "resume"):
        return [*(["reference"] if key == "genome" else []), LATEST, *_runs("evolve")]
    return _values(command, key) or [str(value) for name, value in conf.keys_with_defaults(command) if name == key]


def _values(command: str, key: str) -> list[str]:
    """All values that a key may have, where the comment beside it ends with a list of them; none of other keys."""
    group, _, name = key.rpartition(".")
    files = conf.files(group) if group else [conf.command_file(command)]
    beside = re.compile(rf"^ *{re.escape(name)}: *(\w+) +# (.*)$", re.MULTILINE)
    for default, comment in (found for file in files for found in beside.findall(file.read_text(encoding="utf-8"))):
        listed = re.sub(r" \(.*?\)", "", comment).rpartition(": ")[2].split(", ")
        if default in listed:
            return listed
        if default in ("true", "false"):
            return ["true", "false"]
    return []


def _runs(command: str) -> list[str]:
    return sorted(str(status.parent) for status in Path("runs").glob(f"{command}/*/status.json"))
