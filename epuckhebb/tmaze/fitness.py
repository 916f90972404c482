"""How well the robot does: the paper's behaviour fitness at each step, its goal reward, and the live fitness F.

    forward   = (left + right) / 1.5           driving ahead         left, right: network outputs in (-1, 1)
    avoid     = 1 - max(proximity)^3           keeping off walls
    spin      = 1 - |right - left| / 2         not turning on the spot
    junction  = 1 once in the correct arm, else 0
    combined  = (forward + 2 avoid + spin + junction) / 5
    reward    = 1 - min(1, (1.7 distance)^3)   nearness to the goal [m]
    final     = (combined + reward) / 2

`forward` and `spin` are clipped to [0, 1], as in the published code; the paper does not mention it.
"""

import math
from enum import StrEnum
from typing import Any, NamedTuple

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import compiled
from epuckhebb.controller.plasticity.rule import Rule
from epuckhebb.tmaze.robot import STEP_S


class Signal(StrEnum):
    """Which live fitness F scales plasticity, by its name in the configuration. A kernel has its number, from 0."""

    behaviour = "behaviour"
    final = "final"
    lifetime_mean = "lifetime_mean"
    light_code = "light_code"
    fitness = "fitness"


class History(NamedTuple):
    """What `lifetime_mean` starts from: so many steps, over which combined fitness without junction had this sum.

    The published program never resets its running mean. The obstacle tables are reproduced with a history of two
    lifetimes of 250 s at F = 0.50, and not without it.
    """

    steps: float
    sum: float


_OF_HISTORY = ("history_s", "history_mean", "carries_history")

_, _FINAL, _LIFETIME_MEAN, _LIGHT_CODE, OWN = range(len(Signal))


def signal_number(rule: Rule) -> int:
    """The number of the live fitness that scales a rule; a ValueError where its settings do not fit it."""
    if rule.signal not in list(Signal):
        raise ValueError(f"hebbian.signal must be one of {', '.join(Signal)}, got {rule.signal!r}")
    changed = next((name for name in _OF_HISTORY if getattr(rule, name) != getattr(Rule, name)), None)
    if changed and rule.signal != Signal.lifetime_mean:
        raise ValueError(f"hebbian.{changed} does nothing with hebbian.signal={rule.signal}; give signal=lifetime_mean")
    return list(Signal).index(Signal(rule.signal))


def initial_history(rule: Rule) -> History:
    """What the live fitness of a rule starts from, unless it is carried."""
    steps = float(rule.history_s) / STEP_S
    return History(steps, steps * float(rule.history_mean))


@compiled
def forward(left: float, right: float) -> float:
    """Driving ahead, 0 to 1."""
    return min(1.0, max(0.0, (left + right) / 1.5))


@compiled
def avoid(nearest: float) -> float:
    """Keeping off walls, 0 to 1, from the largest proximity reading."""
    return 1.0 - nearest * nearest * nearest


@compiled
def spin(left: float, right: float) -> float:
    """Not turning on the spot, 0 to 1."""
    return max(0.0, 1.0 - abs(right - left) / 2.0)


@compiled
def combined(left: float, right: float, nearest: float, junction: float) -> float:
    """The paper's behaviour fitness of one step, collision avoidance counted twice."""
    return (forward(left, right) + 2.0 * avoid(nearest) + spin(left, right) + junction) / 5.0


@compiled
def reward(distance: float) -> float:
    """The paper's goal reward from the distance to the goal [m]: 1 at the goal, 0 from 0.59 m on."""
    scaled = 1.7 * distance
    return 1.0 - min(1.0, scaled * scaled * scaled)


@compiled
def light_code(readings: Floats, left: float, right: float) -> float:
    """F as the published program of the light experiment computes it, unlike the paper.

    It has a "follow the light" term and no junction, and `avoid` takes inputs 3 to 10 (five light and three proximity
    sensors), so that any dark sensor makes it nearly 0.
    """
    right_half = (readings[0] + readings[1] + readings[2] + readings[3]) / 4.0
    left_half = (readings[4] + readings[5] + readings[6] + readings[7]) / 4.0
    follow: float = 1.0 - abs(right_half - left_half)
    most = float(readings[3])
    for i in range(4, 11):
        most = max(most, readings[i])
    return (forward(left, right) + 2.0 * avoid(most) + spin(left, right) + follow) / 6.0


@compiled
def live_fitness(
    setup: Any, tally: Any, readings: Floats, left: float, right: float, behaviour: float, step: int
) -> float:
    """The live fitness F that scales plasticity at this step.

    behaviour: this step's combined fitness (the paper as written). final: its mean with the goal reward at this
    distance [m]. lifetime_mean: running mean of combined fitness without the junction term, over the steps of this
    trial, after a history. light_code: that of the published program. fitness: the value of the step by the user's own
    fitness, which the lifetime puts in place of the result.
    """
    signal, history = setup.signal, setup.history
    if signal == _FINAL:
        return (behaviour + reward(tally.goal_distance)) / 2.0
    if signal == _LIFETIME_MEAN:
        return float((history.sum + tally.undirected_sum) / (history.steps + (step + 1.0 - tally.began)))
    if signal == _LIGHT_CODE:
        return light_code(readings, left, right)
    return behaviour


@compiled
def goal_distance(x: float, y: float, goal_x: float, goal_y: float) -> float:
    """Distance [m] from (x, y) to the goal."""
    return math.sqrt((x - goal_x) * (x - goal_x) + (y - goal_y) * (y - goal_y))
