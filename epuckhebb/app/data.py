"""The files that belong to the program: where they are, and what `conf/` offers, to the Tab key too.

A shell waits for this file at every Tab, so it imports nothing heavy and reads `conf/` without Hydra.
"""

import os
import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

_PACKAGE = Path(__file__).resolve().parents[1]
_PACKAGE_OF = "# @package"  # the first line of a file that also changes other groups
_METHODS = "methods"  # the key of a leaderboard that names choices of the group method, one or more
LATEST = "latest"  # the word for the run of the last call


def data_folder(name: str) -> Path:
    """A folder that lies beside the package in a checkout and inside it when installed (`conf`, `runs/reference`)."""
    inside = _PACKAGE / name
    return inside if inside.is_dir() else _PACKAGE.parent / name


def groups(verb: str) -> dict[str, list[str]]:
    """The configuration groups of a verb and their choices, as the names of the files say."""
    defaults = _primary(verb).read_text(encoding="utf-8")
    return {
        folder.name: sorted(file.stem for file in folder.glob("*.yaml"))
        for folder in sorted(path for path in data_folder("conf").iterdir() if path.is_dir())
        if f"- {folder.name}:" in defaults
    }


def first_comment(file: Path) -> str:
    """What the comment at the top of a file of `conf/` says, up to its first line that is none."""
    lines = []
    for line in file.read_text(encoding="utf-8").splitlines():
        if not line.startswith("# "):
            break
        if not line.startswith(_PACKAGE_OF):
            lines.append(line.removeprefix("# ").strip())
    return " ".join(lines)


def complete_override(verb: str, incomplete: str) -> list[str]:
    """Completions of an override. A key comes with its default, so that the shell adds no space after the `=`."""
    typed, only_value = _typed(incomplete)
    key, equals, value = typed.partition("=")
    if not equals:
        return [offer for offer in _offers(verb) if offer.startswith(key)]
    found = [f"{key}={choice}" for choice in _choices(verb, key) if choice.startswith(value)]
    return [offer.partition("=")[2] for offer in found] if only_value else found


def complete_sweep(incomplete: str) -> list[str]:
    """Completions of the name of a sweep."""
    return [name for name in groups("sweep")["experiment"] if name.startswith(incomplete)]


def complete_run(incomplete: str) -> list[str]:
    """Completions of a run folder."""
    return [run for run in [LATEST, *_runs("*")] if run.startswith(incomplete)]


def complete_shown(incomplete: str) -> list[str]:
    """Completions of what `show` can tell of."""
    return [name for name in [LATEST, "reference", *_runs("*")] if name.startswith(incomplete)]


def complete_group(incomplete: str) -> list[str]:
    """Completions of a group of keys; a verb stands for its own ones."""
    verbs = ("evaluate", "evolve", "reproduce", "leaderboard")
    known = [*verbs, *(name for verb in verbs for name in groups(verb) if name != "experiment")]
    return [name for name in dict.fromkeys(known) if name.startswith(incomplete)]


def _primary(verb: str) -> Path:
    """The configuration file of a verb; a sweep is of evaluations."""
    return data_folder("conf") / f"{'evaluate' if verb == 'sweep' else verb}.yaml"


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


def _offers(verb: str) -> Iterator[str]:
    for group, choices in groups(verb).items():
        key = _METHODS if group == "method" else group
        yield from (f"{key}={choice}" for choice in choices)
    for key, value in _keys(verb):
        yield from (f"{key}=", f"{key}={value}")
    if verb == "evolve":
        yield from (f"resume={run}" for run in [LATEST, *_runs("evolve")])


def _choices(verb: str, key: str) -> list[str]:
    if key == _METHODS:
        return ["all", *groups(verb).get("method", [])]
    if key in groups(verb):
        return groups(verb)[key]
    if key in ("genome", "resume"):
        return [*(["reference"] if key == "genome" else []), LATEST, *_runs("evolve")]
    return _values(verb, key) or [str(value) for name, value in _keys(verb) if name == key]


def _values(verb: str, key: str) -> list[str]:
    """All values that a key may have, where the comment beside it ends with a list of them; none of other keys."""
    group, _, name = key.rpartition(".")
    files = sorted((data_folder("conf") / group).glob("*.yaml")) if group else [_primary(verb)]
    beside = re.compile(rf"^ *{re.escape(name)}: *(\w+) +# (.*)$", re.MULTILINE)
    for default, comment in (found for file in files for found in beside.findall(file.read_text(encoding="utf-8"))):
        listed = re.sub(r" \(.*?\)", "", comment).rpartition(": ")[2].split(", ")
        if default in listed:
            return listed
        if default in ("true", "false"):
            return ["true", "false"]
    return []


def _keys(verb: str) -> Iterator[tuple[str, Any]]:
    """The keys that are values, and their defaults."""
    import yaml

    primary = yaml.safe_load(_primary(verb).read_text(encoding="utf-8"))
    chosen = {group: name for entry in primary["defaults"] if isinstance(entry, dict) for group, name in entry.items()}

    def below(node: dict[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
        for key, value in node.items():
            if isinstance(value, dict):
                yield from below(value, f"{prefix}{key}.")
            elif key != "defaults":
                yield prefix + key, "null" if value is None else value

    yield from below({key: value for key, value in primary.items() if key != "hydra"}, "")
    for group in groups(verb):
        file = data_folder("conf") / group / f"{chosen.get(group)}.yaml"
        if group != "experiment" and file.is_file():
            values = yaml.safe_load(file.read_text(encoding="utf-8"))
            yield from below(values.get(group, values), f"{group}.")  # a file may bring other groups, beside its own


def _runs(verb: str) -> list[str]:
    return sorted(str(status.parent) for status in Path("runs").glob(f"{verb}/*/status.json"))
