"""`epuckhebb leaderboard`: a study of many methods, which evolves the missing champions and tests all of them.

Another call may name other methods, more champions or another experiment; only what is missing is done, and tables and
page are those of the last call. The folder is named by the tests, the seeds and the science.
"""

import functools
import itertools
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import pandas as pd

from epuckhebb.analysis import leaderboard as board
from epuckhebb.analysis.leaderboard import EVOLVED, PLAIN, POST_HOC, REVERSAL
from epuckhebb.analysis.tables import Table
from epuckhebb.config import (
    EvaluateConfig,
    EvolveConfig,
    alternatives,
    format_overrides,
    load,
    make_config,
    own_files,
    quoted,
    register,
    swept_values,
)
from epuckhebb.controller.ranges import check as check_ranges
from epuckhebb.controller.ranges import within
from epuckhebb.runs import compile_kernels, prepare_evolution
from epuckhebb.runtime import ConfigError
from epuckhebb.store import Run, fingerprint
from epuckhebb.studies.champions import ChampionStudy, make_job, scenario_evaluation, world_evaluation, worlds_digest
from epuckhebb.studies.jobs import Job, split
from epuckhebb.studies.methods import ALL, Method, find_methods, reversal_methods
from epuckhebb.studies.study import Planned, prepare
from epuckhebb.tmaze.individual import GA_ALONE
from epuckhebb.tmaze.scenario import TRAINED, Scenario
from epuckhebb.tmaze.tasks.reversal import Reversal

if TYPE_CHECKING:
    from matplotlib.figure import Figure

EXPERIMENTS = (*TRAINED, REVERSAL)
QUICK = ("champions=2", "tests=[rescue]", "methods=[ga,sep_cma_es_varied,abcd_shared]")
_METHODS = "methods="
# The columns that differ in the terminal: those of the maze, and those of reversal learning.
_SHOWN = ("solves both sides in training", "success over the test worlds"), ("learn", "rewarded share")
_ENOUGH = 8  # champions of a method; fewer are a smoke test
_COURSE = (1 / 8, 1 / 4, 1 / 2)  # shares of an evolution
_MARKS = ["experiment", "method", "seed", "mark", "robot_steps", "trials", "successes"]
_CHAMPIONS, _RULES, _TESTS = STAGES = "evolve champions", "evolve rules for champions", "test champions"
_PARTS = ("network", "fitness", "physics")  # groups of settings with which champions are tested as they evolved
_NAMES = re.compile(r"[^\[\],\s'\"]+")  # in a value of a sweep, one or a list of them


@dataclass(frozen=True, kw_only=True)
class Entry:
    """A method in an experiment: what the tables say of it, how its champions evolved, its jobs by stage and seed."""

    row: board.Row
    description: str
    evolved: EvolveConfig
    jobs: Mapping[str, Mapping[int, Job]]


@register
@dataclass(kw_only=True)
class Leaderboard(ChampionStudy):
    """The study, with all keys of `epuckhebb leaderboard`.

    What the command names besides: experiments, and config_dir, the user's folder.
    """

    command: ClassVar[str] = "leaderboard"
    reference: ClassVar[str] = "leaderboard"
    methods: list[str] = field(default_factory=list)
    tests: list[str] = field(default_factory=list)
    champions: int = within(1, default=12)
    first_seed: int = within(0, default=201)
    seed: int = within(0, default=1)
    repeats: int = within(1, default=3)
    reversal_repeats: int = within(1, default=100)

    def __post_init__(self) -> None:
        """Validate the settings."""
        self.experiments: Sequence[str] = EXPERIMENTS
        self.config_dir: str | None = None
        check_ranges(self)
        if not self.tests:
            raise ValueError("tests must name one sweep of conf/experiment/ or more")

    @functools.cached_property
    def worlds(self) -> dict[str, dict[str, Scenario]]:
        """The test worlds of each experiment, by name; reversal learning has none but its own world."""
        every = experiment_worlds(self.tests, self.config_dir)
        worlds = {experiment: every.get(experiment, {}) for experiment in self.experiments}
        for experiment, tests in worlds.items():
            if not tests and experiment != REVERSAL:
                names = ",".join(self.tests)
                raise ConfigError(f"tests={names}: none of their scenarios is of the {experiment} experiment")
        return worlds

    @functools.cached_property
    def entries(self) -> list[Entry]:
        """The methods in each experiment, with their jobs, each composed and checked."""
        methods = find_methods(self.methods, self.config_dir)
        entries: list[Entry] = []
        for experiment in self.worlds:
            by_name: dict[str, Entry] = {}  # a method comes after the one whose champions it takes
            for method in reversal_methods(methods) if experiment == REVERSAL else methods:
                try:
                    by_name[method.name] = _entry(self, experiment, method, by_name.get(method.champions_of))
                except ConfigError as error:
                    raise ConfigError(f"method {method.name}: {error}") from error
            entries += by_name.values()
        return entries

    def stages(self) -> list[tuple[str, list[Job]]]:
        """Champions, then rules for champions, then tests, each with its jobs."""
        stages = [
            (stage, {job.run: job for entry in self.entries for job in entry.jobs.get(stage, {}).values()})
            for stage in STAGES
        ]
        return [(stage, list(jobs.values())) for stage, jobs in stages if jobs]

    def folder(self, jobs: Sequence[Job]) -> Path:  # noqa: ARG002  # other methods have the same folder
        """The folder of the study, named by its test worlds, seeds and repeats, whatever the methods."""
        tested = tuple(name for worlds in experiment_worlds(self.tests, self.config_dir).values() for name in worlds)
        depends = [worlds_digest(tested, self.config_dir), self.first_seed, self.seed, self.repeats]
        depends += [self.reversal_repeats]
        return Path("runs") / "leaderboard" / f"seed{self.first_seed}_{fingerprint(depends)[:8]}"

    def tables(self, runs: Sequence[Run]) -> dict[str, pd.DataFrame]:
        """A row for each champion; for each method and test world; the leaderboard."""
        folder = runs[0].path.parent
        champions, worlds, courses = [], [], []
        sweeps = {
            name.replace("+", "_"): sweep for sweep in reversed(self.tests) for name in _swept(sweep, self.config_dir)
        }
        for entry in self.entries:
            whose = {"experiment": entry.row.experiment, "method": entry.row.method}
            *evolutions, tests = (entry.jobs[stage] for stage in STAGES if stage in entry.jobs)
            of_worlds = []
            for seed, test in tests.items():
                evolved = [Run(folder / jobs[seed].run) for jobs in evolutions]
                tested, task = Run(folder / test.run), entry.evolved.world.task
                metrics = tested.table("metrics.csv")
                counts, away = (
                    board.learner_counts(metrics, task)
                    if task.has_trials
                    else board.champion_counts(metrics, TRAINED[entry.row.experiment])
                )
                steps = sum(int(run.table("history.csv").robot_steps.sum()) for run in evolved)
                names = {"seed": seed, "champion": evolutions[-1][seed].run, "test": test.run}
                champions.append(whose | names | counts | {"robot_steps": steps})
                of_worlds.append(away)
                if tested.has("course.csv"):
                    course = [*tested.table("course.csv").to_dict("records"), counts | {"robot_steps": steps}]
                    courses += [whose | {"seed": seed, "mark": mark, **row} for mark, row in enumerate(course)]
            summed = pd.concat(of_worlds).groupby("scenario", sort=False).sum().reset_index()
            summed.insert(0, "tests", summed.scenario.map(sweeps).fillna(""))
            worlds += [whose | {str(name): value for name, value in row.items()} for row in summed.to_dict("records")]
        made = pd.DataFrame(champions).astype({"successes_off": "Int64", "successes_inverted": "Int64"})
        table = board.table([entry.row for entry in self.entries], made)
        every = {"champions": made, "worlds": pd.DataFrame(worlds), "leaderboard": table}
        by_champion = pd.DataFrame(courses, columns=_MARKS)
        return every | ({"anytime": board.anytime(by_champion), "anytime_by_champion": by_champion} if courses else {})

    def figures(self, run: Run) -> dict[str, "Figure"]:
        """Success by method in each experiment, the profiles of all, and success over the cost of evolution."""
        from epuckhebb.analysis import leaderboard_charts as charts  # matplotlib takes a while to load

        limits = {REVERSAL: Reversal().limits()}
        tables = run.table("leaderboard.csv"), run.table("champions.csv")
        groups = (table.groupby("experiment") for table in tables)
        drawn = {
            f"leaderboard_{experiment}": charts.success(methods, champions, limits.get(str(experiment), {}))
            for (experiment, methods), (_, champions) in zip(*groups, strict=True)
        }
        drawn["profiles"] = charts.profiles(*tables)
        if run.has("anytime.csv"):
            drawn["anytime"] = charts.anytime(tables[0], run.table("anytime.csv"))
        for name, figure in drawn.items():
            figure.set_label(board.CAPTIONS[name.partition("_")[0]])
        return drawn

    def page(self, run: Run, captions: Mapping[str, str]) -> str:
        """The page of the leaderboard in Markdown."""
        meanings = {entry.row.method: entry.description for entry in self.entries}
        tests = {experiment: list(worlds) for experiment, worlds in self.worlds.items()}
        table, worlds = (_table(run, name) for name in ("leaderboard", "worlds"))
        few = "**A smoke test: so few champions say nothing about a method.** " if self.champions < _ENOUGH else ""
        sweeps = ", ".join(self.tests)
        tested = [f"{self.repeats} repeats of every side and world of {sweeps}"] if any(tests.values()) else []
        tested += [f"{2 * self.reversal_repeats} new lifetimes in reversal learning"] if REVERSAL in tests else []
        provenance = (
            f"{few}Made by `epuckhebb leaderboard`: {self.champions} champions of each method and experiment, seeds "
            f"{self.first_seed} to {self.first_seed + self.champions - 1}; tests of each (seed {self.seed}): "
            f"{' and '.join(tested)}."
        )
        return board.markdown(table, worlds, meanings, tests, provenance, captions)

    @classmethod
    def shown(cls, run: Run) -> list[Table]:
        """The leaderboard, as the terminal shows it."""
        table, worlds = _table(run, "leaderboard"), _table(run, "worlds")
        shown = []
        for experiment, rows in table.groupby("experiment", sort=False):
            columns = ("method", "kind", *_SHOWN[experiment == REVERSAL], "difference to the matched control")
            shown.append(board.readable(rows, worlds.iloc[:0]).only(*columns, text=2))
        return shown


def plan(experiment: str, arguments: list[str], *, quick: bool = False, config_dir: str | None = None) -> Planned:
    """Plan the study.

    experiment: its name, several of them with commas between, or all. arguments: overrides, of the study and of Hydra.
    """
    named = {name.strip() for name in experiment.split(",")}
    if named - {*EXPERIMENTS, ALL}:
        raise ConfigError(f"leaderboard {experiment}: it must be one or more of {', '.join(EXPERIMENTS)}, or {ALL}")
    typed = [experiment, *(["--quick"] if quick else []), *arguments]
    overrides, of_hydra = split("leaderboard", arguments)
    study = load(Leaderboard, [*(QUICK if quick else ()), *map(_as_list, overrides)], config_dir)
    study.experiments = [name for name in EXPERIMENTS if name in named or ALL in named]
    if config_dir is not None:
        typed += ["--config-dir", config_dir]
        study.config_dir = str(Path(config_dir).absolute())
    return prepare(study, of_hydra, typed)


def _as_list(argument: str) -> str:
    """`methods=a,b` as Hydra writes a list."""
    if not argument.startswith(_METHODS) or argument.startswith(f"{_METHODS}["):
        return argument
    names = argument.removeprefix(_METHODS).split(",")
    return f"{_METHODS}[{','.join(quoted(name) for name in names if name)}]"


@functools.cache
def _swept(name: str, config_dir: str | None) -> tuple[str, ...]:
    """The worlds of a named sweep."""
    params = swept_values([f"experiment={name}"], config_dir)
    if "scenario" not in params:
        raise ConfigError(f"tests={name}: this sweep of conf/experiment/ names no scenarios in hydra.sweeper.params")
    swept = alternatives([f"{key}={params[key]}" for key in ("scenario", "change") if key in params])
    values = [[_NAMES.findall(word.partition("=")[2]) for word in words] for words in swept.values()]
    return tuple("+".join(itertools.chain(*names)) for names in itertools.product(*values))


def experiment_worlds(sweeps: Sequence[str], config_dir: str | None) -> dict[str, dict[str, Scenario]]:
    """The test worlds of every experiment: those of these sweeps, without the training world."""
    tests: dict[str, dict[str, Scenario]] = {experiment: {} for experiment in TRAINED}
    for name in (name for sweep in sweeps for name in _swept(sweep, config_dir)):
        world = world_evaluation(name, config_dir).world
        if name != TRAINED[world.experiment]:
            tests[world.experiment][name] = world
    return tests


def _entry(study: Leaderboard, experiment: str, method: Method, over: Entry | None) -> Entry:
    """A method in an experiment, with its jobs. over: the entry whose champions it takes, if it takes any."""
    training, tests = TRAINED.get(experiment, TRAINED["obstacles"]), study.worlds[experiment]
    if over and over.row.kind != PLAIN:
        raise ConfigError(f"champions_of={method.champions_of}: its champions have a rule; no other can be added")
    jobs = {stage: seeds for stage, seeds in over.jobs.items() if stage != _TESTS} if over else {}
    if method.evolve:
        words = [*([] if "scenario" in method.evolve else [f"scenario={training}"]), *format_overrides(method.evolve)]
        evolved = load(EvolveConfig, [*words, *(["genome=given"] if over else [])], study.config_dir)
        if evolved.world.name in {world.name for world in tests.values()}:
            raise ConfigError(f"its champions would be trained in {evolved.world.name}, a world of the tests")
        prepare_evolution(evolved, has_genome=False)
        jobs[_RULES if over else _CHAMPIONS] = {
            seed: make_job(
                [*format_overrides(method.evolve), f"seed={seed}"],
                {**evolved.values, "seed": seed},
                champion=over.jobs[_CHAMPIONS][seed].run if over else "",
                purpose=f"evolve {method.name}, {experiment}, seed {seed}",
            )
            for seed in range(study.first_seed, study.first_seed + study.champions)
        }
    else:
        assert over is not None  # a method evolves, or takes another's champions
        evolved = over.evolved
    task = {key: value for key, value in method.evolve.items() if key.startswith("task")}
    added = method.evaluate or {**task, "hebbian": "none"}
    tested = dict(scenario_evaluation(training, tuple(format_overrides(added)), study.config_dir).values)
    tested |= {group: evolved.values[group] for group in (*_PARTS, *(["hebbian"] if method.evolve else []))}
    tested |= {"seed": study.seed, "repeats": study.reversal_repeats if experiment == REVERSAL else study.repeats}
    config = make_config(tested, EvaluateConfig, "its test")
    if own_files(tested):
        compile_kernels(config.controllers, config.network_made, config.world)
    kind = POST_HOC if method.evaluate else EVOLVED if config.controllers else PLAIN
    if kind != PLAIN and not method.comparison:
        raise ConfigError("matched_control is missing: name the method that is the same without plasticity")
    champions = jobs.get(_RULES) or jobs[_CHAMPIONS]
    jobs[_TESTS] = {
        seed: make_job(
            [f"genome={champion.run}", *format_overrides(method.evaluate)],
            tested,
            champion=champion.run,
            purpose=f"test {method.name}, {experiment}, seed {seed}",
            worlds=[training, *tests],
            config_dir=study.config_dir,
            **({"course": _COURSE} if tests and method.evolve and not over else {}),
        )
        for seed, champion in champions.items()
    }
    controller = next(iter(config.controllers), GA_ALONE)
    row = board.Row(
        experiment=experiment,
        method=method.name,
        kind=kind,
        matched_control=method.comparison,
        evolved_parameters=evolved.plan.genes,
        knowledge=", ".join(controller.knowledge),
        knowledge_class=controller.knowledge_class,
    )
    return Entry(row=row, description=method.description, evolved=evolved, jobs=jobs)


def _table(run: Run, name: str) -> pd.DataFrame:
    """A table, whose texts are empty where a method has none."""
    table = run.table(f"{name}.csv")
    texts = [column for column in ("matched_control", "best_plain", "tests") if column in table]
    return table.fillna(dict.fromkeys(texts, ""))
