"""What a robot senses before a step: for whoever decides outside the program what its wheels do."""

import math
from typing import Any

from epuckhebb.sim import faults
from epuckhebb.sim.arrays import Floats
from epuckhebb.sim.compiling.kernel import kernel
from epuckhebb.sim.life import Life, Setup
from epuckhebb.sim.physics.pymunk import PYMUNK
from epuckhebb.sim.physics_engine import Handles, Physics, pose
from epuckhebb.sim.random import normal_numbers
from epuckhebb.sim.robot import EPUCK, Robot
from epuckhebb.sim.senses import blinding, senses
from epuckhebb.sim.sensors import Goal
from epuckhebb.sim.task import Task
from epuckhebb.sim.tasks.trial import ONE_TRIAL

# The parts, as the paper's robot has them; `look_kernel` puts others in their place.
sense, blind, draw_noise = senses(EPUCK, PYMUNK), blinding(EPUCK), normal_numbers(EPUCK.inputs)
apply_sensor_faults = faults.hooks(EPUCK, more=True).apply_sensor_faults
reward_input, to_goal = ONE_TRIAL.hooks(EPUCK.inputs)[:2]
_kernels: dict[tuple[object, ...], Any] = {}  # those that this process has used


def look(life: Life, setup: Setup, space: Handles, readings: Floats) -> None:
    """Fill the inputs that the next step of `live` will have: its noise is numbered, so it is the same then."""
    tally, trial, workspace = life.tally[0], setup.trial, life.workspace
    x, y, heading = pose(space)
    if setup.noise_level > 0.0:
        draw_noise(setup.key, tally.step, workspace.noise)
    cos, sin = math.cos(heading), math.sin(heading)
    goal = Goal(trial.goal_x, trial.goal_y, to_goal(trial, x, y))
    sense(x, y, cos, sin, space, setup.lit, workspace.noise, setup.noise_level, workspace.senses, readings, goal)
    apply_sensor_faults(readings, trial.faults, life.past, life.tally[0].step)
    blind(readings, trial.faults.dead_sensors)
    reward_input(readings, tally.reward)


def look_kernel(robot: Robot, task: Task, physics: Physics) -> Any:
    """`look` with these parts, compiled or from the cache. task: only its kind matters."""
    place = (robot, type(task), physics)
    if place not in _kernels:
        hooks = task.hooks(robot.inputs)
        _kernels[place] = kernel(
            look,
            sense=senses(robot, physics),
            blind=blinding(robot),
            draw_noise=normal_numbers(robot.inputs),
            apply_sensor_faults=faults.hooks(robot, more=True).apply_sensor_faults,
            reward_input=hooks.reward_input,
            to_goal=hooks.to_goal,
        )
    return _kernels[place]
