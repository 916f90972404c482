"""Completes a composed configuration: names, changes of the world, own files, and `changed`.

`changed` is what differs from the named world, as tables, folders and pages show it: the difference to a configuration
that is composed of nothing but the choices that name the world. A choice of a group is known by the name of its file or
row, so that need not say `name:`. A configuration that has all names is left as it is.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, NamedTuple

from omegaconf import DictConfig, ListConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from epuckhebb.config import environments, hand
from epuckhebb.config.build import make_scenario
from epuckhebb.config.catalogue import NULL
from epuckhebb.config.errors import explain
from epuckhebb.config.parts import KINDS, NONE, PAPER, PART_GROUPS, make_part, part_class
from epuckhebb.config.plugins import place_files
from epuckhebb.config.schema import SCHEMAS, ScenarioConfig, WorldConfig, plain
from epuckhebb.config.source import BROUGHT, change_row, choice, merge, named
from epuckhebb.config.values import declared, default_values, make
from epuckhebb.controller.plasticity.rule import Rule
from epuckhebb.controller.wiring import LAYERS
from epuckhebb.runtime import ConfigError, conf, data_folder, refusing, user_path, yaml_file
from epuckhebb.runtime.yaml_file import DEFAULTS
from epuckhebb.tmaze.individual import HEBBIAN
from epuckhebb.tmaze.physics.pymunk import PYMUNK
from epuckhebb.tmaze.scenario import TRAINED, Scenario

_NAMED = ("maze", "robot", "scenario", "hebbian", "training")  # groups whose settings have a name
_OF_ANY_NUMBER = ("change", "experiment", "ga")  # groups of which no choice need be made, or several can
_OF_GA = re.compile(r"[+~]*ga[.=]")  # an override of the genetic algorithm
_PARTS = ("maze", "robot", "task", "fitness", "physics")  # groups whose choice `changed` names
_SHOWN = ("scenario", "lifetime", "network", *_PARTS)  # groups whose values `changed` names
_USUAL = ("training", "hebbian")  # more groups whose choice is as it is in what a configuration is compared with
_RECORDING = "lifetime.record_every"  # changes nothing in a lifetime
T_MAZE = "t_maze"  # the maze of training
_LONGEST = 80  # characters of a world in the name of a folder


class Named(NamedTuple):
    """A configuration of nothing but the choices that name the world. differ: groups of parts with another choice."""

    cfg: DictConfig
    differ: list[str]


def resolve(
    command: str, cfg: DictConfig, choices: Mapping[str, str], overrides: Sequence[str], folders: Sequence[Path]
) -> None:
    """Complete a configuration as Hydra composed it; it is changed.

    choices: of each group. folders: in which Hydra has looked for them, in turn.
    """
    OmegaConf.set_struct(cfg, False)
    with refusing(explain, OmegaConfBaseException):
        _check_shape(cfg, default_values(SCHEMAS[command]))
        if "environment" in cfg:  # first, since rows of rules refer to the maze
            environments.complete(cfg, choices, overrides)
            _compare_in_environment(cfg, folders)
            find_own_files(cfg)
            _complete_classes(cfg)
            return
        find_own_files(cfg)
        if "scenario" in cfg and cfg.get("changed") is None:
            _resolve(command, cfg, dict(choices), overrides, folders)


def _check_shape(cfg: DictConfig, defaults: Mapping[str, Any], prefix: str = "") -> None:
    """Refuse a value in place of settings or of a list, which are completed before the schema checks what they hold."""
    for key, default in defaults.items():
        if key not in cfg.keys():  # noqa: SIM118  # a value that refers to nothing is not `in cfg`
            raise ConfigError(f"{prefix}{key} is missing; it cannot be removed")
        if isinstance(default, list) and not isinstance(cfg[key], ListConfig):
            raise ConfigError(f"{prefix}{key} must be a list, got {cfg[key]}")
        if isinstance(default, dict) and (prefix, key) != ("", "ga"):
            if not isinstance(cfg[key], DictConfig):
                hint = "give keys below it (in a file, a choice of a group stands in its `defaults`)"
                raise ConfigError(f"{prefix}{key} must be settings, got {cfg[key]}; {hint}")
            _check_shape(cfg[key], default, f"{prefix}{key}.")


def _resolve(
    command: str, cfg: DictConfig, choices: dict[str, str], overrides: Sequence[str], folders: Sequence[Path]
) -> None:
    for group, known in conf.groups(command).items():
        if group not in _OF_ANY_NUMBER and choices.get(group, NULL) == NULL:
            raise ConfigError(f"{group} must be one of {', '.join(known)}, got none of them, or several")
    _make_changes(cfg, choices, folders)
    _check_idle(cfg, overrides)
    world = named_world(command, choices, cfg.change, folders)
    cfg.changed = ", ".join(differences(cfg, choices, world))
    for group in _NAMED:
        if group in cfg and not cfg[group].get("name"):
            changed = cfg.change if group == "scenario" else ()
            cfg[group].name = "_".join([choices.get(group, ""), *changed])
    if "training" in cfg and any(
        value != world.cfg.training.get(key) for key, value in cfg.training.items() if key != "name"
    ):
        cfg.training.name += " changed"
    added = cfg.get("adaptation")
    if added and added.name == NONE and (added.change_signal != NONE or added.homeostasis):
        _, is_own, kind = str(added.change_signal).rpartition(":")
        cfg.adaptation.name = kind.lower() if is_own else choices["adaptation"]
    if cfg.get("compare"):
        ours = (HEBBIAN, {"rule": PAPER})  # the paper's rule, which the run has anyway
        cfg.compare = dict(
            ours if given is None and name in (NONE, PAPER) else (str(name), _compared(str(name), given, folders))
            for name, given in cfg.compare.items()
        )
    if ":" in str((cfg.get("optimizer") or {}).get("algorithm")) and not any(map(_OF_GA.match, overrides)):
        cfg.ga = None
    _complete_parts(cfg)
    _fit_rule(cfg, choices["hebbian"], world.cfg.hebbian, overrides)


def _make_changes(cfg: DictConfig, choices: dict[str, str], folders: Sequence[Path]) -> None:
    """Write down what the changes bring, and refuse two that set the same key."""
    set_by: dict[str, str] = {}
    for name, settings in cfg.change.items():
        if settings is not None:
            raise ConfigError(f"change.{name} takes no settings, got {settings}; put them into change/{name}.yaml")
        row = change_row(name, folders)
        for key, _ in conf.flat(row):
            if key in set_by:
                raise ConfigError(f"change: {set_by[key]} and {name} both change {key}; give one of the two")
            set_by[key] = name
        cfg.change[name] = {group: str(row[group]) for group in BROUGHT if group in row}
        physics = cfg.change[name].get("physics", choices["physics"])
        if choices["physics"] != physics:  # that a sweep trains with
            cfg.physics, choices["physics"] = _physics(physics), physics


def _check_idle(cfg: DictConfig, overrides: Sequence[str]) -> None:
    """Refuse overrides of keys that the physics ignores."""
    ignored = tuple(f"{key}." for key in _ignored(cfg))
    for key in (word.lstrip("+~").partition("=")[0] for word in overrides):
        if f"{key}.".startswith(ignored):
            raise ConfigError(f"{key} does nothing with physics={cfg.physics.kind}; give physics=ode, or leave it out")


def _ignored(cfg: DictConfig) -> tuple[str, ...]:
    """The keys that the physics ignores."""
    return tuple(part_class("physics", cfg.physics.get("kind"), "physics").ignores)


def _idle(cfg: DictConfig) -> tuple[str, ...]:
    """Keys of the world that act in no lifetime of a configuration."""
    scenario = cfg.scenario
    later = [key for change in scenario.get("changes", ()) if isinstance(change, Mapping) for key in change]
    may_stand = scenario.obstacles or scenario.get("hand") or "obstacles" in later or "training" in cfg
    return (*_ignored(cfg), *(() if may_stand else ("maze.obstacles", "scenario.layout")))


def _compared(name: str, given: Any, folders: Sequence[Path]) -> Any:
    """The settings of what is compared; a name alone stands for the adaptation or the rule of this name."""
    try:
        if given is None:
            is_adaptation = any(choice(folder, "adaptation", name) for folder in folders)
            added = _added("adaptation" if is_adaptation else "hebbian", name, folders)
            return {**added["hebbian"], **({"adaptation": added["adaptation"]} if is_adaptation else {})}
        if isinstance(given, DictConfig) and given.get("rule") in {*conf.table("hebbian")} - {NONE, PAPER}:
            given = OmegaConf.merge(_added("hebbian", given.rule, folders)["hebbian"], given)
        if isinstance(given, DictConfig) and isinstance(given.get("adaptation"), str):
            given.adaptation = _added("adaptation", given.adaptation, folders)["adaptation"]
    except ConfigError as error:
        raise ConfigError(f"compare.{name}: {error}") from error
    return given


def _compare_in_environment(cfg: DictConfig, folders: Sequence[Path]) -> None:
    """Look up what is compared, and give the rules what they have in environments, but for what was typed."""
    for name, given in dict(cfg.get("compare") or {}).items():
        if given is None and name == NONE:  # the run has it anyway
            del cfg.compare[name]
            continue
        cfg.compare[name] = _compared(str(name), given, folders)
        rule, typed = cfg.compare[name], {*(given if isinstance(given, Mapping) else ())}
        if not isinstance(rule, DictConfig):
            continue  # which the schema refuses
        if "adaptation" in rule:
            raise ConfigError(
                f"compare.{name}: adaptations are for the maze, and this is environment={cfg.environment.name}"
            )
        if "rule" not in rule and cfg.hebbian.get("rule") in (None, NONE):
            rule.rule = PAPER
        if rule.get("rule", NONE) != NONE:
            choice = str(name if given is None else rule.rule)
            environments.fit_rule(rule, choice, cfg.network, typed.__contains__)


def _added(group: str, name: str, folders: Sequence[Path]) -> dict[str, Any]:
    """The settings of a rule and of an adaptation that one choice brings, references unresolved."""
    found = named(group, name, folders)
    values = {} if group == "hebbian" else named("hebbian", found["choices"].get("hebbian", PAPER), folders)
    merge(values, found if group == "adaptation" else {**named("adaptation", NONE, folders), **found})
    return values


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
    """Write down where changes by hand are, and what was left as it is in classes."""
    _complete_classes(cfg)
    sensors = cfg.robot.get("sensors")
    for number, settings in enumerate(sensors if isinstance(sensors, ListConfig) else ()):
        key = f"robot.sensors[{number}]"
        if not isinstance(settings, DictConfig) or ":" not in str(settings.get("sensor")):
            raise ConfigError(f"{key} must be {{sensor: FILE.py:NAME}} and its settings, got {settings}")
        _write_defaults(settings, "sensor", settings.sensor, key)
    if cfg.scenario.get("hand") is not None:
        cfg.scenario.hand = str(user_path(cfg.scenario.hand, "scenario.hand").absolute())


def _write_defaults(settings: DictConfig, kind: str, part: str, key: str) -> None:
    """Write down what a class has that was left as it is, but for what it shares with all rules, or all wirings."""
    base: Any = KINDS[kind].base
    shared = {(field.name, field.default) for field in fields(base)} if kind in ("rule", "wiring") else set()
    for field in fields(part_class(kind, part, key)):
        is_new = field.name not in settings and (field.name, field.default) not in shared
        if is_new and isinstance(field.default, bool | int | float | str):
            settings[field.name] = field.default


def _fit_rule(cfg: DictConfig, choice: str, chosen: DictConfig, overrides: Sequence[str]) -> None:
    """Give a rule that was named by its class its own defaults, and drop what the row says for another rule.

    chosen: the row. What was typed stays, also where the row says the same.
    """
    rule = cfg.hebbian.get("rule")
    if rule in (None, NONE) or (rule == chosen.get("rule") and ":" not in choice):
        return
    kind = part_class("rule", rule, "hebbian")
    own = {field.name: field.default for field in fields(kind)}
    shared = {field.name: field.default for field in fields(Rule)}
    raw: Any = OmegaConf.to_container(cfg.hebbian)
    raw_chosen: Any = OmegaConf.to_container(chosen)
    typed = {word.lstrip("+~").partition("=")[0] for word in overrides}
    as_chosen = {key for key, value in raw_chosen.items() if raw.get(key) == value and f"hebbian.{key}" not in typed}
    if "N" in as_chosen or "N" not in raw:
        cfg.hebbian.N = own["N"] or raw.get("N", cfg.scenario.paper_N)
    for key in as_chosen & {*own} - {"N"}:
        if own[key] != shared.get(key):
            cfg.hebbian[key] = getattr(own[key], "name", own[key])
    for key in as_chosen - {"rule", "name", *own}:
        del cfg.hebbian[key]
    if cfg.hebbian.get("name") == choice:
        cfg.hebbian.name = kind.__name__.lower()


def training_world(config: WorldConfig, evolved_in: str = "") -> Scenario:
    """The world in which controllers of this experiment are evolved, for the robot and in the maze of a configuration.

    If a change brought that maze, training is in the usual one. evolved_in: the name of the physics of their evolution,
    which may be another than that of the configuration; "" for that of the plane.
    """
    trained, name = TRAINED[config.world.experiment], evolved_in or PYMUNK.name
    physics = make_part("physics", config.physics, "physics")
    if physics.name != name:
        physics = make_part("physics", _physics(name), "physics")
    is_usual = config.maze.get("name") in [change.get("maze") for change in config.change.values()]
    maze = named("maze", T_MAZE, [data_folder("conf")])["maze"] if is_usual else config.maze
    values = {
        "scenario": {**named("scenario", trained, [data_folder("conf")])["scenario"], "name": trained},
        "maze": maze,
    }
    scenario = plain(OmegaConf.create(values))["scenario"]
    world = make_scenario(make(ScenarioConfig, declared(ScenarioConfig, scenario, "scenario")), maze, config.robot)
    return replace(world, physics=physics)


def _physics(name: str) -> dict[str, Any]:
    """The settings of a physics of the program's."""
    known = conf.groups("evaluate")["physics"]
    if name not in known:
        raise ConfigError(f"physics must be one of {', '.join(known)}, got {name}")
    return yaml_file.load(data_folder("conf") / "physics" / f"{name}.yaml")


def named_world(command: str, choices: Mapping[str, str], changed: Iterable[str], folders: Sequence[Path]) -> Named:
    """The choices that name the world, and what they are without anything else.

    The program's own choices are taken if there are such, so that a file of the user's that replaces one differs.
    changed: the changes of the world, by name. folders: that have choices.
    """
    ours = data_folder("conf")

    def brought(group: str, name: str) -> dict[str, Any]:
        is_ours = choice(ours, group, name) is not None
        return named(group, name, [ours] if is_ours else folders)

    main = yaml_file.load(conf.command_file(command))
    usual = {group: name for entry in main[DEFAULTS] if isinstance(entry, Mapping) for group, name in entry.items()}
    values = {**default_values(SCHEMAS[command]), "network": main["network"]}
    worlds = [brought("scenario", choices["scenario"]), *(brought("change", name) for name in changed)]
    for world in worlds:
        usual |= world["choices"]
    differ = [group for group in _PARTS if choices[group] != usual[group]]
    parts = [brought(group, choices[group]) for group in (*_PARTS, *_USUAL) if group in choices]
    for part in parts:
        usual |= part["choices"]  # a task brings its lifetime
    for more in (brought("lifetime", usual["lifetime"]), *worlds, *parts):
        merge(values, more)
    del values["choices"]
    cfg = OmegaConf.create(values)
    find_own_files(cfg)
    return Named(cfg, differ)


def differences(cfg: DictConfig, choices: Mapping[str, str], world: Named) -> Iterator[str]:
    """What differs from the named world, as overrides. What follows from another value is not repeated."""
    yield from (f"{group}={choices[group]}" for group in world.differ)
    mine, its = _values(cfg, resolve=True), _values(world.cfg, resolve=True)
    if (wiring := mine["network.wiring"]) != LAYERS:
        its |= {f"network.{field.name}": field.default for field in fields(part_class("wiring", wiring, "network"))}
    raw, its_raw = _values(cfg, resolve=False), _values(world.cfg, resolve=False)
    idle = tuple(f"{key}." for key in _idle(cfg))
    for key, value in mine.items():
        is_same = (
            f"{key}.".startswith(idle)
            or value == its.get(key, "null")
            or (key in its_raw and raw.get(key) == its_raw[key])
        )
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


def world_name(cfg: DictConfig) -> str:
    """A world as part of the name of a folder: the environment, or the scenario, and what differs from it."""
    if "environment" in cfg:
        parts = [environments.shown_name(cfg.environment)]
    else:
        parts = [cfg.scenario.name, *(cfg.changed.split(", ") if cfg.changed else [])]
    return "+".join(re.sub(r"[^\w.]+", "-", part) for part in parts)[:_LONGEST].rstrip("+-")


def find_own_files(cfg: DictConfig) -> None:
    """Write down where the user's files are."""
    place_files({group: cfg[group] for group in (*PART_GROUPS, "environment") if group in cfg})
