"""Lists the jobs of one method on a leaderboard: its champions and their tests, each composed and checked."""

import functools
import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from epuckhebb.analysis import leaderboard as board
from epuckhebb.analysis.leaderboard import EVOLVED, PLAIN, POST_HOC, Row
from epuckhebb.config import (
    EvaluateConfig,
    EvolveConfig,
    alternatives,
    load,
    network_for,
    own_files,
    swept_values,
    typed_as,
)
from epuckhebb.controller.plasticity.rule import NoRule
from epuckhebb.runs import compile_for, prepare_evolution
from epuckhebb.runtime import ConfigError
from epuckhebb.studies.champions import evaluation_in, in_training_world, job_of, world_named
from epuckhebb.studies.jobs import Job
from epuckhebb.studies.methods import REVERSAL_TASK, Method
from epuckhebb.tmaze.individual import GA_ALONE
from epuckhebb.tmaze.own_fitness import PAPER_FITNESS
from epuckhebb.tmaze.physics.pymunk import PYMUNK
from epuckhebb.tmaze.scenario import TRAINED, Scenario
from epuckhebb.tmaze.task import Task

if TYPE_CHECKING:
    from epuckhebb.studies.leaderboard import Leaderboard

REVERSAL = board.REVERSAL
_NAMES = re.compile(r"[^\[\],\s'\"]+")  # in a value of a sweep, one or a list of them
_PARTS = ("network", "fitness", "physics")  # groups of settings with which champions are tested as they evolved
_OF_RULES = ("merges", "merge_every")  # settings of optimizers that concern nothing but rules


@dataclass(frozen=True, kw_only=True)
class Entry:
    """A method in an experiment, with its jobs by seed."""

    method: Method
    row: Row  # what the tables say of it
    champions: dict[int, Job]  # the jobs that evolve its champions, or the rules for them
    tests: dict[int, Job]  # the jobs that test these
    before: dict[int, Job]  # the jobs that evolve the champions for which rules are evolved
    config: EvolveConfig | None  # how it is evolved, if it is
    task: Task  # what it is evolved for


@functools.cache
def _swept(name: str, config_dir: str | None) -> tuple[str, ...]:
    """The worlds of a named sweep."""
    params = swept_values([f"experiment={name}"], config_dir)
    if "scenario" not in params:
        raise ConfigError(f"tests={name}: this sweep of conf/experiment/ names no scenarios in hydra.sweeper.params")
    swept = alternatives([f"{key}={params[key]}" for key in ("scenario", "change") if key in params])
    values = [[_NAMES.findall(word.partition("=")[2]) for word in words] for words in swept.values()]
    return tuple("+".join(itertools.chain(*names)) for names in itertools.product(*values))


def tests_of(sweeps: Sequence[str], config_dir: str | None) -> dict[str, dict[str, Scenario]]:
    """The test worlds of every experiment: those of these sweeps, without the training world."""
    tests: dict[str, dict[str, Scenario]] = {one: {} for one in TRAINED}
    for name in (name for sweep in sweeps for name in _swept(sweep, config_dir)):
        world = world_named(name, config_dir)
        if name != TRAINED[world.experiment]:
            tests[world.experiment][name] = world
    return tests


def sweep_of(sweeps: Sequence[str], config_dir: str | None) -> dict[str, str]:
    """The first sweep that has a test world, by the name of the world."""
    return {name.replace("+", "_"): sweep for sweep in reversed(sweeps) for name in _swept(sweep, config_dir)}


class Planner:
    """Makes the entries of an experiment, each after those that it needs."""

    def __init__(self, study: "Leaderboard", experiment: str, tests: dict[str, Scenario]) -> None:
        self._study, self._experiment, self._tests = study, experiment, tests
        self._training_world = TRAINED.get(experiment, TRAINED["obstacles"])
        self._task = tuple(typed_as(REVERSAL_TASK)) if experiment == REVERSAL else ()
        self._entries = dict[str, Entry]()

    def entry(self, method: Method) -> Entry:
        """The entry of a method; an error message begins with its name."""
        try:
            self._entries[method.name] = self._entry(method)
        except ConfigError as error:
            raise ConfigError(f"method {method.name}: {error}") from error
        return self._entries[method.name]

    def _entry(self, method: Method) -> Entry:
        study, over = self._study, self._entries.get(method.champions_of)
        if over and over.row.kind != PLAIN:
            raise ConfigError(
                f"champions_of={method.champions_of}: its champions were evolved with a rule of their own; no other "
                "can be added; give a method without plasticity"
            )
        config, champions = None, over.champions if over else {}
        if method.evolve:
            world = [] if "scenario" in method.evolve else [f"scenario={self._training_world}"]
            given = ["genome=given"] if method.champions_of else []
            config = load(EvolveConfig, [*world, *method.overrides("evolve"), *given], study.config_dir)
            self._check(config)
            champions = {
                seed: job_of(
                    [*method.overrides("evolve"), f"seed={seed}"],
                    {**config.values, "seed": seed},
                    champion=over.champions[seed].run if over else "",
                    purpose=f"evolve {method.name}, {self._experiment}, seed {seed}",
                )
                for seed in range(study.first_seed, study.first_seed + study.champions)
            }
            tested = dict(in_training_world(self._training_world, self._task, study.config_dir).values)
            tested |= {group: config.values[group] for group in ("hebbian", *_PARTS)}
            controller = config.controller
        else:
            evaluation = self._post_hoc(method, over)
            tested, controller = dict(evaluation.values), next(iter(evaluation.controllers), GA_ALONE)
        repeats = study.reversal_repeats if self._experiment == REVERSAL else study.repeats
        tested |= {"seed": study.seed, "repeats": repeats}
        is_plain = config is not None and isinstance(config.controller.rule, NoRule)
        if is_plain and method.champions_of:
            raise ConfigError("it has no plasticity: it adds nothing to champions; leave out champions_of")
        if not is_plain and not method.compared_with:
            raise ConfigError("matched_control is missing: name the method that is the same without plasticity")
        if method.matched_control and config is not None:
            _check_control(config, self._entries[method.matched_control], is_plain=is_plain)
        evolved = config or (over.config if over else None)
        assert evolved is not None  # a method evolves, or takes another's champions
        tests = {
            seed: job_of(
                [f"genome={champion.run}", *method.overrides("evaluate")],
                tested,
                champion=champion.run,
                purpose=f"test {method.name}, {self._experiment}, seed {seed}",
                worlds=[self._training_world, *self._tests],
                config_dir=study.config_dir,
            )
            for seed, champion in champions.items()
        }
        row = Row(
            experiment=self._experiment,
            method=method.name,
            kind=PLAIN if is_plain else EVOLVED if method.evolve else POST_HOC,
            matched_control=method.compared_with,
            evolved_parameters=evolved.plan.genes,
            knowledge=", ".join(controller.knowledge),
            knowledge_class=controller.knowledge_class,
        )
        before = over.champions if over and method.evolve else {}
        task = evolved.world.task
        return Entry(method=method, row=row, champions=champions, tests=tests, before=before, config=config, task=task)

    def _check(self, config: EvolveConfig) -> None:
        """Refuse methods that cannot be evolved here, and training in a test world."""
        for name, world in self._tests.items():
            if board.can_be(config.world, config.training, world):
                raise ConfigError(
                    f"its training world can be {name}, which is one of the tests' own "
                    f"(tests={','.join(self._study.tests)}): champions must not be trained in it. Train "
                    "it elsewhere, or leave these tests out"
                )
        prepared = prepare_evolution(config, has_genome=False)
        if own_files(config.values):
            prepared.compile()

    def _post_hoc(self, method: Method, over: Entry | None) -> EvaluateConfig:
        """How champions are tested with what is added after evolution."""
        evolved = over.config.values if over and over.config else {}
        parts = {f"{group}.{key}": value for group in _PARTS for key, value in evolved.get(group, {}).items()}
        words = evaluation_in(self._training_world, *typed_as(parts), *method.overrides("evaluate"))
        config = load(EvaluateConfig, words, self._study.config_dir)
        if own_files(config.values):
            compile_for(config.controllers, network_for(config.world, config.shape), config.world)
        return config


def _check_control(config: EvolveConfig, matched_control: Entry, *, is_plain: bool) -> None:
    """Refuse a matched control that differs in more than plasticity; of a method without it, in more than one part."""
    other, name = matched_control.config, matched_control.method.name
    if matched_control.row.kind != PLAIN or other is None:
        raise ConfigError(f"matched_control={name} has plasticity itself; give a method without")
    ours, theirs = _but_for_plasticity(config), _but_for_plasticity(other)
    differ = [what for what, value in ours.items() if value != theirs[what]]
    if len(differ) != is_plain or not {*differ} <= {*_PARTS, "optimizer"}:
        raise ConfigError(
            f"matched_control={name} differs in {' and '.join(differ) or 'nothing'}; it must differ in plasticity "
            f"alone, or for a method without plasticity in one of {', '.join(_PARTS)} and optimizer"
        )


def _but_for_plasticity(config: EvolveConfig) -> dict[str, object]:
    """How something is evolved; of the optimizer only settings that concern any evolution."""
    settings = {name: value for name, value in vars(config.algorithm).items() if name not in _OF_RULES}
    return {
        "optimizer": (type(config.algorithm), settings),
        "training": config.training,
        "scenario": replace(config.world, fitness=PAPER_FITNESS, physics=PYMUNK),
        "lifetime": config.lifetime,
        "fitness": config.world.fitness,
        "network": config.shape,
        "physics": config.world.physics,
    }
