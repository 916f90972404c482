"""A scenario: the world of a lifetime, as the paper varies it, and how that world changes meanwhile."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.ranges import Range, check_value, within
from epuckhebb.controller.ranges import check as check_ranges
from epuckhebb.tmaze.changes import AT_ONCE, GROUPED, check_changes, check_kind, check_placed, check_room, first_step
from epuckhebb.tmaze.faults import LONGEST_DELAY
from epuckhebb.tmaze.life import LONGEST_S, Lifetime
from epuckhebb.tmaze.light import BRIGHTEST, Lamp
from epuckhebb.tmaze.maze import T_MAZE, Box, Maze, Place, Pose, Side, boxes, edges, is_reachable
from epuckhebb.tmaze.own_fitness import PAPER_FITNESS, Fitness
from epuckhebb.tmaze.physics.pymunk import PYMUNK
from epuckhebb.tmaze.physics_engine import Physics
from epuckhebb.tmaze.robot import EPUCK, Robot
from epuckhebb.tmaze.sensors import InputGroup
from epuckhebb.tmaze.task import Task
from epuckhebb.tmaze.tasks.trial import ONE_TRIAL

EXPERIMENTS = ("light", "obstacles")
TRAINED = {"light": "highlight", "obstacles": "base"}  # the scenario in which each one's controllers are evolved


@dataclass(frozen=True, kw_only=True)
class Scenario:
    """How light it is, how many obstacles stand in the maze, where its lamp is (lit on right trials), what is broken.

    light: level of the sun, 1 as in bright training, 0.1 dimmed. sun_turn_deg: how far the sun is turned anticlockwise
    from where it stands in training. second_lamp: x, y [m] and intensity of a lamp that is always lit and shines all
    around. obstacles: how many; 0, 2 or 4 in the paper's maze. layout: where they stand, 0 as in the maze, k > 0 the
    k-th random layout. goals: of each side, None for the maze's. dead_sensors: numbers of the places on the robot's rim
    where it is blind (senses the dark and no wall). distance_gain, distance_offset: factor on its distance readings, 0
    to 1, and what is added then. left_distance_gain: one more factor, for those on the left half. crosstalk: share of
    its two neighbours' readings that a distance sensor also reads. sensor_levels: how many values a reading can have, 0
    for any. sensor_delay_steps, wheel_delay_steps: how late the readings and the commands are, in steps of 32 ms.
    left_wheel, right_wheel: share of the commanded speed at which the wheel turns. left_slip, right_slip: share of the
    time for which the wheel slips. mass_ratio: the robot's mass over that for which its drive was made. wall_friction:
    coefficient of friction between robot and walls. lamp_on: whether the lamp is lit, None for what the side says.
    placed: blocks in the maze besides its obstacles. rate: factor on N. put: where the robot is put, at rest, when this
    world begins. reset: whether its weights become those of the genes then. changes: what changes during a lifetime, in
    the order of time; each is `at_s` [s] and new values of keys of this class (`CHANGEABLE`). hand: changes by hand
    (`epuckhebb play`), as `changes`. experiment: that of the paper to which the scenario belongs, `light` or
    `obstacles`. paper_N, paper_duration_s: the paper's base rate and evaluation time [s].
    """

    name: str = "base"
    experiment: str = "obstacles"
    light: float = within(0, BRIGHTEST, usual=2, default=0.1)
    sun_turn_deg: float = within(-180, 180, default=0.0)
    obstacles: int = 0
    layout: int = within(0, default=0)
    goals: Mapping[Side, Place] | None = None
    dead_sensors: Sequence[int] = ()
    distance_gain: float = within(0, above=True, usual=10, default=1.0)
    distance_offset: float = within(-1, 1, above=True, below=True, default=0.0)
    left_distance_gain: float = within(0, above=True, usual=10, default=1.0)
    crosstalk: float = within(0, 0.5, default=0.0)
    sensor_levels: int = within(2, default=0)
    sensor_delay_steps: int = within(0, LONGEST_DELAY, default=0)
    wheel_delay_steps: int = within(0, LONGEST_DELAY, default=0)
    left_wheel: float = within(0, 1, default=1.0)
    right_wheel: float = within(0, 1, default=1.0)
    left_slip: float = within(0, 1, below=True, default=0.0)
    right_slip: float = within(0, 1, below=True, default=0.0)
    mass_ratio: float = within(1, usual=10, default=1.0)  # a lighter robot would move as with 1
    wall_friction: float = within(0, usual=10, default=0.0)
    lamp: Lamp = field(default_factory=Lamp)
    second_lamp: Sequence[float] | None = None
    lamp_on: bool | None = None
    placed: Sequence[Box] = ()
    rate: float = within(0, 10_000, default=1.0)
    put: Pose | None = None
    reset: bool = False
    changes: Sequence[Mapping[str, Any]] = ()
    hand: Sequence[Mapping[str, Any]] = ()
    paper_N: float = 0.000015
    paper_duration_s: float = within(0, LONGEST_S, above=True, default=250.0)
    maze: Maze = T_MAZE
    robot: Robot = EPUCK
    task: Task = ONE_TRIAL
    fitness: Fitness = PAPER_FITNESS
    physics: Physics = PYMUNK

    def __post_init__(self) -> None:
        if self.experiment not in EXPERIMENTS:
            raise ValueError(f"scenario.experiment must be one of {', '.join(EXPERIMENTS)}, got {self.experiment!r}")
        check_ranges(self, "scenario")
        if self.obstacles not in self.maze.obstacle_counts:
            allowed = ", ".join(map(str, self.maze.obstacle_counts))
            raise ValueError(f"scenario.obstacles must be one of {allowed} in {self.maze.name}, got {self.obstacles}")
        if self.layout and not self.maze.niches:
            raise ValueError(f"scenario.layout = {self.layout} needs niches, and maze {self.maze.name} has none")
        for key in ("second_lamp", "lamp_on", "reset"):
            check_kind(f"scenario.{key}", getattr(self, key))
        last, dead = self.robot.sensor_numbers - 1, self.dead_sensors
        whole = isinstance(dead, list | tuple) and all(type(number) is int and 0 <= number <= last for number in dead)
        if not whole or len(set(dead)) < len(dead):
            raise ValueError(f"scenario.dead_sensors must be different whole numbers, 0 to {last}, got {dead}")
        for side, goal in self.goals_now.items():
            check_value(f"scenario.goals.{side}", goal, Range(-self.maze.arena_m, self.maze.arena_m))
        standing = boxes(self.maze, self.obstacles, self.layout)
        check_room("maze.start", self.maze.start, self.maze, self.robot.radius_m, standing)
        check_placed(self.placed, self.maze)
        if self.put is not None:
            check_room("put", self.put, self.maze, self.robot.radius_m, self.boxes)
        self.physics.check(self)
        check_changes("changes", self.changes)
        check_changes("hand", self.hand)
        now = self
        for where, change in self.events:
            try:
                now = now.changed(change)
            except (ValueError, TypeError) as error:
                raise ValueError(f"{where}: {error}") from error

    @property
    def events(self) -> list[tuple[str, Mapping[str, Any]]]:
        """All changes in the order of the steps from which they hold, by hand before planned, each with its key."""
        events = [(f"scenario.hand[{number}]", change) for number, change in enumerate(self.hand)]
        events += [(f"scenario.changes[{number}]", change) for number, change in enumerate(self.changes)]
        return sorted(events, key=lambda event: first_step(event[1])) if self.hand else events

    def changed(self, change: Mapping[str, Any]) -> "Scenario":
        """This world after a change, without changes of its own; what happens at once happens with this one alone.

        Raises:
            TypeError: a new value is of another kind.
        """
        values = {key: value for key, value in change.items() if key != "at_s"}
        for key, value in values.items():
            check_kind(key, value)
        if isinstance(values.get("dead_sensors"), list):
            values["dead_sensors"] = tuple(values["dead_sensors"])
        if "placed" in values:
            values["placed"] = tuple(Box(*box) for box in values["placed"])
        if values.get("put") is not None:
            values["put"] = Pose(*values["put"])
        for key in GROUPED.keys() & values.keys():
            values[key] = replace(getattr(self, key), **values[key])
        if values.get("goals") is not None:
            values["goals"] = {**self.goals_now, **{side: Place(*goal) for side, goal in values["goals"].items()}}
        return replace(self, **{"changes": (), "hand": (), **AT_ONCE, **values})

    @property
    def boxes(self) -> Floats:
        """All that stands here: walls, obstacles and blocks, (boxes, 4) left, right, bottom and top edge [m]."""
        standing = boxes(self.maze, self.obstacles, self.layout)
        return np.concatenate([standing, edges(list(self.placed))]) if self.placed else standing

    @property
    def goals_now(self) -> Mapping[Side, Place]:
        """The goals of each side."""
        return self.maze.goals if self.goals is None else self.goals

    @property
    def groups(self) -> tuple[InputGroup, ...]:
        """The inputs of a network for this robot and task, group by group."""
        return (*self.robot.sensors, *self.task.inputs)

    @property
    def inputs(self) -> int:
        """How many inputs a network for this robot and task has."""
        return sum(group.count for group in self.groups)

    @property
    def phases(self) -> "list[tuple[int, Scenario]]":
        """The worlds of a lifetime, each with the control step from which on it holds."""
        phases = [(0, replace(self, changes=(), hand=()) if self.changes or self.hand else self)]
        for _, change in self.events:
            phases.append((first_step(change), phases[-1][1].changed(change)))
        return phases

    def check_lifetime(self, lifetime: Lifetime) -> None:
        """Check that the motors reach the gain, and that a lifetime is long enough for the task and all changes."""
        robot = self.robot
        self.task.check(self.lamp.intensity, lifetime.duration_s)
        if lifetime.gain_rad_s > robot.motor_limit_rad_s:
            allowed = f"more than 0 and at most robot.motor_limit_rad_s, {robot.motor_limit_rad_s:g}"
            raise ValueError(f"lifetime.gain_rad_s must be {allowed}, got {lifetime.gain_rad_s}")
        for side, goal in () if self.events else self.goals_now.items():
            room = self.maze.start, self.boxes, robot.radius_m, self.maze.arena_m
            if not is_reachable(goal, self.maze.goal_radius_m, *room):
                raise ValueError(f"maze.goals.{side}: walls leave no way from maze.start to {goal.x:g}, {goal.y:g}")
        for where, change in self.events:
            if change["at_s"] >= lifetime.duration_s:
                raise ValueError(f"{where}.at_s must be less than lifetime.duration_s, got {change['at_s']}")
