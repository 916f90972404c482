"""The Python interface behind `epuckhebb.evaluate` and `epuckhebb.evolve`: the same keys, no folders."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from epuckhebb.app import genomes
from epuckhebb.app.compose import composed
from epuckhebb.app.config import EvaluateConfig, EvolveConfig, thread_count, typed
from epuckhebb.app.memories import memory_for
from epuckhebb.evolution.evolve import evolve as generations
from epuckhebb.evolution.evolve import history_row
from epuckhebb.study.evaluate import evaluate as study


def evaluate(genome: NDArray[np.float64], overrides: list[str]) -> pd.DataFrame:
    """See `epuckhebb.evaluate`."""
    config = typed(composed("evaluate", overrides), EvaluateConfig)
    genes = genomes.checked(np.asarray(genome), "the given array")
    given = genomes.Genome(genes=genes, name="genome")
    threads, gain = thread_count(config.threads), config.lifetime.gain_rad_s
    experiment = config.scenario.experiment
    rows, _ = study(
        genes,
        config.scenario,
        config.plasticities,
        config.lifetime,
        memory_for(given, config.plasticities, experiment, gain, threads, lambda _: None),
        repeats=config.repeats,
        seed=config.seed,
        threads=threads,
    )
    return rows


def evolve(overrides: list[str]) -> tuple[NDArray[np.float64], pd.DataFrame]:
    """See `epuckhebb.evolve`."""
    config = typed(composed("evolve", overrides), EvolveConfig)
    history = []
    for generation in generations(
        config.ga, config.scenario, config.lifetime, config.seed, thread_count(config.threads)
    ):
        history.append(history_row(generation))
    return generation.champion, pd.DataFrame(history)
