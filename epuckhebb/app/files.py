"""The formats of all binary files: genomes and `champion.npz`, `checkpoint.npz`, `traces.npz`.

Each is written as bytes, which a run folder puts in place whole; each is checked as it is read.
"""

import hashlib
import io
import json
import re
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from epuckhebb.app.data import data_folder
from epuckhebb.app.errors import ConfigError
from epuckhebb.evolution.evolve import Generation, history_row
from epuckhebb.sim.controller import GENES, INPUTS, LAYERS
from epuckhebb.sim.lifetime import Samples
from epuckhebb.sim.memory import Memory
from epuckhebb.study.evaluate import Traces

REFERENCE = "reference"
CHAMPION, CHECKPOINT, TRACES = "champion.npz", "checkpoint.npz", "traces.npz"
_MEMORY = "memory_"  # how the names of a memory's arrays begin
_OF_SEED = re.compile(rf"{REFERENCE}_\d+")
_UNREADABLE = (OSError, ValueError, KeyError, EOFError, BadZipFile)


@dataclass(frozen=True, kw_only=True)
class Genome:
    """Genes (234,), a name for tables, and what the champion remembers, if it does."""

    genes: NDArray[np.float64]
    name: str
    memory: Memory | None = None

    @property
    def sha256(self) -> str:
        """SHA-256 of the genes as little-endian float64."""
        return hashlib.sha256(self.genes.astype("<f8").tobytes()).hexdigest()


def load_genome(where: str, experiment: str) -> Genome:
    """Load the genome that `genome=...` names.

    Args:
        where: `reference` (the bundled champion of this experiment), `reference_7` (the champion of seed 7 in the
            reference results), a run folder with a `champion.npz`, or a `.npz` or `.npy` file with 234 numbers.
        experiment: The name of the experiment, `light` or `obstacles`.

    Raises:
        ConfigError: There is no such file, or what is in it is not a genome.
    """
    if where == REFERENCE:
        return _read_genome(data_folder("runs/reference") / f"champion_{experiment}.npz", REFERENCE)
    if _OF_SEED.fullmatch(where):
        return _read_genome(_champion_of_seed(where, experiment), where)
    path, name = Path(where).expanduser(), Path(where).stem
    allowed = f"give a run folder of `epuckhebb evolve`, a .npz or .npy file, or `{REFERENCE}`"
    if path.is_dir():
        path, name = path / CHAMPION, path.resolve().name
        if not path.is_file():
            raise ConfigError(f"genome={where} is a folder without a {CHAMPION}; {allowed}")
    if not path.is_file():
        raise ConfigError(f"genome={where} does not exist; {allowed}")
    return _read_genome(path, name)


def checked_genes(genes: NDArray[np.generic], where: str) -> NDArray[np.float64]:
    """The genes as float64 of shape (234,).

    Raises:
        ConfigError: They are not numbers, not 234, or not all finite.
    """
    if genes.dtype.kind not in "fiu":
        raise ConfigError(f"genome={where} must hold numbers, it holds {genes.dtype}")
    if genes.shape != (GENES,):
        raise ConfigError(f"genome={where} must hold {GENES} numbers in one dimension, got shape {genes.shape}")
    genome = genes.astype(np.float64)
    if not np.isfinite(genome).all():
        raise ConfigError(f"genome={where} must hold finite numbers, {(~np.isfinite(genome)).sum()} are not")
    return genome


def champion_file(
    fitness: float,
    genes: NDArray[np.float64],
    experiment: str,
    seed: int,
    generation: int,
    memory: Memory | None = None,
) -> bytes:
    """A `champion.npz`: the genome, where it comes from, and what it remembers, once evolution has ended."""
    arrays: dict[str, Any] = {
        "genome": genes,
        "layers": np.array(LAYERS),
        "fitness": np.float64(fitness),
        "experiment": np.str_(experiment),
        "seed": np.int64(seed),
        "generation": np.int64(generation),
    }
    if memory is not None:
        arrays |= {_MEMORY + key: np.asarray(value) for key, value in asdict(memory).items()}
    return _compressed(arrays)


@dataclass(frozen=True)
class Checkpoint:
    """The state of an evolution between two generations, from which all other files of the run can be written.

    It holds the last whole generation, and `history.csv` up to it as text, so that its bytes stay the same.
    """

    generation: Generation
    history: str

    @classmethod
    def following(cls, before: "Checkpoint | None", generation: Generation) -> "Checkpoint":
        """The checkpoint after one more generation."""
        row = pd.DataFrame([history_row(generation)])
        written = before.history if before else ""
        return cls(generation, written + row.to_csv(index=False, header=not written))

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

    @classmethod
    def read(cls, run: Path, population: int) -> "Checkpoint | None":
        """Read the checkpoint in a run folder; there is none if its first generation never ended.

        Args:
            run: The folder.
            population: The number of individuals that the checkpoint must hold.

        Raises:
            ConfigError: There is one that cannot be used.
        """
        path = run / CHECKPOINT
        if not path.exists():
            return None
        try:
            held = _arrays(path)
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
        except _UNREADABLE as error:
            raise ConfigError(f"{path} cannot be read as a checkpoint: {error}") from error
        if generation.population.shape != (population, GENES):
            raise ConfigError(
                f"{path} holds a population of shape {generation.population.shape}, the run's configuration asks for "
                f"({population}, {GENES})"
            )
        return cls(generation, history)


def traces_file(traces: Traces, genes: NDArray[np.float64]) -> bytes:
    """The content of `traces.npz`: recorded lifetimes, and the genes that they began with."""
    told = {"controller": np.array(traces.controller), "side": np.array(traces.side), "genome": genes}
    return _compressed(told | traces.samples._asdict())


def read_traces(run: Path, state: str) -> tuple[Traces, NDArray[np.float64]]:
    """Read the recorded lifetimes of a run folder, and the genes that they began with.

    Args:
        run: The folder.
        state: What the run says of itself; it explains why there may be no traces.

    Raises:
        ConfigError: They cannot be read.
    """
    try:
        arrays = _arrays(run / TRACES)
        arrays.setdefault("surprise", np.full_like(arrays["rate"], np.nan))  # runs from before there was surprise
        samples = Samples(**{name: arrays[name] for name in Samples._fields})
        traces = Traces(controller=arrays["controller"].tolist(), side=arrays["side"].tolist(), samples=samples)
        return traces, arrays["genome"]
    except _UNREADABLE as error:
        raise ConfigError(f"{run / TRACES} cannot be read (the run is {state}): {error}") from error


def _compressed(arrays: dict[str, Any]) -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def _arrays(path: Path) -> dict[str, NDArray[Any]]:
    """The arrays of a `.npz` by name; that of a `.npy` is the genome."""
    with path.open("rb") as file:
        loaded = np.load(file, allow_pickle=False)
        return dict(loaded) if isinstance(loaded, np.lib.npyio.NpzFile) else {"genome": loaded}


def _champion_of_seed(where: str, experiment: str) -> Path:
    champions = data_folder("runs/reference") / "champions"
    path = champions / f"{experiment}_seed{int(where.partition('_')[2]):03d}.npz"
    if not path.is_file():
        seeds = sorted(int(file.stem[-3:]) for file in champions.glob(f"{experiment}_seed*.npz"))
        first = [seed for seed in seeds if seed - 1 not in seeds]
        last = [seed for seed in seeds if seed + 1 not in seeds]
        there = ", ".join(f"{a} to {b}" for a, b in zip(first, last, strict=True))
        raise ConfigError(
            f"genome={where} is not among the reference champions of the {experiment} experiment, seeds {there}"
        )
    return path


def _read_genome(path: Path, name: str) -> Genome:
    try:
        arrays = _arrays(path)
    except _UNREADABLE as error:
        raise ConfigError(f"genome={path} cannot be read as .npz or .npy: {error}") from error
    if "layers" in arrays and tuple(arrays["layers"].ravel().tolist()) != LAYERS:
        raise ConfigError(f"genome={path} is of layers {arrays['layers'].tolist()}, this network has {list(LAYERS)}")
    if "genome" not in arrays and len(arrays) == 1:
        arrays["genome"] = next(iter(arrays.values()))
    if "genome" not in arrays:
        raise ConfigError(f"genome={path} must hold one array or one named `genome`, it holds {sorted(arrays)}")
    return Genome(genes=checked_genes(arrays["genome"], str(path)), name=name, memory=_memory(arrays, path))


def _memory(arrays: dict[str, NDArray[Any]], path: Path) -> Memory | None:
    """The memory in a champion's file, if there is one."""
    told = {key.removeprefix(_MEMORY): value for key, value in arrays.items() if key.startswith(_MEMORY)}
    if not told:
        return None
    shapes = {"time_to_goal_s": (2,), "away_s": (2,), "reading_mean": (2, INPUTS), "reading_spread": (2, INPUTS)}
    whole = told.keys() == {field.name for field in fields(Memory)} and told["fitness"].ndim == 2
    if not (whole and all(told[key].shape == shape for key, shape in shapes.items())):
        raise ConfigError(f"genome={path} holds a memory of the training world that this program cannot read")
    values: dict[str, Any] = {key: value.item() if value.ndim == 0 else value for key, value in told.items()}
    return Memory(**values)
