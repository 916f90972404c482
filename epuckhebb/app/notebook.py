"""The Python interface behind `epuckhebb.evaluate` and `epuckhebb.evolve`: the same keys, no folders."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from epuckhebb.app import files
from epuckhebb.app.config import EvaluateConfig, EvolveConfig, thread_count, typed
from epuckhebb.app.evaluate import baseline_for, lives, needs, self_checks_for
from epuckhebb.app.evolve import given_weights
from epuckhebb.app.evolve import needs as evolve_needs
from epuckhebb.app.hydra_bridge import composed
from epuckhebb.app.machine import require
from epuckhebb.app.parts import network_for
from epuckhebb.evolution.evolve import evolve as generations
from epuckhebb.evolution.evolve import history_row
from epuckhebb.sim.controller import Controller
from epuckhebb.sim.genome import plan_of
from epuckhebb.sim.plasticity.rule import Rule


def evaluate(genome: NDArray[np.float64], overrides: list[str], rule: Rule | None) -> pd.DataFrame:
    """See `epuckhebb.evaluate`."""
    config = typed(composed("evaluate", overrides), EvaluateConfig)
    network = network_for(config.world.robot, config.layers)
    if rule is not None:
        over = config.adaptation
        name = over.name if over.acts else type(rule).__name__.lower()
        own = Controller(name=name, rule=rule, adaptation=over)
        config.controllers = [own, *(other for other in config.controllers if other.name in config.compare)]
    plans = [plan_of(network), *(plan_of(network, type(controller.rule)) for controller in config.controllers)]
    array = np.asarray(genome)
    plan = next((plan for plan in plans if array.shape == (plan.genes,)), plans[0])
    genes = files.checked_genes(array, "the given array", plan)
    given = files.Genome(genes=genes, name="genome", network=network, robot=config.world.robot.name, plan=plan)
    require(needs(config, given))
    threads = thread_count(config.threads)
    checks = self_checks_for(given, config, threads)
    rows, _ = lives(config, given, baseline_for(given, config, threads), checks, threads)
    return rows


def evolve(overrides: list[str]) -> tuple[NDArray[np.float64], pd.DataFrame]:
    """See `epuckhebb.evolve`."""
    config = typed(composed("evolve", overrides), EvolveConfig)
    network = network_for(config.world.robot, config.layers)
    require(evolve_needs(config, network))
    lived = list(
        generations(
            config.algorithm,
            config.world,
            config.lifetime,
            config.seed,
            thread_count(config.threads),
            training=config.training,
            network=network,
            controller=config.controller,
            weights=given_weights(config),
        )
    )
    return lived[-1].champion, pd.DataFrame(map(history_row, lived))
