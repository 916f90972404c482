"""Makes one compiled function of the groups of sensors that `sensors.py` defines."""

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import compiled, written
from epuckhebb.controller.random import noise_workspace_size
from epuckhebb.tmaze.light import Lights
from epuckhebb.tmaze.physics_engine import Handles, Physics
from epuckhebb.tmaze.robot import Robot
from epuckhebb.tmaze.sensors import NO_GOAL, Goal, Place, RimSensors, Surroundings

Sense = Callable[..., None]


class SenseWorkspace(NamedTuple):
    """Workspace of `sense`: rays (numbers, sensors) of each ring of places; of each group a number for each sensor.

    noise: for a number for each input, of the step.
    """

    rays: tuple[Floats, ...]
    scratch: tuple[Floats, ...]
    noise: Floats


def sense_workspace(robot: Robot, physics: Physics) -> SenseWorkspace:
    """Workspace for a robot of this kind."""
    rays = tuple(np.empty((physics.ray_numbers, len(ring))) for ring in _rings(robot))
    scratch = tuple(np.zeros(group.count) for group in robot.sensors)
    return SenseWorkspace(rays, scratch, np.zeros(noise_workspace_size(robot.inputs)))


@cache
def senses(robot: Robot, physics: Physics) -> Sense:
    """The function `sense(x, y, cos, sin, space, lit, noise, noise_level, workspace, readings, goal)`.

    It fills the readings, (inputs,), from the pose of the robot, its space, the lights, standard normal noise, one
    number for each input, the noise level, 1 for the sensors' own, and the goal.
    """
    rings = _rings(robot)
    parts: dict[str, Any] = {"put_rays": physics.put_rays(robot)}
    put, look, read = [], [], []
    for k, ring in enumerate(rings):
        azimuth = np.radians([sensor.azimuth for sensor in ring])
        x, y = [sensor.x for sensor in ring], [sensor.y for sensor in ring]
        parts[f"ring_{k}"] = np.array([x, y, np.cos(azimuth), np.sin(azimuth)])  # in the robot's frame
        put.append(f"put_rays(space, x, y, cos, sin, ring_{k}, rays[{k}])")
    for k, group in enumerate(robot.sensors):
        ring_of = rings.index(group.places) if isinstance(group, RimSensors) else 0
        arguments = f"around, rays[{ring_of}], scratch[{k}]"
        parts[f"read_{k}"], parts[f"look_{k}"] = physics.kernels(group, robot.input_places(group).start, robot.radius_m)
        look.append(f"look_{k}({arguments})")
        read.append(f"read_{k}({arguments}, readings)")
    # The calls are written out, because each group has its own functions. All groups look before any reads: a group
    # that reads right after its look waits for memory, and sensing takes 15 to 20 % longer.
    calls = ", ".join([*put, *look, *read])
    feel = written("space, x, y, cos, sin, around, rays, scratch, readings", f"({calls},)", parts)

    @compiled
    def sense(
        x: float,
        y: float,
        cos: float,
        sin: float,
        space: Handles,
        lit: Lights,
        noise: Floats,
        noise_level: float,
        workspace: SenseWorkspace,
        readings: Floats,
        goal: Goal = NO_GOAL,
    ) -> None:
        around = Surroundings(x, y, cos, sin, space.walls, lit, noise, noise_level, goal)
        feel(space, x, y, cos, sin, around, workspace.rays, workspace.scratch, readings)

    return sense


def _rings(robot: Robot) -> list[tuple[Place, ...]]:
    """The places of all groups on the rim; groups that share places share their rays."""
    return list(dict.fromkeys(group.places for group in robot.sensors if isinstance(group, RimSensors)))


@cache
def blinding(robot: Robot) -> Callable[[Floats, NDArray[np.int64]], None]:
    """The function that makes the sensors of these numbers dead, in all groups: they sense the dark, and no wall."""
    on_rim = [group for group in robot.sensors if isinstance(group, RimSensors)]
    firsts = np.array([robot.input_places(group).start for group in on_rim])
    counts = np.array([group.count for group in on_rim])
    dead = np.array([group.dead for group in on_rim])

    @compiled
    def blind(readings: Floats, numbers: NDArray[np.int64]) -> None:
        for k in range(numbers.shape[0]):
            number = numbers[k]
            for group in range(firsts.shape[0]):
                if number < counts[group]:
                    readings[firsts[group] + number] = dead[group]

    return blind


@cache
def largest_distance_reading(robot: Robot) -> Callable[[Floats], float]:
    """The function that gives the largest of a robot's distance readings."""
    inputs = robot.input_places(robot.distance)
    first, end = inputs.start, inputs.stop

    @compiled
    def largest(readings: Floats) -> float:
        most = float(readings[first])
        for i in range(first + 1, end):
            most = max(most, readings[i])
        return most

    return largest
