"""What is wrong with a robot, as numbers for the kernel, and what that does to its readings and its wheels.

A wheel *slips* in spells: time is cut into half seconds, and in so many of them, drawn at random for each wheel, the
floor lets through half of its speed. Which ones depends on the key of the lifetime alone, as sensor noise does.

A robot that is heavier than its drive was made for is slow to follow. The drive of this world brings a robot of its
own mass from any speed to the commanded one within a step, by the force m (wanted - actual) / step. The same force
brings m times the ratio only 1 / ratio of the way, so the speed of each wheel trails behind its command. Mass does
nothing else here: walls stand fast, they push on the robot's middle, and the friction of a wall grows with its mass.

Dead sensors and weak wheels are numbers that every kernel knows. The other faults are a part of it, which is there in
the worlds that have one.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim.compiled import compiled
from epuckhebb.sim.random import uniform
from epuckhebb.sim.robot import STEP_S, Robot

SPELL = round(0.5 / STEP_S)  # steps for which a wheel slips or grips
SLIPPING = 0.5  # share of its speed that the floor lets through then
FAR = 2**50  # slips are drawn at numbers where neither sensor noise nor exploration ever comes


class Faults(NamedTuple):
    """What is wrong with a robot.

    dead_sensors: numbers of its blind places. distance_gain, distance_offset: what its distance readings are
    multiplied by, and what is added to them. left_wheel, right_wheel: how well each turns. left_slip, right_slip:
    share of the time for which it slips. lag: share of the way to the commanded speed that a step leaves undone.
    """

    dead_sensors: NDArray[np.int64]
    distance_gain: float
    distance_offset: float
    left_wheel: float
    right_wheel: float
    left_slip: float
    right_slip: float
    lag: float

    @property
    def more(self) -> bool:
        """Whether more is wrong than dead sensors and weak wheels."""
        return (self.distance_gain, self.distance_offset, self.left_slip, self.right_slip, self.lag) != (1, 0, 0, 0, 0)


def lag_of(mass_ratio: float) -> float:
    """The lag of a robot that is so many times as heavy as its drive was made for."""
    return 1.0 - 1.0 / mass_ratio


@compiled
def grip(slip: float, key: np.uint64, step: int, wheel: int) -> float:
    """The share of its speed that the floor lets through at a step. slip: share of spells. wheel: 0 left, 1 right."""
    if slip > 0.0 and uniform(key, FAR + 2 * (step // SPELL) + wheel) < slip:
        return SLIPPING
    return 1.0


class Hooks(NamedTuple):
    """The functions of faults that a lifetime calls.

    apply_sensor_faults(readings, faults): changes the sensor readings. turn_wheels(faults, tally, left, right, gain,
    key, step): the speeds [rad/s] at which the wheels move the robot, for these outputs of the network.
    """

    apply_sensor_faults: Callable[..., None]
    turn_wheels: Callable[..., tuple[float, float]]


def hooks(robot: Robot, more: bool) -> Hooks:
    """The functions for a robot; `more` than dead sensors and weak wheels is wrong, or not."""
    return Hooks(_miscalibrated(robot), _slow_and_slipping) if more else Hooks(_as_it_is, _at_once)


@compiled
def _as_it_is(readings: NDArray[np.float64], faults: Faults) -> None:
    pass


@compiled
def _at_once(
    faults: Faults, tally: Any, left: float, right: float, gain: float, key: np.uint64, step: int
) -> tuple[float, float]:
    tally.left_speed = gain * faults.left_wheel * left  # for a kernel that knows more faults, which may go on with it
    tally.right_speed = gain * faults.right_wheel * right
    return tally.left_speed, tally.right_speed


def _miscalibrated(robot: Robot) -> Callable[..., None]:
    distances = robot.inputs_of(robot.distance)
    first, last = distances.start, distances.stop

    @compiled
    def apply_sensor_faults(readings: NDArray[np.float64], faults: Faults) -> None:
        for i in range(first, last):
            readings[i] = min(1.0, max(0.0, readings[i] * faults.distance_gain + faults.distance_offset))

    return apply_sensor_faults


@compiled
def _slow_and_slipping(
    faults: Faults, tally: Any, left: float, right: float, gain: float, key: np.uint64, step: int
) -> tuple[float, float]:
    left = gain * faults.left_wheel * left * grip(faults.left_slip, key, step, 0)
    right = gain * faults.right_wheel * right * grip(faults.right_slip, key, step, 1)
    tally.left_speed = left + faults.lag * (tally.left_speed - left)
    tally.right_speed = right + faults.lag * (tally.right_speed - right)
    return tally.left_speed, tally.right_speed
