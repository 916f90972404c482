"""Between what the share of rewarded trials lies in reversal learning: what luck gives, and what nobody beats."""

from epuckhebb.sim.tasks.reversal import Reversal

CHANCE, OPTIMUM = "chance", "optimum"  # what rows and lines are called that no robot lived


def limits(task: Reversal) -> dict[str, float]:
    """The share of a robot that goes any fixed sequence of ways, and the best that can be, by name.

    Lives come in pairs, one with each end rewarded first and the switch at the same trial, so what is right in one of
    the two is wrong in the other.
    """
    return {CHANCE: 0.5, OPTIMUM: task.optimum()}
