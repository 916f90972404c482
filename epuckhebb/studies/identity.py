"""Names each job of a sweep by all that its result depends on."""

from collections.abc import Callable, Sequence
from functools import cache

from epuckhebb.config import EvaluateConfig, Plain, check_counts, from_values, own_sources
from epuckhebb.runs import prepare_evaluation
from epuckhebb.runtime import ConfigError
from epuckhebb.store import digest, load_genome, science_version, versions
from epuckhebb.studies.jobs import NO_EFFECT
from epuckhebb.tmaze.maze import SIDES
from epuckhebb.tmaze.physics.pymunk import Pymunk

_APART = ("seed", "repeats", "threads")  # keys that are checked by `check_counts` alone


def settings(config: Plain) -> str:
    """A digest of a configuration without the keys on which no result depends."""
    return digest(_without(config, NO_EFFECT))


def _without(config: Plain, keys: Sequence[str]) -> Plain:
    return {key: value for key, value in config.items() if key not in keys}


class Identities:
    """Names the runs of configurations, and checks the configurations.

    What many of them share is checked once, so thousands of jobs are named in seconds.
    """

    def __init__(self) -> None:
        self._shared: dict[str, EvaluateConfig] = {}
        self._more: dict[tuple[str, str], Plain] = {}
        self._load_genome = cache(load_genome)

    def of(self, config: Plain) -> str:
        """The name of the run of a configuration, from all that its results depend on at this moment.

        Besides the settings these are the genome, what it remembers if that is used, the user's own files, the science,
        and the numeric packages.
        """
        try:
            check_counts(config)
        except ValueError as error:
            raise ConfigError(str(error)) from error
        shared = self.validate_shared(config)
        if (shared, config["genome"]) not in self._more:
            self._more[shared, config["genome"]] = self._depends_on(config, self._shared[shared])
        return f"job_{digest([settings(config), self._more[shared, config['genome']]])[:12]}"

    def validate_shared(self, config: Plain, load: Callable[[], EvaluateConfig] | None = None) -> str:
        """Check, once, what many configurations share with this one; returns a digest of that.

        load: a quicker way to the checked configuration, if there is one.
        """
        shared = digest(_without(config, (*_APART, "genome")))
        if shared not in self._shared:
            self._shared[shared] = load() if load else from_values(config, EvaluateConfig, "a job")
        return shared

    def robot_steps(self, config: Plain) -> tuple[int, bool]:
        """How many steps all robots of an evaluation run, and whether they are in the plane."""
        shared = self._shared[self.validate_shared(config)]
        lifetimes = len(SIDES) * (1 + len(shared.controllers)) * int(config["repeats"])
        return lifetimes * shared.lifetime.steps, isinstance(shared.world.physics, Pymunk)

    def _depends_on(self, config: Plain, shared: EvaluateConfig) -> Plain:
        """What the results of a configuration depend on besides its settings."""
        genome = self._load_genome(config["genome"], shared.world.experiment, shared.shape)
        prepare_evaluation(shared, genome)
        adaptations = [controller.adaptation for controller in shared.controllers]
        return {
            "genome": genome.sha256,
            "nominal": genome.nominal_sha256 if any(one.needs_nominal for one in adaptations) else "",
            "own_code": own_sources(config),
            "science": science_version(),
            "packages": versions(),
        }
