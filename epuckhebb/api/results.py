"""What the Python interface gives: results that a notebook shows."""

import html
from base64 import b64encode
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from epuckhebb.analysis.environments import unreached
from epuckhebb.analysis.evaluate import TRIALS
from epuckhebb.analysis.image import image
from epuckhebb.export.replay import Recording, recording_page
from epuckhebb.live.server import Play
from epuckhebb.runs import PreparedEvaluation, caption, drawn
from epuckhebb.store import Genome

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


@dataclass(frozen=True)
class Film:
    """An animated GIF that a notebook shows. data: the file."""

    data: bytes = field(repr=False)

    def _repr_html_(self) -> str:
        return f'<img src="data:image/gif;base64,{b64encode(self.data).decode()}">'


@dataclass(frozen=True, kw_only=True, repr=False)
class Evaluation:
    """The results of an evaluation's lifetimes; a notebook shows the table.

    Attributes:
        metrics: A row a lifetime, with the columns of `metrics.csv`.
    """

    metrics: pd.DataFrame
    prepared: PreparedEvaluation
    recorded: Any

    @property
    def config(self) -> Any:
        """The settings."""
        return self.prepared.config

    @property
    def genome(self) -> Genome:
        """The genome that was evaluated."""
        return self.prepared.genome

    @property
    def _rows(self) -> list[dict[str, Any]]:
        return [{str(name): value for name, value in row.items()} for row in self.metrics.to_dict("records")]

    @property
    def notes(self) -> list[str]:
        """What a reader must know beside the table, a line for each note: as that a change changes nothing."""
        notes = self.prepared.world.notes(self.genome)
        has_change = "reached" in self.table and bool(self.metrics.change.any())
        return [*notes, *(unreached(self.table.reset_index()) if has_change else ())]

    @cached_property
    def table(self) -> pd.DataFrame:
        """What `evaluate` shows: means over the repeats.

        In the maze the paper's table: a row for each metric, a column for each controller and side. Of reversal
        learning, and in an environment, a row for each controller.
        """
        return self.prepared.world.table(self._rows, self.recorded)

    @cached_property
    def traces(self) -> dict[str, NDArray[Any]]:
        """What was recorded, by name: the arrays of `traces.npz`; ValueError if nothing was recorded.

        In an environment `reward`, `weight_change` and `weight_step`, (lifetimes, steps), nan after the end.
        """
        self.prepared.world.check_recorded()
        return self.prepared.world.arrays(self.genome, self.recorded)

    @property
    def trials(self) -> pd.DataFrame:
        """A row for each trial of each lifetime, as in `reversal_trials.csv`; none where a life is one trial."""
        return pd.DataFrame(getattr(self.recorded, "trials", []), columns=list(TRIALS))

    def plot(self) -> Picture:
        """The main figure: the paths of the first repeat, or the reward over a lifetime in an environment.

        Raises:
            ValueError: Nothing was recorded.
        """
        world = self.prepared.world
        world.check_recorded()
        figures = world.write(lambda *_: None, self.genome, self._rows, self.recorded)
        _, figure = next(drawn(self.config, self.genome.name, figures))
        return Picture(figure)

    def replay(self) -> Page | Film:
        """The page to watch the first repeat step by step, or a film of the first lifetime in an environment.

        Raises:
            ValueError: Nothing was recorded, or the environment cannot be drawn.
        """
        world, genome = self.prepared.world, self.genome
        world.check_recorded()
        if film := world.film(genome):
            return Film(film)
        title = caption(self.config, genome.name)
        return Page(
            recording_page(Recording(self.recorded, genome.weights, genome.network, self.config, title, self.notes))
        )

    def __repr__(self) -> str:
        """The table, and what a reader must know beside it."""
        return "\n".join([str(self.table), *self.notes])

    def _repr_html_(self) -> str:
        return "".join([self.table.to_html(), *(f"<p>{html.escape(note)}</p>" for note in self.notes)])


@dataclass(frozen=True, kw_only=True, repr=False)
class Evolution:
    """The result of an evolution: its champion, with all that it was evolved for and by, and its history.

    Attributes:
        genome: The champion: its genes, its rule, the signs of its updates, its physics, what it remembers.
        history: A row a generation, as in `history.csv`.
        settings: All settings on which the results depend, but for the seed.
    """

    genome: Genome
    history: pd.DataFrame
    settings: Mapping[str, Any]

    @property
    def champion(self) -> NDArray[np.float64]:
        """The genes of the champion, 234 in the paper's network."""
        return self.genome.genes

    def __repr__(self) -> str:
        return f"Evolution of {len(self.history)} generations, best fitness {self.history.best_fitness.iloc[-1]:.3f}"
