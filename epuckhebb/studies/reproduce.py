"""`epuckhebb reproduce`: a study that evolves champions, evaluates each, and reports which of the paper's claims hold.

The folder is named by the settings, so the same command resumes it; see `epuckhebb.studies.jobs`.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pandas as pd
import yaml
from matplotlib.figure import Figure

from epuckhebb.analysis import report, reproduction
from epuckhebb.analysis.tables import code
from epuckhebb.config import EvaluateConfig, EvolveConfig, ReproduceConfig, from_values, load, part_from, settings
from epuckhebb.controller.network import PAPER_NETWORK
from epuckhebb.runs import prepare_evolution
from epuckhebb.runtime import ConfigError, data_folder
from epuckhebb.store import Genome, Run, RunFolder, fingerprint, load_genome
from epuckhebb.studies.champions import champion_job, in_training_world, job_of
from epuckhebb.studies.jobs import Job, folder_and_launcher, launch_in_turn, open_study, split, todo, write_report
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.robot import EPUCK
from epuckhebb.tmaze.scenario import TRAINED, Scenario

EXPERIMENTS = {"light": ("light",), "obstacles": ("obstacles",), "all": ("light", "obstacles")}
QUICK = ("champions=3", "repeats=3", "rates=[0.000015,0.002]")


@dataclass(frozen=True, kw_only=True)
class _Champion:
    """A champion of the study, with its jobs; one whose genome is given is not evolved."""

    experiment: str
    name: str
    evolution: Job | None
    test: Job


def reproduce(experiment: str, arguments: list[str], *, quick: bool) -> Path:
    """Do what is missing and write the report; returns its folder. arguments: overrides, of the study and of Hydra."""
    if experiment not in EXPERIMENTS:
        raise ConfigError(f"reproduce {experiment}: the experiment must be one of {', '.join(EXPERIMENTS)}")
    own, of_hydra = split("reproduce", arguments)
    config, experiments = load(ReproduceConfig, [*(QUICK if quick else ()), *own]), EXPERIMENTS[experiment]
    given = None if config.genome is None else _given(config.genome)
    champions = [champion for one in experiments for champion in _planned(config, one, given)]
    evolutions, tests = [one.evolution for one in champions if one.evolution], [one.test for one in champions]
    stages = [(f"{what} champions", jobs) for what, jobs in (("evolve", evolutions), ("evaluate", tests)) if jobs]
    folder, launcher = folder_and_launcher(of_hydra, _folder(experiment, config, given), len(evolutions) + 1)
    words = [experiment, *(["--quick"] if quick else []), *arguments]
    with open_study(folder, "reproduce", config, words, [*evolutions, *tests]) as study:
        launch_in_turn(study, stages, launcher, champion_job)
        _report(study, config, champions, given)
    return folder


def _given(where: str) -> Genome:
    """The genome in place of champions; it must be for the paper's robot and network."""
    genome = load_genome(where, "obstacles")
    if (genome.network, genome.robot) != (PAPER_NETWORK, EPUCK.name):
        raise ConfigError(
            f"genome={where} is for robot {genome.robot} and a network of layers {genome.network}; the paper's are "
            f"{EPUCK.name} and {PAPER_NETWORK}"
        )
    return genome


def _planned(config: ReproduceConfig, experiment: str, given: Genome | None) -> Iterator[_Champion]:
    """The champions of an experiment, in the order of the tables."""
    training, threads = TRAINED[experiment], {"threads": config.threads, "physics": config.physics}
    evolving = load(EvolveConfig, [f"scenario={training}"]).values | {"ga": config.values["ga"]} | threads
    testing = in_training_world(training).values | {"seed": config.seed, "repeats": config.repeats} | threads
    how: dict[str, Any] = {"worlds": reproduction.worlds(experiment), "experiment": experiment, "rates": config.rates}
    how |= {"signal": config.signal.of(experiment).name}
    if given:
        test = job_of([], testing | {"genome": config.genome}, **how, name=given.name, sha256=given.sha256)
        yield _Champion(experiment=experiment, name=given.name, evolution=None, test=test)
        return
    prepare_evolution(from_values(evolving, EvolveConfig, "reproduce"))
    for seed in range(config.first_seed, config.first_seed + config.champions):
        name = f"{experiment}_seed{seed:03d}"
        evolution = job_of([f"scenario={training}", f"seed={seed}"], evolving | {"seed": seed})
        test = job_of([f"genome={evolution.run}"], testing, champion=evolution.run, **how, name=name)
        yield _Champion(experiment=experiment, name=name, evolution=evolution, test=test)


def _folder(experiment: str, config: ReproduceConfig, given: Genome | None) -> Path:
    """The folder of these settings; other settings, or another version of the science, have another folder."""
    depends = {key: value for key, value in config.values.items() if key not in ("threads", "genome")}
    digest = fingerprint(depends | {"experiment": experiment}, given)[:8]
    who = given.name if given else f"champions{config.champions}"
    return Path("runs") / "reproduce" / f"{experiment}_{who}_seed{config.first_seed}_{digest}"


def figures(path: Path) -> dict[str, Figure]:
    """The figures of a finished reproduction by the names of their files, drawn again."""
    config = from_values(settings(Run(path).config_file), ReproduceConfig, str(path))
    given = None if config.genome is None else _given(config.genome)
    champions = [
        champion
        for experiment in Run(path).table("claims.csv").experiment.unique()
        for champion in _planned(config, experiment, given)
    ]
    if todo(path, [one.test for one in champions]):
        raise ConfigError(f"{path} was made by another version of the program; run it again")
    found, _ = _findings(path, config, champions, given)
    return {name: figure for name, (_, figure) in _figures(path, config, champions, given, found).items()}


def _figures(
    folder: Path, config: ReproduceConfig, champions: list[_Champion], given: Genome | None, found: report.Findings
) -> dict[str, tuple[str, Figure]]:
    shown, histories = dict[str, Any](), dict[str, list[pd.DataFrame]]()
    for one in found.showcase:
        evolutions = {champion.name: champion.evolution for champion in champions if champion.experiment == one}
        runs = {name: Run(folder / job.run) for name, job in evolutions.items() if job}
        best = found.showcase[one][0]
        shown[one] = given.genes if given else load_genome(str(runs[best].path), one).genes
        if runs:
            histories[one] = [run.table("history.csv") for run in runs.values()]
    signals = {one: config.signal.of(one) for one in shown}

    def world(scenario: str) -> tuple[Scenario, Lifetime]:
        there = load(EvaluateConfig, [f"scenario={scenario}"])
        return replace(there.world, physics=part_from("physics", config.physics, "physics")), there.lifetime

    return reproduction.figures_of(found, shown, signals, world, histories, config.seed)


def _report(study: RunFolder, config: ReproduceConfig, champions: list[_Champion], given: Genome | None) -> None:
    """Write the tables, the figures and the report over all lifetimes."""
    found, tables = _findings(study.path, config, champions, given)
    for name, table in tables.items():
        study.write(f"{name}.csv", table)
    made = _figures(study.path, config, champions, given, found)
    text = report.markdown(found, {name: caption for name, (caption, _) in made.items()})
    drawn = {name: figure for name, (_, figure) in made.items()}
    write_report(study, text, drawn, "epuckhebb: the paper's experiment, reproduced")


def _findings(
    folder: Path, config: ReproduceConfig, champions: list[_Champion], given: Genome | None
) -> tuple[report.Findings, dict[str, pd.DataFrame]]:
    """The findings, and all tables by their names."""
    last = config.first_seed + config.champions - 1
    who = f"{config.champions} champions of each experiment, evolved from seeds {config.first_seed} to {last}"
    if given:
        who = f"genome {code(given.name)} (SHA-256 {given.sha256[:16]}…)"
    count = 1 if given else config.champions
    paper: Mapping[str, Any] = yaml.safe_load(
        (data_folder("conf") / "paper" / "tables.yaml").read_text(encoding="utf-8")
    )
    return reproduction.findings_of(
        pd.concat([Run(folder / one.test.run).table("metrics.csv") for one in champions], ignore_index=True),
        paper,
        dict.fromkeys([one.experiment for one in champions], count),  # else a job would have failed
        champions=count,
        given=given is not None,
        repeats=config.repeats,
        provenance=f"Made by `epuckhebb reproduce`: {who}; {config.repeats} repeats of every condition "
        f"(seed {config.seed}); live fitness: {config.signal.value}; physics: {config.physics['kind']}.",
    )
