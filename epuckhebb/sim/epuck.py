"""The e-puck: a disc on two wheels with eight places on its rim that feel both infra-red echoes and ambient light.

Robot frame: x forward, y left, in metres; angles in radians, anticlockwise. Numbers are those of Webots' e-puck
(version 1), which were calibrated on a real one.
"""

import math

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim import light
from epuckhebb.sim.compiled import compiled

STEP_S = 0.032  # one control step: sensing, acting, learning and physics
RADIUS = 0.037  # m
MASS = 0.16  # kg
INERTIA = 8.75e-5  # kg m2, about the vertical axis
WHEEL_RADIUS = 0.020  # m
AXLE = 0.052  # m between the wheels
MOTOR_LIMIT = 6.28  # rad/s

SENSORS = 8
PLACE_X = np.array([0.030, 0.022, 0.000, -0.030, -0.030, 0.000, 0.022, 0.030])
PLACE_Y = np.array([-0.010, -0.025, -0.031, -0.015, 0.015, 0.031, 0.025, 0.010])
AZIMUTH = np.radians([-17.2, -45.9, -90.0, -151.5, 151.2, 90.0, 45.8, 17.1])
_LOOK_X, _LOOK_Y = np.cos(AZIMUTH), np.sin(AZIMUTH)

# Infra-red echo: distance [m], value, noise (standard deviation as a fraction of the value). Linear between the rows.
INFRARED = np.array(
    [
        (0.000, 4095.00, 0.00200),
        (0.005, 2133.33, 0.00300),
        (0.010, 1465.73, 0.00700),
        (0.015, 601.46, 0.04060),
        (0.020, 383.84, 0.01472),
        (0.030, 234.93, 0.02410),
        (0.040, 158.03, 0.02870),
        (0.050, 120.00, 0.04225),
        (0.060, 104.09, 0.03065),
        (0.070, 67.19, 0.04897),
    ]
)
INFRARED_FULL_SCALE = 2000.0  # the value that reads 1 (clipped there), as in the published controller
# The walls are pure red and rough, which makes them look 1.25 times as far; the beams rise by 9.17 degrees.
APPARENT_DISTANCE = 1.25 * 1.013
REACH = 0.07 / 1.25  # m: real distance to a wall beyond which a beam feels nothing


@compiled
def sensor_rays(x: float, y: float, cos: float, sin: float, rays: NDArray[np.float64]) -> None:
    """Place the eight sensors in the maze.

    Fills `rays` (6, 8): x, y [m], the unit vector each looks along, and 1 / its x and 1 / its y.
    """
    for i in range(SENSORS):
        rays[0, i] = x + (cos * PLACE_X[i] - sin * PLACE_Y[i])
        rays[1, i] = y + (sin * PLACE_X[i] + cos * PLACE_Y[i])
        rays[2, i] = cos * _LOOK_X[i] - sin * _LOOK_Y[i]
        rays[3, i] = sin * _LOOK_X[i] + cos * _LOOK_Y[i]
        rays[4, i], rays[5, i] = 1.0 / rays[2, i], 1.0 / rays[3, i]


@compiled
def cast(
    x: float, y: float, rays: NDArray[np.float64], boxes: NDArray[np.float64], distance: NDArray[np.float64]
) -> None:
    """How far each of the eight rays runs before it meets a wall: `distance` (8,) [m], infinite where it meets none.

    Boxes out of reach of a robot at (x, y) are left out. A ray that starts inside a box has distance 0.
    """
    for i in range(SENSORS):
        distance[i] = math.inf
    reach = RADIUS + REACH
    for box in range(boxes.shape[0]):
        left, right, bottom, top = boxes[box, 0], boxes[box, 1], boxes[box, 2], boxes[box, 3]
        if x < left - reach or x > right + reach or y < bottom - reach or y > top + reach:
            continue
        for i in range(SENSORS):
            # The ray is between left and right for one span of its length, between bottom and top for another.
            per_x, per_y = rays[4, i], rays[5, i]
            to_left, to_right = (left - rays[0, i]) * per_x, (right - rays[0, i]) * per_x
            to_bottom, to_top = (bottom - rays[1, i]) * per_y, (top - rays[1, i]) * per_y
            enter = max(min(to_left, to_right), min(to_bottom, to_top))
            leave = min(max(to_left, to_right), max(to_bottom, to_top))
            if leave >= max(0.0, enter):
                distance[i] = min(distance[i], max(0.0, enter))


@compiled
def echo(distance: float) -> tuple[float, float]:
    """Infra-red value and its noise fraction for a wall at a real distance [m] along the beam."""
    apparent = distance * APPARENT_DISTANCE
    last = INFRARED.shape[0] - 1
    if not (distance <= REACH and apparent < INFRARED[last, 0]):
        return INFRARED[last, 1], INFRARED[last, 2]
    k = 0
    for row in range(1, last):
        k += apparent >= INFRARED[row, 0]
    part = (apparent - INFRARED[k, 0]) / (INFRARED[k + 1, 0] - INFRARED[k, 0])
    value = INFRARED[k, 1] + part * (INFRARED[k + 1, 1] - INFRARED[k, 1])
    noise = INFRARED[k, 2] + part * (INFRARED[k + 1, 2] - INFRARED[k, 2])
    return value, noise


@compiled
def sense(
    rays: NDArray[np.float64],
    distance: NDArray[np.float64],
    lit: light.Lights,
    noise: NDArray[np.float64],
    noise_level: float,
    readings: NDArray[np.float64],
) -> None:
    """Write the network's 16 inputs: eight light readings (1 = dark), then eight proximity readings (1 = touching).

    noise: (16,) standard normal numbers. noise_level: 1 for the sensors' own noise, 0 for none.
    """
    for i in range(SENSORS):
        dark = light.reading(light.irradiance(rays[0, i], rays[1, i], rays[2, i], rays[3, i], lit))
        readings[i] = min(1.0, max(0.0, dark * (1.0 + noise_level * light.NOISE * noise[i])))
    for i in range(SENSORS):
        value, fraction = echo(distance[i])
        noisy = value * (1.0 + noise_level * fraction * noise[SENSORS + i])
        readings[SENSORS + i] = min(1.0, max(0.0, noisy / INFRARED_FULL_SCALE))
