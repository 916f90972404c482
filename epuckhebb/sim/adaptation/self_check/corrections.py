"""Corrections: readings as they would be at home, and wheels that turn as they would at home, all life long.

    darker      light of rho < 1 times home's: reading = 1 - u / rho, u = 1 - reading, smoothed over 1 / rho steps
    brighter    light of rho > 1 times home's: the same, not smoothed; where a sensor is saturated, what home's sun
                would give at the heading that fits today's sun best, or 0 if only the lamp can be so bright there
    dead        reading = z Q z, z = (1, the other readings): a quadratic regression
    wheel       output = output / (1 - loss), no faster than the motor

Where nothing has changed each is the identity, bit for bit: rho = 1, no dead sensor, loss = 0.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim.compiled import compiled
from epuckhebb.sim.light import SUN_IRRADIANCE, SUN_X, SUN_Y
from epuckhebb.sim.robot import Robot

HEADINGS = 128  # directions of the sun that are told apart
SATURATED = 0.03  # a light reading up to this says only that it is at least so bright
_DOUBT = 0.05  # weight of a saturated reading in the fit of the sun's direction
_SUNLIT = 0.1  # today's sun alone would read above this, yet the sensor is saturated: that is the lamp
_COARSE = 8  # every so many directions are tried first, then all between


class Corrections(NamedTuple):
    """What a robot corrects, as numbers for the kernel.

    light_ratio: rho, today's light over home's. seeing: (lights,) 1 where a light sensor works, 0 where it is dead.
    sun_now, sun_training: (lights, HEADINGS + 2 * 8) readings under the sun alone, by its direction, today's and
    that of the training world; the last 16 are the first again. dead: numbers of the readings that are made up from
    others; others: of those. regression: (dead, others + 1, others + 1) Q;
    place 0 is of the constant 1. left_loss, right_loss: of the wheels.
    """

    light_ratio: float
    seeing: NDArray[np.float64]
    sun_now: NDArray[np.float64]
    sun_training: NDArray[np.float64]
    dead: NDArray[np.int64]
    others: NDArray[np.int64]
    regression: NDArray[np.float64]
    left_loss: float
    right_loss: float


def no_corrections(robot: Robot) -> Corrections:
    """What a robot corrects that found nothing."""
    by_heading = np.zeros((robot.light.count, HEADINGS + 2 * _COARSE))
    return Corrections(
        light_ratio=1.0,
        seeing=np.ones(robot.light.count),
        sun_now=by_heading,
        sun_training=by_heading,
        dead=np.zeros(0, np.int64),
        others=np.arange(robot.inputs),
        regression=np.zeros((0, robot.inputs + 1, robot.inputs + 1)),
        left_loss=0.0,
        right_loss=0.0,
    )


def check_corrections(corrections: Corrections, robot: Robot) -> None:
    """Refuse corrections that are of another robot, or not finite.

    Raises:
        ValueError: they are.
    """
    whole = no_corrections(robot)
    if (
        corrections.seeing.shape != whole.seeing.shape
        or len(corrections.others) + len(corrections.dead) != robot.inputs
    ):
        raise ValueError(
            f"corrections of a robot with {len(corrections.seeing)} light sensors and "
            f"{len(corrections.others) + len(corrections.dead)} readings do not fit robot {robot.name}, which has "
            f"{robot.light.count} and {robot.inputs}"
        )
    for name, value in corrections._asdict().items():
        if not np.isfinite(value).all():
            raise ValueError(f"a correction must be finite, got {name} = {value}")
    if not corrections.light_ratio > 0:
        raise ValueError(f"a correction for light needs a ratio above 0, got {corrections.light_ratio}")
    for name in ("left_loss", "right_loss"):
        if not getattr(corrections, name) < 1:
            raise ValueError(
                f"a correction for a wheel needs a loss below 1, got {name} = {getattr(corrections, name)}"
            )


def sunlit(robot: Robot, level: float) -> NDArray[np.float64]:
    """Light readings under a sun of this level alone, by the sun's direction: (lights, HEADINGS + 2 * 8).

    reading = clip(1 - E, 0, 1), E = 2.7 level height cos(direction - azimuth), nothing from behind
    """
    azimuth = np.radians([place.azimuth for place in robot.light.places])
    towards = np.arange(HEADINGS + 2 * _COARSE) * (2 * math.pi / HEADINGS)
    facing = np.maximum(0.0, np.cos(towards[None, :] - azimuth[:, None]))
    by_heading: NDArray[np.float64] = np.clip(
        1.0 - SUN_IRRADIANCE * level * math.hypot(SUN_X, SUN_Y) * facing, 0.0, 1.0
    )
    return by_heading


class CorrectionState(NamedTuple):
    """What corrections carry from step to step: smooth (lights,), nan before the first; and workspace."""

    smooth: NDArray[np.float64]
    cost: NDArray[np.float64]
    known: NDArray[np.float64]
    weighted: NDArray[np.float64]


def initial_correction_state(robot: Robot) -> CorrectionState:
    """Room for a robot at birth."""
    return CorrectionState(
        smooth=np.full(robot.light.count, np.nan),
        cost=np.zeros(2 * _COARSE),
        known=np.zeros(robot.inputs + 1),
        weighted=np.zeros(robot.inputs + 1),
    )


@compiled
def from_darker(readings: NDArray[np.float64], ratio: float, smooth: NDArray[np.float64]) -> None:
    """Light readings in a light of `ratio` < 1 times home's, as they would be at home.

    u' = u' + rho (1 - reading - u'), reading = clip(1 - u' / rho, 0, 1)      smoothed as much as it is magnified
    """
    for i in range(smooth.shape[0]):
        bright = 1.0 - readings[i]
        smooth[i] = bright if math.isnan(smooth[i]) else smooth[i] + ratio * (bright - smooth[i])
        readings[i] = min(1.0, max(0.0, 1.0 - smooth[i] / ratio))


@compiled
def from_brighter(readings: NDArray[np.float64], by: Corrections, cost: NDArray[np.float64]) -> None:
    """Light readings in a light of rho > 1 times home's, as they would be at home.

    reading = 1 - (1 - reading) / rho where it is not saturated; elsewhere the sun's direction that fits today's
    readings best says what home's sun would give, unless it says that a saturated sensor is not in the sun: then the
    lamp is lit, and saturates it at home too.
    """
    at = _direction_of_the_sun(readings, by, cost)
    lamp = False
    for i in range(by.seeing.shape[0]):
        lamp = lamp or (by.seeing[i] > 0.0 and readings[i] <= SATURATED and by.sun_now[i, at] > _SUNLIT)
    for i in range(by.seeing.shape[0]):
        if readings[i] > SATURATED:
            readings[i] = 1.0 - (1.0 - readings[i]) / by.light_ratio
        elif lamp:
            readings[i] = 0.0
        else:
            readings[i] = by.sun_training[i, at]


@compiled
def _direction_of_the_sun(readings: NDArray[np.float64], by: Corrections, cost: NDArray[np.float64]) -> int:
    """The direction at which today's sun fits the readings best: every eighth is tried first, then those around."""
    _costs(readings, by, cost, 0, _COARSE)
    nearest = _COARSE * _least(cost)
    first = (nearest - _COARSE) % HEADINGS
    _costs(readings, by, cost, first, 1)
    return (first + _least(cost)) % HEADINGS


@compiled
def _costs(readings: NDArray[np.float64], by: Corrections, cost: NDArray[np.float64], first: int, apart: int) -> None:
    """The weighted squares by which readings miss those of today's sun, for sixteen directions from `first` on."""
    for k in range(2 * _COARSE):
        cost[k] = 0.0
    for i in range(by.seeing.shape[0]):
        weight = by.seeing[i] * (_DOUBT if readings[i] <= SATURATED else 1.0)
        for k in range(2 * _COARSE):
            off = readings[i] - by.sun_now[i, first + apart * k]
            cost[k] += weight * off * off


@compiled
def _least(cost: NDArray[np.float64]) -> int:
    place = 0
    for k in range(1, cost.shape[0]):
        if cost[k] < cost[place]:
            place = k
    return place


@compiled
def instead_of_dead(readings: NDArray[np.float64], by: Corrections, room: CorrectionState) -> None:
    """What dead sensors would read, by the others: a quadratic regression on readings at home.

    reading = clip(z Q z, 0, 1), z = (1, the other readings)
    """
    others = by.others.shape[0]
    room.known[0] = 1.0
    for i in range(others):
        room.known[i + 1] = readings[by.others[i]]
    for d in range(by.dead.shape[0]):
        for j in range(others + 1):
            room.weighted[j] = 0.0
        for i in range(others + 1):
            for j in range(others + 1):
                room.weighted[j] += room.known[i] * by.regression[d, i, j]
        total = 0.0
        for j in range(others + 1):
            total += room.weighted[j] * room.known[j]
        readings[by.dead[d]] = min(1.0, max(0.0, total))


@compiled
def corrected_readings(readings: NDArray[np.float64], by: Corrections, room: CorrectionState) -> None:
    """Readings as they would be at home: first of the light, then of dead sensors, which follow from the others."""
    if by.light_ratio < 1.0:
        from_darker(readings, by.light_ratio, room.smooth)
    elif by.light_ratio > 1.0:
        from_brighter(readings, by, room.cost)
    if by.dead.shape[0] > 0:
        instead_of_dead(readings, by, room)


def corrected_wheel(motor_limit: float) -> Callable[[float, float, float], float]:
    """The function that gives the output which turns a weak wheel as fast as a sound one, as far as the motor goes.

    output' = output / (1 - loss)
    """

    @compiled
    def wheel(output: float, loss: float, gain: float) -> float:
        fastest = motor_limit / gain
        return min(fastest, max(-fastest, output / (1.0 - loss)))

    return wheel
