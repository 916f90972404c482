"""The Python interface behind `epuckhebb.evaluate` and `epuckhebb.evolve`: the same keys, no folders."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from epuckhebb.app import files
from epuckhebb.app.config import EvaluateConfig, EvolveConfig, thread_count, typed
from epuckhebb.app.evaluate import lives, memory_for
from epuckhebb.app.hydra_bridge import composed
from epuckhebb.evolution.evolve import evolve as generations
from epuckhebb.evolution.evolve import history_row


def evaluate(genome: NDArray[np.float64], overrides: list[str]) -> pd.DataFrame:
    """See `epuckhebb.evaluate`."""
    config = typed(composed("evaluate", overrides), EvaluateConfig)
    given = files.Genome(genes=files.checked_genes(np.asarray(genome), "the given array"), name="genome")
    threads = thread_count(config.threads)
    rows, _ = lives(config, given, memory_for(given, config, threads), threads)
    return rows


def evolve(overrides: list[str]) -> tuple[NDArray[np.float64], pd.DataFrame]:
    """See `epuckhebb.evolve`."""
    config = typed(composed("evolve", overrides), EvolveConfig)
    threads = thread_count(config.threads)
    lived = list(generations(config.ga, config.scenario, config.lifetime, config.seed, threads))
    return lived[-1].champion, pd.DataFrame(map(history_row, lived))
