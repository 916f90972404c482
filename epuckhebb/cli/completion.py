"""Completes choices and sweeps for the Tab key. A shell waits for it, so it imports nothing heavy."""

import os
import re
import shlex
from collections.abc import Iterator
from dataclasses import is_dataclass
from enum import Enum
from pathlib import Path
from typing import get_args, get_type_hints

import typer

from epuckhebb.cli.keys import known
from epuckhebb.export import FIGURES
from epuckhebb.runtime import REFERENCE, conf, data_folder

_OF_GENOMES = ("evaluate", "evolve", "sweep", "play", "reproduce")  # commands with a key `genome`


def complete_override(command: str, incomplete: str) -> list[str]:
    """Completions of an override: choices of the groups of a command, bundled champions, values that have names."""
    groups = {"methods" if group == "method" else group: choices for group, choices in conf.groups(command).items()}
    if command in _OF_GENOMES:
        files = sorted((data_folder("runs/reference") / "champions").glob("light_*.npz"))
        groups["genome"] = groups["start"] = [
            REFERENCE,
            *(re.sub("light_(.*)seed0*", rf"{REFERENCE}_\1", file.stem) for file in files),
        ]
    word, is_split = _override(incomplete)
    key, has_value, _ = word.partition("=")
    if has_value and key not in groups:
        groups.update(_named_values(command))
    found = [
        offer for key, choices in groups.items() for offer in _starting(word, *(f"{key}={one}" for one in choices))
    ]
    return [offer.partition("=")[2] for offer in found] if is_split else found


def _named_values(command: str) -> Iterator[tuple[str, list[str]]]:
    """The keys of a command whose values have names, and these. Loading the schema takes most of a second."""
    from epuckhebb.config import SCHEMAS
    from epuckhebb.controller.plasticity.rule import Rule
    from epuckhebb.tmaze.fitness import Signal

    def below(kind: type, prefix: str = "") -> Iterator[tuple[str, list[str]]]:
        for name, hint in get_type_hints(kind).items():
            for one in get_args(hint) or (hint,):
                if isinstance(one, type) and is_dataclass(one):
                    yield from below(one, f"{prefix}{name}.")
                elif isinstance(one, type) and issubclass(one, Enum):
                    yield f"{prefix}{name}", list(one.__members__)

    yield from below(SCHEMAS.get(command, SCHEMAS["evaluate"]))
    yield from below(Rule, "hebbian.")
    yield "hebbian.signal", list(Signal.__members__)


def complete_sweep(incomplete: str) -> list[str]:
    """Completions of the name of a sweep."""
    return _starting(incomplete, *conf.groups("sweep")["experiment"])


def complete_figure(ctx: typer.Context, incomplete: str) -> list[str]:
    """Completions of the name of a figure: those that the run has drawn, or has the files for."""
    run = Path(ctx.params["run"])
    drawn = {file.stem for file in run.glob("figures/*")}
    return _starting(incomplete, *sorted(drawn | {name for name, file in FIGURES.items() if (run / file).is_file()}))


def complete_group(incomplete: str) -> list[str]:
    """Completions of a group of keys; a command stands for its own ones."""
    return _starting(incomplete, *known())


def _override(incomplete: str) -> tuple[str, bool]:
    """The override so far, and whether the shell has split it at its `=`, as bash does, and wants only the rest."""
    try:
        words = shlex.split(os.environ.get("COMP_WORDS", ""))[: int(os.environ.get("COMP_CWORD") or 0) + 1]
    except ValueError:  # an open quotation mark
        words = []
    if len(words) > 1 and words[-1] == "=":
        return f"{words[-2]}=", True
    if len(words) > 2 and words[-2] == "=":
        return f"{words[-3]}={incomplete}", True
    return incomplete, False


def _starting(incomplete: str, *names: str) -> list[str]:
    return [name for name in names if name.startswith(incomplete)]
