"""Faults of a robot, as numbers for the kernel, and their effect on sensor readings and wheels.

A wheel *slips* in spells of half a second, which are drawn at random for each wheel. In a spell the wheel moves the
robot at half its speed. Like sensor noise, the spells depend on the key of the lifetime alone.

A robot that is heavier than its drive was made for *lags*. The drive gives a robot of the usual mass m the commanded
speed within a step, by the force m (wanted - actual) / step. A mass of m times ratio then covers only 1 / ratio of the
way, so each wheel's speed follows its command slowly. Mass has no other effect: walls do not move, they push on the
robot's centre, and the friction of a wall grows with the mass.

Sensors or wheels may be *late*: the network gets the readings of some steps ago, or the wheels its commands of then.
Neighbouring infra-red sensors may *cross-talk*: each also reads a share of what its two neighbours do. A converter with
few *levels* rounds each reading.
"""

import math
from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import compiled
from epuckhebb.controller.random import uniform
from epuckhebb.tmaze.robot import STEP_S, Robot

SPELL = round(0.5 / STEP_S)  # steps for which a wheel slips or grips
SLIPPING = 0.5  # share of its speed that the floor lets through then
LONGEST_DELAY = 31  # steps, about a second
FAR = 2**50  # slips are drawn at numbers that neither sensor noise nor exploration reaches


class Faults(NamedTuple):
    """The faults of a robot, by the names of `Scenario`; lag: share of the way to a commanded speed left undone."""

    dead_sensors: NDArray[np.int64]
    left_wheel: float = 1.0
    right_wheel: float = 1.0
    lag: float = 0.0
    distance_gain: float = 1.0
    distance_offset: float = 0.0
    left_slip: float = 0.0
    right_slip: float = 0.0
    left_distance_gain: float = 1.0
    crosstalk: float = 0.0
    sensor_levels: int = 0
    sensor_delay_steps: int = 0
    wheel_delay_steps: int = 0


KINDS = {name: type(usual) for name, usual in Faults._field_defaults.items() if name != "lag"}  # of what a world sets


def initial_past(robot: Robot) -> Floats:
    """What late sensors and wheels need, of the last steps: the readings, and the two commands."""
    return np.zeros((LONGEST_DELAY + 1, robot.inputs + 2))


def make_faults(world: Any) -> Faults:
    """The faults of the robot in a world, a `Scenario`."""
    values = {name: kind(getattr(world, name)) for name, kind in KINDS.items()}
    return Faults(np.array(world.dead_sensors, np.int64), lag=1.0 - 1.0 / world.mass_ratio, **values)


@compiled
def grip(slip: float, key: np.uint64, step: int, wheel: int) -> float:
    """The share of its speed that the floor lets through at a step. slip: share of spells. wheel: 0 left, 1 right."""
    if slip > 0.0 and uniform(key, FAR + 2 * (step // SPELL) + wheel) < slip:
        return SLIPPING
    return 1.0


@cache
def sensor_faults(robot: Robot) -> Callable[..., None]:
    """The function `apply_sensor_faults(readings, faults, past, step)`, which changes the sensor readings."""
    distances = robot.input_places(robot.distance)
    first, count, inputs = distances.start, robot.distance.count, robot.inputs
    on_left = np.array([(sensor.azimuth + 180.0) % 360.0 > 180.0 for sensor in robot.distance.places])

    @compiled
    def apply_sensor_faults(readings: Floats, faults: Faults, past: Floats, step: int) -> None:
        for i in range(count):
            gain = faults.distance_gain * faults.left_distance_gain if on_left[i] else faults.distance_gain
            readings[first + i] = min(1.0, max(0.0, readings[first + i] * gain + faults.distance_offset))
        now = past[step % past.shape[0]]
        if faults.crosstalk > 0.0:
            for i in range(count):
                beside = readings[first + (i + 1) % count] + readings[first + (i + count - 1) % count]
                now[i] = min(1.0, readings[first + i] + faults.crosstalk * beside)
            for i in range(count):
                readings[first + i] = now[i]
        if faults.sensor_levels > 0:
            steps = faults.sensor_levels - 1.0
            for i in range(inputs):
                readings[i] = math.floor(readings[i] * steps + 0.5) / steps
        for i in range(inputs):  # kept always: a delay may begin during the lifetime
            now[i] = readings[i]
        if faults.sensor_delay_steps > 0:
            then = past[max(0, step - faults.sensor_delay_steps) % past.shape[0]]
            for i in range(inputs):
                readings[i] = then[i]

    return apply_sensor_faults


@compiled
def turn_wheels(
    faults: Faults, tally: Any, past: Floats, left: float, right: float, gain: float, key: np.uint64, step: int
) -> tuple[float, float]:
    """The speeds [rad/s] at which the wheels move the robot, for these outputs of the network.

    past: as `initial_past`, updated.
    """
    commands, now = past.shape[1] - 2, past[step % past.shape[0]]
    now[commands], now[commands + 1] = left, right
    if faults.wheel_delay_steps > 0:
        then = past[max(0, step - faults.wheel_delay_steps) % past.shape[0]]
        left, right = (then[commands], then[commands + 1]) if step >= faults.wheel_delay_steps else (0.0, 0.0)
    left = gain * faults.left_wheel * left * grip(faults.left_slip, key, step, 0)
    right = gain * faults.right_wheel * right * grip(faults.right_slip, key, step, 1)
    tally.left_speed = left + faults.lag * (tally.left_speed - left)
    tally.right_speed = right + faults.lag * (tally.right_speed - right)
    return tally.left_speed, tally.right_speed
