"""Light in the maze: a sun that shines from ahead and right, and the lamp that shows which way to turn.

A sensor reads *low when bright*. Irradiance E adds ambient light (1, whatever the light level), the sun (2.7 times the
light level, times the cosine of its angle to the sensor) and, on right trials, the lamp. Walls cast no shadow.
Source: Webots' light sensor, its textured background light and its e-puck model, which the paper used.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

from epuckhebb.controller.compiling.kernel import compiled
from epuckhebb.controller.ranges import check, within

SUN_X, SUN_Y = 0.465, 0.427  # horizontal part of the unit vector towards the sun; the sensors look level
SUN_IRRADIANCE = 2.7  # at light level 1
BRIGHTEST = 1e6  # light level and intensity, far beyond any sun and lamp
NOISE = 0.01  # standard deviation of a reading, as a fraction of it


@dataclass(kw_only=True)
class Lamp:
    """A spot light in the plane of the sensors. The paper's shines to the left (-X) from the stem's right wall.

    x_m, y_m: place. towards_x, towards_y: direction, of any length. beam_rad: half-angle of its beam. intensity:
    irradiance at 1 m.
    """

    x_m: float = within(-math.inf, default=0.1)
    y_m: float = within(-math.inf, default=-0.2)
    towards_x: float = within(-math.inf, default=-1.0)
    towards_y: float = within(-math.inf, default=0.0)
    beam_rad: float = within(0, math.pi, above=True, default=1.5)
    intensity: float = within(0, BRIGHTEST, usual=20, default=2.0)

    def __post_init__(self) -> None:
        check(self, "scenario.lamp")
        if math.hypot(self.towards_x, self.towards_y) == 0:
            raise ValueError("scenario.lamp.towards_x and towards_y must not both be 0: the lamp needs a direction")


class Lights(NamedTuple):
    """The lights of one lifetime as numbers for the kernel; `lamp_intensity` is 0 when the lamp is off.

    sun_x, sun_y: horizontal part of the unit vector towards the sun. second_*: a lamp that shines all around.
    """

    sun: float
    lamp_intensity: float
    lamp_x: float
    lamp_y: float
    lamp_towards_x: float
    lamp_towards_y: float
    cos_beam: float
    sun_x: float = SUN_X
    sun_y: float = SUN_Y
    second_x: float = 0.0
    second_y: float = 0.0
    second_intensity: float = 0.0


def lights(
    light: float, lamp: Lamp, lamp_on: bool, sun_turn_deg: float = 0.0, second: Sequence[float] | None = None
) -> Lights:
    """Sun at this light level and the lamp, lit or not.

    sun_turn_deg: how far the sun is turned, anticlockwise. second: x, y [m] and intensity of a second lamp.
    """
    cos, sin = math.cos(math.radians(sun_turn_deg)), math.sin(math.radians(sun_turn_deg))
    second_x, second_y, second_intensity = (0.0, 0.0, 0.0) if second is None else map(float, second)
    length = math.hypot(lamp.towards_x, lamp.towards_y)
    return Lights(
        float(SUN_IRRADIANCE * light),
        float(lamp.intensity) if lamp_on else 0.0,
        float(lamp.x_m),
        float(lamp.y_m),
        lamp.towards_x / length,
        lamp.towards_y / length,
        math.cos(lamp.beam_rad),
        SUN_X * cos - SUN_Y * sin,
        SUN_X * sin + SUN_Y * cos,
        second_x,
        second_y,
        second_intensity,
    )


@compiled
def irradiance(x: float, y: float, look_x: float, look_y: float, lit: Lights) -> float:
    """Irradiance E on a sensor at (x, y) that looks along the unit vector (look_x, look_y)."""
    bright = 1.0 + lit.sun * max(0.0, look_x * lit.sun_x + look_y * lit.sun_y)
    if lit.second_intensity > 0.0:
        to_x, to_y = lit.second_x - x, lit.second_y - y
        distance = math.sqrt(to_x * to_x + to_y * to_y)
        bright += lit.second_intensity * max(0.0, look_x * to_x + look_y * to_y) / (distance * distance * distance)
    if lit.lamp_intensity == 0.0:
        return bright
    to_x, to_y = lit.lamp_x - x, lit.lamp_y - y
    distance = math.sqrt(to_x * to_x + to_y * to_y)
    if -(lit.lamp_towards_x * to_x + lit.lamp_towards_y * to_y) < lit.cos_beam * distance:  # outside the beam
        return bright
    facing = max(0.0, look_x * to_x + look_y * to_y)
    return bright + lit.lamp_intensity * facing / (distance * distance * distance)


@compiled
def reading(e: float) -> float:
    """Light reading in [0, 1]: 1 in the dark (E <= 1), 0 when bright (E >= 2), linear between."""
    return min(1.0, max(0.0, 2.0 - e))
