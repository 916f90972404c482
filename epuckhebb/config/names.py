"""What a composed configuration leaves to its files: their names, and what differs from the scenario of that name.

A file of `conf/` is known by its own name, so it need not say `name:`. Hydra knows which files were chosen and where it
looked for them; here the names are filled in, and a value that is not that of the named scenario, or of the lifetime
that is usual there, is named in the key `changed`, which tables, folders and pages show. A configuration that has all
names is left as it is.
"""

import functools
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, ListConfig, OmegaConf, flag_override
from omegaconf.errors import OmegaConfBaseException

from epuckhebb.config.build import scenario_from
from epuckhebb.config.choices import (
    BRINGS_MAZE,
    OURS,
    choice_names,
    choice_settings,
    default_override,
    is_choice,
    where_known,
)
from epuckhebb.config.overrides import literal
from epuckhebb.config.parts import NONE, PAPER, fitness_class, rule_class, rule_file
from epuckhebb.config.parts_from_yaml import maze_from, sensor_class
from epuckhebb.config.schema import ScenarioConfig, plain, said
from epuckhebb.evolution.training import Training
from epuckhebb.runtime.errors import ConfigError
from epuckhebb.runtime.resources import path_of
from epuckhebb.sim.controller import HEBBIAN
from epuckhebb.sim.maze import T_MAZE, Maze
from epuckhebb.sim.plasticity.rule import Rule
from epuckhebb.sim.robot import EPUCK
from epuckhebb.sim.scenario import Scenario

_GROUPS = ("maze", "robot", "scenario", "hebbian", "training")
_BRINGS_RULE = "override /hebbian"  # in the defaults of an adaptation
_BRINGS_LIFETIME = "override /lifetime"  # in the defaults of a task
_RECORDING = "record_every"  # the setting of a lifetime that changes nothing in it
_LONGEST = 80  # characters of a world in the name of a folder


def resolve_names(cfg: DictConfig, choices: Mapping[str, Any], folders: Sequence[Path]) -> DictConfig:
    """The configuration with all names in it.

    Args:
        cfg: As Hydra composed it; it is changed.
        choices: The file that was chosen of each group.
        folders: Where Hydra looked for files, first found first taken.
    """
    if not {"scenario", "maze", "robot", "hebbian"} <= cfg.keys() or cfg.get("changed") is not None:
        return cfg
    own = {name: settings for name, settings in cfg.change.items() if settings is not None}  # no choices of the group
    known = [str(choices.get("scenario")), *(str(name) for name in cfg.change if name not in own)]
    choices = {**choices, "scenario": "_".join(known)}
    with flag_override(cfg, ["struct", "readonly"], [False, False]):
        if own and not cfg.scenario.get("name"):
            cfg.scenario.name = "_".join([*known, *map(str, own)])
        for name, settings in own.items():
            _make(f"change.{name}", settings, cfg.scenario)
        for group in _GROUPS:
            if group in cfg and not cfg[group].get("name"):
                cfg[group].name = choices.get(group) or ""
        if "adaptation" in cfg and cfg.adaptation.name == NONE and _acts(cfg.adaptation):
            cfg.adaptation.name = choices.get("adaptation") or NONE
        if "training" in cfg and _is_changed(cfg.training, str(choices.get("training")), folders):
            cfg.training.name += " changed"
        if None in (cfg.get("compare") or {}).values():
            cfg.compare = _compared(cfg.compare, folders)
        _own_fitness(cfg.fitness)
        _own_sensors(cfg.robot.get("sensors"))
        _own_rules(cfg, str(choices.get("hebbian")), folders)
        if cfg.scenario.get("hand") is not None:
            cfg.scenario.hand = literal(str(path_of(cfg.scenario.hand, "scenario.hand").absolute()))
        for name, settings in (cfg.get("compare") or {}).items():
            if isinstance(settings, DictConfig) and isinstance(settings.get("adaptation"), str):
                settings.adaptation = _adaptation(settings.adaptation, f"compare.{name}.adaptation", folders)
        try:
            changes = [_changed(cfg, str(choices.get("scenario")), folders), *_changed_lifetime(cfg, choices, folders)]
            cfg.changed = literal(", ".join(filter(None, changes)))
            cfg.change = {}  # they are in the scenario, and in its name
        except (ValueError, OmegaConfBaseException) as error:
            raise ConfigError(said(error)) from error
    return cfg


def _make(key: str, settings: Any, scenario: DictConfig) -> None:
    """Make a change of the user's, whose settings stand below a key, in the scenario."""
    if not isinstance(settings, DictConfig):
        raise ConfigError(f"{key} must be settings of a scenario, for example {{light: 0.05}}, got {settings}")
    try:
        scenario.merge_with(settings)
    except OmegaConfBaseException as error:
        raise ConfigError(f"{key}: {said(error)}") from error


def _acts(adaptation: DictConfig) -> bool:
    return bool(adaptation.change_signal != NONE or adaptation.self_check or adaptation.homeostasis)


def world_name(cfg: DictConfig, choices: Mapping[str, Any], folders: Sequence[Path]) -> str:
    """The world of a configuration as part of the name of a folder: the scenario, and what differs from it."""
    try:
        known = resolve_names(cfg, choices, folders)
    except (ValueError, OmegaConfBaseException):  # the job says what is wrong, and leaves no folder
        return str(choices.get("scenario"))
    parts = [str(known.scenario.name), *(str(known.changed).split(", ") if known.changed else [])]
    return "+".join(re.sub(r"[^\w.]+", "-", part) for part in parts)[:_LONGEST].rstrip("+-")


def _is_changed(training: DictConfig, choice: str, folders: Sequence[Path]) -> bool:
    """Whether the training that a file describes was given other values."""
    found = choice_settings("training", choice, where_known("training", choice, folders))
    if found is None or training.name != choice:
        return False
    return bool(OmegaConf.merge(OmegaConf.structured(Training(name=choice)), found) != training)


def _own_rules(cfg: DictConfig, choice: str, folders: Sequence[Path]) -> None:
    """Write down where a user's rule is, and its settings; drop what a file of `conf/hebbian/` says for another."""
    for settings in [cfg.hebbian, *(cfg.get("compare") or {}).values()]:
        file = rule_file(settings) if isinstance(settings, DictConfig) else None
        if file is not None:
            settings.rule = literal(_absolute(file, settings))
    chosen = choice_settings("hebbian", choice, folders)
    if chosen is None:
        return
    file = rule_file(chosen)
    own = chosen.get("rule") if file is None else _absolute(file, chosen)
    if cfg.hebbian.get("rule") in (None, NONE, own):
        return
    kind = rule_class(str(cfg.hebbian.rule), "hebbian")
    own_rate = kind.__dataclass_fields__["N"].default
    if "N" not in cfg.hebbian:
        cfg.hebbian.N = own_rate or cfg.scenario.paper_N
    elif own_rate and cfg.hebbian._get_node("N") == chosen._get_node("N"):
        cfg.hebbian.N = own_rate  # the rule says what rate it wants, and the user did not
    for key in [key for key in chosen if key not in {"rule", *kind.__dataclass_fields__}]:
        if cfg.hebbian._get_node(key) == chosen._get_node(key):
            del cfg.hebbian[key]
    given = {*Rule.__dataclass_fields__, *cfg.hebbian}
    for key, field in kind.__dataclass_fields__.items():  # what the user left as it is in the class
        if key not in given and isinstance(field.default, bool | int | float | str):
            cfg.hebbian[key] = field.default
    if cfg.hebbian.get("name") == choice:
        cfg.hebbian.name = kind.__name__.lower()


def _own_fitness(settings: DictConfig) -> None:
    """Write down where a user's fitness is, and what they left as it is in the class."""
    file, colon, name = str(settings.get("function")).rpartition(":")
    if not colon:
        return
    settings.function = literal(f"{path_of(file, 'fitness.function').absolute()}:{name}")
    _write_defaults(settings, fitness_class(settings.function))


def _own_sensors(sensors: Any) -> None:
    """Write down where the user's sensors are, what was left as it is in the class, and what each reading is called."""
    for number, settings in enumerate(sensors if isinstance(sensors, ListConfig) else ()):
        key = f"robot.sensors[{number}]"
        if not isinstance(settings, DictConfig) or ":" not in str(settings.get("sensor")):
            raise ConfigError(f"{key} must be {{sensor: FILE.py:NAME}} and its settings, got {settings}")
        file, _, name = str(settings.sensor).rpartition(":")
        settings.sensor = literal(f"{path_of(file, f'{key}.sensor').absolute()}:{name}")
        kind = sensor_class(settings.sensor, f"{key}.sensor")
        _write_defaults(settings, kind)
        if "readings" not in settings:
            settings.readings = list(kind.readings)


def _write_defaults(settings: DictConfig, kind: Any) -> None:
    """Write down what the user left as it is in a class."""
    for key, field in kind.__dataclass_fields__.items():
        if key not in settings and isinstance(field.default, bool | int | float | str):
            settings[key] = field.default


def _absolute(file: Path, settings: DictConfig) -> str:
    return f"{file.absolute()}:{str(settings.rule).rpartition(':')[2]}"


def _adaptation(choice: str, key: str, folders: Sequence[Path]) -> Any:
    """The settings of an adaptation that is named below `compare`."""
    found = choice_settings("adaptation", choice, folders)
    if found is None:
        there = sorted(choice_names("adaptation", folders))
        raise ConfigError(f"{key} must be one of {', '.join(there)}, or its settings, got {choice!r}")
    return found.adaptation


def _compared(compare: DictConfig, folders: Sequence[Path]) -> dict[str, Any]:
    """What is compared, where a name alone stands for the adaptation or the rule of this name."""
    controllers: dict[str, Any] = {}
    for key, given in compare.items():
        name = str(key)
        if given is None and name in (NONE, PAPER):  # the run has it anyway
            controllers[HEBBIAN] = {}
            continue
        settings = _rule_brought(name, folders) if given is None else given
        if settings is None:
            there = {name for group in ("adaptation", "hebbian") for name in choice_names(group, folders)}
            raise ConfigError(
                f"compare=[{name}]: a name must be one of {', '.join(sorted(there))}; what has another is given with "
                f"its settings, for example compare.{name}={{N: 0.002, sign: shuffled}}"
            )
        over = choice_settings("adaptation", name, folders) if given is None else None
        if over is not None:
            settings.adaptation = over.adaptation
        controllers[name] = settings
    return controllers


def _rule_brought(choice: str, folders: Sequence[Path]) -> DictConfig | None:
    """The settings of the rule that an adaptation of this name brings, or else of the rule of this name."""
    usual = choice if not is_choice("adaptation", choice, folders) else PAPER
    return choice_settings("hebbian", default_override("adaptation", choice, _BRINGS_RULE, folders) or usual, folders)


def _changed(cfg: DictConfig, choice: str, folders: Sequence[Path]) -> str:
    """What differs from the scenario of this name in its maze, which is mostly the paper's, with the e-puck.

    What bears the name of a scenario of the program's is compared with that, whatever file it is of.
    """
    maze, robot = plain(cfg.maze), plain(cfg.robot)
    name = str(cfg.scenario.name)
    if is_choice("scenario", name, OURS):
        choice = name
    folders = where_known("scenario", choice, folders)
    original = scenario_of(choice, folders, maze, robot)
    task = plain(cfg.task) if "task" in cfg else None
    world = scenario_from(OmegaConf.to_object(cfg.scenario), maze, robot, task, plain(cfg.fitness), plain(cfg.physics))
    return "" if original is None else world.changed_from(original, maze_brought(choice, folders) or T_MAZE, EPUCK)


def _changed_lifetime(cfg: DictConfig, choices: Mapping[str, Any], folders: Sequence[Path]) -> Iterator[str]:
    """Settings of lifetimes that are not those which this command, or the task, has by itself."""
    command = "evolve" if "training" in cfg else "evaluate"
    task = str(choices.get("task"))
    choice = default_override("task", task, _BRINGS_LIFETIME, where_known("task", task, folders)) or command
    found = choice_settings("lifetime", choice, where_known("lifetime", choice, folders))
    if found is None or "lifetime" not in cfg:
        return
    usual = plain(OmegaConf.create({"lifetime": found, "scenario": cfg.scenario}).lifetime)
    for key, value in plain(cfg.lifetime).items():
        if key != _RECORDING and value != usual.get(key):
            yield f"lifetime.{key}={value:g}"


def scenario_of(choice: str, folders: Sequence[Path], maze: dict[str, Any], robot: dict[str, Any]) -> Scenario | None:
    """The scenario of a file of `conf/scenario/`, in a maze, for a robot; None if there is no such file."""
    found = choice_settings("scenario", choice, folders)
    return None if found is None else _scenario(choice, *map(json.dumps, (OmegaConf.to_container(found), maze, robot)))


@functools.lru_cache(maxsize=256)
def _scenario(choice: str, *texts: str) -> Scenario:
    """A scenario of the settings of its file, of a maze and of a robot; jobs of a sweep ask for the same few again."""
    found, maze, robot = map(json.loads, texts)
    schema = OmegaConf.structured(ScenarioConfig(name=choice))
    whole = OmegaConf.create({"maze": maze, "scenario": OmegaConf.merge(schema, found)})
    return scenario_from(OmegaConf.to_object(whole.scenario), maze, robot)


def maze_brought(choice: str, folders: Sequence[Path]) -> Maze | None:
    """The maze that a file of `conf/scenario/`, or one that it takes over from, puts in place of the usual one."""
    brought = _maze_settings(choice, folders)
    return None if brought is None else maze_from(brought)


def _maze_settings(choice: str, folders: Sequence[Path]) -> dict[str, Any] | None:
    """The settings of that maze."""
    brought = default_override("scenario", choice, BRINGS_MAZE, folders)
    found = None if brought is None else choice_settings("maze", brought, folders)
    return None if found is None else plain(found)


def world_of(choice: str, folders: Sequence[Path], robot: dict[str, Any]) -> Scenario | None:
    """The scenario of a file of `conf/scenario/` in the maze that it brings, or the usual one; None without a file."""
    return scenario_of(choice, folders, _maze_settings(choice, folders) or _usual_maze(), robot)


def maze_asked(choice: str, maze: dict[str, Any]) -> dict[str, Any]:
    """The maze of the training world: this one; the paper's if this one comes with the scenario, as a change."""
    brought = maze_brought(choice, OURS)
    return maze if brought is None or brought != maze_from(maze) else _usual_maze()


def _usual_maze() -> dict[str, Any]:
    """The settings of the paper's maze."""
    usual = choice_settings("maze", T_MAZE.name, OURS)
    assert usual is not None  # the program has this file
    return plain(usual)
