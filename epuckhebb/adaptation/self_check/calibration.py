"""The calibration manoeuvre: a short fixed sequence of wheel commands before a lifetime, and the sensor readings.

The robot turns to the left wall, drives near it, waits and comes back, then the same to the right, and ends where it
started. A robot at rest could hardly tell the sun from the lamp, and not measure its wheels.

A careful robot compares its last readings with the first. Where they differ, wheels that slipped have left it turned.
It then turns to one side for as long as it looks more like the beginning; if it never does, to the other side.
"""

import math
from collections.abc import Callable
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import kernel
from epuckhebb.controller.network import HIDDEN, OUTPUTS, Network
from epuckhebb.controller.random import normal_numbers
from epuckhebb.tmaze import faults
from epuckhebb.tmaze.life import TALLY, CalibrationRecord, Lifetime, Trial, Workspace, workspace_for
from epuckhebb.tmaze.light import Lights
from epuckhebb.tmaze.maze import Pose, Side, boxes
from epuckhebb.tmaze.physics.pymunk import PYMUNK, mover
from epuckhebb.tmaze.physics_engine import Handles, Physics, pose
from epuckhebb.tmaze.reachable import gap
from epuckhebb.tmaze.robot import EPUCK, STEP_S, Robot
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.senses import blinding, senses
from epuckhebb.tmaze.simulator import lights_of, trial_of

_QUARTER = 10  # steps at full speed in which an e-puck turns by 89 degrees
_TO_LEFT, _TO_RIGHT = 3, 4  # steps at full speed, 4 mm each, that bring it within 3 mm of the side walls
_HOLD = 12  # steps for which it waits near a wall
_CLEAR_M = 0.001  # a robot nearer to a wall than this may touch it
# Of a careful robot; chosen in the worlds that existed before the third set of unseen kinds:
_TURNED = 0.02  # root mean square difference to the first readings, above which it looks turned
_ASIDE, _TURN = 0.5, 3  # share of full speed for 4 degrees; steps: one that turns, two until the sensors show it
_LOOKS, _MOST = 3, 16  # turns to a side that look no better, after which it turns back; turns to a side in all


def _steps() -> Floats:
    rest, ahead, back, left, right = [(0.0, 0.0)], [(1.0, 1.0)], [(-1.0, -1.0)], [(-1.0, 1.0)], [(1.0, -1.0)]
    there = left * _QUARTER + rest + ahead * _TO_LEFT + rest * _HOLD + back * _TO_LEFT + rest + left * _QUARTER
    across = right * (3 * _QUARTER) + rest + ahead * _TO_RIGHT + rest * _HOLD + back * _TO_RIGHT + rest
    return np.array(there + across + right * _QUARTER + left * (2 * _QUARTER) + rest * 2)


STEPS = _steps()  # (124, 2) of the left and the right wheel, in shares of the motors' full speed
_LONGEST_SEARCH = 2 * _TURN * (_MOST + _LOOKS)  # steps

# The parts of the manoeuvre, as the paper's robot has them; `_kernel_of` puts those of another in their place.
sense, blind, draw_noise, move = senses(EPUCK, PYMUNK), blinding(EPUCK), normal_numbers(EPUCK.inputs), mover(EPUCK)
apply_sensor_faults, turn_wheels = faults.hooks(EPUCK, more=True)


def drive(
    space: Handles,
    lit: Lights,
    trial: Trial,
    noise_level: float,
    key: np.uint64,
    workspace: Workspace,
    tallies: NDArray[np.void],
    calibration: CalibrationRecord,
    first: int,
    last: int,
) -> None:
    """Drive the manoeuvre with the robot that stands in `space`, sensing and moving as in a lifetime.

    key: of the sensor noise. tallies: one record of `TALLY`. calibration: its speeds are commanded, the rest is filled,
    from step `first` to the one before `last`.
    """
    tally, past = tallies[0], calibration.past
    x, y, heading = pose(space)
    for step in range(first, last):
        calibration.poses[step, 0], calibration.poses[step, 1], calibration.poses[step, 2] = x, y, heading
        cos, sin = math.cos(heading), math.sin(heading)
        if noise_level > 0.0:
            draw_noise(key, step, workspace.noise)
        readings = calibration.readings[step]
        sense(x, y, cos, sin, space, lit, workspace.noise, noise_level, workspace.senses, readings)
        apply_sensor_faults(readings, trial.faults, past, step)
        blind(readings, trial.faults.dead_sensors)
        left, right = calibration.speeds[step, 0], calibration.speeds[step, 1]
        left, right = turn_wheels(trial.faults, tally, past, left, right, 1.0, key, step)
        move(space, cos, sin, left, right)
        x, y, heading = pose(space)
    calibration.poses[last, 0], calibration.poses[last, 1], calibration.poses[last, 2] = x, y, heading


@cache
def _kernel_of(robot: Robot, physics: Physics) -> Any:
    apply_sensor_faults, turn_wheels = faults.hooks(robot, more=True)
    return kernel(
        drive,
        (robot, physics),
        sense=senses(robot, physics),
        blind=blinding(robot),
        draw_noise=normal_numbers(robot.inputs),
        move=physics.mover(robot),
        apply_sensor_faults=apply_sensor_faults,
        turn_wheels=turn_wheels,
    )


def calibrate(
    world: Scenario,
    side: Side,
    key: np.uint64,
    noise: float = 1.0,
    start: Pose | None = None,
    *,
    walls: bool = True,
    careful: bool = False,
) -> CalibrationRecord:
    """The calibration manoeuvre of a robot in a world as it is at the start.

    key: of the sensor noise. noise: 1 for the sensors' own, 0 for none. start: None for the start of the maze. walls:
    False for a manoeuvre on an empty floor.
    """
    robot = world.robot
    placed = boxes(world.maze, world.obstacles, world.layout) if walls else np.empty((0, 4))
    space = world.physics.space(placed, world)
    space.place_robot(world.maze.start if start is None else start)
    steps = len(STEPS) + (_LONGEST_SEARCH if careful else 0)
    calibration = CalibrationRecord(
        poses=np.zeros((steps + 1, 3)),
        speeds=np.zeros((steps, 2)),
        readings=np.zeros((steps, robot.inputs)),
        past=faults.initial_past(robot),
    )
    calibration.speeds[: len(STEPS)] = robot.motor_limit_rad_s * STEPS
    trial = trial_of(world, side)
    run = partial(
        _kernel_of(robot, world.physics),
        space.handles,
        lights_of(world, lamp_on=side == "right"),
        trial,
        float(noise),
        key,
        workspace_for(Network((robot.inputs, *HIDDEN, OUTPUTS)), robot, world.physics),
        np.zeros(1, TALLY),
        calibration,
    )
    run(0, len(STEPS))
    if not careful:
        return calibration
    last = _turn_back(run, calibration, robot.motor_limit_rad_s)
    poses, speeds, readings = calibration[:3]
    return calibration._replace(poses=poses[: last + 1], speeds=speeds[:last], readings=readings[:last])


def _turn_back(run: Callable[[int, int], None], calibration: CalibrationRecord, motor_limit: float) -> int:
    """Turn a robot that looks turned until it looks most like at the beginning; the number of steps in all."""
    _, speeds, readings, _ = calibration
    step = len(STEPS)

    def difference() -> float:
        return math.sqrt(np.mean((readings[step - 1] - readings[0]) ** 2))

    def turn(speed: float) -> float:
        nonlocal step
        speeds[step] = -speed * motor_limit, speed * motor_limit
        run(step, step + _TURN)
        step += _TURN
        return difference()

    at_first = least = difference()
    for aside in (_ASIDE, -_ASIDE):
        worse = turns = 0
        while least > _TURNED and worse < _LOOKS and turns < _MOST:
            now = turn(aside)
            worse, least = (0, now) if now < least else (worse + 1, least)
            turns += 1
        for _ in range(worse):
            turn(-aside)
        if least < at_first:
            break
    return step


def check_time(lifetime: Lifetime, world: Scenario) -> None:
    """Check that a calibration manoeuvre leaves time in the lifetime, and ends before the world changes.

    Raises:
        ValueError: it does not.
    """
    lasts = len(STEPS) * STEP_S
    if lifetime.steps <= len(STEPS):
        raise ValueError(
            f"lifetime.duration_s must be more than {lasts:g} s, the time of the calibration manoeuvre, with "
            f"adaptation.calibration_counts=true, got {lifetime.duration_s:g}"
        )
    if world.changes and world.changes[0]["at_s"] < lasts:
        raise ValueError(
            f"scenario.changes[0].at_s must be {lasts:g} s or more with adaptation.calibration_counts=true, got "
            f"{world.changes[0]['at_s']}: the world may not change during the calibration manoeuvre"
        )


def check_space(world: Scenario) -> None:
    """Check that an intact robot touches no wall in the calibration manoeuvre.

    Raises:
        ValueError: it would; the message says how near it comes.
    """
    robot = world.robot
    poses = calibrate(world, "left", np.uint64(0), noise=0.0, walls=False).poses
    placed = boxes(world.maze, world.obstacles, world.layout)
    nearest = min(gap(x, y, placed) for x, y, _ in poses.tolist()) - robot.radius_m
    if nearest < _CLEAR_M:
        way = f"{1000 * -nearest:.1f} mm into" if nearest < 0 else f"within {1000 * nearest:.1f} mm of"
        raise ValueError(
            f"the calibration manoeuvre of the self-check would bring robot {robot.name} from the start of maze "
            f"{world.maze.name} {way} a wall; {1000 * _CLEAR_M:g} mm must be left. Give another maze or start, or "
            "adaptation.self_check=false"
        )
