"""Genomes in files: bundled champions, run folders, and arrays of 234 numbers from anywhere."""

import hashlib
import io
import re
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from epuckhebb.app.data import data_folder
from epuckhebb.app.errors import ConfigError
from epuckhebb.sim.controller import GENES, INPUTS, LAYERS
from epuckhebb.sim.memory import Memory

REFERENCE = "reference"
_MEMORY = "memory_"  # how the names of a memory's arrays begin
_OF_SEED = re.compile(rf"{REFERENCE}_\d+")


@dataclass(frozen=True, kw_only=True)
class Genome:
    """Genes (234,), a name for tables, the SHA-256 of their bytes, and what the champion remembers, if it does."""

    genes: NDArray[np.float64]
    name: str
    memory: Memory | None = None

    @property
    def sha256(self) -> str:
        """SHA-256 of the genes as little-endian float64."""
        return hashlib.sha256(self.genes.astype("<f8").tobytes()).hexdigest()


def champion_file(
    fitness: float,
    genes: NDArray[np.float64],
    experiment: str,
    seed: int,
    generation: int,
    memory: Memory | None = None,
) -> bytes:
    """A `champion.npz`: the genome, where it comes from, and what it remembers, once evolution has ended."""
    buffer = io.BytesIO()
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
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def load(where: str, experiment: str) -> Genome:
    """The genome that `genome=...` names.

    where: `reference` (the bundled champion of this experiment), `reference_7` (the champion of seed 7 in the reference
    results), a run folder with a `champion.npz`, or a `.npz` or `.npy` file with 234 numbers.

    Raises:
        ConfigError: there is no such file, or what is in it is not a genome.
    """
    if where == REFERENCE:
        return _read(data_folder("runs/reference") / f"champion_{experiment}.npz", REFERENCE)
    if _OF_SEED.fullmatch(where):
        return _read(_champion_of_seed(where, experiment), where)
    path = Path(where).expanduser()
    if path.is_dir():
        if not (path / "champion.npz").is_file():
            raise ConfigError(
                f"genome={where} is a folder without a champion.npz; give a run folder of `epuckhebb evolve`, "
                f"a .npz or .npy file, or `{REFERENCE}`"
            )
        return _read(path / "champion.npz", path.resolve().name)
    if not path.is_file():
        raise ConfigError(
            f"genome={where} does not exist; give a run folder of `epuckhebb evolve`, a .npz or .npy file, "
            f"or `{REFERENCE}`"
        )
    return _read(path, path.stem)


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


def _read(path: Path, name: str) -> Genome:
    try:
        with path.open("rb") as file:
            loaded = np.load(file, allow_pickle=False)
            arrays = dict(loaded) if isinstance(loaded, np.lib.npyio.NpzFile) else {"genome": loaded}
    except (OSError, ValueError, EOFError, BadZipFile) as error:
        raise ConfigError(f"genome={path} cannot be read as .npz or .npy: {error}") from error
    if "layers" in arrays and tuple(arrays["layers"].ravel().tolist()) != LAYERS:
        raise ConfigError(f"genome={path} is of layers {arrays['layers'].tolist()}, this network has {list(LAYERS)}")
    if "genome" not in arrays and len(arrays) == 1:
        arrays["genome"] = next(iter(arrays.values()))
    if "genome" not in arrays:
        raise ConfigError(f"genome={path} must hold one array or one named `genome`, it holds {sorted(arrays)}")
    return Genome(genes=checked(arrays["genome"], str(path)), name=name, memory=_memory(arrays, path))


def _memory(arrays: dict[str, NDArray[np.generic]], path: Path) -> Memory | None:
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


def checked(genes: NDArray[np.generic], where: str) -> NDArray[np.float64]:
    """The genes as float64 of shape (234,).

    Raises:
        ConfigError: they are not numbers, not 234, or not all finite.
    """
    if genes.dtype.kind not in "fiu":
        raise ConfigError(f"genome={where} must hold numbers, it holds {genes.dtype}")
    if genes.shape != (GENES,):
        raise ConfigError(f"genome={where} must hold {GENES} numbers in one dimension, got shape {genes.shape}")
    genome = genes.astype(np.float64)
    if not np.isfinite(genome).all():
        raise ConfigError(f"genome={where} must hold finite numbers, {(~np.isfinite(genome)).sum()} are not")
    return genome
