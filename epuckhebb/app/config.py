"""The typed configuration: what keys there are, of which type, and what they may be. Values stand in `conf/`.

The schema is made of the dataclasses of the science itself (`Scenario`, `Hebbian`, `GA`, `Lifetime`), which check
their own ranges. This is the only file that knows where `conf/` is.
"""

import os
from dataclasses import dataclass, field
from typing import Any, TypeVar

from hydra.core.config_store import ConfigStore
from omegaconf import DictConfig, OmegaConf

from epuckhebb.app.errors import ConfigError
from epuckhebb.evolution.ga import GA
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
    """All keys of `epuckhebb evaluate`."""

    seed: int = 1
    genome: str = "reference"
    repeats: int = 10
    threads: int = 0
    scenario: Scenario = field(default_factory=Scenario)
    hebbian: Hebbian = field(default_factory=Hebbian)
    lifetime: Lifetime = field(default_factory=Lifetime)

    def __post_init__(self) -> None:
        """Refuse what cannot be run.

        Raises:
            ValueError: a value is outside the range named in the message.
        """
        _check_common(self.seed, self.threads)
        if self.repeats < 1:
            raise ValueError(f"repeats must be 1 or more, got {self.repeats}")


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


for _verb, _schema in (("evaluate", EvaluateConfig), ("evolve", EvolveConfig)):
    ConfigStore.instance().store(name=f"schema_{_verb}", node=_schema, provider="epuckhebb")

Config = TypeVar("Config", EvaluateConfig, EvolveConfig)


def typed(cfg: DictConfig, schema: type[Config]) -> Config:
    """The composed configuration as plain dataclasses, checked.

    Raises:
        ConfigError: a value is outside its range; the message names the key.
    """
    try:
        config: Any = OmegaConf.to_object(cfg)
    except ValueError as error:
        raise ConfigError(str(error)) from error
    assert isinstance(config, schema)
    return config


def thread_count(threads: int) -> int:
    """The number of threads to use; 0 stands for one a core."""
    if threads:
        return threads
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
