"""Makes the parts of the science from a checked configuration: controllers, tasks, worlds, networks, optimizers."""

import math
from collections.abc import Mapping
from dataclasses import fields, replace
from typing import Any, NamedTuple, get_type_hints

from epuckhebb.adaptation.adaptation import Adaptation
from epuckhebb.config import hand
from epuckhebb.config.parts import GENETIC, NONE, PAPER, make_part, part_class
from epuckhebb.config.values import converted, part_settings, record
from epuckhebb.controller.network import HIDDEN, Network
from epuckhebb.controller.plasticity.control import Control, Sign
from epuckhebb.controller.plasticity.rule import NO_RULE, Acts, NoRule, Reward, Rule, receives_reward
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.controller.wiring import Wiring
from epuckhebb.evolution.optimizer import Algorithm
from epuckhebb.runtime import ConfigError, refusing
from epuckhebb.tmaze.individual import CONTROLS, GA, YOKED, Controller
from epuckhebb.tmaze.maze import Maze, Place, Pose, Side
from epuckhebb.tmaze.own_fitness import PAPER_FITNESS
from epuckhebb.tmaze.physics.pymunk import PYMUNK
from epuckhebb.tmaze.robot import OUTPUTS, Robot
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.sensors import DistanceSensors, LightSensors
from epuckhebb.tmaze.simulator import check_inputs
from epuckhebb.tmaze.task import Task
from epuckhebb.tmaze.tasks.trial import ONE_TRIAL

Shape = tuple[int, ...] | Wiring | None  # of a network: its layers, a wiring, or nothing said
_LAMP = "lamp"  # a maze file may say where its lamp is; the scenario takes it from there
_OWN = "sensors"  # key of a robot's file: the user's own sensors
_OF_DISTANCE = {  # key of a robot's file -> field of its distance sensors
    "distance_places": "places",
    "distance_curve": "curve",
    "stretch": "stretch",
    "reach_m": "reach_m",
    "full_scale": "full_scale",
}


class _Start(NamedTuple):
    """Where the robot starts, as a file has it."""

    x: float
    y: float
    heading_deg: float


def make_rule(settings: Mapping[str, Any], key: str) -> Rule:
    """The rule that a part of the configuration describes. key: where it stands there, for messages."""
    given = {name: value for name, value in settings.items() if name != "name"}
    if given.get("rule") != NONE:
        rule: Rule = make_part("rule", given, key)
        return rule
    if len(given) > 1:
        useless = next(name for name in given if name != "rule")
        raise ConfigError(f"{key}.{useless} does nothing with {key}=none, which is no plasticity; choose a rule")
    return NO_RULE


def make_optimizer(settings: Mapping[str, Any], ga: Algorithm | None) -> Algorithm:
    """The optimizer that a part of the configuration describes. ga: the genetic algorithm; None for another one."""
    if (settings.get("algorithm") == GENETIC) != (ga is not None) or (ga is not None and len(settings) > 1):
        given = f"optimizer={settings.get('algorithm')}, with{'out' * (ga is None)} settings of ga"
        raise ConfigError(f"ga.population and the like go with optimizer=ga, else optimizer.population; got {given}")
    return make_part("optimizer", settings, "optimizer") if ga is None else ga


def resolve_signal(adaptation: Adaptation, key: str = "adaptation") -> Adaptation:
    """An adaptation whose signal of change is a class if it is the user's, FILE.py:NAME."""
    if ":" not in str(adaptation.change_signal):
        return adaptation
    return replace(adaptation, change_signal=part_class("change signal", adaptation.change_signal, key))


def make_controller(rule: Rule, adaptation: Adaptation, called: str | None = None) -> Controller:
    """The controller of a rule and an adaptation. called: the name of the rule; its class unless given."""
    differs = [one.name for one in (rule.sign, rule.control) if one not in (Sign.hebbian, Control.none)]
    control = f" ({', '.join(differs)})" if differs else ""
    frozen = " (frozen)" if rule.acts is Acts.before_change else ""
    if adaptation.acts:
        name = f"{adaptation.name}{control}"
    elif isinstance(rule, NoRule):
        name = GA
    elif called in (PAPER, "", None) and isinstance(rule, Paper):
        name = CONTROLS[rule.sign] if rule.control is Control.none else YOKED[rule.control]
        name += "" if Sign.hebbian is rule.sign or rule.control is Control.none else f" ({rule.sign.name})"
    else:
        name = f"{called or type(rule).__name__.lower()}{control}"
    return Controller(name=f"{name}{frozen}", rule=rule, adaptation=adaptation)


def compared(name: str, settings: Any, hebbian: Mapping[str, Any], paper_rate: float) -> Controller:
    """The controller that stands below `compare`: settings are what differs from the rule of the run, in `hebbian`.

    They differ from the paper's rule if the run has none, and are complete if they name a rule. They may have
    `adaptation`, a mapping with the keys of the group (its name has been looked up before).
    """
    key, own = f"compare.{name}", converted(f"compare.{name}", settings, dict[str, Any])
    if "rule" not in own:
        own = {**({"rule": PAPER} if hebbian.get("rule") == NONE else hebbian), **own}
    given, place = own.pop("adaptation", None) or {}, f"{key}.adaptation"
    given = part_settings(Adaptation, given, place, "an adaptation", change_signal=str)
    if own["rule"] != NONE:
        own.setdefault("N", paper_rate)
    with refusing(lambda error: f"{key}: {error}", (ValueError, TypeError)):
        adaptation = resolve_signal(Adaptation(**{**given, "name": name}), place) if given else Adaptation()
        return Controller(name=name, rule=make_rule(own, key), adaptation=adaptation)


def add_controls(controller: Controller, task: Task) -> list[Controller]:
    """A controller, unless it does nothing, and the control that it has in a task that gives a reward.

    The control is the same controller, whose rule receives the reward inverted. A rule without reward has no control.
    """
    if controller.is_ga_alone:
        return []
    if not (task.gives_reward and receives_reward(type(controller.rule)) and controller.rule.reward is Reward.given):
        return [controller]
    rule = replace(controller.rule, reward=Reward.inverted)
    return [controller, replace(controller, name=f"{controller.name} (reward inverted)", rule=rule)]


def make_maze(value: object) -> Maze:
    """A maze: boxes and goals by name, `start.heading_deg` in degrees, bounds of arms infinite if they are left out."""
    given = {key: item for key, item in value.items() if key != _LAMP} if isinstance(value, Mapping) else value
    values = part_settings(Maze, given, "maze", "a maze", start=_Start)
    x, y, heading_deg = values.pop("start")
    return Maze(**values, start=Pose(x, y, math.radians(heading_deg)))


def make_robot(value: object) -> Robot:
    """A robot, which needs all keys; places are lists of x, y [m], azimuth [degrees], points of the curve lists too.

    `sensors` may be left out: the user's own, each `sensor: FILE.py:NAME` with its settings.
    """
    distance = get_type_hints(DistanceSensors)
    kinds = {name: kind for name, kind in get_type_hints(Robot).items() if name != "sensors"}
    kinds["light_places"] = get_type_hints(LightSensors)["places"]
    kinds |= {key: distance[field] for key, field in _OF_DISTANCE.items()}
    kinds[_OWN] = list[Any]
    values = {"solid": None, _OWN: [], **record("robot", value, kinds, {_OWN: [], "solid": None}, "a robot")}
    own = values.pop(_OWN)
    light = LightSensors(places=values.pop("light_places"))
    felt = DistanceSensors(**{field: values.pop(key) for key, field in _OF_DISTANCE.items()})
    keys = [f"robot.{_OWN}[{number}]" for number in range(len(own))]
    more = [make_part("sensor", converted(key, one, dict[str, Any]), key) for key, one in zip(keys, own, strict=True)]
    return Robot(**values, sensors=(light, felt, *more))


def make_scenario(
    scenario: Any,
    maze: Mapping[str, Any],
    robot: Mapping[str, Any],
    task: Mapping[str, Any] | None = None,
    fitness: Mapping[str, Any] | None = None,
    physics: Mapping[str, Any] | None = None,
) -> Scenario:
    """The world of a configuration. task, fitness, physics: None for the paper's, or that of the plane."""
    values = {field.name: getattr(scenario, field.name) for field in fields(scenario)}
    in_maze, of_kind = make_maze(maze), make_robot(robot)
    start = values.pop("start")
    if start is not None:
        x, y, heading_deg = converted("scenario.start", start, tuple[float, float, float])
        in_maze = replace(in_maze, start=Pose(x, y, math.radians(heading_deg)))
    values["changes"] = converted("scenario.changes", values["changes"], tuple[dict[str, Any], ...])
    values["hand"] = () if values["hand"] is None else hand.read(values["hand"])
    if isinstance(values["dead_sensors"], list):
        values["dead_sensors"] = tuple(values["dead_sensors"])
    if values["goals"] is not None:
        given = converted("scenario.goals", values["goals"], dict[Side, Place | None])
        goals = {**in_maze.goals, **{side: place for side, place in given.items() if place}}
        values["goals"] = None if goals == in_maze.goals else goals
    return Scenario(
        **values,
        maze=in_maze,
        robot=of_kind,
        task=ONE_TRIAL if task is None else make_part("task", task, "task"),
        fitness=PAPER_FITNESS if fitness is None else make_part("fitness", fitness, "fitness"),
        physics=PYMUNK if physics is None else make_part("physics", physics, "physics"),
    )


def make_network(world: Scenario, shape: Shape) -> Network:
    """The network of this shape; without one, the paper's hidden layers between the inputs and the wheels."""
    if isinstance(shape, Wiring):
        try:
            return Network((world.inputs, *shape.sizes), world.task.gives_reward, shape)
        except Exception as error:  # of a user's code
            own = "" if isinstance(error, ValueError) else f"wiring {shape.name}: {type(error).__name__}: "
            raise ConfigError(f"{own}{error}") from error
    network = Network((world.inputs, *HIDDEN, OUTPUTS) if shape is None else shape, world.task.gives_reward)
    check_inputs(network, world)
    return network
