"""What the self-check finds: dead sensors, weak wheels, and how bright the light is, each with its standard error.

    dead    an infra-red sensor that read exactly 0 all the time; an intact one always reads a little. If more than half
            did, none is called dead: something else is wrong with all of them
    loss    of the wheels: least squares of (IR - M) / (s + 0.003) on [J_left, J_right, J_x, J_y, J_heading]
    rho     present light over training's: sum(u u0) / sum(u0^2), u = 1 - reading, where the lamp makes no difference
    lamp    lit or not, whichever fits the light readings better where it makes a difference

M, s, J: mean sensor readings of the calibration manoeuvre in training, their spread, and their change with each cause
(`memory`). A misfit is what no cause explains: the root mean square of the residuals, in spreads, about 1 at best.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from epuckhebb.adaptation.self_check.memory import REPEATS, SelfMemory
from epuckhebb.controller.arrays import Floats
from epuckhebb.tmaze import light

MISFIT = 2.0  # spreads; a larger misfit is not explained by known causes
_LEAST_SPREAD = 0.003  # of a reading
_LAMP_SHOWS = 0.01  # a reading differs by so much or more with the lamp
_DARKEST, _BRIGHTEST = 0.02, 0.97  # of u: below there is nothing to compare, above a sensor is saturated


@dataclass(frozen=True, kw_only=True)
class Findings:
    """What a self-check finds.

    lamp: whether it seems lit. dead_sensors: numbers of their places. wheel_loss, wheel_loss_error: (2,) left and
    right, lost share of their speed. light_ratio, light_ratio_error: present light over training's. distance_misfit,
    light_misfit: what is left unexplained, in spreads.
    """

    lamp: bool
    dead_sensors: tuple[int, ...]
    wheel_loss: Floats
    wheel_loss_error: Floats
    light_ratio: float
    light_ratio_error: float
    distance_misfit: float
    light_misfit: float


def find(readings: Floats, memory: SelfMemory) -> Findings:
    """Compare the sensor readings of a calibration manoeuvre, (steps, inputs), with those in training."""
    lights = memory.lights
    dead = dead_sensors(readings[:, lights:])
    working = np.setdiff1d(np.arange(readings.shape[1] - lights), dead)
    causes, error, distance_misfit = _causes(readings, memory, lights + working)
    seeing = np.setdiff1d(np.arange(lights), dead)
    known = causes if distance_misfit <= MISFIT else np.zeros_like(causes)
    shift = np.tensordot(known, memory.effects[:, :, seeing], axes=1)
    nominal = 1.0 - (memory.mean[:, :, seeing] + shift)
    ratio, ratio_error, light_misfit = light_ratio(1.0 - readings[:, seeing], nominal, memory.spread[:, seeing])
    return Findings(
        lamp=lamp_is_lit(1.0 - readings[:, seeing], nominal, ratio),
        dead_sensors=tuple(dead.tolist()),
        wheel_loss=causes[:2],
        wheel_loss_error=error[:2],
        light_ratio=ratio,
        light_ratio_error=ratio_error,
        distance_misfit=distance_misfit,
        light_misfit=light_misfit,
    )


def dead_sensors(distances: Floats) -> NDArray[np.int64]:
    """The numbers of distance sensors that always read exactly 0, at most half of them; distances: (steps, sensors)."""
    silent = np.flatnonzero((distances == 0.0).all(axis=0))
    return silent if 2 * len(silent) <= distances.shape[1] else silent[:0]


def least_squares(design: Floats, target: Floats) -> tuple[Floats, Floats, float]:
    """Coefficients that fit the columns of `design` to `target`, their standard errors, and the misfit m.

    c = (X'X)^-1 X'y, error = sqrt(diag (X'X)^-1 max(1, m^2)), m = root mean square of y - X c

    The target is in units of its spread, so m is about 1 or less if the columns explain it. Without a target,
    coefficients are 0 and errors infinite.
    """
    squares = design.T @ design
    if len(target) == 0 or np.linalg.matrix_rank(squares) < len(squares):
        return np.zeros(len(squares)), np.full(len(squares), math.inf), math.nan
    inverse = np.linalg.inv(squares)
    found = inverse @ design.T @ target
    left = float(np.sqrt(np.mean((target - design @ found) ** 2)))
    return found, np.sqrt(np.diag(inverse)) * max(1.0, left), left


def _causes(readings: Floats, memory: SelfMemory, used: NDArray[np.int64]) -> tuple[Floats, Floats, float]:
    """How much of each cause of `memory.effects` is in the readings of these numbers; see `least_squares`."""
    spread = memory.spread[1:, used] + _LEAST_SPREAD  # nothing has moved before the first step
    design = np.stack([(effect[1:, used] / spread).ravel() for effect in memory.effects], axis=1)
    return least_squares(design, ((readings[1:, used] - memory.mean[0][1:, used]) / spread).ravel())


def light_ratio(bright: Floats, nominal: Floats, spread: Floats) -> tuple[float, float, float]:
    """Present light over training's, its standard error, and the misfit; 1, infinite and nan without usable sensors.

    rho = sum(u u0) / sum(u0^2), error = max(0.01, std(u - rho u0)) / sqrt(sum(u0^2))

    bright: (steps, lights) u = 1 - reading. nominal: (2, steps, lights) u0 in training, without and with the lamp.
    spread: of sensor readings in training.
    """
    usable = (np.abs(nominal[0] - nominal[1]) < _LAMP_SHOWS) & (nominal[0] > _DARKEST) & (nominal[0] < _BRIGHTEST)
    usable &= bright < _BRIGHTEST
    u, u0 = bright[usable], nominal[0][usable]
    total = float(u0 @ u0)
    if total == 0.0:
        return 1.0, math.inf, math.nan
    ratio = float(u0 @ u) / total
    left = u - ratio * u0
    scatter = spread[usable] * math.sqrt(1.0 + ratio**2 / REPEATS)  # of u, and of rho times a mean of REPEATS
    misfit = float(np.sqrt(np.mean((left / (scatter + _LEAST_SPREAD)) ** 2)))
    return ratio, max(light.NOISE, float(left.std())) / math.sqrt(total), misfit


def lamp_is_lit(bright: Floats, nominal: Floats, ratio: float) -> bool:
    """Whether the lamp is lit: which of the two fits better where it makes a difference.

    u = clip(rho u0, 0, 1) without, clip(rho u0 + lamp, 0, 1) with it; lamp: what it adds in training
    """
    shows = np.abs(nominal[0] - nominal[1]) >= _LAMP_SHOWS
    added = np.array([np.zeros_like(nominal[0]), nominal[1] - nominal[0]])
    off, on = (((bright - np.clip(ratio * nominal[0] + lamp, 0.0, 1.0))[shows] ** 2).sum() for lamp in added)
    return bool(on < off)
