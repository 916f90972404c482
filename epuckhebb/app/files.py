"""The formats of all binary files: genomes and `champion.npz`, `checkpoint.npz`, `traces.npz`.

Each is written as bytes, which a run folder puts in place whole; each is checked as it is read.
"""

import hashlib
import io
import math
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import IO, Any
from zipfile import ZipFile

import numpy as np
import pandas as pd
from numpy.lib import format as npy
from numpy.typing import NDArray

from epuckhebb.app import formats, runs
from epuckhebb.app.data import data_folder
from epuckhebb.app.errors import ConfigError
from epuckhebb.app.machine import path_of
from epuckhebb.evolution.evolve import Generation, history_row
from epuckhebb.evolution.optimizer import State
from epuckhebb.sim.adaptation.baseline import Baseline
from epuckhebb.sim.adaptation.homeostasis import PATTERNS
from epuckhebb.sim.adaptation.self_check.dance import STEPS
from epuckhebb.sim.adaptation.self_check.memory import EFFECTS, SelfMemory
from epuckhebb.sim.genome import WEIGHTS, GenomePlan, Part, plan_of
from epuckhebb.sim.lifetime import Samples, empty_samples
from epuckhebb.sim.maze import SIDES
from epuckhebb.sim.network import PAPER_NETWORK, Network
from epuckhebb.sim.robot import EPUCK
from epuckhebb.study.evaluate import Traces

REFERENCE = "reference"
CHAMPION, CHECKPOINT, TRACES = "champion.npz", "checkpoint.npz", "traces.npz"
FINDINGS, SUMMARY, DOSE_RESPONSE = "findings.csv", "summary.csv", "figures/dose_response.png"
REVERSAL, REVERSAL_TRIALS = "reversal.csv", "reversal_trials.csv"
_BASELINE = "memory_"  # how the names of a baseline's arrays begin, in files since version 0.1
_SELF_MEMORY = "self_"  # how the names of what the self-check remembers begin
_OF_SEED = re.compile(rf"{REFERENCE}_\d+")
_MOST = 64 * 2**20  # bytes of an array whose size nothing else tells; the weights of the largest network take 0.8 MB
_HEADERS = {(1, 0): npy.read_array_header_1_0, (2, 0): npy.read_array_header_2_0}
_KINDS = {
    "iu": "whole numbers",
    "f": "numbers",
    "fiu": "numbers",
    "U": "text",
    "fiuU": "numbers or text",
}  # of dtype, in words
_TEXTS = ("robot", "experiment", "optimizer", "training", "rule", "task")  # of a champion
_OF_A_GENERATION = ("generation", "fitness", "success", "champion", "champion_fitness", "history", "settings")
_Shape = Sequence[int | None]  # None where any length will do


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
        experiment, optimizer, training: Of which experiment it is, the names of what it was evolved by, and in which
            worlds; nothing if that is not known.
        rule: The name of the plasticity rule that it evolved with; nothing without one, or if that is not known.
        task: The name of the task that it evolved for, if it is another than the paper's.
        baseline: What the champion remembers of its training world.
        self_memory: What its self-check compares with.
    """

    genes: NDArray[np.float64]
    name: str
    network: Network = PAPER_NETWORK
    robot: str = EPUCK.name
    lights: int = EPUCK.lights
    plan: GenomePlan = field(default_factory=lambda: plan_of(PAPER_NETWORK))
    experiment: str = ""
    optimizer: str = ""
    training: str = ""
    rule: str = ""
    task: str = ""
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
    path, name = path_of(where, "genome"), Path(where).stem
    allowed = f"give a run folder of `epuckhebb evolve`, a .npz or .npy file, or `{REFERENCE}`"
    if path.is_dir():
        path, name = path / CHAMPION, path.resolve().name
        if not path.is_file():
            raise ConfigError(f"genome={where} is a folder without a {CHAMPION}; {allowed}")
    if not path.is_file():
        raise ConfigError(f"genome={where} does not exist; {allowed}")
    return _read_genome(path, name, layers)


def is_bundled(where: str) -> bool:
    """Whether `genome=...` names a champion that comes with the program."""
    return where == REFERENCE or _OF_SEED.fullmatch(where) is not None


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
        "optimizer": np.str_(genome.optimizer),
        "training": np.str_(genome.training),
    }
    if genome.rule:
        arrays["rule"] = np.str_(genome.rule)
    if genome.task:
        arrays |= {"task": np.str_(genome.task), "rewarded": np.int64(genome.network.rewarded)}
    if genome.baseline is not None:
        known = asdict(genome.baseline)
        if not len(genome.baseline.patterns):  # it was read from a file of before version 0.2
            del known["patterns"], known["novelty"]
        arrays |= {_BASELINE + key: np.asarray(value) for key, value in known.items()}
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

    def as_bytes(self, settings: str) -> bytes:
        """The content of `checkpoint.npz`; `settings` is a digest of those that make it this evolution."""
        last = self.generation
        arrays: dict[str, Any] = last.state | {
            "generation": np.int64(last.number),
            "fitness": last.fitness,
            "success": last.success,
            "champion": last.champion,
            "champion_fitness": np.float64(last.champion_fitness),
            "history": np.str_(self.history),
        }
        buffer = io.BytesIO()
        arrays["settings"] = np.str_(settings)
        np.savez(buffer, **arrays)
        return buffer.getvalue()

    @classmethod
    def read(cls, run: Path, genes: int, go_on: Callable[[State], object], settings: str) -> "Checkpoint | None":
        """Read the checkpoint in a run folder; there is none if its first generation never ended.

        Args:
            run: The folder.
            genes: The number of genes that each individual must have.
            go_on: A function that goes on from the state of a search, or says what is wrong with it: a ValueError, or a
                KeyError.
            settings: The digest that the checkpoint must have; those of version 0.1 have none.

        Raises:
            ConfigError: There is one that cannot be used.
        """
        path = run / CHECKPOINT
        if not path.exists():
            return None
        with _told(f"{path} cannot be read as a checkpoint of this run's configuration"):
            held = _Arrays(runs.content(run, CHECKPOINT))
            known = held.text("settings") if "settings" in held else settings
            history, fitness = held.text("history"), held.take("fitness", "f", (None,))
            is_earlier = "champion_fitness" not in held  # of version 0.1
            generation = Generation(
                number=int(held.take("generation", "iu", ())),
                fitness=fitness,
                success=held.take("success", "f", fitness.shape),
                champion=held.take("champion", "f", (genes,)),
                champion_fitness=float(fitness.max() if is_earlier else held.take("champion_fitness", "f", ())),
                state={name: held.take(name, "fiuU") for name in held.names if name not in _OF_A_GENERATION},
                robot_steps=0,
                seconds=0.0,
            )
            for name in ("fitness", "success", "champion", "champion_fitness"):
                if not np.isfinite(getattr(generation, name)).all():
                    raise ValueError(f"{name} must hold finite numbers")
            if len(formats.table(history.encode(), path, formats.HISTORY)) != generation.number + 1:
                raise ValueError(f"its history is not of {generation.number + 1} generations")
            go_on(generation.state)
        if known != settings:
            raise ConfigError(
                f"{run}/.hydra/config.yaml is not what this evolution began with, and to go on with it would make a "
                f"hybrid: put it back as it was. The number of generations and threads may be changed"
            )
        return cls(generation, history)


def traces_file(traces: Traces, weights: NDArray[np.float64], network: Network) -> bytes:
    """The content of `traces.npz`."""
    return _compressed(traces_arrays(traces, weights, network))


def traces_arrays(traces: Traces, weights: NDArray[np.float64], network: Network) -> dict[str, NDArray[Any]]:
    """Recorded lifetimes as arrays by name, with the weights and the network that they began with; `formats.TRACES`."""
    told = {"controller": np.array(traces.controller), "side": np.array(traces.side), "genome": weights}
    return told | {"layers": np.array(network.layers)} | traces.samples._asdict()


def read_traces(run: Path, state: str, lifetimes: int, samples: int) -> tuple[Traces, NDArray[np.float64], Network]:
    """Read the recorded lifetimes of a run folder, and the weights and the network that they began with.

    Args:
        run: The folder.
        state: What the run says of itself; it explains why there may be no traces.
        lifetimes: How many there must be.
        samples: How many samples each must have.

    Raises:
        ConfigError: They cannot be read.
    """
    with _told(f"{run / TRACES} cannot be read (the run is {state})"):
        if not (run / TRACES).is_file():
            raise ValueError("there is no such file")
        held = _Arrays(runs.content(run, TRACES))
        network = Network(held.layers() or PAPER_NETWORK.layers)
        each = (lifetimes, samples)
        found = {
            name: held.take(name, "f", (*each, *empty.shape[1:]))
            for name, empty in empty_samples(0, network)._asdict().items()
            if name in held or name != "change_signal"
        }
        for name, values in found.items():
            if name != "change_signal" and not np.isfinite(values).all():
                raise ValueError(f"{name} must hold finite numbers")
        found.setdefault("change_signal", np.full(each, np.nan))  # runs of version 0.1
        controllers, sides = (held.take(name, "U", (lifetimes,)).tolist() for name in ("controller", "side"))
        if not set(sides) <= set(SIDES) or len(set(zip(controllers, sides, strict=True))) < lifetimes:
            raise ValueError(f"side must be one of {', '.join(SIDES)}, and each controller's lifetime there one")
        traces = Traces(controller=controllers, side=sides, samples=Samples(**found))
        return traces, checked_genes(held.take("genome", "f", (network.synapses,)), TRACES, plan_of(network)), network


def read_findings(run: Path) -> list[dict[str, Any]]:
    """What the robots of a run found in their self-checks, a row each; nothing if they made none.

    Raises:
        ConfigError: It cannot be read.
    """
    if not runs.has(run, FINDINGS):
        return []
    found = runs.table(run, FINDINGS, formats.FOUND)
    texts = {name: "" for name, column in formats.FOUND.items() if column.kind == formats.TEXT_OR_EMPTY}
    return [{str(name): value for name, value in row.items()} for row in found.fillna(texts).to_dict("records")]


def _compressed(arrays: dict[str, Any]) -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


class _Arrays:
    """The arrays of a `.npz`, or of a `.npy` that of the genome, each looked at before it is read.

    A few bytes can say that they hold more numbers than there is memory for, in the directory of the `.npz` or in the
    header of an array. So what the header says must be what is wanted and as many bytes as there are, before any is
    unpacked.
    """

    def __init__(self, content: bytes) -> None:
        """Look into a file with this content."""
        self._content = content
        self._zip = ZipFile(io.BytesIO(content)) if content.startswith(b"PK") else None
        members = self._zip.infolist() if self._zip else []
        self._members = {member.filename.removesuffix(".npy"): member for member in members}
        self.names = list(self._members) if self._zip else ["genome"]

    def __contains__(self, name: str) -> bool:
        """Whether there is an array of this name."""
        return name in self.names

    def take(self, name: str, kinds: str, shape: _Shape | None = None) -> NDArray[Any]:
        """Read an array.

        Args:
            name: Its name.
            kinds: The letters of the dtypes that it may have, a key of `_KINDS`.
            shape: What its shape must be; None for any.

        Raises:
            ValueError: It is not there, or something else.
        """
        if name not in self:
            raise ValueError(f"it has no array {name}")
        with self._opened(name) as (file, size):
            found, is_fortran, dtype = _HEADERS[npy.read_magic(file)](file)
            fits = shape is None or (
                len(found) == len(shape) and all(n in (None, m) for n, m in zip(shape, found, strict=True))
            )
            if dtype.kind not in kinds or not fits:
                sizes = ", ".join("any" if n is None else str(n) for n in shape or ())
                wanted = _KINDS[kinds] if shape is None else f"{_KINDS[kinds]} of shape ({sizes})"
                raise ValueError(f"{name} must be {wanted}, it is {dtype} of shape {found}")
            count = math.prod(found)
            if count * dtype.itemsize != size - file.tell():
                raise ValueError(f"{name} is damaged: its shape is {found}, and it has {size} bytes")
            most = max(_MOST, len(self._content))  # or what is there as it is, not packed
            if size > most and (shape is None or None in shape or dtype.kind == "U"):
                raise ValueError(f"{name} takes {size} bytes; at most {most} are read")
            numbers = np.frombuffer(file.read(), dtype, count)
        own: NDArray[Any] = numbers.reshape(found, order="F" if is_fortran else "C").astype(dtype.newbyteorder("="))
        return own

    def text(self, name: str) -> str:
        """A text."""
        return str(self.take(name, "U", ()))

    def layers(self) -> tuple[int, ...] | None:
        """The layers of the network that the file is for, if it says so."""
        return tuple(self.take("layers", "iu", (None,)).tolist()) if "layers" in self else None

    @contextmanager
    def _opened(self, name: str) -> Iterator[tuple[IO[bytes], int]]:
        """An array to be read, and how many bytes it has with its header."""
        if self._zip is None:
            yield io.BytesIO(self._content), len(self._content)
            return
        with self._zip.open(self._members[name]) as file:
            yield file, self._members[name].file_size


@contextmanager
def _told(what: str) -> Iterator[None]:
    """Tell of whatever goes wrong while a file is read as one `ConfigError` that begins so."""
    try:
        yield
    except ConfigError:
        raise
    except Exception as error:  # what damaged bytes may raise has no end
        raise ConfigError(f"{what}: {error or type(error).__name__}") from error


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
    with _told(f"genome={path} cannot be read as .npz or .npy"):
        if path.stat().st_size > _MOST:
            raise ValueError(f"it has {path.stat().st_size} bytes; at most {_MOST} are read")
        held = _Arrays(runs.content(path.parent, path.name))
        own = held.layers()
        texts = {name: held.text(name) for name in _TEXTS if name in held}
        lights = int(held.take("lights", "iu", ())) if "lights" in held else EPUCK.lights
        rewarded = bool(held.take("rewarded", "iu", ())) if "rewarded" in held else False
        parts = None
        if "parts" in held and "part_sizes" in held:
            names = held.take("parts", "U", (None,)).tolist()
            sizes = held.take("part_sizes", "iu", (len(names),)).tolist()
            parts = tuple(map(Part, names, sizes))
            if min(sizes, default=0) < 0 or len(set(names)) < len(names):
                raise ValueError("each of its parts must have a name of its own, and a size of 0 or more")
        key = held.names[0] if "genome" not in held and len(held.names) == 1 else "genome"
        if key not in held:
            raise ConfigError(
                f"genome={path} must hold one array or one named `genome`, it holds {sorted(held.names)[:20]}"
            )
        genes = held.take(key, "fiu")
    if own is not None and layers is not None and own != layers:
        raise ConfigError(f"genome={path} is of layers {list(own)}, and network.layers asks for {list(layers)}")
    try:
        network = Network(own or layers or PAPER_NETWORK.layers, rewarded)
    except ValueError as error:
        raise ConfigError(f"genome={path}: {error}") from error
    plan = plan_of(network)
    if parts is not None:
        plan = GenomePlan(parts)
        if plan.parts[:1] != (Part(WEIGHTS, network.synapses),):
            raise ConfigError(f"genome={path} must begin with {network.synapses} weights, it has {plan.told()}")
    if not 0 <= lights <= network.inputs:
        raise ConfigError(f"genome={path}: lights must lie between 0 and {network.inputs}, the readings, got {lights}")
    return Genome(
        genes=checked_genes(genes, str(path), plan),
        name=name,
        network=network,
        robot=texts.get("robot", EPUCK.name),
        lights=lights,
        plan=plan,
        experiment=texts.get("experiment", ""),
        optimizer=texts.get("optimizer", ""),
        training=texts.get("training", ""),
        rule=texts.get("rule", ""),
        task=texts.get("task", ""),
        baseline=_baseline(held, path, network.inputs, lights),
        self_memory=_self_memory(held, path, network.inputs),
    )


def _baseline(held: _Arrays, path: Path, inputs: int, lights: int) -> Baseline | None:
    """The baseline in a champion's file, if there is one."""
    if not any(name.startswith(_BASELINE) for name in held.names):
        return None
    shapes: dict[str, _Shape] = {"success": (2,), "time_to_goal_s": (2,), "away_s": (2,), "fitness": (2, None)}
    shapes |= {"reading_mean": (2, inputs), "reading_spread": (2, inputs)}
    with _told(f"genome={path} holds a baseline of the training world that this program cannot read"):
        if held.take(f"{_BASELINE}fitness", "f").size == 0:
            raise ValueError("its fitness is of no second")
        known: dict[str, Any] = {"patterns": np.zeros((0, lights)), "novelty": np.inf}  # before version 0.2
        if f"{_BASELINE}novelty" in held.names:
            known["patterns"] = held.take(f"{_BASELINE}patterns", "f", (PATTERNS, lights)).astype(np.float64)
            known["novelty"] = float(held.take(f"{_BASELINE}novelty", "f", ()))
        for name, shape in shapes.items():
            known[name] = held.take(_BASELINE + name, "f", shape).astype(np.float64)
        return Baseline(
            experiment=held.text(f"{_BASELINE}experiment"),
            scenario=held.text(f"{_BASELINE}scenario"),
            gain_rad_s=float(held.take(f"{_BASELINE}gain_rad_s", "f", ())),
            **known,
        )


def _self_memory(held: _Arrays, path: Path, inputs: int) -> SelfMemory | None:
    """What the self-check of a champion compares with, if it is in its file."""
    if not any(name.startswith(_SELF_MEMORY) for name in held.names):
        return None
    steps, terms = len(STEPS), 1 + inputs + inputs * (inputs + 1) // 2
    shapes: dict[str, _Shape] = {"mean": (2, steps, inputs), "spread": (steps, inputs)}
    shapes |= {"effects": (EFFECTS, steps, inputs), "moments": (terms * (terms + 1) // 2,)}
    with _told(f"genome={path} holds a memory of the self-check that this program cannot read"):
        arrays = {name: held.take(_SELF_MEMORY + name, "f", shape).astype(np.float64) for name, shape in shapes.items()}
        for name, array in arrays.items():
            if not np.isfinite(array).all():
                raise ValueError(f"{name} must hold finite numbers")
        return SelfMemory(
            experiment=held.text(f"{_SELF_MEMORY}experiment"),
            scenario=held.text(f"{_SELF_MEMORY}scenario"),
            light=float(held.take(f"{_SELF_MEMORY}light", "f", ())),
            lights=int(held.take(f"{_SELF_MEMORY}lights", "iu", ())),
            **arrays,
        )
