"""Compose a configuration without running anything: for the Python interface, and to check a sweep before it starts."""

import copy
import itertools
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from epuckhebb.app import genomes
from epuckhebb.app.config import EvaluateConfig, EvolveConfig, typed
from epuckhebb.app.data import data_folder, groups
from epuckhebb.app.errors import ConfigError
from epuckhebb.app.hydra_bridge import explain, version_base

_CHECKED_IN_FULL = 20  # a longer list of values is checked at its two ends
_VALUE_KEY = re.compile(r"[\w.]+")  # of a plain override: nothing added, deleted, or put into another package


def composed(verb: str, overrides: list[str], config_dir: str | None = None, *, with_hydra: bool = False) -> DictConfig:
    """The configuration that a verb would run with these overrides.

    config_dir: a folder with more configuration files. with_hydra: include what Hydra keeps for itself.

    Raises:
        ConfigError: they do not make one.
    """
    more = [f'hydra.searchpath=["file://{Path(config_dir).absolute()}"]'] if config_dir else []
    GlobalHydra.instance().clear()
    try:
        with initialize_config_dir(str(data_folder("conf")), **version_base()):
            return compose(verb, [*overrides, *more], return_hydra_config=with_hydra)
    except (HydraException, OmegaConfBaseException) as error:
        raise ConfigError(explain(error)) from error


def combinations(
    verb: str, fixed: list[str], choices: dict[str, list[str]], config_dir: str | None
) -> Iterator[tuple[list[str], DictConfig]]:
    """Every combination of the choices (as from `alternatives`), as overrides and composed.

    Hydra takes a tenth of a second for each composition, so values are put into a copy of what is composed from the
    groups alone; what cannot be put in so simply is left to Hydra, which may also explain why not.

    Raises:
        ConfigError: an override cannot be used.
    """

    @cache
    def prepared(overrides: tuple[str, ...]) -> DictConfig:
        return composed(verb, [*fixed, *overrides], config_dir)

    @cache
    def parsed(override: str) -> tuple[str, Any]:
        one = OverridesParser.create().parse_override(override)
        return one.key_or_group, one.value()

    values = {key for key in choices if _VALUE_KEY.fullmatch(key) and key not in groups(verb)}
    for overrides in itertools.product(*choices.values()):
        told = list(zip(choices, overrides, strict=True))
        cfg = copy.deepcopy(prepared(tuple(override for key, override in told if key not in values)))
        try:
            for key, override in told:
                if key in values:
                    OmegaConf.update(cfg, *parsed(override))
        except OmegaConfBaseException:
            cfg = composed(verb, [*fixed, *overrides], config_dir)
        yield list(overrides), cfg


def check_single(verb: str, overrides: list[str], config_dir: str | None) -> None:
    """Refuse to run a named sweep as one job, which Hydra would do without a word.

    Raises:
        ConfigError: an experiment is named that sweeps.
    """
    named = [override for override in overrides if override.lstrip("+").startswith("experiment=")]
    if named and composed(verb, overrides, config_dir, with_hydra=True).hydra.sweeper.params:
        name = named[-1].partition("=")[2]
        raise ConfigError(f"experiment={name} is a sweep of many jobs: run `epuckhebb sweep {name}`, or add --multirun")


def check(verb: str, overrides: list[str], config_dir: str | None = None) -> None:
    """Refuse what a run with these overrides would refuse.

    Raises:
        ConfigError: a key, a value or the genome cannot be used.
    """
    if verb == "evolve":
        typed(composed(verb, overrides, config_dir), EvolveConfig)
    else:
        config = typed(composed(verb, overrides, config_dir), EvaluateConfig)
        genomes.load(config.genome, config.scenario.experiment)


def check_sweep(verb: str, overrides: list[str], config_dir: str | None = None) -> None:
    """Refuse a multirun of which a job would be refused, before any has run.

    Every value of every swept key is tried once, with the first values of the others: a sum, not a product.

    Raises:
        ConfigError: a key, a value or the genome cannot be used.
    """
    choices = list(alternatives(overrides).values())
    first = [values[0] for values in choices]
    check(verb, first, config_dir)
    for place, values in enumerate(choices):
        for value in values[1:] if len(values) <= _CHECKED_IN_FULL else values[-1:]:
            check(verb, [*first[:place], value, *first[place + 1 :]], config_dir)


def alternatives(overrides: list[str]) -> dict[str, list[str]]:
    """For each key the overrides that it is to have in turn; a key that comes again replaces the earlier one.

    Raises:
        ConfigError: they cannot be read.
    """
    try:
        return {
            override.get_key_element(): _choices(override)
            for override in OverridesParser.create().parse_overrides(overrides)
        }
    except HydraException as error:
        raise ConfigError(explain(error)) from error


def _choices(override: Override) -> list[str]:
    """The overrides that a swept one stands for; itself if it is not swept, or only its sweeper knows."""
    if not override.is_discrete_sweep():
        return [override.input_line or ""]
    return [f"{override.get_key_element()}={value}" for value in override.sweep_string_iterator()]
