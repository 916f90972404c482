"""The tables and figures over all runs of `epuckhebb evolve -m`."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from epuckhebb.analysis import evolutions
from epuckhebb.analysis.tables import Table
from epuckhebb.store import Run, as_bytes, of_multirun, write_atomic
from epuckhebb.studies.jobs import Job
from epuckhebb.studies.sweep import Sweep

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class Evolutions(Sweep):
    """The runs of a multirun of `evolve`."""

    @classmethod
    def shown(cls, run: Run) -> list[Table]:
        """See `Study`."""
        return [evolutions.readable(run.table("summary.csv"))]


def write_summary_of_evolutions(folder: Path, finished: Sequence[Path]) -> None:
    """Write the table and the figure over all runs of a multirun of `evolve` into its folder."""
    from epuckhebb.analysis.image import image  # matplotlib takes a while to load

    write_atomic(folder / "summary.csv", as_bytes(evolutions.summary(_ways(finished))))
    for name, figure in figures(folder).items():
        write_atomic(folder / "figures" / f"{name}.png", image(figure))


def figures(folder: Path) -> dict[str, "Figure"]:
    """The figures over all runs of a multirun of `evolve`."""
    from epuckhebb.analysis import charts

    ways = {" ".join(f"{key}={value}" for key, value in way.items()): own for way, own in _ways(of_multirun(folder))}
    return {"learning": charts.learning_curves(ways)}


def _ways(runs: Sequence[Path]) -> list[tuple[Mapping[str, Any], list[pd.DataFrame]]]:
    """The settings that runs differ in, but for the seed, and the histories of each."""
    every = [Job(number=0, overrides=Run(one).provenance["overrides"], run="", config={}).settings for one in runs]
    differ = [key for key in every[0] if key != "seed" and len({own.get(key) for own in every}) > 1]
    ways: dict[tuple[str, ...], list[pd.DataFrame]] = {}
    for path, settings in zip(runs, every, strict=True):
        ways.setdefault(tuple(settings.get(key, "") for key in differ), []).append(Run(path).table("history.csv"))
    return [(dict(zip(differ, way, strict=True)), own) for way, own in ways.items()]
