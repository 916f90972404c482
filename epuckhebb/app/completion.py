"""What the Tab key offers: `group=choice`, `key=value`, sweeps and runs. Reads `conf/` and imports nothing heavy."""

import os
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from epuckhebb.app.data import data_folder, groups


def overrides(verb: str, incomplete: str) -> list[str]:
    """Completions of an override. A key comes with its default, so that the shell adds no space after the `=`."""
    typed, only_value = _typed(incomplete)
    key, equals, value = typed.partition("=")
    if not equals:
        return [offer for offer in _offers(verb) if offer.startswith(key)]
    found = [f"{key}={choice}" for choice in _choices(verb, key) if choice.startswith(value)]
    return [offer.partition("=")[2] for offer in found] if only_value else found


def _typed(incomplete: str) -> tuple[str, bool]:
    """The override so far, and whether the shell wants to have only what follows its `=`.

    bash takes `=` for a word of its own: of `scenario=ba` it hands over `ba`, and its line has the rest.
    """
    words = _bash_words()[: int(os.environ.get("COMP_CWORD") or 0) + 1]
    if words and words[-1] == "=" and len(words) > 1:
        return f"{words[-2]}=", True
    if len(words) > 2 and words[-2] == "=":
        return f"{words[-3]}={incomplete}", True
    return incomplete, False


def _bash_words() -> list[str]:
    try:
        return shlex.split(os.environ.get("COMP_WORDS", ""))
    except ValueError:  # an open quotation mark
        return []


def _offers(verb: str) -> Iterator[str]:
    for group, choices in groups(verb).items():
        yield from (f"{group}={choice}" for choice in choices)
    for key, value in _keys(verb):
        yield from (f"{key}=", f"{key}={value}")
    if verb == "evolve":
        yield from (f"resume={run}" for run in _runs("evolve"))


def _choices(verb: str, key: str) -> list[str]:
    if key in groups(verb):
        return groups(verb)[key]
    if key in ("genome", "resume"):
        return [*(["reference"] if key == "genome" else []), *_runs("evolve")]
    return [str(value) for name, value in _keys(verb) if name == key]


def _keys(verb: str) -> Iterator[tuple[str, Any]]:
    """The keys that are values, and their defaults."""
    import yaml

    conf = data_folder("conf")
    primary = yaml.safe_load((conf / f"{'evaluate' if verb == 'sweep' else verb}.yaml").read_text())
    chosen = {group: name for entry in primary["defaults"] if isinstance(entry, dict) for group, name in entry.items()}

    def below(node: dict[str, Any], prefix: str) -> Iterator[tuple[str, Any]]:
        for key, value in node.items():
            if isinstance(value, dict):
                yield from below(value, f"{prefix}{key}.")
            elif key != "defaults":
                yield prefix + key, "null" if value is None else value

    yield from below({key: value for key, value in primary.items() if key != "hydra"}, "")
    for group in groups(verb):
        file = conf / group / f"{chosen.get(group)}.yaml"
        if group != "experiment" and file.is_file():
            yield from below(yaml.safe_load(file.read_text()), f"{group}.")


def _runs(verb: str) -> list[str]:
    return sorted(str(status.parent) for status in Path("runs", verb).glob("*/status.json"))


def sweeps(incomplete: str) -> list[str]:
    """Completions of the name of a sweep."""
    return [name for name in groups("sweep")["experiment"] if name.startswith(incomplete)]


def runs(incomplete: str) -> list[str]:
    """Completions of a run folder."""
    found = (str(status.parent) for status in Path("runs").glob("*/*/status.json"))
    return sorted(run for run in found if run.startswith(incomplete))
