"""Writes and reads `checkpoint.npz`, from which an evolution is resumed."""

import io
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from epuckhebb.evolution.evolve import MOMENTS, Generation, history_row
from epuckhebb.evolution.search import Results, Search
from epuckhebb.runtime import ConfigError
from epuckhebb.store.disk import CHECKPOINT, convert_errors, parse_arrays
from epuckhebb.store.rows import as_csv
from epuckhebb.store.run import Run

_MEASURE = "results_"  # before the names of what an optimizer receives beside the fitness


@dataclass(frozen=True)
class Checkpoint:
    """The state of an evolution between two generations, from which all other files of the run can be written.

    It holds the last whole generation, the results of all generations for the optimizer, and `history.csv` up to it as
    text, so that its bytes stay the same.
    """

    generation: Generation
    history: str

    @classmethod
    def following(cls, previous: "Checkpoint | None", generation: Generation) -> "Checkpoint":
        """The checkpoint after one more generation."""
        written = previous.history if previous else ""
        return cls(generation, written + as_csv([history_row(generation)], header=not written))

    def as_bytes(self, settings: str) -> bytes:
        """The content of `checkpoint.npz`; `settings` is a digest of those that make it this evolution."""
        last = self.generation
        measures = {name: [results.measures[name] for results in last.log] for name in last.log[0].measures}
        arrays: dict[str, Any] = {
            "settings": np.str_(settings),
            "generation": np.int64(last.number),
            "fitness": last.fitness,
            "success": last.success,
            "champion": last.champion,
            "champion_fitness": np.float64(last.champion_fitness),
            "history": np.str_(self.history),
            "digests": np.array([results.digest for results in last.log]),
            "individuals": np.array([len(results.fitness) for results in last.log]),
            "results": np.concatenate([results.fitness for results in last.log]),
        } | {_MEASURE + name: np.concatenate(values) for name, values in measures.items()}
        if last.moments is not None:
            arrays[MOMENTS] = last.moments
        buffer = io.BytesIO()
        np.savez(buffer, **arrays)
        return buffer.getvalue()

    @classmethod
    def read(cls, run: Path, resume: Callable[[Sequence[Results]], Search], settings: str) -> "Checkpoint | None":
        """Read the checkpoint in a run folder; None if its first generation never ended.

        resume: resumes a search from its log. settings: the digest, which must be that of `as_bytes`.
        """
        path = run / CHECKPOINT
        if not path.exists():
            return None
        with convert_errors(f"{path} cannot be read as a checkpoint of this run's configuration"):
            arrays = parse_arrays(Run(run).content(CHECKPOINT))
            if str(arrays["settings"]) != settings:
                raise ConfigError(f"{run}/.hydra/config.yaml is not what this evolution began with; put it back")
            ends = np.cumsum(arrays["individuals"])[:-1]  # of each generation
            names = [name for name in arrays if name.startswith(_MEASURE)]
            measures = {name.removeprefix(_MEASURE): np.split(arrays[name], ends) for name in names}
            generations = zip(arrays["digests"], np.split(arrays["results"], ends), strict=True)
            search = resume(
                [
                    Results(str(digest), fitness, {name: parts[number] for name, parts in measures.items()})
                    for number, (digest, fitness) in enumerate(generations)
                ]
            )
            generation = Generation(
                number=int(arrays["generation"]),
                fitness=arrays["fitness"],
                success=arrays["success"],
                champion=arrays["champion"],
                champion_fitness=float(arrays["champion_fitness"]),
                log=search.log,
                tables=search.tables(),
                robot_steps=0,
                moments=arrays.get(MOMENTS),
            )
        return cls(generation, str(arrays["history"]))
