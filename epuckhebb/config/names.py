"""What a composed configuration leaves to its files: their names, and what differs from the scenario of that name.

A file of `conf/` is known by its own name, so it need not say `name:`. Hydra knows which files were chosen and where it
looked for them; here the names are filled in, and a value that is not that of the named scenario, or of the lifetime
that is usual there, is named in the key `changed`, which tables, folders and pages show. A configuration that has all
names is left as it is.
"""

import copy
import functools
import json
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, ListConfig, OmegaConf, flag_override
from omegaconf.errors import OmegaConfBaseException

from epuckhebb.config.build import scenario_from
from epuckhebb.config.choices import BROUGHT, OURS, choice_names, choice_of, known_choice
from epuckhebb.config.overrides import literal
from epuckhebb.config.parts import KINDS, NONE, PAPER, PART_GROUPS, part_class, part_from
from epuckhebb.config.parts_from_yaml import maze_from
from epuckhebb.config.plugins import own_references
from epuckhebb.config.schema import ScenarioConfig, plain, said
from epuckhebb.controller.plasticity.rule import Rule
from epuckhebb.controller.wiring import LAYERS
from epuckhebb.evolution.training import Training
from epuckhebb.runtime import ConfigError, path_of
from epuckhebb.tmaze.individual import HEBBIAN
from epuckhebb.tmaze.maze import T_MAZE
from epuckhebb.tmaze.physics.pymunk import PYMUNK
from epuckhebb.tmaze.physics_engine import Physics
from epuckhebb.tmaze.robot import EPUCK
from epuckhebb.tmaze.scenario import TRAINED, Scenario

_GROUPS = ("maze", "robot", "scenario", "hebbian", "training")
_RULE = "override /hebbian"  # in the defaults of an adaptation
_LIFETIME = "override /lifetime"  # in the defaults of a task
_RECORDING = "record_every"  # the setting of a lifetime that changes nothing in it
_LONGEST = 80  # characters of a world in the name of a folder
_for_name: list[Any] = []  # what `_changes` was asked last for such a name, and its answer


def resolve_names(
    cfg: DictConfig, choices: Mapping[str, Any], folders: Sequence[Path], *, for_name: bool = False
) -> DictConfig:
    """The configuration with all names in it. cfg: as Hydra composed it; it is changed.

    choices: the file that was chosen of each group. folders: where Hydra looked for files, first found first taken.
    for_name: whether only the name of a run's folder is wanted; the run will ask for itself.
    """
    if ":" in str((cfg.get("flock") or {}).get("coupling")):
        cfg.flock.coupling = _absolute(cfg.flock.coupling, "flock.coupling")
    if "scenario" not in cfg or cfg.get("changed") is not None:
        return cfg
    own = {name: settings for name, settings in cfg.change.items() if settings is not None}  # no choices of the group
    known = [str(choices.get("scenario")), *(str(name) for name in cfg.change if name not in own)]
    chosen = {group: str(choice) for group, choice in choices.items()} | {"scenario": "_".join(known)}
    with flag_override(cfg, ["struct", "readonly"], [False, False]):
        if own and not cfg.scenario.get("name"):
            cfg.scenario.name = "_".join([*known, *map(str, own)])
        brought = _of_scenario("physics", chosen["scenario"], folders)
        if brought and brought["kind"] != cfg.physics.get("kind"):  # of a study whose training is in another
            cfg.physics = brought
        for name, settings in own.items():
            _make(f"change.{name}", settings, cfg, folders)
        for group in _GROUPS:
            if group in cfg and not cfg[group].get("name"):
                cfg[group].name = chosen.get(group, "")
        added = cfg.get("adaptation")
        if added and added.name == NONE and (added.change_signal != NONE or added.homeostasis):
            _, is_own, kind = str(added.change_signal).rpartition(":")
            cfg.adaptation.name = kind.lower() if is_own else chosen.get("adaptation", NONE)
        if "training" in cfg and _is_changed(cfg.training, chosen.get("training", ""), folders):
            cfg.training.name += " changed"
        if cfg.get("compare"):
            cfg.compare = dict(_compared(str(name), given, folders) for name, given in cfg.compare.items())
        try:
            _own_code(cfg)
            _own_rule(cfg, chosen.get("hebbian", ""), folders)
            if cfg.scenario.get("hand") is not None:
                cfg.scenario.hand = literal(str(path_of(cfg.scenario.hand, "scenario.hand").absolute()))
            cfg.changed = literal(_changes(cfg, chosen, folders, for_name=for_name))
            cfg.change = {}  # they are in the scenario, and in its name
        except ConfigError:
            raise
        except (ValueError, OmegaConfBaseException) as error:
            raise ConfigError(said(error)) from error
    return cfg


def world_name(cfg: DictConfig, choices: Mapping[str, Any], folders: Sequence[Path]) -> str:
    """The world of a configuration as part of the name of a folder: the scenario, and what differs from it."""
    try:
        known = resolve_names(cfg, choices, folders, for_name=True)
    except (ValueError, OmegaConfBaseException):  # the job says what is wrong, and leaves no folder
        return str(choices.get("scenario"))
    parts = [str(known.scenario.name), *(str(known.changed).split(", ") if known.changed else [])]
    return "+".join(re.sub(r"[^\w.]+", "-", part) for part in parts)[:_LONGEST].rstrip("+-")


def _make(key: str, settings: Any, cfg: DictConfig, folders: Sequence[Path]) -> None:
    """Make a change of the user's, whose settings stand below a key, in the scenario; and its maze and its physics."""
    if not isinstance(settings, DictConfig):
        raise ConfigError(f"{key} must be settings of a scenario, for example {{light: 0.05}}, got {settings}")
    for group in BROUGHT:
        if (name := settings.pop(group, None)) is not None:
            if (found := choice_of(group, name, folders)) is None:
                raise ConfigError(f"{key}.{group} must be one of {', '.join(choice_names(group, folders))}, got {name}")
            cfg[group] = {**found.settings, "name": name} if group == "maze" else found.settings
    try:
        cfg.scenario.merge_with(settings)
    except OmegaConfBaseException as error:
        raise ConfigError(f"{key}: {said(error)}") from error


def _is_changed(training: DictConfig, name: str, folders: Sequence[Path]) -> bool:
    """Whether the training that a file describes was given other values."""
    found = known_choice("training", name, folders)
    if found is None or training.name != name:
        return False
    return bool(OmegaConf.merge(OmegaConf.structured(Training(name=name)), found.settings) != training)


def _compared(name: str, given: Any, folders: Sequence[Path]) -> tuple[str, Any]:
    """What is compared, by its name; a name alone stands for the adaptation or the rule of this name."""
    if given is None and name in (NONE, PAPER):  # the run has it anyway
        return HEBBIAN, {}
    if given is None:
        over = choice_of("adaptation", name, folders)
        rule = choice_of("hebbian", over.brings.get(_RULE, PAPER) if over else name, folders)
        if rule is None:
            known = {one for group in ("adaptation", "hebbian") for one in choice_names(group, folders)}
            raise ConfigError(
                f"compare=[{name}]: a name must be one of {', '.join(sorted(known))}; what has another is given with "
                f"its settings, for example compare.{name}={{N: 0.002, sign: shuffled}}"
            )
        given = copy.deepcopy(rule.settings)
        if over:
            given.adaptation = over.settings.adaptation
        return name, given
    if isinstance(given, DictConfig) and isinstance(choice := given.get("adaptation"), str):
        over = choice_of("adaptation", choice, folders)
        if over is None:
            there = choice_names("adaptation", folders)
            raise ConfigError(
                f"compare.{name}.adaptation must be one of {', '.join(sorted(there))}, or its settings, got {choice!r}"
            )
        given.adaptation = over.settings.adaptation
    return name, given


def _own_code(cfg: DictConfig) -> None:
    """Write down where the user's files are, and what was left as it is in their classes."""
    for settings, key, path, name in list(own_references({group: cfg[group] for group in PART_GROUPS if group in cfg})):
        settings[key] = literal(f"{path.absolute()}:{name}")
    for kind, row in KINDS.items():
        settings = cfg.get(row.group)
        part = settings.get(row.key) if isinstance(settings, DictConfig) else None
        if kind not in ("rule", "change signal") and (":" in str(part) or (kind == "wiring" and part != LAYERS)):
            _write_defaults(settings, part_class(kind, part, row.group))
    if ":" in str((cfg.get("optimizer") or {}).get("algorithm")):
        cfg.ga = None
    if cfg.network.get("wiring") != LAYERS and cfg.network.get("layers") is None:
        cfg.network.pop("layers", None)
    sensors = cfg.robot.get("sensors")
    for number, settings in enumerate(sensors if isinstance(sensors, ListConfig) else ()):
        key = f"robot.sensors[{number}]"
        if not isinstance(settings, DictConfig) or ":" not in str(settings.get("sensor")):
            raise ConfigError(f"{key} must be {{sensor: FILE.py:NAME}} and its settings, got {settings}")
        kind = part_class("sensor", settings.sensor, key)
        _write_defaults(settings, kind)
        settings.setdefault("readings", list(kind.readings))


def _absolute(where: Any, key: str) -> str:
    """`FILE.py:NAME` with the whole path of the file; another name as it is."""
    file, colon, name = str(where).rpartition(":")
    return literal(f"{path_of(file, key).absolute()}:{name}") if colon else name


def _write_defaults(settings: DictConfig, kind: Any, besides: Sequence[str] = ()) -> None:
    """Write down what the user left as it is in a class, but for these keys."""
    for field in fields(kind):
        if field.name not in {*besides, *settings} and isinstance(field.default, bool | int | float | str):
            settings[field.name] = field.default


def _own_rule(cfg: DictConfig, name: str, folders: Sequence[Path]) -> None:
    """Give a user's own rule its settings; drop what the chosen file of `conf/hebbian/` says for another rule."""
    found, rule = choice_of("hebbian", name, folders), cfg.hebbian.get("rule")
    if found is None or rule in (None, NONE, _absolute(found.settings.get("rule"), "hebbian.rule")):
        return
    chosen, kind = found.settings, part_class("rule", rule, "hebbian")
    own = {field.name: field.default for field in fields(kind)}
    if "N" not in cfg.hebbian:
        cfg.hebbian.N = own["N"] or cfg.scenario.paper_N
    elif own["N"] and cfg.hebbian._get_node("N") == chosen._get_node("N"):
        cfg.hebbian.N = own["N"]  # the rule says what rate it wants, and the user did not
    for key in chosen.keys() - {"rule", *own}:
        if cfg.hebbian._get_node(key) == chosen._get_node(key):
            del cfg.hebbian[key]
    _write_defaults(cfg.hebbian, kind, besides=[field.name for field in fields(Rule)])
    if cfg.hebbian.get("name") == name:
        cfg.hebbian.name = kind.__name__.lower()


def _changes(cfg: DictConfig, chosen: Mapping[str, str], folders: Sequence[Path], *, for_name: bool) -> str:
    """What differs from the named scenario, the usual lifetime and the usual network.

    A run asks for the name of its folder, and then for itself. So an answer for a name is kept for the next question.
    """
    asked, kept = (OmegaConf.to_container(cfg, resolve=False), chosen, list(folders)), list(_for_name)
    _for_name.clear()
    if kept and not for_name and kept[0] == asked:
        return str(kept[1])
    changes = [_changed(cfg, chosen["scenario"], folders), *_changed_lifetime(cfg, chosen, folders)]
    answer = ", ".join(filter(None, [*changes, *_changed_network(cfg.network)]))
    if for_name:
        _for_name[:] = asked, answer
    return answer


def _changed(cfg: DictConfig, name: str, folders: Sequence[Path]) -> str:
    """What differs from the scenario of this name in its maze, which is mostly the paper's, with the e-puck.

    What bears the name of a scenario of the program's is compared with that, whatever file it is of.
    """
    maze, robot = plain(cfg.maze), plain(cfg.robot)
    if choice_of("scenario", cfg.scenario.name, OURS):
        name = cfg.scenario.name
    if choice_of("scenario", name, OURS):
        folders = OURS
    original = world_of(name, robot, folders, maze)
    task = plain(cfg.task) if "task" in cfg else None
    world = scenario_from(OmegaConf.to_object(cfg.scenario), maze, robot, task, plain(cfg.fitness), plain(cfg.physics))
    if original is None:
        return ""
    brought = _of_scenario("maze", name, folders)
    usual = maze_from(brought) if brought else T_MAZE
    if cfg.scenario.start is not None:  # it takes the place of the start that the maze has
        usual = replace(usual, start=world.maze.start)
    return world.changed_from(original, usual, EPUCK)


def _changed_lifetime(cfg: DictConfig, chosen: Mapping[str, str], folders: Sequence[Path]) -> Iterator[str]:
    """Settings of lifetimes that are not those which this command, or the task, has by itself."""
    task = known_choice("task", chosen.get("task", ""), folders)
    of_command = "evolve" if "training" in cfg else "evaluate"
    found = known_choice("lifetime", task.brings.get(_LIFETIME, of_command) if task else of_command, folders)
    if found is None or "lifetime" not in cfg:
        return
    usual = plain(OmegaConf.create({"lifetime": found.settings, "scenario": cfg.scenario}).lifetime)
    for key, value in plain(cfg.lifetime).items():
        if key != _RECORDING and value != usual.get(key):
            yield f"lifetime.{key}={value:g}"


def _changed_network(settings: DictConfig) -> Iterator[str]:
    """The wiring, if there is one, and settings that are not those of its class."""
    if settings.wiring == LAYERS:
        return
    yield f"network.wiring={str(settings.wiring).rpartition(':')[2]}"
    usual = {field.name: field.default for field in fields(part_class("wiring", settings.wiring, "network"))}
    for key, value in settings.items():
        if key in usual and value != usual[str(key)]:
            yield f"network.{key}={value}"


def world_of(
    name: str, robot: dict[str, Any], folders: Sequence[Path] = OURS, maze: dict[str, Any] | None = None
) -> Scenario | None:
    """A scenario by its name, for a robot; None if there is none. maze: None for the one that it brings."""
    found = choice_of("scenario", name, folders)
    if found is None:
        return None
    maze = maze or _of_scenario("maze", name, folders) or _usual_maze()
    physics = _of_scenario("physics", name, folders)
    return _world(name, *map(json.dumps, (OmegaConf.to_container(found.settings), maze, robot, physics)))


@functools.lru_cache(maxsize=256)
def _world(name: str, *texts: str) -> Scenario:
    """A scenario of the settings of its file, of a maze, a robot and a physics; jobs of a sweep ask for few."""
    found, maze, robot, physics = map(json.loads, texts)
    schema = OmegaConf.structured(ScenarioConfig(name=name))
    whole = OmegaConf.create({"maze": maze, "scenario": OmegaConf.merge(schema, found)})
    return scenario_from(OmegaConf.to_object(whole.scenario), maze, robot, physics=physics)


def training_world(
    experiment: str, scenario: str, maze: dict[str, Any], robot: dict[str, Any], physics: Physics = PYMUNK
) -> Scenario:
    """The world in which controllers of an experiment are evolved, for a robot in the maze of another world.

    If that scenario brings its maze, as a change, training is in the usual one. physics: of their evolution.
    """
    brought = _of_scenario("maze", scenario, OURS)
    if brought is not None and maze_from(brought) == maze_from(maze):
        maze = _usual_maze()
    world = world_of(TRAINED[experiment], robot, maze=maze)
    assert world is not None  # the program has these files
    return replace(world, physics=physics)


@functools.cache
def usual_physics(name: str) -> Physics:
    """The physics of this name with the settings of its file."""
    found = choice_of("physics", name, OURS)
    if found is None:
        raise ConfigError(f"there is no physics {name}; the program has {', '.join(choice_names('physics', OURS))}")
    physics: Physics = part_from("physics", plain(found.settings), "physics")
    return physics


def brings_physics(scenario: str) -> bool:
    """Whether a scenario puts a physics in place of the usual one, as `base_3d` does."""
    return _of_scenario("physics", scenario, OURS) is not None


def _of_scenario(group: str, scenario: str, folders: Sequence[Path]) -> dict[str, Any] | None:
    """The settings of the maze, or of the physics, that a scenario puts in place of the usual one."""
    found = choice_of("scenario", scenario, folders)
    named = found.brings.get(BROUGHT[group]) if found else None
    brought = choice_of(group, named, folders) if named else None
    return plain(brought.settings) if brought else None


def _usual_maze() -> dict[str, Any]:
    """The settings of the paper's maze."""
    usual = choice_of("maze", T_MAZE.name, OURS)
    assert usual is not None  # the program has this file
    return plain(usual.settings)
