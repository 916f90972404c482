"""From the words of a configuration to the parts of the science: rules, adaptations, worlds.

A rule is a file of `epuckhebb/sim/plasticity/`, or one of the user's own, `FILE.py:NAME`. What a part has for settings
is known from its dataclass, so keys of a user's rule are checked as ours are.
"""

import difflib
import functools
import hashlib
import importlib
import importlib.util
import math
import pkgutil
import sys
import types
import typing
from collections.abc import Mapping
from dataclasses import MISSING, fields, replace
from enum import Enum
from numbers import Real
from pathlib import Path
from typing import Any

from epuckhebb.app.errors import ConfigError
from epuckhebb.app.machine import Need, path_of, require
from epuckhebb.evolution import optimizers
from epuckhebb.evolution.optimizer import Optimizer
from epuckhebb.sim import plasticity, tasks
from epuckhebb.sim.adaptation.adaptation import Adaptation
from epuckhebb.sim.adaptation.self_check.dance import check_time
from epuckhebb.sim.adaptation.self_check.memory import check_robot
from epuckhebb.sim.controller import CONTROLS, GA, HEBBIAN, Controller
from epuckhebb.sim.fitness import Signal
from epuckhebb.sim.lifetime import Lifetime, check_inputs
from epuckhebb.sim.maze import SIDES, Maze, Place, Side, grid_bytes, maze_from
from epuckhebb.sim.network import HIDDEN, OUTPUTS, Network
from epuckhebb.sim.plasticity.control import Sign
from epuckhebb.sim.plasticity.paper import Paper
from epuckhebb.sim.plasticity.rule import NO_RULE, NoRule, Reward, Rule, asked, hears_reward
from epuckhebb.sim.robot import Robot, robot_from
from epuckhebb.sim.scenario import Scenario
from epuckhebb.sim.task import Task
from epuckhebb.sim.tasks.trial import ONE_TRIAL

NONE, PAPER = "none", "paper"
GENETIC = "ga"  # the optimizer whose settings are a group of their own
_NOT_RULES = ("control", "four_terms", "rule", "update", "weight_change")  # the other files beside the rules


def rule_names() -> list[str]:
    """The rules that the program has."""
    return sorted(module.name for module in pkgutil.iter_modules(plasticity.__path__) if module.name not in _NOT_RULES)


def rule_from(settings: Mapping[str, Any], key: str) -> Rule:
    """The rule that a part of the configuration describes.

    Args:
        settings: `rule`, the name of one or `FILE.py:NAME`, and the rule's own settings.
        key: Where in the configuration they stand, for messages.

    Raises:
        ConfigError: There is no such rule, it has no such setting, or a value cannot be used.
    """
    given = {name: value for name, value in settings.items() if name not in ("rule", "name")}
    where = settings.get("rule")
    if where == NONE:
        if given:
            raise ConfigError(
                f"{key}.{next(iter(given))} does nothing with {key}=none, which is no plasticity; choose a rule: "
                f"{key}={', '.join(rule_names())}"
            )
        return NO_RULE
    kind = rule_class(str(where), key)
    try:
        return kind(**_settings(kind, given, key, f"rule {where}"))
    except ConfigError:
        raise
    except ValueError as error:
        raise ConfigError(str(error).replace("hebbian.", f"{key}.", 1)) from error


def _settings(kind: Any, given: Mapping[str, Any], key: str, told: str) -> dict[str, Any]:
    """The settings that are given below a key, as the dataclass of a part declares them.

    Raises:
        ConfigError: The part, told as this, has no such setting, or lacks one, or a value is of another type.
    """
    known = {field.name: field for field in fields(kind)}
    hints = typing.get_type_hints(kind)
    values = {}
    for name, value in given.items():
        if name not in known:
            raise ConfigError(f"{key}.{name} is not a setting of {told}; {_near(name, known)}")
        values[name] = _as_declared(value, hints[name], f"{key}.{name}")
    missing = [
        name
        for name, field in known.items()
        if name not in values and field.default is MISSING and field.default_factory is MISSING
    ]
    if missing:
        raise ConfigError(f"{key}.{missing[0]} is missing: {told} has no default for it")
    return values


def rule_class(where: str, key: str) -> type[Rule]:
    """The class of a rule, of the program's own or of a file.

    Raises:
        ConfigError: There is no such rule, or its file cannot be used.
    """
    file, colon, name = where.rpartition(":")
    if not colon:
        if where not in rule_names():
            raise ConfigError(
                f"{key}.rule={where} must be one of {', '.join([NONE, *rule_names()])}, or a rule of your own, "
                "FILE.py:NAME"
            )
        known: type[Rule] = _class_in(importlib.import_module(f"{plasticity.__name__}.{where}"), Rule)
        return known
    module = _loaded(path_of(file, f"{key}.rule"), f"{key}.rule={where}")
    kind = getattr(module, name, None)
    rules = [n for n, v in vars(module).items() if isinstance(v, type) and issubclass(v, Rule) and v is not Rule]
    if not (isinstance(kind, type) and issubclass(kind, Rule)):
        raise ConfigError(
            f"{key}.rule={where}: {file} has no rule {name}, that is a subclass of epuckhebb.Rule; "
            + (f"it has {', '.join(rules)}" if rules else "it has none at all")
        )
    try:
        asked(kind)
    except ValueError as error:
        raise ConfigError(f"{key}.rule={where}: {error}") from error
    return kind


def rule_file(settings: Mapping[str, Any]) -> Path | None:
    """The file of a user's own rule; None for a rule of the program."""
    file, colon, _ = str(settings.get("rule", "")).rpartition(":")
    return path_of(file, "hebbian.rule") if colon else None


def sha256_of(file: Path) -> str:
    """SHA-256 of the content of a file."""
    return hashlib.sha256(file.read_bytes()).hexdigest()


def _loaded(file: Path, told: str) -> Any:
    """The module of a file; it is run once for its content."""
    if not file.is_file():
        raise ConfigError(f"{told}: there is no file {file}")
    name = f"epuckhebb_rule_{sha256_of(file)[:16]}"
    if name not in sys.modules:
        spec = importlib.util.spec_from_file_location(name, file)
        if spec is None or spec.loader is None:
            raise ConfigError(f"{told}: {file} is no Python file; its name must end in .py")
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module
        try:
            spec.loader.exec_module(module)
        except Exception as error:
            del sys.modules[name]
            line = _line_of(error, file)
            raise ConfigError(f"{told}: {file}{line} cannot be imported: {type(error).__name__}: {error}") from error
    return sys.modules[name]


def _line_of(error: BaseException, file: Path) -> str:
    """Where in a file an error arose."""
    if isinstance(error, SyntaxError):
        return f", line {error.lineno},"
    line, trace = "", error.__traceback__
    while trace is not None:
        if trace.tb_frame.f_code.co_filename == str(file):
            line = f", line {trace.tb_lineno},"
        trace = trace.tb_next
    return line


def _as_declared(value: Any, kind: Any, key: str) -> Any:
    """A value of a configuration as the type that a dataclass declares."""
    if isinstance(kind, type) and issubclass(kind, Enum):
        names = [member.name for member in kind]
        name = value.name if isinstance(value, Enum) else value
        if name not in names:
            raise ConfigError(f"{key} must be one of {', '.join(names)}, got {value!r}")
        return kind[name]
    if isinstance(kind, types.UnionType):  # a type, or nothing
        if value is None:
            return None
        kind = next(one for one in typing.get_args(kind) if one is not types.NoneType)
    if kind is float and isinstance(value, int | float) and not isinstance(value, bool):
        return float(value)
    if kind in (int, bool, str) and type(value) is kind:
        return value
    wanted = {float: "a number", int: "a whole number", bool: "true or false", str: "text"}.get(kind, str(kind))
    raise ConfigError(f"{key} must be {wanted}, got {value!r}")


def _near(name: str, known: Mapping[str, object]) -> str:
    as_written = {one.lower(): one for one in known}  # n for N is the most frequent slip
    near = difflib.get_close_matches(name.lower(), as_written, n=1)
    return f"did you mean {as_written[near[0]]}?" if near else f"it has {', '.join(known)}"


@functools.cache
def checked(kind: Any) -> Any:
    """A class that users make objects of, which from now on refuses in our own words what it cannot take.

    Python would raise a TypeError that names no other setting. It holds for subclasses too, as a user's rule is one.
    """
    made = kind.__new__

    def new(cls: Any, *given: Any, **settings: Any) -> Any:
        called = "Hebbian" if cls is Paper else cls.__name__
        known = cls._field_defaults if hasattr(cls, "_fields") else {field.name: field.type for field in fields(cls)}
        for name, value in settings.items():
            if name not in known:
                raise ConfigError(f"{called}({name}=...): {name} is not a setting of it; {_near(name, known)}")
            if known[name] in (int, float) and not isinstance(value, Real):
                raise ConfigError(f"{called}({name}=...): {name} must be a number, got {value!r}")
        if made is not object.__new__:
            return made(cls, *given, **settings)
        if given:
            first = next(iter(known))
            raise ConfigError(f"{called}({given[0]!r}): settings are given by their names, as {called}({first}=...)")
        return made(cls)

    kind.__new__ = staticmethod(new)
    return kind


def optimizer_names() -> list[str]:
    """The optimizers that the program has."""
    return sorted(module.name for module in pkgutil.iter_modules(optimizers.__path__))


def optimizer_from(settings: Mapping[str, Any], ga: Optimizer | None) -> Optimizer:
    """The optimizer that a part of the configuration describes.

    Args:
        settings: `algorithm`, the name of one, and its own settings, but for those of the genetic algorithm.
        ga: The settings of the genetic algorithm, None for another optimizer.

    Raises:
        ConfigError: There is no such optimizer, it has no such setting, or a value cannot be used.
    """
    given = {name: value for name, value in settings.items() if name != "algorithm"}
    algorithm = settings.get("algorithm")
    if algorithm == GENETIC:
        if given:
            raise ConfigError(
                f"optimizer.{next(iter(given))} does nothing with optimizer=ga, whose settings are ga.population, "
                "ga.generations, ...; give one of these, or another optimizer"
            )
        if ga is None:
            raise ConfigError("optimizer=ga needs settings: give ga=textbook or ga=as_coded")
        return ga
    if algorithm not in optimizer_names():
        raise ConfigError(f"optimizer.algorithm must be one of {', '.join(optimizer_names())}, got {algorithm!r}")
    if ga is not None:
        raise not_its_settings(str(algorithm))
    kind = optimizer_class(str(algorithm))
    return kind(**_settings(kind, given, "optimizer", f"optimizer {algorithm}"))


def optimizer_class(algorithm: str) -> type[Optimizer]:
    """The class of the optimizer of this name, whose fields are its settings."""
    kind: type[Optimizer] = _class_in(importlib.import_module(f"{optimizers.__name__}.{algorithm}"), Optimizer)
    return kind


def _class_in(module: types.ModuleType, base: Any) -> Any:
    """The subclass of a base that a module has of its own."""
    return next(
        kind
        for kind in vars(module).values()
        if isinstance(kind, type) and issubclass(kind, base) and kind.__module__ == module.__name__
    )


def not_its_settings(optimizer: str) -> ConfigError:
    """The error of who gives settings of the genetic algorithm to another optimizer."""
    return ConfigError(
        f"ga and its keys are settings of optimizer=ga; those of optimizer={optimizer} are optimizer.population and so "
        "on. Leave out ga, or give optimizer=ga"
    )


def controller_from(hebbian: Mapping[str, Any], adaptation: Adaptation, key: str = "hebbian") -> Controller:
    """The controller of a run: its rule and what is laid over it, by the paper's name if it is the paper's rule.

    Raises:
        ConfigError: The rule or a setting cannot be used.
    """
    return controller_of(rule_from(hebbian, key), adaptation, hebbian.get("name") or "")


def controller_of(rule: Rule, adaptation: Adaptation, called: str = "") -> Controller:
    """The controller of a rule and what is laid over it. called: the name of the rule; its class unless given."""
    control = "" if rule.sign is Sign.hebbian else f" ({rule.sign.name})"
    if adaptation.acts:
        name = f"{adaptation.name}{control}"
    elif isinstance(rule, NoRule):
        name = GA
    elif called in (PAPER, "") and isinstance(rule, Paper):
        name = CONTROLS[rule.sign]
    else:
        name = f"{called or type(rule).__name__.lower()}{control}"
    return Controller(name=name, rule=rule, adaptation=adaptation)


def compared(name: str, settings: Any, paper_rate: float) -> Controller:
    """The controller that stands below `compare`: settings are what differs from the paper's rule.

    They may have `adaptation`, a mapping with the keys of the group (its name has been looked up before).

    Raises:
        ConfigError: The name is taken, or a setting cannot be used.
    """
    key = f"compare.{name}"
    if name in (GA, HEBBIAN, NONE, PAPER) and not (name == HEBBIAN and settings == {}):
        raise ConfigError(f"{key}: the name is taken ({GA} is the control that always runs); give another")
    if not isinstance(settings, Mapping):
        raise ConfigError(f"{key} must be settings of a rule, for example {{N: 0.002, sign: shuffled}}, got {settings}")
    own = dict(settings)
    over = own.pop("adaptation", None) or {}
    if not isinstance(over, Mapping):
        raise ConfigError(f"{key}.adaptation must be the name of an adaptation, or its settings, got {over}")
    over = dict(over)
    kinds = typing.get_type_hints(Adaptation)
    for setting, value in over.items():
        if setting not in kinds:
            raise ConfigError(f"{key}.adaptation.{setting} is not a setting of an adaptation; {_near(setting, kinds)}")
        over[setting] = _as_declared(value, kinds[setting], f"{key}.adaptation.{setting}")
    rule_settings = {"rule": PAPER, **own}
    if rule_settings["rule"] != NONE:
        rule_settings.setdefault("N", paper_rate)
    try:
        return Controller(
            name=name,
            rule=rule_from(rule_settings, key),
            adaptation=Adaptation(**{**over, "name": name}) if over else Adaptation(),
        )
    except (ValueError, TypeError) as error:
        raise error if isinstance(error, ConfigError) else ConfigError(f"{key}: {error}") from error


def with_controls(controller: Controller, task: Task) -> list[Controller]:
    """A controller, unless it does nothing, and the control that it has in a task that tells a reward.

    The control is the same controller, whose rule hears the reward inverted; a rule that hears none has no control.
    """
    if controller.is_ga_alone:
        return []
    if not (task.tells_reward and hears_reward(type(controller.rule)) and controller.rule.reward is Reward.told):
        return [controller]
    rule = replace(controller.rule, reward=Reward.inverted)
    return [controller, replace(controller, name=f"{controller.name} (reward inverted)", rule=rule)]


def task_names() -> list[str]:
    """The tasks that the program has."""
    return sorted(module.name for module in pkgutil.iter_modules(tasks.__path__))


def task_from(settings: Mapping[str, Any]) -> Task:
    """The task that a part of the configuration describes: `kind`, the name of one, and its own settings.

    Raises:
        ConfigError: There is no such task, or it has no such setting.
        ValueError: A value cannot be used.
    """
    given = {name: value for name, value in settings.items() if name != "kind"}
    where = settings.get("kind")
    if where not in task_names():
        raise ConfigError(f"task.kind must be one of {', '.join(task_names())}, got {where!r}")
    kind = task_class(str(where))
    if given and not fields(kind):
        raise ConfigError(f"task.{next(iter(given))} does nothing with task={where}, which has no settings")
    return kind(**_settings(kind, given, "task", f"task {where}"))


def task_class(name: str) -> type[Task]:
    """The class of the task of this name, whose fields are its settings."""
    kind: type[Task] = _class_in(importlib.import_module(f"{tasks.__name__}.{name}"), Task)
    return kind


def scenario_from(
    scenario: Any, maze: Mapping[str, Any], robot: Mapping[str, Any], task: Mapping[str, Any] | None = None
) -> Scenario:
    """The world of a configuration. task: None for the paper's.

    Raises:
        ValueError: A value cannot be used; the message names the key.
    """
    values = {field.name: getattr(scenario, field.name) for field in fields(scenario)}
    in_maze, of_kind = maze_from(maze), robot_from(robot)
    require([Need(grid_bytes(in_maze.arena_m), "a way to the goals of so large a maze", "lower maze.arena_m")])
    for number, change in enumerate(values["changes"]):
        if not isinstance(change, Mapping):
            raise ConfigError(f"scenario.changes[{number}] must be as {{at_s: 60, light: 1.0}}, got {change}")
    values["changes"] = tuple(map(dict, values["changes"]))
    if isinstance(values["dead_sensors"], list):
        values["dead_sensors"] = tuple(values["dead_sensors"])
    if values["goals"] is not None:
        goals = _goals(values["goals"], in_maze)
        values["goals"] = None if goals == in_maze.goals else goals
    return Scenario(**values, maze=in_maze, robot=of_kind, task=ONE_TRIAL if task is None else task_from(task))


def _goals(given: Any, maze: Maze) -> dict[Side, Place]:
    """Goals of both sides; a side that is left out keeps the maze's."""
    if not isinstance(given, Mapping) or not set(given) <= set(SIDES):
        raise ConfigError(f"scenario.goals must be {{left: [x, y], right: [x, y]}} in m, got {given}")
    goals = dict(maze.goals)
    for side in SIDES:
        place = given.get(side)
        if place is None:
            continue
        numbers = list(place) if isinstance(place, list | tuple) else []
        if len(numbers) != 2 or not all(isinstance(n, int | float) and math.isfinite(n) for n in numbers):
            raise ConfigError(f"scenario.goals.{side} must be two numbers, x and y in m, got {place}")
        goals[side] = Place(*map(float, numbers))
    return goals


def network_for(world: Scenario, layers: tuple[int, ...] | None) -> Network:
    """The network of these layers; left open, the paper's hidden layers between what there is to read and the wheels.

    Raises:
        ValueError: The layers do not make a network, or do not fit the robot and the task.
    """
    network = Network((world.inputs, *HIDDEN, OUTPUTS) if layers is None else layers, world.task.tells_reward)
    check_inputs(network, world.robot, world.task)
    return network


def check_pace(lifetime: Lifetime, world: Scenario) -> None:
    """Refuse a gain that the robot's motors do not reach, too little time, and changes after the end of life.

    Raises:
        ValueError: The gain is too high, the time too short, or a change comes too late.
    """
    robot = world.robot
    world.task.check_time(lifetime.duration_s)
    if lifetime.gain_rad_s > robot.motor_limit_rad_s:
        raise ValueError(
            f"lifetime.gain_rad_s must be more than 0 and at most {robot.motor_limit_rad_s:g}, the fastest of robot "
            f"{robot.name}, got {lifetime.gain_rad_s}"
        )
    for number, change in enumerate(world.changes):
        if change["at_s"] >= lifetime.duration_s:
            raise ValueError(
                f"scenario.changes[{number}].at_s must be less than lifetime.duration_s, {lifetime.duration_s:g} s, "
                f"got {change['at_s']}"
            )


def check_signal(controller: Controller, robot: Robot) -> None:
    """Refuse the live fitness of the paper's light program for a robot that has not the e-puck's readings.

    Raises:
        ValueError: The robot has others.
    """
    if controller.rule.signal is Signal.light_code and (robot.lights, robot.distances) != (8, 8):
        raise ValueError(
            f"hebbian.signal=light_code reads eight light and eight distance sensors; robot {robot.name} has "
            f"{robot.lights} and {robot.distances}"
        )


def check_task(controller: Controller, task: Task) -> None:
    """Refuse what a task leaves no sense: an adaptation where there is no one goal, a reward that nobody tells.

    Raises:
        ValueError: It makes none.
    """
    if task.has_trials and controller.adaptation.acts:
        raise ValueError(
            f"adaptation={controller.adaptation.name} compares a life with those in the training world, where there is "
            f"one goal for all of it, and task={task.name} has none; give adaptation=none"
        )
    if controller.rule.reward is not Reward.told and not task.tells_reward:
        raise ValueError(
            f"hebbian.reward={controller.rule.reward.name} does nothing with task={task.name}, which tells no reward"
        )


def check_self_check(adaptation: Adaptation, world: Scenario, lifetime: Lifetime) -> None:
    """Refuse a self-check for a robot that has not the sensors, and a dance that counts and has no time.

    Raises:
        ValueError: The robot has not, or there is no time.
    """
    if adaptation.self_check:
        check_robot(world.robot)
    if adaptation.dance_counts:
        check_time(lifetime, world)
