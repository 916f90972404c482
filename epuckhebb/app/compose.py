"""Compose a configuration without running anything: for the Python interface, and to check a sweep before it starts."""

from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.errors import HydraException
from omegaconf import DictConfig
from omegaconf.errors import OmegaConfBaseException

from epuckhebb.app import genomes
from epuckhebb.app.config import EvaluateConfig, EvolveConfig, typed
from epuckhebb.app.data import data_folder
from epuckhebb.app.errors import ConfigError
from epuckhebb.app.hydra_bridge import explain

_CHECKED_IN_FULL = 20  # a longer list of values is checked at its two ends


def composed(verb: str, overrides: list[str]) -> DictConfig:
    """The configuration that a verb would run with these overrides.

    Raises:
        ConfigError: they do not make one.
    """
    GlobalHydra.instance().clear()
    try:
        with initialize_config_dir(str(data_folder("conf")), version_base="1.3"):
            return compose(verb, overrides)
    except (HydraException, OmegaConfBaseException) as error:
        raise ConfigError(explain(error)) from error


def check(verb: str, overrides: list[str]) -> None:
    """Refuse what a run with these overrides would refuse.

    Raises:
        ConfigError: a key, a value or the genome cannot be used.
    """
    if verb == "evolve":
        typed(composed(verb, overrides), EvolveConfig)
    else:
        config = typed(composed(verb, overrides), EvaluateConfig)
        genomes.load(config.genome, config.scenario.experiment)


def check_sweep(verb: str, overrides: list[str]) -> None:
    """Refuse a multirun of which a job would be refused, before any has run.

    Every value of every swept key is tried once, with the first values of the others: a sum, not a product.

    Raises:
        ConfigError: a key, a value or the genome cannot be used.
    """
    try:
        parsed = OverridesParser.create().parse_overrides(overrides)
        choices = [_choices(override) for override in parsed]
    except HydraException as error:
        raise ConfigError(explain(error)) from error
    first = [values[0] for values in choices]
    check(verb, first)
    for place, values in enumerate(choices):
        for value in values[1:] if len(values) <= _CHECKED_IN_FULL else values[-1:]:
            check(verb, [*first[:place], value, *first[place + 1 :]])


def _choices(override: Override) -> list[str]:
    """The overrides that a swept one stands for; itself if it is not swept, or only its sweeper knows."""
    if not override.is_discrete_sweep():
        return [override.input_line or ""]
    return [f"{override.get_key_element()}={value}" for value in override.sweep_string_iterator()]
