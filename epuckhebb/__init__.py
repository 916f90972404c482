"""Evolved controllers that learn: an e-puck in a T-maze, a genetic algorithm, and Hebbian plasticity on top.

A controller (a network of 234 weights, its genome) is evolved to drive an e-puck through a T-maze: lamp on, go right;
lamp off, go left. While it lives, Hebbian plasticity may change its weights every 32 ms, the faster the better it does;
when it dies the changes are forgotten. This package evolves such controllers, lets them live in worlds with other light
or with obstacles, and says what plasticity did for them.

Axes: X to the robot's right and Y ahead of it at the start; headings anticlockwise from X. Units: m, s, rad, kg.
Read in this order: sim/maze, light, robot, network, plasticity/paper, fitness, physics, lifetime, block; then
evolution/training, optimizer, optimizers/ga, evolve; then study/evaluate, tables, figures, replay; study/findings for
what many champions tell. app/ is the program around it, conf/ its settings.

    import epuckhebb
    champion = epuckhebb.load("reference")                           # 234 genes
    rows = epuckhebb.evaluate(champion, "scenario=4obstacles")       # a pandas DataFrame, a row a lifetime
    champion, history = epuckhebb.evolve("seed=7")                   # the fittest, and how the generations went
"""

from typing import TYPE_CHECKING

__version__ = "0.1.0"
__all__ = ["Evolved", "Rule", "evaluate", "evolve", "load"]

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd
    from numpy.typing import NDArray

    from epuckhebb.sim.plasticity.rule import Evolved, Rule


def __getattr__(name: str) -> object:
    """`epuckhebb.Rule`, of which plasticity rules are made, and `Evolved`, what of them is; loaded when asked for."""
    if name not in ("Evolved", "Rule"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from epuckhebb.sim.plasticity import rule

    return getattr(rule, name)


def load(where: str = "reference", experiment: str = "obstacles") -> "NDArray[np.float64]":
    """A genome (234,): `reference`, the bundled champion of an experiment, or one from a run folder, .npz or .npy.

    Raises:
        ValueError: there is no genome there; the message says why.
    """
    from epuckhebb.app import files

    return files.load_genome(where, experiment).genes


def evaluate(genome: "NDArray[np.float64]", *overrides: str, hebbian: "Rule | None" = None) -> "pd.DataFrame":
    """Let a genome (234,) live with and without plasticity; overrides as on the command line.

    hebbian: a rule of your own as an object, in place of the one that the overrides name.

    Returns one row a lifetime, with the columns of `metrics.csv`. Writes nothing.

    Raises:
        ValueError: an override or the genome cannot be used; the message says why.
    """
    from epuckhebb.app import notebook

    return notebook.evaluate(genome, list(overrides), hebbian)


def evolve(*overrides: str) -> "tuple[NDArray[np.float64], pd.DataFrame]":
    """Evolve a controller; overrides as on the command line, for example "seed=7", "scenario=highlight".

    Returns the champion (234,) of the last generation, and the rows of `history.csv`. Writes nothing.

    Raises:
        ValueError: an override cannot be used; the message says why.
    """
    from epuckhebb.app import notebook

    return notebook.evolve(list(overrides))
