"""The figures of a run, by their names, from what it wrote. It loads matplotlib, which takes a while."""

import pandas as pd
from matplotlib.figure import Figure

from epuckhebb.analysis import charts, figures
from epuckhebb.analysis.evaluate import Traces
from epuckhebb.analysis.image import image
from epuckhebb.config import EvaluateConfig, EvolveConfig


def file_of(name: str, kind: str, *data: object) -> bytes:
    """The content of a figure's file. name: of a function below, which is given the data. kind: png, svg or pdf."""
    return image(globals()[name](*data), kind)


def trajectories(config: EvaluateConfig, title: str, traces: Traces) -> Figure:
    """The paths of the recorded lifetimes."""
    return figures.trajectories(traces, config.world, title)


def reversal(config: EvaluateConfig, genome: str, shares: pd.DataFrame, trials: pd.DataFrame) -> Figure:
    """Reversal learning: the rewarded shares."""
    title = f"{config.world.name} ({config.changed}) · genome {genome} · {2 * config.repeats} lifetimes each"
    return charts.reversal(shares, trials, title)


def learning(config: EvolveConfig, optimizer: str, history: pd.DataFrame) -> Figure:
    """Fitness over the generations of an evolution. optimizer: its name."""
    title = f"{config.world.name}, seed {config.seed}, {optimizer}"
    return charts.learning_curves({title: [history]})
