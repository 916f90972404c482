"""The typed configuration: what keys there are, of which type, and what they may be. Values stand in `conf/`.

The schema is made of the dataclasses of the science itself (`Scenario`, `Hebbian`, `GA`, `Lifetime`), which check
their own ranges.
"""

import json
import math
import os
from dataclasses import dataclass, field
from enum import Enum
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from hydra.core.config_store import ConfigStore
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from yaml import YAMLError

from epuckhebb.app.errors import ConfigError
from epuckhebb.evolution.ga import GA
from epuckhebb.sim.fitness import Signal
from epuckhebb.sim.lifetime import Lifetime
from epuckhebb.sim.plasticity import Hebbian
from epuckhebb.sim.scenario import Scenario


def _check_common(seed: int, threads: int) -> None:
    if seed < 0:
        raise ValueError(f"seed must be 0 or more, got {seed}")
    if threads < 0:
        raise ValueError(f"threads must be 0 (one for each core) or more, got {threads}")


@dataclass(kw_only=True)
class EvaluateConfig:
    """All keys of `epuckhebb evaluate`.

    plasticities: what comes of them, `hebbian` (unless it is none) and those of `compare`.
    """

    seed: int = 1
    genome: str = "reference"
    repeats: int = 10
    threads: int = 0
    scenario: Scenario = field(default_factory=Scenario)
    hebbian: Hebbian = field(default_factory=Hebbian)
    compare: dict[str, Any] = field(default_factory=dict)  # name -> what differs from the paper's rule
    lifetime: Lifetime = field(default_factory=Lifetime)

    def __post_init__(self) -> None:
        """Refuse what cannot be run.

        Raises:
            ValueError: a value is outside the range named in the message.
        """
        _check_common(self.seed, self.threads)
        if self.repeats < 1:
            raise ValueError(f"repeats must be 1 or more, got {self.repeats}")
        self.plasticities = [] if self.hebbian.name == "none" else [self.hebbian]
        self.plasticities += [_compared(name, json.dumps(settings)) for name, settings in self.compare.items()]


@cache  # a sweep asks for the same ones in every job
def _compared(name: str, settings: str) -> Hebbian:
    """The plasticity of this name; settings: in JSON, what differs from the paper's rule."""
    if name in ("GA", "none", "paper"):
        raise ValueError(f"compare.{name}: the name is taken (GA is the control that always runs); give another")
    try:
        hebbian = OmegaConf.to_object(
            OmegaConf.merge(OmegaConf.structured(Hebbian), json.loads(settings) or {}, {"name": name})
        )
    except (OmegaConfBaseException, ValueError) as error:
        raise ValueError(f"compare.{name}: {str(error).splitlines()[0].removeprefix('hebbian.')}") from error
    assert isinstance(hebbian, Hebbian)
    return hebbian


@dataclass(kw_only=True)
class EvolveConfig:
    """All keys of `epuckhebb evolve`."""

    seed: int = 1
    threads: int = 0
    scenario: Scenario = field(default_factory=Scenario)
    ga: GA = field(default_factory=GA)
    lifetime: Lifetime = field(default_factory=Lifetime)

    def __post_init__(self) -> None:
        """Refuse what cannot be run.

        Raises:
            ValueError: a value is outside the range named in the message.
        """
        _check_common(self.seed, self.threads)


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
        _check_common(self.seed, self.threads)
        for name, least in (("champions", 1), ("repeats", 1), ("first_seed", 0)):
            if getattr(self, name) < least:
                raise ValueError(f"{name} must be {least} or more, got {getattr(self, name)}")
        for rate in self.rates:
            if not (math.isfinite(rate) and rate > 0):
                raise ValueError(f"rates must be numbers above 0 (0 is always run, as the GA alone), got {rate}")


SCHEMAS = {"evaluate": EvaluateConfig, "evolve": EvolveConfig, "reproduce": ReproduceConfig}
for _verb, _schema in SCHEMAS.items():
    ConfigStore.instance().store(name=f"schema_{_verb}", node=_schema, provider="epuckhebb")

Config = TypeVar("Config", EvaluateConfig, EvolveConfig, ReproduceConfig)


def typed(cfg: DictConfig, schema: type[Config]) -> Config:
    """The composed configuration as plain dataclasses, checked.

    Raises:
        ConfigError: A value is outside its range; the message names the key.
    """
    try:
        config: Any = OmegaConf.to_object(cfg)
    except ValueError as error:
        raise ConfigError(str(error)) from error
    assert isinstance(config, schema)
    return config


def stored(run: Path, verb: str) -> DictConfig:
    """The configuration that a run of this verb wrote down.

    Raises:
        ConfigError: It cannot be read, or holds what this program does not know.
    """
    file = run / ".hydra" / "config.yaml"
    try:
        cfg = OmegaConf.merge(OmegaConf.structured(SCHEMAS[verb]), OmegaConf.load(file))
    except (OSError, YAMLError, OmegaConfBaseException) as error:
        raise ConfigError(f"{file} cannot be used: {error}") from error
    assert isinstance(cfg, DictConfig)
    return cfg


def thread_count(threads: int) -> int:
    """The number of threads to use; 0 stands for one a core."""
    if threads:
        return threads
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
