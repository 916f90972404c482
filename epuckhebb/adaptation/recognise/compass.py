"""The compass: a robot's heading since the start, by its wheels and the sun, and whether the lamp is lit.

    odometry    heading += r (right - left) / axle, one step after the command
    sun         u_i = min(1, a max(0, cos(bearing - heading - azimuth_i))), u = 1 - light reading
    correction  the shift of the heading and the level a that fit all light sensors best, every 8 steps
    lamp        light that this sun leaves unexplained, several fits in a row; then lit for the whole lifetime

A shift costs its square over .5 rad, a level its distance from the present or the training level (in logarithms), and a
sensor its squared residual over .03, at most 9. Constants were chosen in the worlds that exist, on champions 1 to 20.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from epuckhebb.adaptation.change_signal import NominalOfSide
from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import compiled
from epuckhebb.tmaze.robot import STEP_S, Robot

EVERY = 8  # steps from one fit to the next
LIT = 8.0  # fits' worth of unexplained light from which on the lamp counts as lit
UNEXPLAINED = 0.3
_SHIFTS = np.radians(np.arange(-40.0, 41.0, 5.0))
_LEVELS = np.array([0.04, 0.07, 0.12, 0.17, 0.25, 0.4, 0.7, 1.1, 1.7, 2.2])
_LOG_LEVELS = np.log(_LEVELS)
_SIGMA, _MOST = 0.03, 9.0
_ALIKE, _NEAR = 0.5, math.radians(11.0)  # levels farther off than this (in logarithms) go with small shifts alone
_GAIN, _LEVEL_GAIN, _NEW_LEVEL_GAIN, _COUNT = 0.45, 0.18, 0.02, 2.0  # of a fit, every eight steps
_DARK_STEPS = 40.0  # steps without light and without an echo, after which a sensor counts as dead
_LOOK_STEPS = 8  # at the start, in which the robot looks where the sun stands
_SURELY, _CLEARLY = 4.0, 8.0  # cost of a good fit, and by how much it must beat the training bearing
_NO_SUN = 0.02


def compass(robot: Robot) -> tuple[Callable[..., None], Callable[..., None]]:
    """The functions `turn(now)` and `look(now, dark, bright, readings, nominal, step)` of a robot.

    now: a record of `place.NOW`. turn: odometry. look: the sun. dark: (lights,) for how many steps each place has
    sensed nothing. bright: (lights,) mean brightness at the start.
    """
    count, per_rad = robot.light.count, robot.wheel_radius_m / robot.axle_m
    azimuth = np.radians([place.azimuth for place in robot.light.places])
    along, across = np.cos(azimuth), np.sin(azimuth)
    first_echo = robot.inputs_of(robot.distance).start

    @compiled
    def turn(now: Any) -> None:
        now.heading += now.turning
        now.turning = per_rad * (now.right - now.left) * STEP_S

    @compiled
    def misfit(readings: Floats, dark: Floats, to: float, level: float, most: float) -> float:
        cos, sin, cost = math.cos(to), math.sin(to), 0.0
        for i in range(count):
            if dark[i] < _DARK_STEPS:
                sun = min(1.0, level * max(0.0, cos * along[i] + sin * across[i]))
                off = (1.0 - readings[i] - sun) / _SIGMA
                cost += min(_MOST, off * off)
                if cost > most:
                    break
        return cost

    @compiled
    def find_sun(now: Any, dark: Floats, bright: Floats, nominal: NominalOfSide) -> None:
        """Where the sun stands at the start, if that is clear and not where it stands in training."""
        least, in_training, bearing, most = 1e9, 1e9, nominal.sun_bearing, 0.0
        for i in range(count):
            most = max(most, bright[i])
            bright[i] = 1.0 - bright[i]
        for k in range(72):
            to = nominal.sun_bearing + k * math.radians(5.0)
            for m in range(_LEVELS.shape[0]):
                if abs(_LOG_LEVELS[m] - math.log(nominal.sun_level)) <= _ALIKE:
                    cost = misfit(bright, dark, to - now.heading / 2.0, _LEVELS[m], 1e9)
                    if cost < least:
                        least, bearing = cost, to
                    if k == 0:
                        in_training = min(in_training, cost)
        if most < _NO_SUN:
            now.bearing = math.nan
        elif least < _SURELY and in_training > least + _CLEARLY:
            now.bearing = bearing

    @compiled
    def fit_sun(now: Any, dark: Floats, readings: Floats, nominal: NominalOfSide) -> None:
        present, usual = math.log(now.level), math.log(nominal.sun_level)
        least, shift, log_level = 1e9, 0.0, present
        for k in range(_SHIFTS.shape[0]):
            to = now.bearing - now.heading - _SHIFTS[k]
            for m in range(_LEVELS.shape[0]):
                change = min(abs(_LOG_LEVELS[m] - present), abs(_LOG_LEVELS[m] - usual))
                prior = (_SHIFTS[k] / 0.5) ** 2 + change * change
                if prior < least and not (change > _ALIKE and abs(_SHIFTS[k]) > _NEAR):
                    cost = prior + misfit(readings, dark, to, _LEVELS[m], least - prior)
                    if cost < least:
                        least, shift, log_level = cost, _SHIFTS[k], _LOG_LEVELS[m]
        to, level, most = now.bearing - now.heading - shift, math.exp(log_level), 0.0
        for i in range(count):
            most = max(most, 1.0 - readings[i] - min(1.0, level * max(0.0, math.cos(to - azimuth[i]))))
        lit = most > UNEXPLAINED
        if min(abs(log_level - present), abs(log_level - usual)) < _ALIKE:
            now.heading += (0.5 if lit else 1.0) * _GAIN * shift
            if not lit and abs(log_level - present) < _ALIKE:
                now.level *= math.exp(_LEVEL_GAIN * (log_level - present))
        elif not lit and abs(shift) < _NEAR / 2.0:  # a lamp can pass for a brighter sun, but not for long
            now.level *= math.exp(_NEW_LEVEL_GAIN * (log_level - present))
        if now.lamp < LIT:
            now.lamp = now.lamp + _COUNT if lit else max(0.0, now.lamp - _COUNT)

    @compiled
    def look(now: Any, dark: Floats, bright: Floats, readings: Floats, nominal: NominalOfSide, step: int) -> None:
        for i in range(count):
            unseen = readings[i] == 1.0 and readings[first_echo + i] == 0.0
            dark[i] = dark[i] + 1.0 if unseen else 0.0
            if step < _LOOK_STEPS:
                bright[i] += (1.0 - readings[i]) / _LOOK_STEPS
        if step == 0:
            now.bearing, now.level = nominal.sun_bearing, nominal.sun_level
        if step == _LOOK_STEPS:
            find_sun(now, dark, bright, nominal)
        if step % EVERY == 0 and not math.isnan(now.bearing):
            fit_sun(now, dark, readings, nominal)

    return turn, look
