"""Evolved controllers that learn: an e-puck in a T-maze, a genetic algorithm, and Hebbian plasticity on top.

A controller (a network of 234 weights, its genome) is evolved to drive an e-puck through a T-maze: lamp on, go right;
lamp off, go left. During a lifetime, Hebbian plasticity may change its weights every 32 ms, the faster the better the
robot does; each lifetime begins with the evolved weights. This package evolves such controllers, runs their lifetimes
in worlds with other light or with obstacles, and measures what plasticity did for them.

Axes: X to the robot's right and Y ahead of it at the start; headings anticlockwise from X. Units: m, s, rad, kg.
Read in this order: sim/maze, light, robot, network, plasticity/rules/paper, fitness, physics, life, lifetime, session,
block; then evolution/training, optimizer, optimizers/ga, evolve; then analysis/evaluate, tables, figures, replay;
analysis/findings for what many champions tell. The other packages are the program around it, conf/ its settings.

    import epuckhebb
    result = epuckhebb.evaluate("reference", scenario="4obstacles")  # .metrics, .table, .traces, .plot(), .replay()
    champion, history = epuckhebb.evolve(seed=7)                     # the fittest, and how the generations went
    epuckhebb.evaluate(champion, hebbian=epuckhebb.Hebbian(N=0.0002), repeats=5)
"""

from collections.abc import Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

__version__ = "0.2.0"
__all__ = [
    "GA",
    "Adaptation",
    "Evaluation",
    "Evolution",
    "Evolved",
    "Fitness",
    "Hebbian",
    "Lifetime",
    "Live",
    "Rule",
    "Sensor",
    "evaluate",
    "evolve",
    "load",
    "play",
    "sweep",
]

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd
    from numpy.typing import NDArray

    from epuckhebb.api import Evaluation, Evolution, Live
    from epuckhebb.evolution.optimizers.ga import GA
    from epuckhebb.sim.adaptation.adaptation import Adaptation
    from epuckhebb.sim.life import Lifetime
    from epuckhebb.sim.own_fitness import Fitness
    from epuckhebb.sim.own_sensor import Sensor
    from epuckhebb.sim.plasticity.rule import Evolved, Rule
    from epuckhebb.sim.plasticity.rules.paper import Paper as Hebbian

_FROM = {  # name -> where it is, and what it is called there; loaded when asked for
    "GA": ("evolution.optimizers.ga", "GA"),
    "Adaptation": ("sim.adaptation.adaptation", "Adaptation"),
    "Evaluation": ("api", "Evaluation"),
    "Evolution": ("api", "Evolution"),
    "Evolved": ("sim.plasticity.rule", "Evolved"),
    "Fitness": ("sim.own_fitness", "Fitness"),
    "Hebbian": ("sim.plasticity.rules.paper", "Paper"),
    "Lifetime": ("sim.life", "Lifetime"),
    "Live": ("api", "Live"),
    "Rule": ("sim.plasticity.rule", "Rule"),
    "Sensor": ("sim.own_sensor", "Sensor"),
}


def __getattr__(name: str) -> object:
    """The classes that users make objects of; loaded when asked for, so that `import epuckhebb` takes no time."""
    if name not in _FROM:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module, called = _FROM[name]
    return getattr(import_module(f"{__name__}.{module}"), called)


def load(where: str | Path = "reference", experiment: str = "obstacles") -> "NDArray[np.float64]":
    """The genes of a champion.

    Args:
        where: `reference`, the bundled champion of an experiment; `reference_7`, the one of seed 7; a run folder of
            `epuckhebb evolve`, `latest`, a `.npz` or a `.npy`.
        experiment: `light` or `obstacles`, for the bundled ones.

    Returns:
        The genes, 234 in the paper's network.

    Raises:
        ValueError: There is no genome there; the message says why.
    """
    from epuckhebb.store import load_genome, resolve_run

    return load_genome(str(resolve_run(str(where), "evolve")), experiment).genes


def evaluate(
    genome: "NDArray[np.float64] | Evolution | str | Path" = "reference",
    *overrides: str,
    config_dir: str | Path | None = None,
    progress: bool = True,
    **keys: Any,
) -> "Evaluation":
    """Run a genome's lifetimes with and without plasticity, on the same random numbers. Nothing is written.

    Every key of the command line is a keyword: `scenario="4obstacles"`, `repeats=5`, `threads=1`. What has a dot is
    given as settings, `lifetime={"duration_s": 60}`, or as text, `"lifetime.duration_s=60"`. Objects go where they
    belong: `hebbian=Hebbian(N=0.0002)` or a rule of your own, `lifetime=Lifetime(...)`, `adaptation=Adaptation(...)`.

    Args:
        genome: Genes, or where they are, as for `load`.
        overrides: Settings as on the command line; they come after the keywords.
        config_dir: A folder with YAML files of your own.
        progress: Whether to say on standard error what takes long.
        keys: Settings as keywords.

    Returns:
        The results: `.metrics` (a row a lifetime), `.table` (the paper's), `.traces` (the arrays of `traces.npz`),
        `.findings` (of self-checks), `.plot()` (the paths) and `.replay()` (the page); a notebook shows the last two.

    Raises:
        ValueError: A setting or the genome cannot be used; the message says why.
    """
    from epuckhebb import api

    return api.evaluate(genome, overrides, config_dir, progress, keys)


def evolve(*overrides: str, config_dir: str | Path | None = None, progress: bool = True, **keys: Any) -> "Evolution":
    """Evolve a controller. Nothing is written.

    Args:
        overrides: Settings as on the command line, for example "seed=7".
        config_dir: A folder with YAML files of your own.
        progress: Whether to show how far it is on standard error; without a terminal a line in half a minute.
        keys: Settings as keywords: `seed=7`, `scenario="highlight"`, `ga=GA(population=20)`.

    Returns:
        The champion of the last generation, and the rows of `history.csv`.

    Raises:
        ValueError: A setting cannot be used; the message says why.
    """
    from epuckhebb import api

    return api.evolve(overrides, config_dir, progress, keys)


def play(
    genome: str | Path = "reference",
    *overrides: str,
    side: str = "left",
    config_dir: str | Path | None = None,
    **keys: Any,
) -> "Live":
    """Open a live world that one disturbs by hand; a notebook shows its page below the cell.

    Args:
        genome: Where the genes are, as for `load`.
        overrides: Settings as on the command line; they come after the keywords.
        side: Which way is the right one, `left` or `right`.
        config_dir: A folder with YAML files of your own.
        keys: Settings as keywords.

    Returns:
        The live world: `.address` of its page, `.open()` it in a new tab, `.close()` ends it. Runs that the page saves
        are in `runs/evaluate/`.

    Raises:
        ValueError: A setting or the genome cannot be used; the message says why.
    """
    from epuckhebb import api

    return api.play(genome, overrides, side, config_dir, keys)


def sweep(
    genome: "NDArray[np.float64] | Evolution | str | Path" = "reference",
    *overrides: str,
    over: Mapping[str, Sequence[Any]] | None = None,
    config_dir: str | Path | None = None,
    progress: bool = True,
    **keys: Any,
) -> "pd.DataFrame":
    """Every combination of values, in one table. Nothing is written; `epuckhebb sweep` does it on many machines.

    Args:
        genome: As for `evaluate`.
        overrides: As for `evaluate`.
        over: For each key its values, for example `{"scenario": ["base", "lowlight"], "hebbian.N": [0.0002, 0.002]}`;
            it must be given. `genome`, `seed` and objects, as `{"hebbian": [Hebbian(N=0.001), MyRule(N=0.001)]}`, too.
        config_dir: As for `evaluate`.
        progress: Whether to show how far it is on standard error; without a terminal a line in half a minute.
        keys: Settings that all have in common; the same `seed` gives the same numbers.

    Returns:
        A row a lifetime, each of them once, with the columns of `metrics.csv`. Before them is a column for each key of
        `over` that `metrics.csv` has no column for; it says `any` for the GA if the key is one of plasticity.

    Raises:
        ValueError: A setting or a genome cannot be used; the message says why.
    """
    from epuckhebb import api

    return api.sweep(genome, overrides, over, config_dir, progress, keys)
