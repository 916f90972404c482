"""The Python interface behind `epuckhebb.evaluate` and `epuckhebb.evolve`: the same keys, no folders."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from epuckhebb.app import genomes
from epuckhebb.app.compose import composed
from epuckhebb.app.config import EvaluateConfig, EvolveConfig, thread_count, typed
from epuckhebb.evolution.evolve import evolve as generations
from epuckhebb.evolution.evolve import history_row
from epuckhebb.study.evaluate import evaluate as study


def evaluate(genome: NDArray[np.float64], overrides: list[str]) -> pd.DataFrame:
    """See `epuckhebb.evaluate`."""
    config = typed(composed("evaluate", overrides), EvaluateConfig)
    rows, _ = study(
        genomes.checked(np.asarray(genome), "the given array"),
        config.scenario,
        [] if config.hebbian.name == "none" else [config.hebbian],
        config.lifetime,
        repeats=config.repeats,
        seed=config.seed,
        threads=thread_count(config.threads),
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
