"""What the wheels do while the gate of exploration is open: motor noise, new every two seconds, or wall-following."""

from collections.abc import Callable
from typing import Any

from epuckhebb.controller.compiling.kernel import compiled
from epuckhebb.controller.random import normal_numbers
from epuckhebb.tmaze.robot import STEP_S

FAR = 2**40  # motor noise is drawn for steps that sensor noise never reaches
HOLD = round(2.0 / STEP_S)  # steps for which motor noise stays the same

draw: Callable[..., None] = normal_numbers(16)  # two are used; the e-puck's sensors draw as many, so bits stay the same
Explore = Callable[..., tuple[float, float]]  # `explore` of `adaptation.Hooks`


@compiled
def limit_output(output: float, noise: float, gain: float, motor_limit: float) -> float:
    """A wheel's output with noise, limited to what the motor can do at this gain [rad/s]."""
    fastest = motor_limit / gain
    return min(fastest, max(-fastest, output + noise))


def motor_noise_exploration(motor_limit: float) -> Explore:
    """Exploration by noise on both wheels."""

    @compiled
    def explore(life: Any, setup: Any, left: float, right: float) -> tuple[float, float]:
        tally = life.tally[0]
        if setup.adaptation.motor_noise > 0.0 and tally.exploring:
            left = limit_output(left, tally.noise_left, setup.gain, motor_limit)
            right = limit_output(right, tally.noise_right, setup.gain, motor_limit)
        return left, right

    return explore


def wall_exploration(follow: Callable[..., tuple[float, float]], motor_limit: float) -> Explore:
    """Exploration along walls. follow: the function that `wall_following` makes for a robot."""
    add_noise = motor_noise_exploration(motor_limit)

    @compiled
    def explore(life: Any, setup: Any, left: float, right: float) -> tuple[float, float]:
        if life.tally[0].exploring:
            left, right = follow(life.activation, life.adaptation.hand)
            return add_noise(life, setup, left / setup.gain, right / setup.gain)
        life.adaptation.hand[0] = 0.0
        return left, right

    return explore


def halting_exploration(explore: Explore) -> Explore:
    """An exploration that ends with a halt at the goal."""

    @compiled
    def explore_and_halt(life: Any, setup: Any, left: float, right: float) -> tuple[float, float]:
        left, right = explore(life, setup, left, right)
        return (0.0, 0.0) if life.tally[0].halted else (left, right)

    return explore_and_halt
