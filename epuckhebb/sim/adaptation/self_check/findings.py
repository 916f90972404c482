"""What the self-check finds: dead sensors, weak wheels, and how bright the light is, each with its standard error.

    dead    an infra-red sensor that read exactly 0 all the time; a healthy one always feels a little. If more than half
            did, they are not dead: something else is wrong with all of them
    loss    of the wheels: least squares of (IR - M) / (s + 0.003) on [J_left, J_right, J_x, J_y, J_heading]
    rho     today's light over home's: sum(u u0) / sum(u0^2), u = 1 - reading, where the lamp makes no difference
    lamp    lit or not, whichever fits the light readings better where it does make one

M, s, J: what the dance felt like at home, its spread, and how it changes with each cause (`memory`). What no cause
explains is in the misfits: the root mean square of what is left, in spreads, about 1 where all is explained.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim import light
from epuckhebb.sim.adaptation.self_check.memory import REPEATS, SelfMemory

MISFIT = 2.0  # more is left than known causes explain: spreads
_LEAST_SPREAD = 0.003  # of a reading
_LAMP_SHOWS = 0.01  # a reading differs by so much or more with the lamp
_DARKEST, _BRIGHTEST = 0.02, 0.97  # of u: below there is nothing to compare, above a sensor is saturated


@dataclass(frozen=True, kw_only=True)
class Findings:
    """What a robot found of itself and of the light.

    lamp: whether it is lit, inferred. dead_sensors: numbers of their places. wheel_loss, wheel_loss_error: (2,) left
    and right, share of their speed that is lost. light_ratio, light_ratio_error: today's light over home's.
    distance_misfit, light_misfit: what is left unexplained, in spreads.
    """

    lamp: bool
    dead_sensors: tuple[int, ...]
    wheel_loss: NDArray[np.float64]
    wheel_loss_error: NDArray[np.float64]
    light_ratio: float
    light_ratio_error: float
    distance_misfit: float
    light_misfit: float


def find(readings: NDArray[np.float64], memory: SelfMemory) -> Findings:
    """What the readings of a dance, (steps, inputs), tell beside those that are remembered."""
    lights = memory.lights
    dead = dead_sensors(readings[:, lights:])
    working = np.setdiff1d(np.arange(readings.shape[1] - lights), dead)
    causes, error, distance_misfit = _causes(readings, memory, lights + working)
    seeing = np.setdiff1d(np.arange(lights), dead)
    known = causes if distance_misfit <= MISFIT else np.zeros_like(causes)
    shift = np.tensordot(known, memory.effects[:, :, seeing], axes=1)
    home = 1.0 - (memory.mean[:, :, seeing] + shift)
    ratio, ratio_error, light_misfit = light_ratio(1.0 - readings[:, seeing], home, memory.spread[:, seeing])
    return Findings(
        lamp=lamp_is_lit(1.0 - readings[:, seeing], home, ratio),
        dead_sensors=tuple(dead.tolist()),
        wheel_loss=causes[:2],
        wheel_loss_error=error[:2],
        light_ratio=ratio,
        light_ratio_error=ratio_error,
        distance_misfit=distance_misfit,
        light_misfit=light_misfit,
    )


def dead_sensors(distances: NDArray[np.float64]) -> NDArray[np.int64]:
    """The numbers of those distance sensors, of (steps, sensors), that read exactly 0 all the time; half at most."""
    silent = np.flatnonzero((distances == 0.0).all(axis=0))
    return silent if 2 * len(silent) <= distances.shape[1] else silent[:0]


def least_squares(
    design: NDArray[np.float64], target: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Coefficients of the columns of `design` that make `target`, their standard errors, and what is left.

    c = (X'X)^-1 X'y, error = sqrt(diag (X'X)^-1 max(1, m^2)), m = root mean square of y - X c

    The target is in its own spreads, so that m is about 1 or less where the columns explain it; where they do not, the
    errors grow with it. Without a target nothing is known: coefficients 0, errors infinite.
    """
    squares = design.T @ design
    if len(target) == 0 or np.linalg.matrix_rank(squares) < len(squares):
        return np.zeros(len(squares)), np.full(len(squares), math.inf), math.nan
    inverse = np.linalg.inv(squares)
    found = inverse @ design.T @ target
    left = float(np.sqrt(np.mean((target - design @ found) ** 2)))
    return found, np.sqrt(np.diag(inverse)) * max(1.0, left), left


def _causes(
    readings: NDArray[np.float64], memory: SelfMemory, used: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """How much of each cause of `memory.effects` is in the readings of these numbers; see `least_squares`."""
    spread = memory.spread[1:, used] + _LEAST_SPREAD  # nothing has moved before the first step
    design = np.stack([(effect[1:, used] / spread).ravel() for effect in memory.effects], axis=1)
    return least_squares(design, ((readings[1:, used] - memory.mean[0][1:, used]) / spread).ravel())


def light_ratio(
    bright: NDArray[np.float64], home: NDArray[np.float64], spread: NDArray[np.float64]
) -> tuple[float, float, float]:
    """Today's light over home's, its standard error, and the misfit; 1, infinite and nan where nothing can be compared.

    rho = sum(u u0) / sum(u0^2), error = max(0.01, std(u - rho u0)) / sqrt(sum(u0^2))

    bright: (steps, lights) u = 1 - reading. home: (2, steps, lights) u0 at home, without and with the lamp. spread: of
    readings at home.
    """
    usable = (np.abs(home[0] - home[1]) < _LAMP_SHOWS) & (home[0] > _DARKEST) & (home[0] < _BRIGHTEST)
    usable &= bright < _BRIGHTEST
    u, u0 = bright[usable], home[0][usable]
    total = float(u0 @ u0)
    if total == 0.0:
        return 1.0, math.inf, math.nan
    ratio = float(u0 @ u) / total
    left = u - ratio * u0
    scatter = spread[usable] * math.sqrt(1.0 + ratio**2 / REPEATS)  # of u, and of rho times a mean of so many dances
    misfit = float(np.sqrt(np.mean((left / (scatter + _LEAST_SPREAD)) ** 2)))
    return ratio, max(light.NOISE, float(left.std())) / math.sqrt(total), misfit


def lamp_is_lit(bright: NDArray[np.float64], home: NDArray[np.float64], ratio: float) -> bool:
    """Whether the lamp is lit: which of the two fits better where it makes a difference.

    u = clip(rho u0, 0, 1) without, clip(rho u0 + lamp, 0, 1) with it; lamp: what it adds at home
    """
    shows = np.abs(home[0] - home[1]) >= _LAMP_SHOWS
    added = np.array([np.zeros_like(home[0]), home[1] - home[0]])
    off, on = (((bright - np.clip(ratio * home[0] + lamp, 0.0, 1.0))[shows] ** 2).sum() for lamp in added)
    return bool(on < off)
