"""A fitness of your own: explore. Each of 25 squares of the floor counts once, contact costs, and the goal counts."""

from dataclasses import dataclass
from typing import ClassVar

from epuckhebb import Fitness


@dataclass(frozen=True, kw_only=True)
class Explorer(Fitness):
    """contact_cost: share of a step's value that contact with a wall costs. goal: value of an end at the goal."""

    state: ClassVar = {"seen": (0.0,) * 25}

    contact_cost: float = 0.5
    goal: float = 1.0

    @staticmethod
    def step(left, right, contact, x, y, state, by):
        """The value of a control step, and with hebbian.signal=fitness the live fitness F."""
        column, row = min(4, max(0, int(5 * (x + 0.5)))), min(4, max(0, int(5 * (y + 0.5))))
        state.seen[5 * column + row] = 1.0
        return max(0.0, (left + right) / 2) * (1.0 - by.contact_cost * contact)

    @staticmethod
    def life(mean, state, success, by):
        """The fitness of a lifetime, which evolution maximises."""
        return mean + state.seen.mean() + by.goal * success
