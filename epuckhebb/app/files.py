"""The formats of all binary files: genomes and `champion.npz`, `checkpoint.npz`, `traces.npz`.

Each is written as bytes, which a run folder puts in place whole; each is checked as it is read.
"""

import hashlib
import io
import json
import re
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from epuckhebb.app.data import data_folder
from epuckhebb.app.errors import ConfigError
from epuckhebb.evolution.evolve import Generation, history_row
from epuckhebb.sim.adaptation.baseline import Baseline
from epuckhebb.sim.adaptation.self_check.dance import STEPS
from epuckhebb.sim.adaptation.self_check.memory import EFFECTS, SelfMemory
from epuckhebb.sim.genome import WEIGHTS, GenomePlan, Part, plan_of
from epuckhebb.sim.lifetime import Samples
from epuckhebb.sim.network import PAPER_NETWORK, Network
from epuckhebb.sim.robot import EPUCK
from epuckhebb.study.evaluate import Traces

REFERENCE = "reference"
CHAMPION, CHECKPOINT, TRACES = "champion.npz", "checkpoint.npz", "traces.npz"
FINDINGS = "findings.csv"
_BASELINE = "memory_"  # how the names of a baseline's arrays begin, in files since version 0.1
_SELF_MEMORY = "self_"  # how the names of what the self-check remembers begin
_OF_SEED = re.compile(rf"{REFERENCE}_\d+")
_UNREADABLE = (OSError, ValueError, KeyError, EOFError, BadZipFile)


@dataclass(frozen=True, kw_only=True)
class Genome:
    """Genes, a name for tables, what they are for, and what the champion remembers, if it does.

    Attributes:
        genes: All genes, (genes,); 234 weights in the paper.
        name: What tables call it.
        network: The network that the weights are for.
        robot: The name of the robot that it was evolved for.
        lights: How many of its readings are of light; the others are of distance.
        plan: The parts of the genes; the weights come first.
        baseline: What the champion remembers of its training world.
        self_memory: What its self-check compares with.
    """

    genes: NDArray[np.float64]
    name: str
    network: Network = PAPER_NETWORK
    robot: str = EPUCK.name
    lights: int = EPUCK.lights
    plan: GenomePlan = field(default_factory=lambda: plan_of(PAPER_NETWORK))
    baseline: Baseline | None = None
    self_memory: SelfMemory | None = None

    @property
    def weights(self) -> NDArray[np.float64]:
        """The genes that are weights, (synapses,)."""
        return self.plan.split(self.genes)[WEIGHTS]

    @property
    def sha256(self) -> str:
        """SHA-256 of the genes as little-endian float64."""
        return hashlib.sha256(self.genes.astype("<f8").tobytes()).hexdigest()

    @property
    def baseline_sha256(self) -> str:
        """SHA-256 of what the champion remembers; nothing if it remembers nothing."""
        return _sha256(self.baseline)

    @property
    def self_memory_sha256(self) -> str:
        """SHA-256 of what the self-check compares with; nothing if there is nothing."""
        return _sha256(self.self_memory)


def _sha256(remembered: Baseline | SelfMemory | None) -> str:
    if remembered is None:
        return ""
    arrays = {name: np.asarray(value) for name, value in sorted(asdict(remembered).items())}
    told = b"".join(name.encode() + array.tobytes() for name, array in arrays.items())
    return hashlib.sha256(told).hexdigest()


def load_genome(where: str, experiment: str, layers: tuple[int, ...] | None = None) -> Genome:
    """Load the genome that `genome=...` names.

    Args:
        where: `reference` (the bundled champion of this experiment), `reference_7` (the champion of seed 7 in the
            reference results), a run folder with a `champion.npz`, or a `.npz` or `.npy` file with as many numbers as
            the network has weights, 234 in the paper.
        experiment: The name of the experiment, `light` or `obstacles`.
        layers: The layers of the network; None for those that the file names, or else the paper's.

    Raises:
        ConfigError: There is no such file, or what is in it is not a genome.
    """
    if where == REFERENCE:
        return _read_genome(data_folder("runs/reference") / f"champion_{experiment}.npz", REFERENCE, layers)
    if _OF_SEED.fullmatch(where):
        return _read_genome(_champion_of_seed(where, experiment), where, layers)
    path, name = Path(where).expanduser(), Path(where).stem
    allowed = f"give a run folder of `epuckhebb evolve`, a .npz or .npy file, or `{REFERENCE}`"
    if path.is_dir():
        path, name = path / CHAMPION, path.resolve().name
        if not path.is_file():
            raise ConfigError(f"genome={where} is a folder without a {CHAMPION}; {allowed}")
    if not path.is_file():
        raise ConfigError(f"genome={where} does not exist; {allowed}")
    return _read_genome(path, name, layers)


def checked_genes(genes: NDArray[np.generic], where: str, plan: GenomePlan) -> NDArray[np.float64]:
    """The genes as float64 of shape (genes,).

    Raises:
        ConfigError: They are not numbers, not as many as the plan has, or not all finite.
    """
    if genes.dtype.kind not in "fiu":
        raise ConfigError(f"genome={where} must hold numbers, it holds {genes.dtype}")
    if genes.shape != (plan.genes,):
        raise ConfigError(
            f"genome={where} must hold {plan.genes} numbers in one dimension ({plan.told()}), got shape {genes.shape}"
        )
    genome = genes.astype(np.float64)
    if not np.isfinite(genome).all():
        raise ConfigError(f"genome={where} must hold finite numbers, {(~np.isfinite(genome)).sum()} are not")
    return genome


def champion_file(genome: Genome, fitness: float, experiment: str, seed: int, generation: int) -> bytes:
    """A `champion.npz`: the genome, where it comes from, and what it remembers, once evolution has ended."""
    arrays: dict[str, Any] = {
        "genome": genome.genes,
        "layers": np.array(genome.network.layers),
        "fitness": np.float64(fitness),
        "experiment": np.str_(experiment),
        "seed": np.int64(seed),
        "generation": np.int64(generation),
        "robot": np.str_(genome.robot),
        "lights": np.int64(genome.lights),
        "parts": np.array([part.name for part in genome.plan.parts]),
        "part_sizes": np.array([part.size for part in genome.plan.parts]),
    }
    if genome.baseline is not None:
        arrays |= {_BASELINE + key: np.asarray(value) for key, value in asdict(genome.baseline).items()}
    if genome.self_memory is not None:
        arrays |= {_SELF_MEMORY + key: np.asarray(value) for key, value in asdict(genome.self_memory).items()}
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
    def read(cls, run: Path, population: int, genes: int) -> "Checkpoint | None":
        """Read the checkpoint in a run folder; there is none if its first generation never ended.

        Args:
            run: The folder.
            population: The number of individuals that the checkpoint must hold.
            genes: The number of genes that each must have.

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
        if generation.population.shape != (population, genes):
            raise ConfigError(
                f"{path} holds a population of shape {generation.population.shape}, the run's configuration asks for "
                f"({population}, {genes})"
            )
        return cls(generation, history)


def traces_file(traces: Traces, weights: NDArray[np.float64], network: Network) -> bytes:
    """The content of `traces.npz`: recorded lifetimes, and the weights and the network that they began with."""
    told = {"controller": np.array(traces.controller), "side": np.array(traces.side), "genome": weights}
    return _compressed(told | {"layers": np.array(network.layers)} | traces.samples._asdict())


def read_traces(run: Path, state: str) -> tuple[Traces, NDArray[np.float64], Network]:
    """Read the recorded lifetimes of a run folder, and the weights and the network that they began with.

    Args:
        run: The folder.
        state: What the run says of itself; it explains why there may be no traces.

    Raises:
        ConfigError: They cannot be read.
    """
    try:
        arrays = _arrays(run / TRACES)
        arrays.setdefault("change_signal", np.full_like(arrays["rate"], np.nan))  # runs of version 0.1
        samples = Samples(**{name: arrays[name] for name in Samples._fields})
        traces = Traces(controller=arrays["controller"].tolist(), side=arrays["side"].tolist(), samples=samples)
        layers = arrays.get("layers", np.array(PAPER_NETWORK.layers))
        return traces, arrays["genome"], Network(tuple(int(size) for size in layers))
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


def _read_genome(path: Path, name: str, layers: tuple[int, ...] | None) -> Genome:
    try:
        arrays = _arrays(path)
    except _UNREADABLE as error:
        raise ConfigError(f"genome={path} cannot be read as .npz or .npy: {error}") from error
    if "genome" not in arrays and len(arrays) == 1:
        arrays["genome"] = next(iter(arrays.values()))
    if "genome" not in arrays:
        raise ConfigError(f"genome={path} must hold one array or one named `genome`, it holds {sorted(arrays)}")
    own = tuple(int(size) for size in arrays["layers"].ravel()) if "layers" in arrays else None
    if own is not None and layers is not None and own != layers:
        raise ConfigError(f"genome={path} is of layers {list(own)}, and network.layers asks for {list(layers)}")
    try:
        network = Network(own or layers or PAPER_NETWORK.layers)
    except ValueError as error:
        raise ConfigError(f"genome={path}: {error}") from error
    plan = plan_of(network)
    if "parts" in arrays and "part_sizes" in arrays and len(arrays["parts"]) == len(arrays["part_sizes"]):
        sizes = [int(size) for size in arrays["part_sizes"]]
        plan = GenomePlan(tuple(map(Part, arrays["parts"].tolist(), sizes)))
        if plan.parts[:1] != (Part(WEIGHTS, network.synapses),):
            raise ConfigError(f"genome={path} must begin with {network.synapses} weights, it has {plan.told()}")
    return Genome(
        genes=checked_genes(arrays["genome"], str(path), plan),
        name=name,
        network=network,
        robot=str(arrays.get("robot", EPUCK.name)),
        lights=int(arrays.get("lights", EPUCK.lights)),
        plan=plan,
        baseline=_baseline(arrays, path, network.inputs),
        self_memory=_self_memory(arrays, path, network.inputs),
    )


def _baseline(arrays: dict[str, NDArray[Any]], path: Path, inputs: int) -> Baseline | None:
    """The baseline in a champion's file, if there is one."""
    told = {key.removeprefix(_BASELINE): value for key, value in arrays.items() if key.startswith(_BASELINE)}
    if not told:
        return None
    shapes: dict[str, tuple[int, ...]] = {"success": (2,), "time_to_goal_s": (2,), "away_s": (2,)}
    shapes |= {"reading_mean": (2, inputs), "reading_spread": (2, inputs)}
    whole = told.keys() == {field.name for field in fields(Baseline)} and told["fitness"].ndim == 2
    numbers = whole and all(told[key].dtype == np.float64 for key in (*shapes, "fitness"))
    if not (numbers and len(told["fitness"]) == 2 and all(told[key].shape == shape for key, shape in shapes.items())):
        raise ConfigError(f"genome={path} holds a baseline of the training world that this program cannot read")
    values: dict[str, Any] = {key: value.item() if value.ndim == 0 else value for key, value in told.items()}
    return Baseline(**values)


def _self_memory(arrays: dict[str, NDArray[Any]], path: Path, inputs: int) -> SelfMemory | None:
    """What the self-check of a champion compares with, if it is in its file."""
    told = {key.removeprefix(_SELF_MEMORY): value for key, value in arrays.items() if key.startswith(_SELF_MEMORY)}
    if not told:
        return None
    steps = len(STEPS)
    terms = 1 + inputs + inputs * (inputs + 1) // 2
    shapes: dict[str, tuple[int, ...]] = {
        "mean": (2, steps, inputs),
        "spread": (steps, inputs),
        "effects": (EFFECTS, steps, inputs),
        "moments": (terms * (terms + 1) // 2,),
    }
    whole = told.keys() == {field.name for field in fields(SelfMemory)}
    numbers = whole and all(told[key].shape == shape and told[key].dtype == np.float64 for key, shape in shapes.items())
    if not (numbers and all(np.isfinite(told[key]).all() for key in shapes)):
        raise ConfigError(f"genome={path} holds a memory of the self-check that this program cannot read")
    values: dict[str, Any] = {key: value.item() if value.ndim == 0 else value for key, value in told.items()}
    return SelfMemory(**values)
