"""Corrections: in every step, sensor readings and wheel speeds as they would be in the training world.

    darker      light of rho < 1 times training's: reading = 1 - u / rho, u = 1 - reading, smoothed over 1 / rho steps
    brighter    light of rho > 1 times training's: the same, not smoothed; a saturated sensor reads what training's sun
                would give at the heading that fits the present sun best, or 0 if only the lamp can be so bright there
    dead        reading = z Q z, z = (1, the other readings): a quadratic regression
    wheel       output = output / (1 - loss), no faster than the motor

Where nothing has changed (rho = 1, no dead sensor, loss = 0), each is the identity, bit for bit.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import compiled
from epuckhebb.tmaze.light import SUN_IRRADIANCE, SUN_X, SUN_Y
from epuckhebb.tmaze.robot import Robot

HEADINGS = 128  # directions of the sun
SATURATED = 0.03  # a light reading up to this says only that it is at least so bright
_DOUBT = 0.05  # weight of a saturated reading in the fit of the sun's direction
_SUNLIT = 0.1  # if the present sun alone would read more, a saturated sensor is in the lamp
_COARSE = 8  # every eighth direction is tried first, then all around the best


class Corrections(NamedTuple):
    """What a robot corrects, as numbers for the kernel.

    light_ratio: rho, the present light over training's. seeing: (lights,) 1 where a light sensor works, 0 where it is
    dead. sun_now, sun_training: (lights, HEADINGS + 2 * 8) light readings by the direction of the sun alone, at present
    and in training; the last 16 repeat the first. dead: inputs that are predicted from the inputs `others`.
    regression: (dead, others + 1, others + 1) Q; index 0 is the constant 1. left_loss, right_loss: of the wheels.
    """

    light_ratio: float
    seeing: Floats
    sun_now: Floats
    sun_training: Floats
    dead: NDArray[np.int64]
    others: NDArray[np.int64]
    regression: Floats
    left_loss: float
    right_loss: float


def no_corrections(robot: Robot) -> Corrections:
    """The corrections of a robot in which nothing has changed."""
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
    """Check that corrections are finite and fit this robot; else a ValueError."""
    lights, inputs = len(corrections.seeing), len(corrections.others) + len(corrections.dead)
    if (lights, inputs) != (robot.light.count, robot.inputs):
        raise ValueError(
            f"corrections of a robot with {lights} light sensors and {inputs} readings do not fit robot {robot.name}, "
            f"which has {robot.light.count} and {robot.inputs}"
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


def sunlit(robot: Robot, level: float) -> Floats:
    """Light readings under a sun of this level alone, by the sun's direction: (lights, HEADINGS + 2 * 8).

    reading = clip(1 - E, 0, 1), E = 2.7 level height cos(direction - azimuth), nothing from behind
    """
    azimuth = np.radians([place.azimuth for place in robot.light.places])
    towards = np.arange(HEADINGS + 2 * _COARSE) * (2 * math.pi / HEADINGS)
    facing = np.maximum(0.0, np.cos(towards[None, :] - azimuth[:, None]))
    by_heading: Floats = np.clip(1.0 - SUN_IRRADIANCE * level * math.hypot(SUN_X, SUN_Y) * facing, 0.0, 1.0)
    return by_heading


class CorrectionState(NamedTuple):
    """What corrections carry from step to step: smooth (lights,) brightness, nan at first; and workspace."""

    smooth: Floats
    cost: Floats
    known: Floats
    weighted: Floats


def initial_correction_state(robot: Robot) -> CorrectionState:
    """The state before the first step."""
    return CorrectionState(
        smooth=np.full(robot.light.count, np.nan),
        cost=np.zeros(2 * _COARSE),
        known=np.zeros(robot.inputs + 1),
        weighted=np.zeros(robot.inputs + 1),
    )


@compiled
def from_darker(readings: Floats, ratio: float, smooth: Floats) -> None:
    """Light readings in a light of `ratio` < 1 times training's, as they would be in training.

    u' = u' + rho (1 - reading - u'), reading = clip(1 - u' / rho, 0, 1)      smoothed as much as it is magnified
    """
    for i in range(smooth.shape[0]):
        bright = 1.0 - readings[i]
        smooth[i] = bright if math.isnan(smooth[i]) else smooth[i] + ratio * (bright - smooth[i])
        readings[i] = min(1.0, max(0.0, 1.0 - smooth[i] / ratio))


@compiled
def from_brighter(readings: Floats, by: Corrections, cost: Floats) -> None:
    """Light readings in a light of rho > 1 times training's, as they would be in training.

    reading = 1 - (1 - reading) / rho where the sensor is not saturated. A saturated one reads what training's sun
    would give from the direction that fits all sensors best. If the present sun cannot saturate it from there, the
    lamp is lit and would saturate it in training too.
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
def _direction_of_the_sun(readings: Floats, by: Corrections, cost: Floats) -> int:
    """The direction from which the present sun fits the readings best."""
    _costs(readings, by, cost, 0, _COARSE)
    nearest = _COARSE * _least(cost)
    first = (nearest - _COARSE) % HEADINGS
    _costs(readings, by, cost, first, 1)
    return (first + _least(cost)) % HEADINGS


@compiled
def _costs(readings: Floats, by: Corrections, cost: Floats, first: int, apart: int) -> None:
    """Weighted squared errors of the present sun's readings, for sixteen directions from `first` on."""
    for k in range(2 * _COARSE):
        cost[k] = 0.0
    for i in range(by.seeing.shape[0]):
        weight = by.seeing[i] * (_DOUBT if readings[i] <= SATURATED else 1.0)
        for k in range(2 * _COARSE):
            off = readings[i] - by.sun_now[i, first + apart * k]
            cost[k] += weight * off * off


@compiled
def _least(cost: Floats) -> int:
    place = 0
    for k in range(1, cost.shape[0]):
        if cost[k] < cost[place]:
            place = k
    return place


@compiled
def predict_dead(readings: Floats, by: Corrections, state: CorrectionState) -> None:
    """Predict what dead sensors would read from the others, by a quadratic regression on training readings.

    reading = clip(z Q z, 0, 1), z = (1, the other readings)
    """
    others = by.others.shape[0]
    state.known[0] = 1.0
    for i in range(others):
        state.known[i + 1] = readings[by.others[i]]
    for d in range(by.dead.shape[0]):
        for j in range(others + 1):
            state.weighted[j] = 0.0
        for i in range(others + 1):
            for j in range(others + 1):
                state.weighted[j] += state.known[i] * by.regression[d, i, j]
        total = 0.0
        for j in range(others + 1):
            total += state.weighted[j] * state.known[j]
        readings[by.dead[d]] = min(1.0, max(0.0, total))


@compiled
def corrected_readings(readings: Floats, by: Corrections, state: CorrectionState) -> None:
    """Sensor readings as in the training world: first of the light, then of dead sensors, predicted from the others."""
    if by.light_ratio < 1.0:
        from_darker(readings, by.light_ratio, state.smooth)
    elif by.light_ratio > 1.0:
        from_brighter(readings, by, state.cost)
    if by.dead.shape[0] > 0:
        predict_dead(readings, by, state)


def corrected_wheel(motor_limit: float) -> Callable[[float, float, float], float]:
    """The function that gives the output with which a weak wheel turns as fast as an intact one.

    output' = output / (1 - loss)
    """

    @compiled
    def wheel(output: float, loss: float, gain: float) -> float:
        fastest = motor_limit / gain
        return min(fastest, max(-fastest, output / (1.0 - loss)))

    return wheel
