"""The goal signal: what a robot is given when it is within 5 cm of its goal, and what may be wrong with that.

The paper's supervisor knows where the robot is. A real one may be late, look only now and then, be wrong, or take too
large a place for the goal. Only adaptations use the goal signal; success is judged by the goal itself.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.compiling.kernel import compiled
from epuckhebb.controller.random import uniform
from epuckhebb.controller.ranges import check, within
from epuckhebb.tmaze.robot import STEP_S

LONGEST_DELAY_S = 10.0
SPELL = round(1.0 / STEP_S)  # steps for which a signal is false, or not
_SPELLS, _START = 2**52, 2**53  # numbers that neither sensor noise, nor exploration, nor slips reach


@dataclass(kw_only=True)
class GoalSignal:
    """How a robot is given the goal signal; the default is exact, in every step.

    delay_s: how late it is [s]. every_s: it is given in one step every so often [s], 0 for every step. false_share:
    share of seconds in which it is wrong: given away from the goal, and not given there. radius_ratio: over the radius
    of the goal, of the place that is taken for the goal. chance_s: above 0, a control: chance gives the signal, from a
    time on that is drawn evenly up to this [s], wherever the robot is.
    """

    delay_s: float = within(0, LONGEST_DELAY_S, default=0.0)
    every_s: float = within(0, default=0.0)
    false_share: float = within(0, 1, default=0.0)
    radius_ratio: float = within(0, above=True, default=1.0)
    chance_s: float = within(0, default=0.0)

    def __post_init__(self) -> None:
        check(self, "scenario.goal_signal")

    def numbers(self) -> "SignalNumbers":
        """The settings for the kernel."""
        delay, every, chance = (round(seconds / STEP_S) for seconds in (self.delay_s, self.every_s, self.chance_s))
        return SignalNumbers(delay, every, chance, float(self.false_share), float(self.radius_ratio))


class SignalNumbers(NamedTuple):
    """A `GoalSignal` for the kernel. delay, every, chance: steps."""

    delay: int
    every: int
    chance: int
    false_share: float
    radius_ratio: float


def initial_signal() -> NDArray[np.bool_]:
    """The goal signal of the last steps, of which a late one is made."""
    return np.zeros(round(LONGEST_DELAY_S / STEP_S) + 1, np.bool_)


@compiled
def goal_signal(
    signal: SignalNumbers, distance: float, radius: float, past: NDArray[np.bool_], key: np.uint64, step: int
) -> bool:
    """The goal signal of a step. distance, radius: from the goal and of it [m]. past: of `initial_signal`, updated."""
    if signal.chance > 0:
        return step >= uniform(key, _START) * signal.chance
    here = distance < radius * signal.radius_ratio
    past[step % past.shape[0]] = here
    if signal.delay > 0:
        here = step >= signal.delay and past[(step - signal.delay) % past.shape[0]]
    if signal.false_share > 0.0 and uniform(key, _SPELLS + step // SPELL) < signal.false_share:
        here = not here
    return here and (signal.every == 0 or step % signal.every == 0)
