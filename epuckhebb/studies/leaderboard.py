"""`epuckhebb leaderboard`: a study of many methods, which evolves the missing champions and tests all of them.

Another call may name other methods, more champions or another experiment; only what is missing is done, and tables and
page are those of the last call. The folder is named by the tests, the seeds and the science.
"""

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar

import pandas as pd

from epuckhebb.analysis import leaderboard as board
from epuckhebb.analysis.tables import Table
from epuckhebb.config import (
    EvaluateConfig,
    check_config_dir,
    from_values,
    load,
    quoted,
    register,
    settings,
)
from epuckhebb.controller.ranges import check as check_ranges
from epuckhebb.controller.ranges import within
from epuckhebb.runtime import ConfigError
from epuckhebb.store import Run, fingerprint
from epuckhebb.studies.champions import COST, ChampionStudy, worlds_digest
from epuckhebb.studies.jobs import Job, split
from epuckhebb.studies.leaderboard_jobs import REVERSAL, Entry, Planner, sweep_of, tests_of
from epuckhebb.studies.methods import ALL, REVERSAL_TASK, Method, methods_named
from epuckhebb.studies.study import Planned, prepare
from epuckhebb.tmaze.scenario import TRAINED, Scenario

if TYPE_CHECKING:
    from matplotlib.figure import Figure

EXPERIMENTS = (*TRAINED, REVERSAL)
QUICK = ("champions=2", "tests=[rescue]", "methods=[ga,sep_cma_es_varied,abcd_shared]")
_METHODS = "methods="
_PLAIN = "ga"  # what all rules are compared with in reversal learning
_REVERSAL_GA = {"ga": "reversal"}
_FIRST_REPORTED = 100  # settings were chosen on lower seeds
_SHOWN = ((0, 1, 3, 4, 7), (0, 1, 2, 3, 6))  # columns in the terminal; those of reversal learning last
_ENOUGH = 8  # champions of a method; fewer are a smoke test


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
            raise ValueError(
                "tests must name one sweep of conf/experiment/ or more, in whose worlds champions are tested"
            )

    @functools.cached_property
    def worlds(self) -> dict[str, dict[str, Scenario]]:
        """The test worlds of each experiment, by name; reversal learning has none but its own world."""
        every = tests_of(self.tests, self.config_dir)
        worlds = {one: every.get(one, {}) for one in self.experiments}
        for one, own in worlds.items():
            if not own and one != REVERSAL:
                raise ConfigError(f"tests={','.join(self.tests)}: none of their scenarios is of the {one} experiment")
        return worlds

    @functools.cached_property
    def entries(self) -> list[Entry]:
        """The methods in each experiment, with their jobs, each composed and checked."""
        worlds_of = self.worlds
        methods = methods_named(self.methods, self.config_dir)
        entries: list[Entry] = []
        for one, worlds in worlds_of.items():
            planner = Planner(self, one, worlds)
            here = in_reversal(methods, self.config_dir) if one == REVERSAL else methods
            entries += [planner.entry(method) for method in here]
        return entries

    def stages(self) -> list[tuple[str, list[Job]]]:
        """See `Study`: champions, rules for champions, tests."""
        stages: dict[str, dict[str, Job]] = {
            what: {} for what in ("evolve champions", "evolve rules for champions", "test champions")
        }
        for entry in self.entries:
            evolved = stages["evolve rules for champions" if entry.before else "evolve champions"]
            for jobs, own in ((evolved, entry.champions), (stages["test champions"], entry.tests)):
                for job in own.values():
                    jobs.setdefault(job.run, job)
        return [(what, list(jobs.values())) for what, jobs in stages.items() if jobs]

    def folder(self, jobs: Sequence[Job]) -> Path:  # noqa: ARG002  # other methods have the same folder
        """See `Study`."""
        tested = tuple(name for worlds in tests_of(self.tests, self.config_dir).values() for name in worlds)
        depends = [worlds_digest(tested, self.config_dir), self.first_seed, self.seed, self.repeats]
        depends += [self.reversal_repeats]
        return Path("runs") / "leaderboard" / f"seed{self.first_seed}_{fingerprint(depends)[:8]}"

    def tables(self, runs: Sequence[Run]) -> dict[str, pd.DataFrame]:
        """See `Study`: a row for each champion; for each method and test world; the leaderboard; costs."""
        folder = runs[0].path.parent
        champions, worlds, costs = [], [], []
        sweeps = sweep_of(self.tests, self.config_dir)
        for entry in self.entries:
            whose = {"experiment": entry.row.experiment, "method": entry.row.method}
            spent: dict[str, list[float]] = {"evolve_cpu_s": [], "test_cpu_s": []}
            of_worlds = []
            for seed, test in entry.tests.items():
                evolved = [Run(folder / jobs[seed].run) for jobs in (entry.before, entry.champions) if jobs]
                tested = Run(folder / test.run)
                metrics, task = tested.table("metrics.csv"), entry.task
                counts, away = (
                    board.of_learner(metrics, task)
                    if task.has_trials
                    else board.of_champion(metrics, TRAINED[entry.row.experiment])
                )
                steps = sum(int(run.table("history.csv").robot_steps.sum()) for run in evolved)
                names = {"seed": seed, "champion": entry.champions[seed].run, "test": test.run}
                champions.append(whose | names | counts | {"robot_steps": steps})
                of_worlds.append(away)
                spent["evolve_cpu_s"].append(sum(run.json(COST)["cpu_s"] for run in evolved))
                spent["test_cpu_s"].append(tested.json(COST)["cpu_s"])
            summed = pd.concat(of_worlds).groupby("scenario", sort=False).sum().reset_index()
            summed.insert(0, "tests", summed.scenario.map(sweeps).fillna(""))
            worlds += [whose | {str(name): value for name, value in row.items()} for row in summed.to_dict("records")]
            costs.append(whose | {name: round(sum(each) / len(each), 1) for name, each in spent.items()})
        made = pd.DataFrame(champions).astype({"successes_off": "Int64", "successes_inverted": "Int64"})
        table = board.table([entry.row for entry in self.entries], made)
        return {"champions": made, "worlds": pd.DataFrame(worlds), "leaderboard": table, "cost": pd.DataFrame(costs)}

    def figures(self, run: Run) -> dict[str, "Figure"]:
        """See `Study`."""
        from epuckhebb.analysis import charts  # matplotlib takes a while to load

        champions, lines = run.table("champions.csv"), {}
        for test in champions.test[champions.experiment == REVERSAL][:1]:
            config = from_values(settings(Run(run.path / test).config_file), EvaluateConfig, str(run.path / test))
            lines[REVERSAL] = config.world.task.limits()
        figure = charts.leaderboard_of(run.table("leaderboard.csv"), champions, lines)
        figure.set_label(board.CAPTION)
        return {"leaderboard": figure}

    def page(self, run: Run, captions: Mapping[str, str]) -> str:  # noqa: ARG002  # its one figure has its place
        """See `Study`."""
        meanings = {entry.method.name: entry.method.description for entry in self.entries}
        tests = {experiment: list(own) for experiment, own in self.worlds.items()}
        table, worlds, costs = (_table(run, name) for name in ("leaderboard", "worlds", "cost"))
        return board.markdown(table, worlds, costs, meanings, tests, self._provenance())

    def _provenance(self) -> str:
        last = self.first_seed + self.champions - 1
        chosen = f"Settings of methods were chosen on seeds below {_FIRST_REPORTED}, none on these."
        if self.first_seed < _FIRST_REPORTED:
            chosen = f"**{chosen.removesuffix(', none on these.')}: these figures are too high.**"
        tested, worlds = [], ""
        if any(self.worlds.values()):
            tested.append(f"{self.repeats} repeats of every champion, side and world")
            worlds = (
                f" Test worlds are those of the sweeps {', '.join(self.tests)}. No training uses one of them. Light "
                "levels and weak wheels of tests lie between those of varied training."
            )
        if REVERSAL in self.worlds:
            tested.append(f"{2 * self.reversal_repeats} new lifetimes of every champion in reversal learning")
        few = "**A smoke test: so few champions say nothing about a method.** " if self.champions < _ENOUGH else ""
        return (
            f"{few}Made by `epuckhebb leaderboard`: {self.champions} champions of each method and experiment, seeds "
            f"{self.first_seed} to {last}, evolved in the robot-steps of the table; {' and '.join(tested)} "
            f"(seed {self.seed}). {chosen}{worlds}"
        )

    @classmethod
    def shown(cls, run: Run) -> list[Table]:
        """See `Study`."""
        table, worlds = _table(run, "leaderboard"), _table(run, "worlds")
        return [
            board.readable(own, worlds.iloc[:0]).only(*_SHOWN[one == REVERSAL], text=2)
            for one, own in table.groupby("experiment", sort=False)
        ]


def plan(experiment: str, arguments: list[str], *, quick: bool = False, config_dir: str | None = None) -> Planned:
    """Plan the study.

    experiment: its name, several of them with commas between, or all. arguments: overrides, of the study and of Hydra.
    """
    named = {name.strip() for name in experiment.split(",")}
    if unknown := named - {*EXPERIMENTS, ALL}:
        raise ConfigError(
            f"leaderboard {experiment}: {', '.join(sorted(unknown)) or 'nothing'} is no experiment; it must be one of "
            f"{', '.join(EXPERIMENTS)}, several of them with commas between, or {ALL}"
        )
    check_config_dir(config_dir)
    typed = [experiment, *(["--quick"] if quick else []), *arguments]
    own, of_hydra = split("leaderboard", arguments)
    study = load(Leaderboard, [*(QUICK if quick else ()), *map(_as_list, own)], config_dir)
    study.experiments = [one for one in EXPERIMENTS if one in named or ALL in named]
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


def in_reversal(methods: Sequence[Method], config_dir: str | None = None) -> list[Method]:
    """These methods in reversal learning: their rules, evolved by the GA in its one world.

    Methods that differ in training or optimizer alone are one here. All without plasticity are the GA. Methods with an
    adaptation are left out.
    """
    (plain,) = methods_named([_PLAIN], config_dir)
    found = [replace(plain, evolve={**REVERSAL_TASK, **_REVERSAL_GA})]
    for method in methods:
        if not method.is_rule_alone:
            continue
        made = replace(
            method,
            evolve={**REVERSAL_TASK, **_REVERSAL_GA, **method.rule} if method.evolve else {},
            evaluate={**REVERSAL_TASK, **method.rule} if method.evaluate else {},
            champions_of=_PLAIN if method.champions_of else "",
            matched_control="" if method.champions_of else _PLAIN,
        )
        if method.rule and not any(replace(made, name=one.name, description=one.description) == one for one in found):
            found.append(made)
    names = [method.name for method in methods]
    if not found[1:] and names != [_PLAIN]:
        raise ConfigError(
            f"methods={','.join(names)}: none has a place in reversal learning, which compares plasticity rules; give "
            "one that has hebbian and no adaptation, for example modulated"
        )
    return found


def _table(run: Run, name: str) -> pd.DataFrame:
    """A table, whose texts are empty where a method has none."""
    table = run.table(f"{name}.csv")
    texts = [column for column in ("matched_control", "tests") if column in table]
    return table.fillna(dict.fromkeys(texts, ""))
