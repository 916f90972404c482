"""What the Python interface gives: results that a notebook shows."""

import html
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from epuckhebb.analysis import figures, reversal
from epuckhebb.analysis.evaluate import TRIALS, Traces
from epuckhebb.analysis.image import image
from epuckhebb.analysis.paper_table import PaperTable
from epuckhebb.config import EvaluateConfig
from epuckhebb.export.replay import Recording, page_of
from epuckhebb.live.server import Play
from epuckhebb.runs import caption, notes_of
from epuckhebb.runtime import ConfigError
from epuckhebb.store import Genome, traces_arrays

_LIVE = '<iframe src="{}" width="100%" height="860" style="border:0" allow="clipboard-write"></iframe>'
_FRAME = '<iframe srcdoc="{}" width="100%" height="760" style="border:0" sandbox="allow-scripts"></iframe>'


@dataclass(frozen=True)
class Picture:
    """A figure of matplotlib that a notebook shows."""

    figure: Figure = field(repr=False)

    def _repr_png_(self) -> bytes:
        return image(self.figure)


@dataclass(frozen=True)
class Page:
    """A page of HTML that a notebook shows inside itself. text: the page."""

    text: str = field(repr=False)

    def _repr_html_(self) -> str:
        return _FRAME.format(html.escape(self.text))


class Live(Play):
    """A live world that is served until it is closed, or Python ends; a notebook shows its page.

    address: of the page, for a browser of this computer.
    """

    def _repr_html_(self) -> str:
        return _LIVE.format(html.escape(self.address))

    def close(self) -> None:
        """End the world."""
        self.__exit__()


@dataclass(frozen=True, kw_only=True, repr=False)
class Evaluation:
    """The results of an evaluation's lifetimes; a notebook shows the paper's table.

    Attributes:
        metrics: A row a lifetime, with the columns of `metrics.csv`.
        config: The settings.
        genome: The genome that was evaluated.
    """

    metrics: pd.DataFrame
    config: EvaluateConfig
    genome: Genome
    recorded: Traces
    lifetime_ids: Mapping[str, str]

    @property
    def _recording(self) -> Recording:
        if not self.config.lifetime.record_every:
            raise ConfigError("nothing was recorded with lifetime.record_every=0; give lifetime={'record_every': 8}")
        genome, title = self.genome, caption(self.config, self.genome.name)
        notes = notes_of(genome, self.config)
        return Recording(self.recorded, genome.weights, genome.network, self.config, title, notes)

    @cached_property
    def table(self) -> pd.DataFrame:
        """The paper's table: a row for each metric, a column for each controller and side; means over the repeats.

        Of reversal learning, a row for each controller.
        """
        task = self.config.world.task
        if task.has_trials:
            return reversal.table(self.metrics, self.trials, task, self.config.seed).set_index("controller")
        means = pd.DataFrame(PaperTable.from_rows(self.metrics.to_dict("records")).means)
        return means.rename_axis("metric").rename_axis(["controller", "side"], axis=1)

    @cached_property
    def traces(self) -> dict[str, NDArray[Any]]:
        """What was recorded of the first repeat: the arrays of `traces.npz`; ValueError if nothing was recorded."""
        made = self._recording
        return traces_arrays(made.traces, made.weights, made.network)

    @property
    def trials(self) -> pd.DataFrame:
        """A row for each trial of each lifetime, as in `reversal_trials.csv`; none where a life is one trial."""
        return pd.DataFrame(self.recorded.trials, columns=list(TRIALS))

    def plot(self) -> Picture:
        """The paths of the first repeat, for each controller; ValueError if nothing was recorded."""
        made = self._recording
        return Picture(figures.trajectories(made.traces, made.config.world, made.title))

    def replay(self) -> Page:
        """The page to watch the first repeat, step by step; ValueError if nothing was recorded."""
        return Page(page_of(self._recording))

    def __repr__(self) -> str:
        """The table, and what a reader must know beside it."""
        return "\n".join([str(self.table), *notes_of(self.genome, self.config)])

    def _repr_html_(self) -> str:
        notes = (f"<p>{html.escape(note)}</p>" for note in notes_of(self.genome, self.config))
        return "".join([self.table.to_html(), *notes])


class Evolution(NamedTuple):
    """The result of an evolution. champion: its genes. history: a row a generation, as in `history.csv`."""

    champion: NDArray[np.float64]
    history: pd.DataFrame
