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

from importlib import import_module
from typing import TYPE_CHECKING

__version__ = "0.2.0"
__all__ = [
    "GA",
    "Adaptation",
    "Coupling",
    "Evaluation",
    "Evolution",
    "Evolved",
    "Fitness",
    "Hebbian",
    "Lifetime",
    "Live",
    "Optimizer",
    "Rule",
    "Sensor",
    "Wiring",
    "evaluate",
    "evolve",
    "load",
    "play",
    "sweep",
    "tanh",
]

if TYPE_CHECKING:
    from epuckhebb.api import evaluate, evolve, load, play, sweep
    from epuckhebb.api.results import Evaluation, Evolution, Live
    from epuckhebb.evolution.optimizer import Optimizer
    from epuckhebb.evolution.optimizers.ga import GA
    from epuckhebb.sim.adaptation.adaptation import Adaptation
    from epuckhebb.sim.coupling import Coupling
    from epuckhebb.sim.evolved import Evolved
    from epuckhebb.sim.life import Lifetime
    from epuckhebb.sim.network import tanh
    from epuckhebb.sim.own_fitness import Fitness
    from epuckhebb.sim.own_sensor import Sensor
    from epuckhebb.sim.plasticity.rule import Rule
    from epuckhebb.sim.plasticity.rules.paper import Paper as Hebbian
    from epuckhebb.sim.wiring import Wiring

_FROM = {  # name -> where it is, if not in `api`
    "GA": "evolution.optimizers.ga",
    "Adaptation": "sim.adaptation.adaptation",
    "Coupling": "sim.coupling",
    "Evaluation": "api.results",
    "Evolution": "api.results",
    "Evolved": "sim.evolved",
    "Fitness": "sim.own_fitness",
    "Hebbian": "sim.plasticity.rules.paper",
    "Lifetime": "sim.life",
    "Live": "api.results",
    "Optimizer": "evolution.optimizer",
    "Rule": "sim.plasticity.rule",
    "Sensor": "sim.own_sensor",
    "Wiring": "sim.wiring",
    "tanh": "sim.network",
}


def __getattr__(name: str) -> object:
    """What users call, and make objects of; loaded when asked for, so that `import epuckhebb` takes no time."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = import_module(f"{__name__}.{_FROM.get(name, 'api')}")
    return getattr(module, "Paper" if name == "Hebbian" else name)
