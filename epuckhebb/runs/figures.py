"""The figures of a run, by their names, from what it wrote. It loads matplotlib, which takes a while."""

from typing import TYPE_CHECKING

from matplotlib.figure import Figure

from epuckhebb.analysis import charts, figures
from epuckhebb.analysis.evaluate import Traces
from epuckhebb.config import EvaluateConfig, EvaluateEnvironment, EvolveConfig, EvolveEnvironment
from epuckhebb.runs.notes import caption

if TYPE_CHECKING:
    import pandas as pd


def trajectories(config: EvaluateConfig, genome: str, traces: Traces) -> Figure:
    """The paths of the recorded lifetimes."""
    return figures.trajectories(traces, config.world, caption(config, genome))


def reversal(config: EvaluateConfig, genome: str, shares: "pd.DataFrame", trials: "pd.DataFrame") -> Figure:
    """Reversal learning: the rewarded shares."""
    title = f"{config.world.name} ({config.changed}) · genome {genome} · {2 * config.repeats} lifetimes each"
    return charts.reversal(shares, trials, title)


def lifetime(config: EvaluateEnvironment, genome: str, course: "pd.DataFrame") -> Figure:
    """The reward over a lifetime in an environment."""
    changes = [int(change["at"]) for change in config.environment.changes]
    title = f"{config.world.name} · {config.change_text or 'nothing changes'} · genome {genome} · seed {config.seed}"
    return charts.lifetime(course, title, changes)


def learning(config: EvolveConfig | EvolveEnvironment, optimizer: str, history: "pd.DataFrame") -> Figure:
    """Fitness over the generations of an evolution. optimizer: its name."""
    title = f"{config.world.name}, seed {config.seed}, {optimizer}"
    return charts.learning_curves({title: [history]})
