"""The state of an evolution between two generations, as a file: the one that all others of the run are written from."""

import io
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
import pandas as pd

from epuckhebb.app.errors import ConfigError
from epuckhebb.evolution.evolve import Generation, history_row
from epuckhebb.sim.controller import GENES

NAME = "checkpoint.npz"


@dataclass(frozen=True)
class Checkpoint:
    """The last whole generation, and `history.csv` up to it (as text, so that its bytes stay the same)."""

    generation: Generation
    history: str

    def as_bytes(self) -> bytes:
        """The content of `checkpoint.npz`."""
        last = self.generation
        buffer = io.BytesIO()
        np.savez(
            buffer,
            generation=np.int64(last.number),
            population=last.population,
            fitness=last.fitness,
            success=last.success,
            champion=last.champion,
            rng_state=np.str_(json.dumps(last.rng_state)),
            history=np.str_(self.history),
        )
        return buffer.getvalue()


def following(before: Checkpoint | None, generation: Generation) -> Checkpoint:
    """The checkpoint after one more generation."""
    row = pd.DataFrame([history_row(generation)])
    written = before.history if before else ""
    return Checkpoint(generation, written + row.to_csv(index=False, header=not written))


def read(run: Path, population: int) -> Checkpoint | None:
    """The checkpoint in a run folder; None if its first generation never ended.

    population: the number of individuals that it must hold.

    Raises:
        ConfigError: there is one that cannot be used.
    """
    path = run / NAME
    if not path.exists():
        return None
    try:
        with path.open("rb") as file, np.load(file, allow_pickle=False) as arrays:
            held: dict[str, Any] = dict(arrays)
        generation = Generation(
            number=int(held["generation"]),
            fitness=held["fitness"],
            success=held["success"],
            champion=held["champion"],
            population=held["population"],
            rng_state=json.loads(str(held["rng_state"])),
            robot_steps=0,
            seconds=0.0,
        )
        history = str(held["history"])
    except (OSError, ValueError, KeyError, EOFError, BadZipFile) as error:
        raise ConfigError(f"{path} cannot be read as a checkpoint: {error}") from error
    if generation.population.shape != (population, GENES):
        raise ConfigError(
            f"{path} holds a population of shape {generation.population.shape}, the run's configuration asks for "
            f"({population}, {GENES})"
        )
    return Checkpoint(generation, history)
