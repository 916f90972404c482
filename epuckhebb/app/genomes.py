"""Genomes in files: bundled champions, run folders, and arrays of 234 numbers from anywhere."""

import hashlib
import io
from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
from numpy.typing import NDArray

from epuckhebb.app.data import data_folder
from epuckhebb.app.errors import ConfigError
from epuckhebb.sim.controller import GENES, LAYERS

REFERENCE = "reference"


@dataclass(frozen=True, kw_only=True)
class Genome:
    """Genes (234,), a name for tables, and the SHA-256 of their bytes."""

    genes: NDArray[np.float64]
    name: str

    @property
    def sha256(self) -> str:
        """SHA-256 of the genes as little-endian float64."""
        return hashlib.sha256(self.genes.astype("<f8").tobytes()).hexdigest()


def champion_file(fitness: float, genes: NDArray[np.float64], experiment: str, seed: int, generation: int) -> bytes:
    """A `champion.npz`: the genome and where it comes from."""
    buffer = io.BytesIO()
    np.savez(
        buffer,
        genome=genes,
        layers=np.array(LAYERS),
        fitness=np.float64(fitness),
        experiment=np.str_(experiment),
        seed=np.int64(seed),
        generation=np.int64(generation),
    )
    return buffer.getvalue()


def load(where: str, experiment: str) -> Genome:
    """The genome that `genome=...` names.

    where: `reference` (the bundled champion of this experiment), a run folder with a `champion.npz`, or a `.npz` or
    `.npy` file with 234 numbers.

    Raises:
        ConfigError: there is no such file, or what is in it is not a genome.
    """
    if where == REFERENCE:
        path = data_folder("runs/reference") / f"champion_{experiment}.npz"
        return Genome(genes=_read(path), name=REFERENCE)
    path = Path(where).expanduser()
    if path.is_dir():
        if not (path / "champion.npz").is_file():
            raise ConfigError(
                f"genome={where} is a folder without a champion.npz; give a run folder of `epuckhebb evolve`, "
                f"a .npz or .npy file, or `{REFERENCE}`"
            )
        return Genome(genes=_read(path / "champion.npz"), name=path.resolve().name)
    if not path.is_file():
        raise ConfigError(
            f"genome={where} does not exist; give a run folder of `epuckhebb evolve`, a .npz or .npy file, "
            f"or `{REFERENCE}`"
        )
    return Genome(genes=_read(path), name=path.stem)


def _read(path: Path) -> NDArray[np.float64]:
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
    return checked(arrays["genome"], str(path))


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
