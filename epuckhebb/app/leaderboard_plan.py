"""What belongs to a leaderboard: its methods, champions and test worlds, each composed and checked before any is made.

A job evolves one champion, or lets one live in its training world and in all test worlds. A job is known by all that
its result depends on: its settings, the job that made its champion, the worlds, rules of the user's own, the science.
"""

import copy
import functools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from omegaconf import DictConfig

from epuckhebb.app import engine, evaluate, evolve, hydra_bridge, runs
from epuckhebb.app.config import EvaluateConfig, EvolveConfig, LeaderboardConfig, typed
from epuckhebb.app.data import data_folder
from epuckhebb.app.engine import Job
from epuckhebb.app.errors import ConfigError
from epuckhebb.app.hydra_bridge import Plain
from epuckhebb.app.machine import require
from epuckhebb.app.method import ALL, REVERSAL_TASK, Method, in_reversal, methods_named, typed_as
from epuckhebb.app.named import world_of
from epuckhebb.app.parts import check_pace, network_for, sha256_of
from epuckhebb.sim.plasticity.rule import NoRule
from epuckhebb.sim.scenario import TRAINED, Scenario
from epuckhebb.sim.task import Task
from epuckhebb.study import leaderboard as board
from epuckhebb.study.leaderboard import EVOLVED, LAID_OVER, PLAIN, Row

REVERSAL = board.REVERSAL
EXPERIMENTS = (*TRAINED, REVERSAL)
QUICK = ("champions=2", "tests=[rescue]", "methods=[ga,sep_cma_es_varied,abcd_shared]")
_METHODS = "methods="
_OF_RULES = ("merges", "merge_every")  # settings of optimizers that concern nothing but rules


@dataclass(frozen=True, kw_only=True)
class _Entry:
    """A method in an experiment.

    Attributes:
        method: The method.
        row: What the tables say of it.
        champions: For each seed the job that evolves its champion, or the rule for it.
        lives: For each seed the job in which it is tested.
        before: For each seed what was evolved before that: the job of the champion for which a rule is evolved.
        config: How it is evolved, if it is.
        task: What it is evolved for.
    """

    method: Method
    row: Row
    champions: dict[int, Job]
    lives: dict[int, Job]
    before: dict[int, Job]
    config: EvolveConfig | None
    task: Task


@dataclass(frozen=True, kw_only=True)
class Leaderboard:
    """What was asked for.

    Attributes:
        config: The settings.
        cfg: The same, as they were composed.
        tests: The test worlds of each experiment, by name; reversal learning has none but its own.
        entries: The methods of each experiment.
        folder: Where everything is kept.
        launcher: What was typed for Hydra's launcher.
        rules: Files of the user's own rules.
        arguments: What was typed.
    """

    config: LeaderboardConfig
    cfg: DictConfig
    tests: dict[str, dict[str, Scenario]]
    entries: list[_Entry]
    folder: Path
    launcher: list[str]
    rules: list[Path]
    arguments: list[str]

    @property
    def jobs(self) -> list[Job]:
        """All jobs, in the order in which they need each other."""
        return [job for _, jobs in self.stages for job in jobs]

    @property
    def told(self) -> dict[str, str]:
        """What each run is for."""
        told: dict[str, str] = {}
        for entry in self.entries:
            for verb, jobs in (("evolve", entry.champions), ("test", entry.lives)):
                for seed, job in jobs.items():
                    told.setdefault(job.run, f"{verb} {entry.method.name}, {entry.row.experiment}, seed {seed}")
        return told

    @property
    def stages(self) -> list[tuple[str, list[Job]]]:
        """What is done in turn: champions, rules for champions, tests."""
        first = {job.run: job for entry in self.entries if not entry.before for job in entry.champions.values()}
        then = {job.run: job for entry in self.entries if entry.before for job in entry.champions.values()}
        lives = {job.run: job for entry in self.entries for job in entry.lives.values()}
        named = (("evolve champions", first), ("evolve rules for champions", then), ("test champions", lives))
        return [(what, list(jobs.values())) for what, jobs in named if jobs]


def _experiments_named(text: str) -> list[str]:
    """The experiments of an argument, in their usual order."""
    named = {name.strip() for name in text.split(",")}
    if unknown := named - {*EXPERIMENTS, ALL}:
        raise ConfigError(
            f"leaderboard {text}: {', '.join(sorted(unknown)) or 'nothing'} is no experiment; it must be one of "
            f"{', '.join(EXPERIMENTS)}, several of them with commas between, or {ALL}"
        )
    return [one for one in EXPERIMENTS if one in named or ALL in named]


def plan(experiment: str, arguments: list[str], *, quick: bool = False, config_dir: str | None = None) -> Leaderboard:
    """List what belongs to a leaderboard, each part composed and checked; nothing is written.

    Args:
        experiment: Its name, several of them with commas between, or all.
        arguments: Overrides, of the study and of Hydra.
        quick: Whether only a look is wanted.
        config_dir: A folder with YAML of the user's own.

    Raises:
        ConfigError: The experiment, a method, a key or a value cannot be used.
    """
    experiments = _experiments_named(experiment)
    hydra_bridge.check_config_dir(config_dir)
    typed_words = [experiment, *(["--quick"] if quick else []), *arguments]
    if config_dir is not None:
        typed_words += ["--config-dir", config_dir]
        config_dir = str(Path(config_dir).absolute())
    hydras = engine.for_hydra("leaderboard", arguments)
    own = [_as_list(argument) for argument in arguments if argument not in hydras]
    cfg = hydra_bridge.composed("leaderboard", [*(QUICK if quick else ()), *own], config_dir)
    config = typed(cfg, LeaderboardConfig)
    folders = _folders(config_dir)
    all_tests = tests_of(config.tests, config_dir)
    tests = {one: all_tests.get(one, {}) for one in experiments}
    for one, worlds in tests.items():
        if not worlds and one != REVERSAL:
            raise ConfigError(f"tests={','.join(config.tests)}: none of their scenarios is of the {one} experiment")
    methods = methods_named(config.methods, folders)
    entries: list[_Entry] = []
    for one, worlds in tests.items():
        planned = _Planner(config, config_dir, one, worlds)
        here = in_reversal(methods, folders) if one == REVERSAL else methods
        entries += [planned.entry(method) for method in here]
    rules = [
        file for entry in entries for job in entry.lives.values() for file in evaluate.own_rules(job.config["config"])
    ]
    tested = [name for worlds in all_tests.values() for name in worlds]
    asked = [
        _digest_of(tuple(tested), config_dir),
        config.first_seed,
        config.seed,
        config.repeats,
        config.reversal_repeats,
        runs.science_version(),
    ]
    usual = Path("runs") / "leaderboard" / f"seed{config.first_seed}_{engine.digest(asked)[:8]}"
    folder, launcher = engine.folder_and_launcher(hydras, usual)
    return Leaderboard(
        config=config,
        cfg=cfg,
        tests=tests,
        entries=entries,
        folder=folder,
        launcher=launcher,
        rules=list(dict.fromkeys(rules)),
        arguments=typed_words,
    )


def in_world(config: EvaluateConfig, world: Scenario) -> EvaluateConfig:
    """The same evaluation in a world of its experiment: at home as it is, elsewhere for as long as lives last there."""
    if world.name == config.world.name:
        return config
    there = copy.copy(config)
    there.world, there.lifetime = world, replace(config.lifetime, duration_s=world.paper_duration_s)
    return there


@functools.cache
def world_named(name: str, config_dir: str | None) -> Scenario:
    """A world by its name.

    Raises:
        ConfigError: There is none, or it cannot be.
    """
    robot = hydra_bridge.plain(_home_cfg(TRAINED["obstacles"], (), config_dir).robot)
    try:
        world = world_of(name, _folders(config_dir), robot)
    except ValueError as error:
        raise ConfigError(f"scenario {name}: {error}") from error
    if world is None:
        raise ConfigError(f"there is no scenario {name} in {' or '.join(map(str, _folders(config_dir)))}")
    return replace(world, name=name)


@functools.cache
def _home_cfg(home: str, task: tuple[str, ...], config_dir: str | None) -> DictConfig:
    """An evaluation of nothing but genes at home."""
    return hydra_bridge.composed("evaluate", _lives_in(home, *task, "hebbian=none"), config_dir)


def _lives_in(home: str, *words: str) -> list[str]:
    return [f"scenario={home}", "lifetime.record_every=0", *words]


def _folders(config_dir: str | None) -> list[Path]:
    return [*([Path(config_dir)] if config_dir else []), data_folder("conf")]


def _as_list(argument: str) -> str:
    """`methods=a,b` as Hydra writes a list.

    Raises:
        ConfigError: The argument chooses one method, as if it were a group of which one is chosen.
    """
    if argument.lstrip("+~").startswith("method="):
        raise ConfigError(f"{argument}: a leaderboard has many methods; give methods={argument.partition('=')[2]}")
    if not argument.startswith(_METHODS) or argument.startswith(f"{_METHODS}["):
        return argument
    names = argument.removeprefix(_METHODS).split(",")
    return f"{_METHODS}[{','.join(hydra_bridge.quoted(name) for name in names if name)}]"


@functools.cache
def _swept(name: str, config_dir: str | None) -> tuple[str, ...]:
    """The worlds of a named sweep."""
    params = hydra_bridge.composed("evaluate", [f"experiment={name}"], config_dir, with_hydra=True).hydra.sweeper.params
    if not params or "scenario" not in params:
        raise ConfigError(f"tests={name}: this sweep of conf/experiment/ names no scenarios in hydra.sweeper.params")
    return tuple(world.strip() for world in str(params["scenario"]).split(","))


def tests_of(sweeps: Sequence[str], config_dir: str | None) -> dict[str, dict[str, Scenario]]:
    """The test worlds of every experiment: those of these sweeps, but for the training world."""
    found: dict[str, dict[str, Scenario]] = {one: {} for one in TRAINED}
    for name in (name for sweep in sweeps for name in _swept(sweep, config_dir)):
        world = world_named(name, config_dir)
        if name != TRAINED[world.experiment]:
            found[world.experiment][name] = world
    return found


@functools.cache
def _digest_of(worlds: tuple[str, ...], config_dir: str | None) -> str:
    """A digest of all that worlds are."""
    return engine.digest({name: repr(world_named(name, config_dir)) for name in worlds})


def identity(asked: Plain) -> str:
    """The name of the run that a job leads to."""
    config, rules = dict(asked["config"]), evaluate.own_rules(asked["config"])
    for key in (*engine.NO_EFFECT, "genome"):
        config.pop(key)
    if rules:  # wherever they are
        config["hebbian"] = {**config["hebbian"], "rule": str(config["hebbian"]["rule"]).rpartition(":")[2]}
    worlds = tuple(asked.get("worlds", ()))
    depends = {
        "config": config,
        "champion": asked["champion"],
        "worlds": _digest_of(worlds, asked["config_dir"]),
        "rules": [sha256_of(file) for file in rules],
        "science": runs.science_version(),
        "packages": runs.versions(runs.NUMERIC),
    }
    return f"{'test' if worlds else 'champion'}_{engine.digest(depends)[:12]}"


class _Planner:
    """Makes the entries of an experiment, each after those that it needs."""

    def __init__(
        self, config: LeaderboardConfig, config_dir: str | None, experiment: str, tests: dict[str, Scenario]
    ) -> None:
        self._config, self._config_dir, self._experiment, self._tests = config, config_dir, experiment, tests
        self._home = TRAINED.get(experiment, TRAINED["obstacles"])
        self._task = tuple(typed_as(REVERSAL_TASK)) if experiment == REVERSAL else ()
        self._repeats = config.reversal_repeats if experiment == REVERSAL else config.repeats
        self._entries = dict[str, _Entry]()
        self._seeds = range(config.first_seed, config.first_seed + config.champions)

    def entry(self, method: Method) -> _Entry:
        """The entry of a method.

        Raises:
            ConfigError: It cannot be used; the message begins with its name.
        """
        try:
            made = self._entry(method)
        except ConfigError as error:
            raise ConfigError(f"method {method.name}: {error}") from error
        self._entries[method.name] = made
        return made

    def _entry(self, method: Method) -> _Entry:
        over = self._entries.get(method.over)
        if over and over.row.kind != PLAIN:
            plain = [name for name, entry in self._entries.items() if entry.row.kind == PLAIN]
            raise ConfigError(
                f"over={method.over}: its champions were evolved with a rule of their own, and another cannot be laid "
                f"over it; give a method without plasticity, for example {', '.join(plain) or 'ga'}"
            )
        config, champions = None, over.champions if over else {}
        if method.evolve:
            cfg = self._evolve_cfg(method)
            config = typed(cfg, EvolveConfig)
            self._check(method, config)
            champions = dict(self._evolutions(method, hydra_bridge.plain(cfg), over))
            lived = hydra_bridge.plain(_home_cfg(self._home, self._task, self._config_dir))
            lived["hebbian"] = hydra_bridge.plain(cfg)["hebbian"]
        else:
            lived = self._laid_over(method)
        lived |= {"seed": self._config.seed, "repeats": self._repeats}
        is_plain = config is not None and isinstance(config.controller.rule, NoRule)
        if is_plain and (method.over or method.twin):
            raise ConfigError(
                "it has no plasticity, so it has no twin, and nothing is laid over; leave out over and twin"
            )
        if not is_plain and not method.compared_with:
            raise ConfigError("twin is missing: name the method that is the same without plasticity")
        if method.twin and config is not None:
            _check_twin(config, self._entries[method.twin])
        evolved = config or (over.config if over else None)
        assert evolved is not None  # a method evolves, or takes another's champions
        return _Entry(
            method=method,
            row=Row(
                experiment=self._experiment,
                method=method.name,
                kind=PLAIN if is_plain else EVOLVED if method.evolve else LAID_OVER,
                twin=method.compared_with,
                numbers=evolved.plan.genes,
            ),
            champions=champions,
            lives=dict(self._lives(method, lived, champions)),
            before=over.champions if over and method.evolve else {},
            config=config,
            task=evolved.world.task,
        )

    def _evolve_cfg(self, method: Method) -> DictConfig:
        words = method.overrides("evolve")
        if "scenario" not in method.evolve:
            words.insert(0, f"scenario={self._home}")
        return hydra_bridge.composed("evolve", [*words, *(["genome=given"] if method.over else [])], self._config_dir)

    def _check(self, method: Method, config: EvolveConfig) -> None:
        """Refuse what cannot be evolved here, and what could be trained in a test."""
        for name, world in self._tests.items():
            if board.can_be(config.world, config.training, world):
                raise ConfigError(
                    f"its training world can be {name}, which is one of the tests' own "
                    f"(tests={','.join(self._config.tests)}): champions must not know what they are tested in. Train "
                    "it elsewhere, or leave these tests out"
                )
        network = evolve.network_of(config)
        require(evolve.needs(config, network))
        if "hebbian.rule" in method.evolve:
            evaluate.compiled_for(config.controller, network, config.world)

    def _laid_over(self, method: Method) -> Plain:
        """How champions live with what is laid over them."""
        cfg = hydra_bridge.composed("evaluate", _lives_in(self._home, *method.overrides("evaluate")), self._config_dir)
        config = typed(cfg, EvaluateConfig)
        for name, world in self._tests.items():
            try:
                check_pace(in_world(config, world).lifetime, world)
            except ValueError as error:
                raise ConfigError(f"{name}: {error}") from error
        for controller in config.controllers if "hebbian.rule" in method.evaluate else ():
            evaluate.compiled_for(controller, network_for(config.world, config.layers), config.world)
        return hydra_bridge.plain(cfg)

    def _evolutions(self, method: Method, config: Plain, over: _Entry | None) -> Iterator[tuple[int, Job]]:
        for seed in self._seeds:
            champion = over.champions[seed].run if over else ""
            asked = {"config": {**config, "seed": seed}, "champion": champion, "config_dir": self._config_dir}
            yield seed, self._job([*method.overrides("evolve"), f"seed={seed}"], asked)

    def _lives(self, method: Method, config: Plain, champions: Mapping[int, Job]) -> Iterator[tuple[int, Job]]:
        worlds = [self._home, *self._tests]
        for seed, champion in champions.items():
            asked = {"config": config, "champion": champion.run, "worlds": worlds, "config_dir": self._config_dir}
            yield seed, self._job([f"genome={champion.run}", *method.overrides("evaluate")], asked)

    def _job(self, overrides: list[str], asked: Plain) -> Job:
        return Job(number=0, overrides=overrides, run=identity(asked), config=asked)


def _check_twin(config: EvolveConfig, twin: _Entry) -> None:
    """Refuse a twin that differs in more than plasticity.

    Raises:
        ConfigError: It does.
    """
    other = twin.config
    if twin.row.kind != PLAIN or other is None:
        raise ConfigError(f"twin={twin.method.name} has plasticity itself; give a method without")
    for what, ours, theirs in (
        ("optimizer", _optimizer(config), _optimizer(other)),
        ("training", config.training, other.training),
        ("scenario", config.world, other.world),
        ("lifetime", config.lifetime, other.lifetime),
    ):
        if ours != theirs:
            raise ConfigError(
                f"twin={twin.method.name} has another {what}; a twin is the same but for plasticity, or plasticity "
                "would be credited with what that does"
            )


def _optimizer(config: EvolveConfig) -> tuple[object, ...]:
    """The optimizer, with its settings that concern any evolution."""
    settings = {name: value for name, value in vars(config.algorithm).items() if name not in _OF_RULES}
    return type(config.algorithm), settings
