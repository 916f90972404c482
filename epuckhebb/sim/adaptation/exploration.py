"""Motor noise, an exploration: noise on both wheels while the gate is open, new every two seconds."""

from collections.abc import Callable

from epuckhebb.sim.compiled import compiled
from epuckhebb.sim.random import normal_numbers
from epuckhebb.sim.robot import STEP_S

FAR = 2**40  # motor noise is drawn for steps that sensor noise never reaches
HOLD = round(2.0 / STEP_S)  # steps for which motor noise stays the same

draw: Callable[..., None] = normal_numbers(16)  # two are used; the e-puck's sensors draw as many, so bits stay the same


@compiled
def within_motor(output: float, noise: float, gain: float, motor_limit: float) -> float:
    """A wheel's output with noise, limited to what the motor can do at this gain [rad/s]."""
    fastest = motor_limit / gain
    return min(fastest, max(-fastest, output + noise))
