"""The figures of a run, by their names, from what it wrote. It loads matplotlib, which takes a while."""

import pandas as pd
from matplotlib.figure import Figure

from epuckhebb.analysis import charts
from epuckhebb.config import EvaluateConfig, EvolveConfig


def reversal(config: EvaluateConfig, genome: str, shares: pd.DataFrame, trials: pd.DataFrame) -> Figure:
    """Reversal learning: the rewarded shares."""
    title = f"{config.world.name} ({config.changed}) · genome {genome} · {2 * config.repeats} lifetimes each"
    return charts.reversal(shares, trials, title)


def learning(config: EvolveConfig, optimizer: str, history: pd.DataFrame) -> Figure:
    """Fitness over the generations of an evolution. optimizer: its name."""
    title = f"{config.world.name}, seed {config.seed}, {optimizer}"
    return charts.learning_curves({title: [history]})
