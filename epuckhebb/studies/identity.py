"""Names each job of a sweep by all that its result depends on."""

import json
from collections.abc import Sequence
from functools import cache
from typing import Any

from omegaconf import DictConfig

from epuckhebb.config import plugins
from epuckhebb.config.build import check_counts
from epuckhebb.config.compose import Plain
from epuckhebb.config.schema import EvaluateConfig, typed
from epuckhebb.config.stored import as_config
from epuckhebb.runs.evaluate import check_genome
from epuckhebb.runtime.errors import ConfigError
from epuckhebb.store import provenance
from epuckhebb.store.genome import load_genome
from epuckhebb.store.provenance import digest

NO_EFFECT = ("threads",)  # keys on which no result depends
_APART = ("seed", "repeats", "threads")  # keys that are checked by `check_counts` alone


class Identities:
    """Names the runs that configurations lead to, and checks the configurations.

    What many of them share is looked at once: so thousands of jobs can be named in seconds.
    """

    def __init__(self) -> None:
        self._asked: dict[str, EvaluateConfig] = {}
        self._more: dict[tuple[str, str], Plain] = {}
        self._load_genome = cache(load_genome)
        self._texts: dict[int, tuple[Any, str]] = {}  # of parts that jobs share; each is kept, so its id stays its own

    def of(self, config: Plain) -> str:
        """The name of the run that a configuration leads to with all that its results depend on at this moment.

        That is the genome, what it remembers if that is used, the user's own files, the science, and the packages that
        compute.

        Raises:
            ConfigError: A value or the genome cannot be used.
        """
        try:
            check_counts(**{key: config[key] for key in _APART})
        except ValueError as error:
            raise ConfigError(str(error)) from error
        shared = self.meet(config)
        if (shared, config["genome"]) not in self._more:
            self._more[shared, config["genome"]] = self._depends_on(config, self._asked[shared])
        return f"job_{digest([self.settings(config), self._more[shared, config['genome']]])[:12]}"

    def meet(self, config: Plain, cfg: DictConfig | None = None) -> str:
        """Check what many configurations share with this one, once; returns a digest of that.

        cfg: the same configuration as Hydra has it, if that has been made already.
        """
        shared = digest(self._texts_of(config, (*_APART, "genome")))
        if shared not in self._asked:
            self._asked[shared] = typed(cfg or as_config(config, "evaluate"), EvaluateConfig)
        return shared

    def settings(self, config: Plain) -> str:
        """A digest of a configuration, but for the keys on which no result depends."""
        return digest(self._texts_of(config, NO_EFFECT))

    def _texts_of(self, config: Plain, without: Sequence[str]) -> dict[str, str]:
        """The values of a configuration as JSON; those that jobs share are written once."""
        return {key: self._text(value) for key, value in config.items() if key not in without}

    def _text(self, value: Any) -> str:
        if not isinstance(value, dict | list):
            return json.dumps(value)
        if id(value) not in self._texts:
            self._texts[id(value)] = value, json.dumps(value, sort_keys=True)
        return self._texts[id(value)][1]

    def _depends_on(self, config: Plain, asked: EvaluateConfig) -> Plain:
        """On what else than its settings the results of a configuration depend."""
        genome = self._load_genome(config["genome"], asked.world.experiment, asked.layers)
        check_genome(genome, asked)
        over = [controller.adaptation for controller in asked.controllers]
        return {
            "genome": genome.sha256,
            "baseline": genome.nominal_sha256 if any(one.needs_nominal for one in over) else "",
            "self_memory": genome.self_memory_sha256 if any(one.self_check for one in over) else "",
            "own_code": plugins.sources(config),
            "science": provenance.science_version(),
            "packages": provenance.versions(provenance.NUMERIC),
        }
