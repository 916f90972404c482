"""`epuckhebb reproduce`: evolves champions, evaluates each, and reports which of the paper's claims hold."""

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import TYPE_CHECKING, Any, ClassVar

import pandas as pd
import yaml

from epuckhebb.analysis import findings, reproduction
from epuckhebb.analysis.tables import Table, code
from epuckhebb.config import MOST_THREADS, EvaluateConfig, EvolveConfig, load, make_config, make_part, register
from epuckhebb.controller.network import PAPER_NETWORK
from epuckhebb.controller.ranges import check as check_ranges
from epuckhebb.controller.ranges import within
from epuckhebb.evolution.optimizers.ga import GA
from epuckhebb.runs import prepare_evolution
from epuckhebb.runtime import ConfigError, data_folder
from epuckhebb.store import Genome, Run, load_genome
from epuckhebb.studies.champions import ChampionStudy, make_job, scenario_evaluation
from epuckhebb.studies.jobs import Job, split, todo
from epuckhebb.studies.study import Planned, prepare
from epuckhebb.tmaze.fitness import Signal
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.physics.pymunk import PYMUNK
from epuckhebb.tmaze.robot import EPUCK
from epuckhebb.tmaze.scenario import TRAINED, Scenario

if TYPE_CHECKING:
    from matplotlib.figure import Figure

EXPERIMENTS = {"light": ("light",), "obstacles": ("obstacles",), "all": ("light", "obstacles")}
_EVOLVE, _TEST = "evolve champions", "evaluate champions"
QUICK = ("champions=3", "repeats=3", "rates=[0.000015,0.002]")


class LiveFitness(Enum):
    """Which live fitness a reproduction uses: as the paper says, or as each of its two programs does."""

    paper = "paper"
    as_coded = "as_coded"

    def choose(self, experiment: str) -> Signal:
        """The signal of an experiment."""
        if self is LiveFitness.paper:
            return Signal.behaviour
        return Signal.light_code if experiment == "light" else Signal.lifetime_mean


@register
@dataclass(kw_only=True)
class Reproduction(ChampionStudy):
    """The study, with all keys of `epuckhebb reproduce`. experiments: of the paper, which the command names."""

    command: ClassVar[str] = "reproduce"
    reference: ClassVar[str] = "reproduce"
    champions: int = within(1, default=20)
    first_seed: int = within(0, default=1)
    seed: int = within(0, default=1)
    repeats: int = within(1, default=10)
    rates: list[float] = field(default_factory=list)
    signal: LiveFitness = LiveFitness.paper
    genome: str | None = None
    threads: int = within(0, MOST_THREADS, default=0)
    ga: GA = field(default_factory=GA)
    physics: dict[str, Any] = field(default_factory=lambda: {"kind": PYMUNK.name})

    def __post_init__(self) -> None:
        """Validate the settings."""
        self.experiments = "all"
        check_ranges(self)
        for rate in self.rates:
            if not (math.isfinite(rate) and rate > 0):
                raise ValueError(f"rates must be numbers above 0 (0 is always run, as the GA alone), got {rate}")

    @property
    def label(self) -> str:
        """The first part of the name of the study's folder."""
        who = self.fixed_genome.name if self.fixed_genome else f"champions{self.champions}"
        return f"{self.experiments}_{who}_seed{self.first_seed}"

    @functools.cached_property
    def fixed_genome(self) -> Genome | None:
        """The genome in place of champions; it must be for the paper's robot and network."""
        if self.genome is None:
            return None
        genome = load_genome(self.genome, "obstacles")
        if genome.network != PAPER_NETWORK or genome.robot not in ("", EPUCK.name):
            body = f"{genome.robot or 'any robot'}, {genome.network}"
            raise ConfigError(f"genome={self.genome} is for {body}, not {EPUCK.name}, {PAPER_NETWORK}")
        return genome

    @functools.cached_property
    def jobs(self) -> dict[str, dict[tuple[str, str], Job]]:
        """For each stage the jobs by experiment and champion; one whose genome is given is not evolved."""
        evolutions, tests = dict[tuple[str, str], Job](), dict[tuple[str, str], Job]()
        for experiment in EXPERIMENTS[self.experiments]:
            training, shared = TRAINED[experiment], {"threads": self.threads, "physics": self.physics}
            testing = scenario_evaluation(training).values | {"seed": self.seed, "repeats": self.repeats} | shared
            how: dict[str, Any] = {"worlds": reproduction.worlds(experiment), "experiment": experiment}
            how |= {"rates": self.rates, "signal": self.signal.choose(experiment).name}
            if self.fixed_genome:
                facts = {"name": self.fixed_genome.name, "sha256": self.fixed_genome.sha256}
                tests[experiment, self.fixed_genome.name] = make_job(
                    [], testing | {"genome": self.genome}, **how, **facts
                )
                continue
            evolving = load(EvolveConfig, [f"scenario={training}"]).values | {"ga": self.values["ga"]} | shared
            prepare_evolution(make_config(evolving, EvolveConfig, "reproduce"))
            for seed in range(self.first_seed, self.first_seed + self.champions):
                name = f"{experiment}_seed{seed:03d}"
                evolution = make_job([f"scenario={training}", f"seed={seed}"], evolving | {"seed": seed})
                evolutions[experiment, name] = evolution
                tests[experiment, name] = make_job(
                    [f"genome={evolution.run}"], testing, champion=evolution.run, **how, name=name
                )
        return {_EVOLVE: evolutions, _TEST: tests}

    def stages(self) -> list[tuple[str, list[Job]]]:
        """Champions, then their evaluations, each with its jobs."""
        return [(stage, list(jobs.values())) for stage, jobs in self.jobs.items() if jobs]

    @classmethod
    def stored(cls, run: Run) -> "Reproduction":
        """The reproduction of a folder, with the settings that it was called with."""
        study = super().stored(run)
        study.experiments = run.provenance["command_line"][2]
        return study

    def tables(self, runs: Sequence[Run]) -> dict[str, pd.DataFrame]:
        """The paper's tables and ours over all champions, by name."""
        tests = runs[-len(self.jobs[_TEST]) :]
        metrics = pd.concat([run.table("metrics.csv") for run in tests], ignore_index=True)
        return reproduction.make_tables(metrics, _paper())

    def figures(self, run: Run) -> dict[str, "Figure"]:
        """The paper's figures for our champions; those that are shown run again."""
        if todo(run.path, list(self.jobs[_TEST].values())):
            raise ConfigError(f"{run.path} was made by another version of the program; run it again")
        shown, histories = dict[str, Any](), dict[str, list[pd.DataFrame]]()
        for experiment, (best, *_) in _showcases(run).items():
            if self.fixed_genome:
                shown[experiment] = best, self.fixed_genome.genes
                continue
            jobs = {name: job for (where, name), job in self.jobs[_EVOLVE].items() if where == experiment}
            shown[experiment] = best, load_genome(str(run.path / jobs[best].run), experiment).genes
            histories[experiment] = [Run(run.path / job.run).table("history.csv") for job in jobs.values()]

        def world(scenario: str) -> tuple[Scenario, Lifetime]:
            config = load(EvaluateConfig, [f"scenario={scenario}"])
            return replace(config.world, physics=make_part("physics", self.physics, "physics")), config.lifetime

        signals = {experiment: self.signal.choose(experiment) for experiment in shown}
        names = ("doses", "rescue_over_all", "rescue_and_harm", "ends")
        tables = {name: run.table(f"{name}.csv") for name in names if run.has(f"{name}.csv")}
        return reproduction.make_figures(tables, shown, signals, world, histories, self.seed)

    def page(self, run: Run, captions: Mapping[str, str]) -> str:
        """The report: the paper's tables with ours beside them."""
        last = self.first_seed + self.champions - 1
        who = f"{self.champions} champions of each experiment, evolved from seeds {self.first_seed} to {last}"
        if self.fixed_genome:
            who = f"genome {code(self.fixed_genome.name)} (SHA-256 {self.fixed_genome.sha256[:16]}…)"
        names = ["claims", "success", "rescue_and_harm", "ends", "comparison"]
        return reproduction.markdown(
            {name: run.table(f"{name}.csv") for name in names},
            _paper(),
            _showcases(run),
            captions,
            champions=1 if self.fixed_genome else self.champions,
            repeats=self.repeats,
            is_fixed=self.fixed_genome is not None,
            provenance=f"Made by `epuckhebb reproduce`: {who}; {self.repeats} repeats of every condition "
            f"(seed {self.seed}); live fitness: {self.signal.value}; physics: {self.physics['kind']}.",
        )

    @classmethod
    def shown(cls, run: Run) -> list[Table]:
        """What held and what did not, as the terminal shows it."""
        claims = reproduction.claims_table(run.table("claims.csv")).only(
            "experiment", "claim", "verdict", "trials", text=3
        )
        return [claims, *reproduction.terminal_tables(run.table("comparison.csv"), _paper())]


def plan(experiment: str, arguments: list[str], *, quick: bool = False) -> Planned:
    """Plan the study. experiment: one of `EXPERIMENTS`. arguments: overrides, of the study and of Hydra."""
    if experiment not in EXPERIMENTS:
        raise ConfigError(f"reproduce {experiment}: the experiment must be one of {', '.join(EXPERIMENTS)}")
    overrides, of_hydra = split("reproduce", arguments)
    study = load(Reproduction, [*(QUICK if quick else ()), *overrides])
    study.experiments = experiment
    return prepare(study, of_hydra, [experiment, *(["--quick"] if quick else []), *arguments])


def _showcases(run: Run) -> dict[str, tuple[str, int, int]]:
    return reproduction.showcases(findings.trials(run.table("metrics.csv")), _paper())


@functools.cache
def _paper() -> Mapping[str, Any]:
    """The published tables."""
    tables: Mapping[str, Any] = yaml.safe_load(
        (data_folder("conf") / "paper" / "tables.yaml").read_text(encoding="utf-8")
    )
    return tables
