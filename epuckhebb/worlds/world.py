"""What a world is to `evolve` and `evaluate`: the maze is one, and any environment of Gymnasium.

All that is alike in worlds is written once, in `epuckhebb.runs`, and asks a world for what is its own.
"""

from collections.abc import Callable, Collection, Mapping
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.network import Network

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

    from epuckhebb.analysis.tables import Rows
    from epuckhebb.evolution.evolve import Evaluator
    from epuckhebb.store import Genome

Write = Callable[[str, Any], None]  # writes a file of a run: its name, its content
Figures = dict[str, tuple[Any, ...]]  # functions of `runs.figures` by name, with what they draw


class World(Protocol):
    """A world with the settings of a run: which lifetimes its controllers run, and what is told of them.

    genome: a champion, or genes from a file. nominal: what `nominal` measured. measures: what an optimizer can know of
    a lifetime, besides its fitness.
    """

    measures: ClassVar[Collection[str]] = ()

    @property
    def identity(self) -> tuple[Any, ...]:
        """All of the world on which a lifetime depends, besides its controller, its genome and its seed."""

    def facts(self, moments: Floats | None) -> Mapping[str, Any]:
        """What the file of a champion says of the world in which it was evolved. moments: of its `Generation`."""

    def check_genome(self, genome: "Genome") -> None:
        """Refuse a genome that cannot run here; a ConfigError."""

    def champion_settings(self, genome: "Genome") -> Any:
        """The settings, with what they leave to the champion that is evaluated."""

    def notes(self, genome: "Genome | None" = None) -> list[str]:
        """What a reader must know of the world, and of a genome in it."""

    def compile(self, network: Network) -> None:
        """Load or compile what the lifetimes need."""

    def nominal(self, genome: "Genome", threads: int) -> Any:  # noqa: ARG002  # the maze needs them
        """What the adaptations of an evaluation compare with; None where none needs it."""
        return None

    def nominal_of_training(self, weights: Floats, network: Network, threads: int) -> Any:  # noqa: ARG002  # the maze needs them
        """What a champion's file remembers of this world, in which it was evolved; None if there is nothing."""
        return None

    def run(self, genome: "Genome", nominal: Any, threads: int, *, record: bool = True) -> "tuple[Rows, Any]":
        """Run the lifetimes of an evaluation: a row of `metrics.csv` each, and what else was recorded, if any is."""

    def write(self, write: Write, genome: "Genome", rows: "Rows", recorded: Any) -> Figures:
        """Write the tables and records of an evaluation. Returns what its figures need, the main one first."""

    def check_recorded(self) -> None:
        """Refuse to show what the settings do not record; a ConfigError."""
        return

    def table(self, rows: "Rows", recorded: Any) -> "pd.DataFrame":
        """The table of an evaluation for Python."""

    def arrays(self, genome: "Genome", recorded: Any) -> "dict[str, NDArray[Any]]":
        """What was recorded, by name."""

    def film(self, genome: "Genome") -> bytes | None:  # noqa: ARG002  # environments need it
        """A GIF of the first lifetime of the rule; None where a page shows what was recorded."""
        return None

    def evaluator(self, network: Network, threads: int) -> "Evaluator":
        """What runs the lifetimes of an evolution."""
