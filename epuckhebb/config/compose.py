"""Composes a configuration with Hydra from the files of `conf/` and overrides, once or for many combinations."""

import functools
import re
from collections.abc import Iterable, Iterator
from contextlib import nullcontext
from typing import Any

from omegaconf import DictConfig, OmegaConf

from epuckhebb.config.catalogue import Composed, hydra_composition
from epuckhebb.config.overrides import OF_ENVIRONMENT, check_words, hydra_arguments, values_of
from epuckhebb.config.resolve import resolve
from epuckhebb.config.schema import SCHEMAS, Config, plain, typed
from epuckhebb.config.source import search_folders
from epuckhebb.config.values import Plain, converted, declared, field_types
from epuckhebb.runtime import ConfigError, working

_ALONE = ("genome", "seed", "repeats", "threads")  # keys on which nothing else in a configuration depends, unless:
_REFERENCE = re.compile(rf"\$\{{[^}}]*\b({'|'.join(_ALONE)})\b")


def load(schema: type[Config], overrides: list[str], config_dir: str | None = None) -> Config:
    """The checked configuration of a command, that of the schema: `conf/`, the user's folder and overrides as typed."""
    if hydra_arguments(schema.command, overrides)[0] != schema.command:
        chosen = next(word for word in overrides if word.startswith(("environment=", "experiment=")))
        shown = "`epuckhebb replay RUN` shows a lifetime of a run of `evaluate`"
        raise ConfigError(f"{chosen}: an environment is for `epuckhebb evolve`, `evaluate` and `sweep`; {shown}")
    config = load_any(schema.command, overrides, config_dir)
    assert isinstance(config, schema)
    return config


def load_any(command: str, overrides: list[str], config_dir: str | None = None) -> Any:
    """The checked configuration of `evolve` or `evaluate`, in the maze or in an environment."""
    command, words = _read(command, overrides)
    return typed(composed_with_hydra(command, words, config_dir).cfg, SCHEMAS[command])


def composed(command: str, overrides: list[str], config_dir: str | None = None) -> DictConfig:
    """The configuration that a command would run with these overrides, all names in it."""
    return composed_with_hydra(*_read(command, overrides), config_dir).cfg


def _read(command: str, overrides: list[str]) -> tuple[str, list[str]]:
    """The name of a configuration, and its words, which are checked."""
    name, words = hydra_arguments(command, overrides)
    if name in SCHEMAS:
        check_words(name, words)
    return name, words


def composed_with_hydra(command: str, words: list[str], config_dir: str | None) -> Composed:
    """A configuration, all names in it, with what Hydra keeps for itself. command, words: as of `hydra_arguments`."""
    found = hydra_composition(command, words, config_dir)
    resolve(command, found.cfg, found.choices, words, search_folders(found.hydra.runtime))
    return found


def swept_values(overrides: list[str], config_dir: str | None = None) -> dict[str, str]:
    """For each key the values that a named sweep of `evaluate` gives it; empty if the overrides name none."""
    params = hydra_composition(*_read("evaluate", overrides), config_dir).hydra.sweeper.params
    return {str(key): str(values) for key, values in (params or {}).items()}


def configurations(
    command: str, fixed: list[str], jobs: Iterable[tuple[str, ...]], config_dir: str | None
) -> Iterator[tuple[list[str], Plain]]:
    """The overrides of each job, and its configuration of plain values.

    A genome, a seed and the like are put into the plain values of what differs in nothing else. fixed: the overrides
    that all have.
    """

    @functools.cache
    def shared(words: tuple[str, ...]) -> tuple[Plain, bool]:
        """A configuration, and whether something in it refers to a genome, a seed or the like."""
        cfg = composed(command, [*fixed, *words], config_dir)
        return declared(SCHEMAS[command], plain(cfg)), bool(
            _REFERENCE.search(str(OmegaConf.to_container(cfg, resolve=False)))
        )

    @functools.cache
    def alone_as_declared(override: str) -> Plain:
        """A key and its value, of the type that the schema declares."""
        ((key, value),) = values_of([override]).items()
        return {key: converted(key, value, field_types(SCHEMAS[command])[key])}

    # In an environment, rule and network are those of the genome's evolution.
    keys = [key for key in _ALONE if key != "genome" or OF_ENVIRONMENT not in command]
    jobs = list(jobs)
    with working("Composing the settings of all jobs.") if len(jobs) > 1 else nullcontext():
        for overrides in jobs:
            alone = [word for word in overrides if word.partition("=")[0] in keys and "${" not in word]
            config, refers = shared(tuple(word for word in overrides if word not in alone))
            if refers:
                config = shared(tuple(overrides))[0]
            else:
                for override in alone:
                    config = {**config, **alone_as_declared(override)}
            yield list(overrides), config
