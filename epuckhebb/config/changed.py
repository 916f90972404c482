"""The key `changed`: what differs from the named world, as tables, folders and pages show it.

It is the difference between a configuration and one that is composed of nothing but the choices that name the world.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields
from typing import Any, NamedTuple

from omegaconf import DictConfig, OmegaConf

from epuckhebb.config import hand
from epuckhebb.config.catalogue import by_hydra
from epuckhebb.config.overrides import parsed
from epuckhebb.config.parts import PART_GROUPS, part_class
from epuckhebb.config.plugins import own_references
from epuckhebb.config.values import literal
from epuckhebb.controller.wiring import LAYERS
from epuckhebb.runtime import ConfigError, conf

_PARTS = ("maze", "robot", "task", "fitness", "physics")  # groups whose choice `changed` names
_SHOWN = ("scenario", "lifetime", "network", *_PARTS)  # groups whose values `changed` names
_USUAL = ("training", "hebbian")  # more groups whose choice is as it is in what a configuration is compared with
_COMPARED = (*_SHOWN, "training", "change", "experiment")  # keys and groups that can make a difference
_RECORDING = "lifetime.record_every"  # changes nothing in a lifetime
_LONGEST = 80  # characters of a world in the name of a folder


class UsualWorld(NamedTuple):
    """A configuration of nothing but the choices that name the world. differ: groups of parts with another choice."""

    cfg: DictConfig
    differ: list[str]


def usual_world(
    command: str, choices: Mapping[str, str], overrides: Sequence[str], config_dir: str | None
) -> UsualWorld | None:
    """What the choices that name the world are without anything else; None if nothing that counts differs from it.

    The program's own choices are taken if there are such, so that a file of the user's that replaces one differs.
    """
    words = [(str(word.key_or_group), word) for word in parsed(overrides)]
    naming = [word for key, word in words if key in ("scenario", "change") and not isinstance(word.value(), dict)]
    others = [key for key, word in words if word not in naming and key != _RECORDING]
    if config_dir is None and not any(key.partition(".")[0] in _COMPARED or key == "hebbian.rule" for key in others):
        return None
    changes_named = [str(word.input_line) for word in naming if word.key_or_group == "change"]

    def usual(folder: str | None) -> UsualWorld:
        named = [f"scenario='{choices['scenario']}'", *changes_named]
        found = by_hydra(command, named, folder)
        differ = [group for group in (*_PARTS, *_USUAL) if choices.get(group) != found.choices.get(group)]
        if differ:
            found = by_hydra(command, [*named, *(f"{group}='{choices[group]}'" for group in differ)], folder)
        find_own_files(found.cfg)
        return UsualWorld(found.cfg, [group for group in differ if group in _PARTS])

    try:
        return usual(None)
    except ConfigError:  # a choice of the user's
        return usual(config_dir)


def differences(cfg: DictConfig, choices: Mapping[str, str], usual: UsualWorld) -> Iterator[str]:
    """What differs from the named world, as overrides. What follows from another value is not repeated."""
    yield from (f"{group}={choices[group]}" for group in usual.differ)
    mine, its = _values(cfg, resolve=True), _values(usual.cfg, resolve=True)
    if (wiring := mine["network.wiring"]) != LAYERS:
        its |= {f"network.{field.name}": field.default for field in fields(part_class("wiring", wiring, "network"))}
    raw, its_raw = _values(cfg, resolve=False), _values(usual.cfg, resolve=False)
    for key, value in mine.items():
        is_same = value == its.get(key, "null") or (key in its_raw and raw.get(key) == its_raw[key])
        if is_same or key in (_RECORDING, "scenario.name"):
            continue
        shown = key.removeprefix("scenario.")
        if shown == "hand":
            yield f"{len(hand.read(value))} changes by hand"
        elif shown == "changes":
            for change in filter(lambda one: isinstance(one, Mapping), value):
                settings = " ".join(f"{name}={_text(new)}" for name, new in dict(change).items() if name != "at_s")
                yield f"{settings} at {_text(dict(change).get('at_s'))} s"
        else:
            yield f"{shown}={_text(value)}"


def _values(cfg: DictConfig, *, resolve: bool) -> dict[str, Any]:
    """The values that `changed` can name, by their dotted keys."""
    groups = (group for group in _SHOWN if group in cfg)
    return dict(conf.flat({one: OmegaConf.to_container(cfg[one], resolve=resolve, enum_to_str=True) for one in groups}))


def _text(value: object) -> str:
    """A value as `changed` has it, without spaces after commas; of a user's own class its name."""
    if isinstance(value, Mapping):
        return "{" + " ".join(f"{key}:{_text(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list):
        return f"[{','.join(map(_text, value))}]"
    if isinstance(value, str) and ".py:" in value:
        return value.rpartition(":")[2]
    return f"{value:g}" if isinstance(value, float) else str(value)


def world_name(scenario: str, changed: str | None) -> str:
    """A world as part of the name of a folder: the scenario, and what differs from it."""
    parts = [scenario, *(changed.split(", ") if changed else [])]
    return "+".join(re.sub(r"[^\w.]+", "-", part) for part in parts)[:_LONGEST].rstrip("+-")


def find_own_files(cfg: DictConfig) -> None:
    """Write down where the user's files are."""
    groups = (group for group in (*PART_GROUPS, "environment") if group in cfg)
    for part, key, path, name in list(own_references({group: cfg[group] for group in groups})):
        part[key] = literal(f"{path.absolute()}:{name}")
