"""Limits of the share of rewarded trials in reversal learning: chance, and the optimum."""

from epuckhebb.sim.tasks.reversal import Reversal

CHANCE, OPTIMUM = "chance", "optimum"  # names of their rows and lines


def limits(task: Reversal) -> dict[str, float]:
    """The share of a robot that does not learn, and the best possible share, by name.

    Lifetimes come in pairs: one with each end rewarded first, and the switch at the same trial. A fixed sequence of
    choices is therefore right in one lifetime wherever it is wrong in the other.
    """
    return {CHANCE: 0.5, OPTIMUM: task.optimum()}
