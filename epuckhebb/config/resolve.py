"""Completes a composed configuration: names, changes of the world, own files, and `changed`.

A choice of a group is known by the name of its file or row, so that need not say `name:`. A configuration that has all
names is left as it is.
"""

import functools
import re
from collections.abc import Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, ListConfig, OmegaConf, flag_override
from omegaconf.errors import OmegaConfBaseException

from epuckhebb.config import environments, yaml_file
from epuckhebb.config.build import scenario_from
from epuckhebb.config.catalogue import BROUGHT, NULL, by_hydra, changes, of_program
from epuckhebb.config.changed import differences, find_own_files, usual_world
from epuckhebb.config.errors import explain
from epuckhebb.config.overrides import literal
from epuckhebb.config.parts import KINDS, NONE, PAPER, part_class, part_from
from epuckhebb.config.schema import WorldConfig, plain
from epuckhebb.controller.wiring import LAYERS
from epuckhebb.runtime import ConfigError, conf, data_folder, path_of
from epuckhebb.tmaze.individual import HEBBIAN
from epuckhebb.tmaze.physics_engine import Physics
from epuckhebb.tmaze.scenario import TRAINED, Scenario

_NAMED = ("maze", "robot", "scenario", "hebbian", "training")  # groups whose settings have a name
_OF_ANY_NUMBER = ("change", "experiment", "ga")  # groups of which no choice need be made, or several can
_OF_GA = re.compile(r"[+~]*ga[.=]")  # an override of the genetic algorithm


def resolve(
    command: str, cfg: DictConfig, choices: Mapping[str, str], overrides: Sequence[str], config_dir: str | None
) -> None:
    """Complete a configuration as Hydra composed it; it is changed. choices: of each group."""
    with flag_override(cfg, ["struct", "readonly"], [False, False]):
        try:
            if "environment" in cfg:  # first, since rows of rules refer to the maze
                environments.complete(cfg, choices, overrides)
            find_own_files(cfg)
            if "environment" in cfg:
                _complete_classes(cfg)
            elif "scenario" in cfg and cfg.get("changed") is None:
                _resolve(command, cfg, dict(choices), overrides, config_dir)
        except OmegaConfBaseException as error:
            raise ConfigError(explain(error)) from error


def _resolve(
    command: str, cfg: DictConfig, choices: dict[str, str], overrides: Sequence[str], config_dir: str | None
) -> None:
    for group, known in conf.groups(command).items():
        if group not in _OF_ANY_NUMBER and choices.get(group, NULL) == NULL:
            raise ConfigError(f"{group} must be one of {', '.join(known)}, got none of them, or several")
    _make_changes(cfg, choices, config_dir)
    usual = usual_world(command, choices, overrides, config_dir)
    cfg.changed = literal(", ".join(differences(cfg, choices, usual))) if usual else ""
    for group in _NAMED:
        if group in cfg and not cfg[group].get("name"):
            changed = cfg.change if group == "scenario" else ()
            cfg[group].name = "_".join([choices.get(group, ""), *changed])
    if usual and "training" in cfg and OmegaConf.merge(cfg.training, {"name": ""}) != usual.cfg.training:
        cfg.training.name += " changed"
    added = cfg.get("adaptation")
    if added and added.name == NONE and (added.change_signal != NONE or added.homeostasis):
        _, is_own, kind = str(added.change_signal).rpartition(":")
        cfg.adaptation.name = kind.lower() if is_own else choices["adaptation"]
    if cfg.get("compare"):
        cfg.compare = dict(_compared(str(name), given, config_dir) for name, given in cfg.compare.items())
    if ":" in str((cfg.get("optimizer") or {}).get("algorithm")) and not any(map(_OF_GA.match, overrides)):
        cfg.ga = None
    _complete_parts(cfg)
    if usual:
        _fit_rule(cfg, choices["hebbian"], usual.cfg.hebbian)


def _make_changes(cfg: DictConfig, choices: dict[str, str], config_dir: str | None) -> None:
    """Write down what the changes bring, and refuse two that set the same key."""
    known = changes(Path(config_dir).absolute() if config_dir else None) if cfg.change else {}
    set_by: dict[str, str] = {}
    for name, settings in cfg.change.items():
        if settings is not None:
            raise ConfigError(f"change.{name} takes no settings, got {settings}; put them into change/{name}.yaml")
        row = known.get(name, {})
        for key, _ in conf.flat(row):
            if key in set_by:
                raise ConfigError(f"change: {set_by[key]} and {name} both change {key}; give one of the two")
            set_by[key] = name
        cfg.change[name] = {group: str(row[group]) for group in BROUGHT if group in row}
        physics = cfg.change[name].get("physics", choices["physics"])
        if choices["physics"] != physics:  # that a sweep trains with
            cfg.physics, choices["physics"] = yaml_file.load(_physics_file(physics)), physics


def _compared(name: str, given: Any, config_dir: str | None) -> tuple[str, Any]:
    """What is compared, by its name; a name alone stands for the adaptation or the rule of this name."""
    if given is None and name in (NONE, PAPER):  # the run has it anyway
        return HEBBIAN, {}
    try:
        if given is None:
            file = Path(config_dir or ".", "adaptation", f"{name}.yaml")
            is_adaptation = name in conf.groups("evaluate")["adaptation"] or (config_dir is not None and file.is_file())
            added = _named(f"{'adaptation' if is_adaptation else 'hebbian'}={name}", config_dir)
            return name, {**added["hebbian"], **({"adaptation": added["adaptation"]} if is_adaptation else {})}
        if isinstance(given, DictConfig) and isinstance(given.get("adaptation"), str):
            given.adaptation = _named(f"adaptation={given.adaptation}", config_dir)["adaptation"]
    except ConfigError as error:
        raise ConfigError(f"compare.{name}: {error}") from error
    return name, given


def _named(word: str, config_dir: str | None) -> dict[str, Any]:
    """The settings of a rule and of an adaptation that one choice brings, references unresolved."""
    found = by_hydra("compared", [word], config_dir) if config_dir else of_program("compared", word)
    values: Any = OmegaConf.to_container(found.cfg)
    return dict(values)


def _complete_classes(cfg: DictConfig) -> None:
    """Write down what was left as it is in classes of parts."""
    for kind in ("rule", "fitness", "task", "wiring", "optimizer"):
        group, key = KINDS[kind].group, KINDS[kind].key
        part = str((cfg.get(group) or {}).get(key))
        if ":" in part or (kind == "wiring" and part in KINDS[kind].names and part != LAYERS):
            _write_defaults(cfg[group], kind, part, group)
    if cfg.network.get("wiring") != LAYERS and cfg.network.get("layers") is None:
        cfg.network.pop("layers", None)


def _complete_parts(cfg: DictConfig) -> None:
    """Write down where changes by hand are, what sensors of the user's read, and what was left as it is in classes."""
    _complete_classes(cfg)
    sensors = cfg.robot.get("sensors")
    for number, settings in enumerate(sensors if isinstance(sensors, ListConfig) else ()):
        key = f"robot.sensors[{number}]"
        if not isinstance(settings, DictConfig) or ":" not in str(settings.get("sensor")):
            raise ConfigError(f"{key} must be {{sensor: FILE.py:NAME}} and its settings, got {settings}")
        settings.setdefault("readings", list(part_class("sensor", settings.sensor, key).readings))
        _write_defaults(settings, "sensor", settings.sensor, key)
    if cfg.scenario.get("hand") is not None:
        cfg.scenario.hand = literal(str(path_of(cfg.scenario.hand, "scenario.hand").absolute()))


def _write_defaults(settings: DictConfig, kind: str, part: str, key: str) -> None:
    """Write down what a class has that was left as it is, but for what it shares with all rules, or all wirings."""
    base: Any = KINDS[kind].base
    shared = {(field.name, field.default) for field in fields(base)} if kind in ("rule", "wiring") else set()
    for field in fields(part_class(kind, part, key)):
        is_new = field.name not in settings and (field.name, field.default) not in shared
        if is_new and isinstance(field.default, bool | int | float | str):
            settings[field.name] = field.default


def _fit_rule(cfg: DictConfig, choice: str, chosen: DictConfig) -> None:
    """Give a rule that was named by its class its own rate and bounds, and drop what the row says for another rule."""
    rule = cfg.hebbian.get("rule")
    if rule in (None, NONE, chosen.get("rule")):
        return
    kind = part_class("rule", rule, "hebbian")
    own = {field.name: field.default for field in fields(kind)}
    raw: Any = OmegaConf.to_container(cfg.hebbian)
    raw_chosen: Any = OmegaConf.to_container(chosen)
    as_chosen = {key for key, value in raw_chosen.items() if raw.get(key) == value}
    if "N" in as_chosen or "N" not in raw:
        cfg.hebbian.N = own["N"] or raw.get("N", cfg.scenario.paper_N)
    if "normalise" in as_chosen:
        cfg.hebbian.normalise = own["normalise"].name
    for key in as_chosen - {"rule", "name", *own}:
        del cfg.hebbian[key]
    if cfg.hebbian.get("name") == choice:
        cfg.hebbian.name = kind.__name__.lower()


def training_world(config: WorldConfig, experiment: str, physics: Physics) -> Scenario:
    """The world in which controllers of an experiment are evolved, for the robot and in the maze of a configuration.

    If a change brought that maze, training is in the usual one. physics: of their evolution.
    """
    cfg = of_program("evaluate", f"scenario={TRAINED[experiment]}").cfg.copy()
    cfg.scenario.name = TRAINED[experiment]
    if config.maze.get("name") not in [change.get("maze") for change in config.change.values()]:
        cfg.maze = config.maze
    world = scenario_from(OmegaConf.to_object(cfg.scenario), plain(cfg)["maze"], config.robot)
    return replace(world, physics=physics)


@functools.cache
def usual_physics(name: str) -> Physics:
    """The physics of this name with the settings of its file."""
    physics: Physics = part_from("physics", yaml_file.load(_physics_file(name)), "physics")
    return physics


def _physics_file(name: str) -> Path:
    """The file of a physics of the program's."""
    file = data_folder("conf") / "physics" / f"{name}.yaml"
    if not file.is_file():
        raise ConfigError(f"physics must be one of {', '.join(conf.groups('evaluate')['physics'])}, got {name}")
    return file
