"""What the wheels do while the gate of exploration is open: motor noise, new every two seconds, or wall-following."""

from collections.abc import Callable
from typing import Any

from epuckhebb.sim.arrays import Floats
from epuckhebb.sim.compiling.kernel import compiled
from epuckhebb.sim.random import normal_numbers
from epuckhebb.sim.robot import STEP_S

FAR = 2**40  # motor noise is drawn for steps that sensor noise never reaches
HOLD = round(2.0 / STEP_S)  # steps for which motor noise stays the same

draw: Callable[..., None] = normal_numbers(16)  # two are used; the e-puck's sensors draw as many, so bits stay the same
Explore = Callable[..., tuple[float, float]]  # `explore` of `adaptation.Hooks`


@compiled
def within_motor(output: float, noise: float, gain: float, motor_limit: float) -> float:
    """A wheel's output with noise, limited to what the motor can do at this gain [rad/s]."""
    fastest = motor_limit / gain
    return min(fastest, max(-fastest, output + noise))


def with_motor_noise(motor_limit: float) -> Explore:
    """Exploration by noise on both wheels."""

    @compiled
    def explore(
        gate: Any, tally: Any, state: Any, readings: Floats, left: float, right: float, gain: float
    ) -> tuple[float, float]:
        if gate.motor_noise > 0.0 and tally.exploring:
            left = within_motor(left, tally.noise_left, gain, motor_limit)
            right = within_motor(right, tally.noise_right, gain, motor_limit)
        return left, right

    return explore


def following(follow: Callable[..., tuple[float, float]], motor_limit: float) -> Explore:
    """Exploration along walls. follow: of `wall_following`."""
    add_noise = with_motor_noise(motor_limit)

    @compiled
    def explore(
        gate: Any, tally: Any, state: Any, readings: Floats, left: float, right: float, gain: float
    ) -> tuple[float, float]:
        if tally.exploring:
            left, right = follow(readings, state.hand)
            return add_noise(gate, tally, state, readings, left / gain, right / gain, gain)
        state.hand[0] = 0.0
        return left, right

    return explore


def staying(explore: Explore, halts: bool, recognises: bool) -> Explore:
    """An exploration that ends with a halt at the goal, and notes what it commands for odometry."""
    if not (halts or recognises):
        return explore

    @compiled
    def explore_and_stay(
        gate: Any, tally: Any, state: Any, readings: Floats, left: float, right: float, gain: float
    ) -> tuple[float, float]:
        left, right = explore(gate, tally, state, readings, left, right, gain)
        if halts and tally.halted:
            left, right = 0.0, 0.0
        if recognises:
            now = state.place.now[0]
            now.left, now.right = gain * left, gain * right
        return left, right

    return explore_and_stay
