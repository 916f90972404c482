"""The typed configuration: what keys there are, of which type, and what they may be. Values stand in `conf/`.

Parts that are dataclasses of the science (`GA`, `Lifetime`, `Lamp`, `Adaptation`) are the schema themselves; those
that a user can bring (a rule, a maze, a robot) are open here, and checked when they are made (`epuckhebb.app.parts`).
"""

import difflib
import functools
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any, TypeVar

import yaml
from hydra.core.config_store import ConfigStore
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from epuckhebb.app import machine, runs
from epuckhebb.app.earlier import of_today
from epuckhebb.app.errors import ConfigError
from epuckhebb.app.parts import (
    check_pace,
    check_self_check,
    check_signal,
    check_task,
    compared,
    controller_from,
    network_for,
    optimizer_from,
    scenario_from,
    with_controls,
)
from epuckhebb.evolution.evolve import evolved_plan
from epuckhebb.evolution.optimizers.ga import GA
from epuckhebb.evolution.training import Training
from epuckhebb.sim.adaptation.adaptation import Adaptation
from epuckhebb.sim.controller import GA_ALONE
from epuckhebb.sim.fitness import Signal
from epuckhebb.sim.lifetime import Lifetime
from epuckhebb.sim.light import Lamp
from epuckhebb.sim.tasks.trial import ONE_TRIAL

_MOST_THREADS = 1024  # more than cores of any machine there is; a system may refuse to start more


def check_counts(seed: int, threads: int, repeats: int = 1) -> None:
    """Refuse numbers of these keys that cannot be.

    Raises:
        ValueError: One is outside the range named in the message.
    """
    if seed < 0:
        raise ValueError(f"seed must be 0 or more, got {seed}")
    if repeats < 1:
        raise ValueError(f"repeats must be 1 or more, got {repeats}")
    if not 0 <= threads <= _MOST_THREADS:
        raise ValueError(f"threads must lie between 0 (one for each core) and {_MOST_THREADS}, got {threads}")


@dataclass(kw_only=True)
class ScenarioConfig:
    """The keys of a scenario; see `epuckhebb.sim.scenario.Scenario`, which comes of it, the maze and the robot."""

    name: str = ""
    experiment: str = "obstacles"
    light: float = 0.1
    obstacles: int = 0
    layout: int = 0
    goals: Any = None
    dead_sensors: Any = field(default_factory=list)
    distance_gain: float = 1.0
    distance_offset: float = 0.0
    left_wheel: float = 1.0
    right_wheel: float = 1.0
    left_slip: float = 0.0
    right_slip: float = 0.0
    mass_ratio: float = 1.0
    wall_friction: float = 0.0
    lamp: Lamp = field(default_factory=Lamp)
    changes: list[Any] = field(default_factory=list)
    paper_N: float = 0.000015
    paper_duration_s: float = 250.0


@dataclass(kw_only=True)
class NetworkConfig:
    """The keys of a network. layers: None where they follow from the genome, or from the robot."""

    layers: list[int] | None = None


@dataclass(kw_only=True)
class WorldConfig:
    """The keys that `evaluate` and `evolve` have in common, and the world that comes of them.

    world: the scenario, with its maze and robot. layers: of the network; None if they were left open.
    """

    seed: int = 1
    threads: int = 0
    scenario: ScenarioConfig = field(default_factory=ScenarioConfig)
    maze: dict[str, Any] = field(default_factory=dict)
    robot: dict[str, Any] = field(default_factory=dict)
    network: NetworkConfig = field(default_factory=NetworkConfig)
    hebbian: dict[str, Any] = field(default_factory=dict)
    lifetime: Lifetime = field(default_factory=Lifetime)
    task: dict[str, Any] = field(default_factory=lambda: {"kind": ONE_TRIAL.name})
    changed: str | None = None

    def __post_init__(self) -> None:
        """Refuse what cannot be run.

        Raises:
            ValueError: a value is outside the range named in the message.
        """
        check_counts(self.seed, self.threads)
        self.world = scenario_from(self.scenario, self.maze, self.robot, self.task)
        self.layers = None if self.network.layers is None else tuple(self.network.layers)
        if self.layers is not None:
            network_for(self.world, self.layers)
        check_pace(self.lifetime, self.world)


@dataclass(kw_only=True)
class EvaluateConfig(WorldConfig):
    """All keys of `epuckhebb evaluate`.

    controllers: what comes of them, `hebbian` with `adaptation` (unless both are none), the same with its reward
    inverted if it hears one, and those of `compare`.
    """

    genome: str = "reference"
    repeats: int = 10
    adaptation: Adaptation = field(default_factory=Adaptation)
    compare: dict[str, Any] = field(default_factory=dict)  # name -> what differs from the paper's rule

    def __post_init__(self) -> None:
        """Refuse what cannot be run.

        Raises:
            ValueError: a value is outside the range named in the message.
        """
        super().__post_init__()
        check_counts(self.seed, self.threads, self.repeats)
        main = controller_from(self.hebbian, self.adaptation)
        given = with_controls(main, self.world.task)
        others = [compared(name, settings, self.scenario.paper_N) for name, settings in self.compare.items()]
        self.controllers = [*given, *(other for other in others if other != main)]
        names = [GA_ALONE.name, *(controller.name for controller in self.controllers)]
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice:
            raise ValueError(
                f"the name {twice} is taken by another controller of this run; they are told apart by their names: "
                f"{', '.join(names)}. Give hebbian.name, adaptation.name or the name below compare another one"
            )
        for controller in self.controllers:
            check_signal(controller, self.world.robot)
            check_task(controller, self.world.task)
            check_self_check(controller.adaptation, self.world, self.lifetime)


@dataclass(kw_only=True)
class EvolveConfig(WorldConfig):
    """All keys of `epuckhebb evolve`.

    genome: whose weights all individuals are given, so that only the rule is evolved; None for weights that evolve.
    controller: what drives the robots besides their genes. algorithm: the optimizer, of `optimizer` and `ga`. schedule:
    how long it goes on. plan: what is evolved.
    """

    genome: str | None = None
    ga: GA | None = field(default_factory=GA)  # None if the optimizer is another
    optimizer: dict[str, Any] = field(default_factory=lambda: {"algorithm": GA.key})
    training: Training = field(default_factory=Training)

    def __post_init__(self) -> None:
        """Refuse what cannot be run.

        Raises:
            ValueError: a value is outside the range named in the message.
        """
        super().__post_init__()
        self.controller = controller_from(self.hebbian, Adaptation())
        check_signal(self.controller, self.world.robot)
        check_task(self.controller, self.world.task)
        self.algorithm = optimizer_from(self.optimizer, self.ga)
        self.schedule = self.algorithm.schedule(self.training, self.lifetime)
        self.training.check(self.world, self.lifetime, self.schedule.loops)
        network = network_for(self.world, self.layers)
        self.plan = evolved_plan(network, self.controller.rule, given=self.genome is not None)
        self.algorithm.check(self.plan)


class LiveFitness(Enum):
    """Which live fitness a reproduction uses: as the paper says, or as each of its two programs does."""

    paper = "paper"
    as_coded = "as_coded"

    def of(self, experiment: str) -> Signal:
        """The signal of an experiment."""
        if self is LiveFitness.paper:
            return Signal.behaviour
        return Signal.light_code if experiment == "light" else Signal.lifetime_mean


@dataclass(kw_only=True)
class ReproduceConfig:
    """All keys of `epuckhebb reproduce`."""

    champions: int = 20
    first_seed: int = 1
    seed: int = 1
    repeats: int = 10
    rates: list[float] = field(default_factory=list)
    signal: LiveFitness = LiveFitness.paper
    genome: str | None = None
    threads: int = 0
    ga: GA = field(default_factory=GA)

    def __post_init__(self) -> None:
        """Refuse what cannot be run.

        Raises:
            ValueError: a value is outside the range named in the message.
        """
        check_counts(self.seed, self.threads, self.repeats)
        for name, least in (("champions", 1), ("first_seed", 0)):
            if getattr(self, name) < least:
                raise ValueError(f"{name} must be {least} or more, got {getattr(self, name)}")
        for rate in self.rates:
            if not (math.isfinite(rate) and rate > 0):
                raise ValueError(f"rates must be numbers above 0 (0 is always run, as the GA alone), got {rate}")


@dataclass(kw_only=True)
class LeaderboardConfig:
    """All keys of `epuckhebb leaderboard`."""

    methods: list[str] = field(default_factory=list)
    tests: list[str] = field(default_factory=list)
    champions: int = 12
    first_seed: int = 201
    seed: int = 1
    repeats: int = 3
    reversal_repeats: int = 100

    def __post_init__(self) -> None:
        """Refuse what cannot be run.

        Raises:
            ValueError: a value is outside the range named in the message.
        """
        check_counts(self.seed, 0, self.repeats)
        for name, least in (("champions", 1), ("first_seed", 0), ("reversal_repeats", 1)):
            if getattr(self, name) < least:
                raise ValueError(f"{name} must be {least} or more, got {getattr(self, name)}")
        if not self.tests:
            raise ValueError(
                "tests must name one sweep of conf/experiment/ or more, in whose worlds champions are tested"
            )


SCHEMAS = {
    "evaluate": EvaluateConfig,
    "evolve": EvolveConfig,
    "reproduce": ReproduceConfig,
    "leaderboard": LeaderboardConfig,
}
# Below these, the schema does not know the keys.
OPEN = ("hebbian", "compare", "maze", "robot", "optimizer", "task", "scenario.goals")
for _verb, _schema in SCHEMAS.items():
    _node = OmegaConf.structured(_schema)
    for _key in ("hebbian", "compare", "optimizer", "task"):
        if _key in _node:
            OmegaConf.set_struct(_node[_key], False)  # Hydra takes any key below them, without a +
    if _schema is EvolveConfig:
        _node.ga = None  # until group ga is chosen, which other optimizers than the GA undo
    ConfigStore.instance().store(name=f"schema_{_verb}", node=_node, provider="epuckhebb")

Config = TypeVar("Config", EvaluateConfig, EvolveConfig, ReproduceConfig, LeaderboardConfig)


def typed(cfg: DictConfig, schema: type[Config]) -> Config:
    """The composed configuration as plain dataclasses, checked.

    Raises:
        ConfigError: A key is unknown or a value is outside its range; the message names the key.
    """
    known = _known_keys(schema.__name__)
    for key in _keys_below(cfg, ""):
        if key not in known and not key.startswith(tuple(f"{open_}." for open_ in OPEN)):
            near = near_keys(key, known)
            raise ConfigError(f"{key} is not a key of this configuration" + (f"; did you mean {near}?" if near else ""))
    try:
        config: Any = OmegaConf.to_object(cfg)
    except ConfigError:
        raise
    except (ValueError, OmegaConfBaseException) as error:
        raise ConfigError(str(error).splitlines()[0]) from error
    if not isinstance(config, schema):
        raise ConfigError("the configuration is not one of this verb")
    return config


@functools.cache
def _known_keys(schema: str) -> list[str]:
    kind = next(kind for kind in SCHEMAS.values() if kind.__name__ == schema)
    return list(_keys_below(OmegaConf.structured(kind), ""))


def near_keys(key: str, known: list[str]) -> str:
    """The known keys that are like one that is not known, by their whole or by their last part."""
    last = key.rpartition(".")[2]
    same = [other for other in known if other.rpartition(".")[2] == last]
    return ", ".join(same[:3] or difflib.get_close_matches(key, known, n=3))


def _keys_below(node: Any, prefix: str) -> Iterator[str]:
    """All keys of a configuration, dotted; of a list, only its own."""
    for key in node:
        yield f"{prefix}{key}"
        value = node._get_node(key)
        if isinstance(value, DictConfig) and not (value._is_none() or value._is_missing()):
            yield from _keys_below(value, f"{prefix}{key}.")


def stored(run: Path, verb: str) -> DictConfig:
    """The configuration that a run of this verb wrote down.

    Raises:
        ConfigError: It cannot be read, was changed since, or holds what this program does not know.
    """
    runs.content(run, runs.CONFIG)  # it is as it was written
    return read_config(run / runs.CONFIG, verb)


def read_config(file: Path, verb: str) -> DictConfig:
    """A configuration that was written down whole, all names and values in it.

    Raises:
        ConfigError: It cannot be read, or holds what this program does not know.
    """
    try:
        held = OmegaConf.to_container(OmegaConf.load(file))
        cfg = as_config(held, verb) if isinstance(held, dict) and held else None
    except Exception as error:  # what damaged settings may raise has no end
        raise ConfigError(f"{file} cannot be used: {error}") from error
    if cfg is None:
        raise ConfigError(f"{file} cannot be used: it holds no settings")
    return cfg


def as_config(held: Mapping[Any, Any], verb: str) -> DictConfig:
    """The configuration of a verb that these plain values are, all names among them; no text refers to another.

    Raises:
        OmegaConfBaseException: They hold what this program does not know.
    """
    cfg = OmegaConf.merge(_keys_of(verb), of_today(_literally(dict(held))))
    assert isinstance(cfg, DictConfig)
    return cfg


@functools.cache
def _keys_of(verb: str) -> DictConfig:
    """The keys of a verb with their types, made once: every job of a sweep has them."""
    schema = OmegaConf.structured(SCHEMAS[verb])
    assert isinstance(schema, DictConfig)
    return schema


def literal(text: str) -> str:
    """A text as a configuration has to be given it, so that a `${...}` in it, of a folder's name, means nothing."""
    return re.sub(r"(\\*)\$\{", lambda found: f"{2 * found[1]}\\${{", text)


def _literally(told: Any) -> Any:
    """What was written down with all values in it: no text in it refers to another."""
    if isinstance(told, dict):
        return {str(key): _literally(value) for key, value in told.items()}
    if isinstance(told, list):
        return [_literally(value) for value in told]
    return literal(told) if isinstance(told, str) else told


def settings(file: Path) -> dict[str, Any]:
    """The settings in such a file as they stand there, whatever they are.

    Raises:
        ConfigError: It holds none.
    """
    try:
        held = yaml.safe_load(file.read_bytes())
    except Exception as error:  # what damaged text may raise has no end
        raise ConfigError(f"{file} cannot be used: {error}") from error
    if not isinstance(held, dict):
        raise ConfigError(f"{file} cannot be used: it holds no settings")
    return {str(key): value for key, value in held.items()}


def thread_count(threads: int) -> int:
    """The number of threads to use; 0 stands for one for each core that this process, or its container, may use."""
    return threads or machine.cores()
