"""Names each job of a sweep by all that its result depends on."""

from collections.abc import Callable, Sequence
from functools import cache

from epuckhebb.config import EvaluateConfig, Plain, from_values, own_sources
from epuckhebb.controller.ranges import check_values
from epuckhebb.runs import prepare_evaluation
from epuckhebb.runtime import ConfigError
from epuckhebb.store import Genome, digest, fingerprint, load_genome
from epuckhebb.studies.jobs import NO_EFFECT
from epuckhebb.tmaze.maze import SIDES
from epuckhebb.tmaze.physics.pymunk import Pymunk

_APART = ("seed", "repeats", "threads")  # keys that are checked by themselves


def settings(config: Plain, without: Sequence[str] = NO_EFFECT) -> Plain:
    """A configuration without these keys, or without those on which no result depends."""
    return {key: value for key, value in config.items() if key not in without}


class Identities:
    """Names the runs of configurations, and checks the configurations.

    What many of them share is checked once, so thousands of jobs are named in seconds.
    """

    def __init__(self) -> None:
        self._shared: dict[str, EvaluateConfig] = {}
        self._genomes: dict[tuple[str, str], Genome] = {}
        self._load_genome = cache(load_genome)

    def of(self, config: Plain) -> str:
        """The name of the run of a configuration, from all that its results depend on at this moment."""
        try:
            check_values(EvaluateConfig, config)
        except ValueError as error:
            raise ConfigError(str(error)) from error
        shared = self.validate_shared(config)
        key = shared, config["genome"]
        if key not in self._genomes:
            job = self._shared[shared]
            genome = self._load_genome(config["genome"], job.world.experiment, job.shape)
            self._genomes[key] = prepare_evaluation(job, genome).genome
        return f"job_{fingerprint(settings(config), self._genomes[key], own_sources(config))}"

    def validate_shared(self, config: Plain, load: Callable[[], EvaluateConfig] | None = None) -> str:
        """Check, once, what many configurations share with this one; returns a digest of that.

        load: a quicker way to the checked configuration, if there is one.
        """
        shared = digest(settings(config, (*_APART, "genome")))
        if shared not in self._shared:
            self._shared[shared] = load() if load else from_values(config, EvaluateConfig, "a job")
        return shared

    def robot_steps(self, config: Plain) -> tuple[int, bool]:
        """How many steps all robots of an evaluation run, and whether they are in the plane."""
        shared = self._shared[self.validate_shared(config)]
        lifetimes = len(SIDES) * (1 + len(shared.controllers)) * int(config["repeats"])
        return lifetimes * shared.lifetime.steps, isinstance(shared.world.physics, Pymunk)
