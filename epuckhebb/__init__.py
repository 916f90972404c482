"""Evolved controllers that learn: an e-puck in a T-maze, a genetic algorithm, and Hebbian plasticity on top.

A controller (a network of 234 weights, its genome) is evolved to drive an e-puck through a T-maze: lamp on, go right;
lamp off, go left. During a lifetime, Hebbian plasticity may change its weights every 32 ms, the faster the better the
robot does; each lifetime begins with the evolved weights. This package evolves such controllers, runs their lifetimes
in worlds with other light or with obstacles, and measures what plasticity did for them.

Axes: X to the robot's right and Y ahead of it at the start; headings anticlockwise from X. Units: m, s, rad, kg.
Read in this order: controller/network, plasticity/rules/paper; tmaze/maze, light, robot, fitness, physics, life,
lifetime, session, batch; adaptation/adaptation; then evolution/training, optimizer, optimizers/ga, evolve; then
analysis/evaluate, tables, figures, replay; analysis/findings for what many champions tell. The other packages are the
program around it, conf/ its settings.

    import epuckhebb
    result = epuckhebb.evaluate("reference", scenario="4obstacles")  # .metrics, .table, .traces, .plot(), .replay()
    evolution = epuckhebb.evolve(seed=7)                             # .champion, .history
    epuckhebb.evaluate(evolution, hebbian=epuckhebb.Hebbian(N=0.0002), repeats=5)
"""

from importlib import import_module
from typing import TYPE_CHECKING

__version__ = "0.2.0"
__all__ = [
    "GA",
    "Adaptation",
    "ChangeSignal",
    "Controller",
    "Coupling",
    "Evaluation",
    "Evolution",
    "Evolved",
    "Fitness",
    "Hebbian",
    "Lifetime",
    "Live",
    "Network",
    "Optimizer",
    "Rule",
    "Sensor",
    "Study",
    "Task",
    "Wiring",
    "compare",
    "evaluate",
    "evolve",
    "load",
    "play",
    "sweep",
    "tanh",
]

if TYPE_CHECKING:
    from epuckhebb.adaptation.adaptation import Adaptation
    from epuckhebb.adaptation.change_signal import ChangeSignal
    from epuckhebb.api import compare, evaluate, evolve, load, play, sweep
    from epuckhebb.api.controller import Controller
    from epuckhebb.api.results import Evaluation, Evolution, Live
    from epuckhebb.controller.evolved import Evolved
    from epuckhebb.controller.network import Network, tanh
    from epuckhebb.controller.plasticity.rule import Rule
    from epuckhebb.controller.plasticity.rules.paper import Paper as Hebbian
    from epuckhebb.controller.wiring import Wiring
    from epuckhebb.evolution.optimizer import Optimizer
    from epuckhebb.evolution.optimizers.ga import GA
    from epuckhebb.flock.coupling import Coupling
    from epuckhebb.studies.study import Study
    from epuckhebb.tmaze.life import Lifetime
    from epuckhebb.tmaze.own_fitness import Fitness
    from epuckhebb.tmaze.own_sensor import Sensor
    from epuckhebb.tmaze.task import Task

_FROM = {  # name -> where it is, if not in `api`
    "GA": "evolution.optimizers.ga",
    "Adaptation": "adaptation.adaptation",
    "ChangeSignal": "adaptation.change_signal",
    "Controller": "api.controller",
    "Coupling": "flock.coupling",
    "Evaluation": "api.results",
    "Evolution": "api.results",
    "Evolved": "controller.evolved",
    "Fitness": "tmaze.own_fitness",
    "Hebbian": "controller.plasticity.rules.paper",
    "Lifetime": "tmaze.life",
    "Live": "api.results",
    "Optimizer": "evolution.optimizer",
    "Rule": "controller.plasticity.rule",
    "Sensor": "tmaze.own_sensor",
    "Study": "studies.study",
    "Task": "tmaze.task",
    "Wiring": "controller.wiring",
    "Network": "controller.network",
    "tanh": "controller.network",
}


def __getattr__(name: str) -> object:
    """What users call, and make objects of; loaded when asked for, so that `import epuckhebb` takes no time."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = import_module(f"{__name__}.{_FROM.get(name, 'api')}")
    return getattr(module, "Paper" if name == "Hebbian" else name)
