"""Writes and reads genomes: `champion.npz`, plain arrays, and the champions that come with the program."""

import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epuckhebb.adaptation.nominal import Nominal
from epuckhebb.controller import random
from epuckhebb.controller.genome import WEIGHTS, GenomePlan, Part, make_plan
from epuckhebb.controller.network import PAPER_NETWORK, WEIGHT_LIMIT, Network
from epuckhebb.controller.wiring import LAYERS, Wiring, recorded_wiring
from epuckhebb.runtime import LATEST, REFERENCE, ConfigError, data_folder, user_path
from epuckhebb.store.disk import CHAMPION, as_npz, convert_errors, parse_arrays
from epuckhebb.store.run import Run
from epuckhebb.tmaze.robot import EPUCK

_NOMINAL = "memory_"  # how the names of the arrays of nominal statistics begin
_OF_SEED = re.compile(rf"{REFERENCE}_([a-z]+_)?(\d+)")
_RANDOM = re.compile(r"random_(\d+)")
# What a champion was evolved for and by, as far as it is known.
_TEXTS = (
    *("robot", "experiment", "optimizer", "training", "rule", "task", "fitness_function", "sensors"),
    *("wiring_settings", "physics", "start", "environment", "environment_settings"),
)


@dataclass(frozen=True, kw_only=True)
class Genome:
    """Genes, a name for tables, what they are for, and what the champion remembers.

    Attributes:
        genes: All genes, (genes,); 234 weights in the paper.
        name: What tables call it.
        network: The network that the weights are for.
        robot: The name of the robot that it was evolved for; "" for any.
        lights: How many of its sensor readings are of light; the others are of distance.
        plan: The parts of the genes; the weights come first.
        experiment, optimizer, training: Names of what it was evolved in and by; "" if unknown.
        rule: The name of the plasticity rule with which it was evolved; "" without one, or if unknown.
        task: The name of the task for which it was evolved, if it is not the paper's.
        fitness_function: The name of the fitness that its evolution maximised, if it is not the paper's.
        wiring_settings: Those of the wiring, as JSON; "" for layers.
        sensors: The readings of the robot's own sensors, by name, with `, ` between; "" without any.
        physics: The name of the physics in which it was evolved, if it is not that of the plane.
        start: The champion at whose genes its evolution began, and the SHA-256 of these; "" for random genes.
        environment: The name of the environment in which it was evolved, if that is not the maze.
        environment_settings: Those of its readings, rewards and steps there, as JSON.
        signs: Of the updates of its rule, (synapses,), if they were shuffled in its evolution.
        nominal: Statistics of the champion in its training world.
    """

    genes: NDArray[np.float64]
    name: str
    network: Network = PAPER_NETWORK
    robot: str = EPUCK.name
    lights: int = EPUCK.light.count
    plan: GenomePlan = field(default_factory=lambda: make_plan(PAPER_NETWORK))
    experiment: str = ""
    optimizer: str = ""
    training: str = ""
    rule: str = ""
    task: str = ""
    fitness_function: str = ""
    sensors: str = ""
    wiring_settings: str = ""
    physics: str = ""
    start: str = ""
    environment: str = ""
    environment_settings: str = ""
    signs: NDArray[np.float64] | None = None
    nominal: Nominal | None = None

    @property
    def weights(self) -> NDArray[np.float64]:
        """The genes that are weights, (synapses,)."""
        return self.plan.split(self.genes)[WEIGHTS]

    @property
    def network_genes(self) -> NDArray[np.float64]:
        """The genes of the network: the weights, and the parameters of the neurons of a wiring."""
        return self.plan.pick(self.genes, self.plan.network_parts)

    @property
    def wiring(self) -> str:
        """The name of the wiring of its network; `mlp` for layers."""
        return LAYERS if self.network.wiring is None else self.network.wiring.name

    @property
    def sha256(self) -> str:
        """SHA-256 of the genes as little-endian float64."""
        return hashlib.sha256(self.genes.astype("<f8").tobytes()).hexdigest()

    @property
    def nominal_sha256(self) -> str:
        """SHA-256 of the nominal statistics; "" if there are none."""
        if self.nominal is None:
            return ""
        parts = (name.encode() + np.asarray(value).tobytes() for name, value in sorted(asdict(self.nominal).items()))
        return hashlib.sha256(b"".join(parts)).hexdigest()


def load_genome(where: str, experiment: str, shape: tuple[int, ...] | Wiring | None = None) -> Genome:
    """Load the genome that `genome=...` names.

    Args:
        where: `reference` (the bundled champion of this experiment), `reference_7` (the champion of seed 7 in the
            reference results; `reference_ode_301` was evolved with `physics=ode`), `random_7` (genes drawn by the
            number 7, uniform in +-1 as those of a first generation), a run folder with a `champion.npz`, or a `.npz` or
            `.npy` file with as many numbers as the network has weights, 234 in the paper.
        experiment: The name of the experiment, `light` or `obstacles`, or of the environment.
        shape: The layers of the network, or its wiring; None for what the file names, or else the paper's layers.
    """
    if drawn := _RANDOM.fullmatch(where):
        return _random_genome(where, int(drawn[1]), shape)
    reference, name, of_seed = data_folder("runs/reference"), where, _OF_SEED.fullmatch(where)
    if where == REFERENCE:
        path = reference / f"champion_{experiment}.npz"
    elif of_seed:
        path = reference / "champions" / f"{experiment}_{of_seed[1] or ''}seed{int(of_seed[2]):03d}.npz"
    else:
        path = user_path(where, "genome")
        name, path = (path.resolve().name, path / CHAMPION) if path.is_dir() else (path.stem, path)
    if not path.is_file():
        allowed = (
            f"`{LATEST}`, a run of evolve, a .npz or .npy file, `{REFERENCE}`, or one as `{REFERENCE}_7` or `random_7`"
        )
        raise ConfigError(f"genome={where} does not exist: there is no file {path}; give {allowed}")
    return _read_genome(path, name, shape)


def _random_genome(name: str, seed: int, shape: tuple[int, ...] | Wiring | None) -> Genome:
    """A genome of random weights, which no robot has evolved."""
    if isinstance(shape, Wiring):
        raise ConfigError(f"genome={name} needs network.wiring={LAYERS}, got network.wiring={shape.name}")
    network = PAPER_NETWORK if shape is None else Network(shape)
    genes = random.rng(seed, random.Stream.random_genome).uniform(-1.0, 1.0, network.synapses)
    return Genome(genes=genes, name=name, network=network, robot="", plan=make_plan(network))


def checked_genes(genes: NDArray[np.generic], where: str, plan: GenomePlan) -> NDArray[np.float64]:
    """The genes as float64 of shape (genes,)."""
    if genes.dtype.kind not in "fiu" or genes.shape != (plan.genes,):
        needed = f"{plan.genes} numbers in one dimension ({plan.text()})"
        raise ConfigError(f"genome={where} must hold {needed}, got {genes.dtype} of shape {genes.shape}")
    with np.errstate(over="ignore"):
        finite = np.isfinite(checked := genes.astype(np.float64))
    if not finite.all():
        raise ConfigError(f"genome={where} must hold finite numbers, {(~finite).sum()} are not")
    return checked


def champion_file(genome: Genome, fitness: float, seed: int, generation: int) -> bytes:
    """A `champion.npz`: the genome, where it comes from, and what it remembers, once evolution has ended."""
    arrays: dict[str, Any] = {
        "genome": genome.genes,
        "layers": np.array(genome.network.layers),
        "fitness": np.float64(fitness),
        "seed": np.int64(seed),
        "generation": np.int64(generation),
        "lights": np.int64(genome.lights),
        "parts": np.array([part.name for part in genome.plan.parts]),
        "part_sizes": np.array([part.size for part in genome.plan.parts]),
    } | {name: np.str_(text) for name in _TEXTS if (text := getattr(genome, name))}
    if genome.task or genome.network.rewarded:
        arrays["rewarded"] = np.int64(genome.network.rewarded)
    if genome.network.wiring is not None:
        settings = json.dumps(asdict(genome.network.wiring), default=str)
        arrays |= {**wiring_arrays(genome.network), "wiring_settings": np.str_(settings)}
    if genome.signs is not None:
        arrays["signs"] = genome.signs
    if genome.nominal is not None:
        arrays |= {_NOMINAL + key: np.asarray(value) for key, value in asdict(genome.nominal).items()}
    return as_npz(arrays)


def wiring_arrays(network: Network) -> dict[str, Any]:
    """What a file says of the wiring of a network, for `parse_network`; nothing of layers."""
    if network.wiring is None:
        return {}
    return {"wiring": np.str_(network.wiring.name), "joined": np.array(network.joined)}


def parse_network(arrays: Mapping[str, Any], default: tuple[int, ...] = PAPER_NETWORK.layers) -> Network:
    """The network that a file is for. default: the layers, if the file does not say."""
    layers = tuple(arrays["layers"].tolist()) if "layers" in arrays else default
    rewarded = bool(arrays.get("rewarded", False))
    if "wiring" not in arrays:
        return Network(layers, rewarded)
    return Network(layers, rewarded, recorded_wiring(str(arrays["wiring"]), layers[1:], arrays["joined"].T.tolist()))


def shaped(network: Network, where: str, shape: tuple[int, ...] | Wiring | None) -> Network:
    """The network of a genome, with the settings of a wiring; a ConfigError if it has another shape, if one is given.

    A wiring must join the same neurons.
    """
    if isinstance(shape, Wiring):
        wired, wiring = Network((network.inputs, *shape.sizes), network.rewarded, shape), network.wiring
        is_like = wiring is not None and wiring.name == shape.name and wired.layers == network.layers
        if not (is_like and np.array_equal(wired.joined, network.joined)):
            its = f"{network} with network.wiring={wiring.name if wiring else LAYERS}"
            raise ConfigError(
                f"genome={where} is for {its}, the settings make {wired} with network.wiring={shape.name}"
            )
        return wired
    if shape and network.layers != shape:
        raise ConfigError(f"genome={where} is of layers {network}, and network.layers asks for {list(shape)}")
    return network


def _read_genome(path: Path, name: str, shape: tuple[int, ...] | Wiring | None) -> Genome:
    """Read a genome from a file, and check that it fits the shape of the network, if one is given."""
    layers = None if isinstance(shape, Wiring) else shape
    with convert_errors(f"genome={path} cannot be used"):
        arrays = parse_arrays(Run(path.parent).content(path.name))
        if "genome" not in arrays and len(arrays) != 1:
            raise ValueError("it holds several arrays, none named `genome`")
        network = shaped(parse_network(arrays, layers or PAPER_NETWORK.layers), str(path), shape)
        plan = make_plan(network)
        if "parts" in arrays:
            plan = GenomePlan(tuple(map(Part, arrays["parts"].tolist(), arrays["part_sizes"].tolist())))
        statistics: dict[str, Any] = {field.name: arrays.get(_NOMINAL + field.name) for field in fields(Nominal)}
        recorded = {
            key: value if value.ndim else value.item() for key, value in statistics.items() if value is not None
        }
        genes = checked_genes(arrays.get("genome", next(iter(arrays.values()))), str(path), plan)
        largest = np.abs(plan.split(genes)[WEIGHTS]).max()
        if "optimizer" not in arrays and largest > WEIGHT_LIMIT:  # those that evolved here were clipped meanwhile, too
            raise ConfigError(f"genome={path} must hold weights within +-{WEIGHT_LIMIT:g}, the largest is {largest:g}")
        return Genome(
            genes=genes,
            name=name,
            network=network,
            lights=int(arrays.get("lights", EPUCK.light.count)),
            plan=plan,
            signs=arrays.get("signs"),
            nominal=Nominal(**recorded) if recorded else None,
            **{fact: str(arrays[fact]) for fact in _TEXTS if fact in arrays},
        )
