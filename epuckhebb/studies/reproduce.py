"""`epuckhebb reproduce`: a study that evolves champions, evaluates each, and reports which of the paper's claims hold.

The folder is named by the settings, so the same command resumes it; see `epuckhebb.studies.jobs`. All conditions of a
champion are one task, so its lifetimes share the threads of one process.
"""

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd
import yaml

from epuckhebb.analysis import figures, report, reproduction
from epuckhebb.analysis.evaluate import evaluate, memory_to_evaluate
from epuckhebb.analysis.tables import code
from epuckhebb.config.compose import load
from epuckhebb.config.schema import EvaluateConfig, EvolveConfig, ReproduceConfig
from epuckhebb.evolution.evolve import Generation, evolve, history_row, memory_to_evolve
from epuckhebb.runs.evaluate import compile_for
from epuckhebb.runs.evolve import prepare
from epuckhebb.runtime.errors import ConfigError
from epuckhebb.runtime.resources import Need, data_folder, require, thread_count
from epuckhebb.sim.life import Lifetime
from epuckhebb.sim.maze import SIDES
from epuckhebb.sim.network import PAPER_NETWORK
from epuckhebb.sim.robot import EPUCK
from epuckhebb.sim.scenario import TRAINED, Scenario
from epuckhebb.store import Genome, Run, RunFolder, load_genome, provenance
from epuckhebb.studies import jobs
from epuckhebb.studies.jobs import Task

EXPERIMENTS = {"light": ("light",), "obstacles": ("obstacles",), "all": ("light", "obstacles")}
QUICK = ("champions=3", "repeats=3", "rates=[0.000015,0.002]")


@dataclass(frozen=True, kw_only=True)
class _Champion:
    """A champion of the study, and the names of its files in the folder; one whose genome is given is not evolved."""

    experiment: str
    name: str
    seed: int
    given: Genome | None

    @property
    def file(self) -> str:
        return f"champions/{self.name}.npz"

    @property
    def history(self) -> str:
        return f"history/{self.name}.csv"

    @property
    def lifetimes(self) -> str:
        return f"lifetimes/{self.experiment}_{self.name}.csv" if self.given else f"lifetimes/{self.name}.csv"

    def genome(self, folder: Path) -> Genome:
        return self.given or Genome(genes=load_genome(str(folder / self.file), self.experiment).genes, name=self.name)


@dataclass(frozen=True, kw_only=True)
class _Study:
    """A reproduction: its settings, folder and champions."""

    experiments: tuple[str, ...]
    config: ReproduceConfig
    folder: Path
    champions: list[_Champion]  # in the order of the tables
    given: Genome | None  # used in place of champions
    paper: Mapping[str, Any]  # the published tables
    changed: list[str] = field(default_factory=list)  # the experiment of each champion whose genome changed


def reproduce(experiment: str, overrides: list[str], *, quick: bool) -> Path:
    """Do what is missing and write the report; returns its folder.

    Raises:
        ConfigError: The experiment, a key, the genome, or what an earlier run left cannot be used.
    """
    if experiment not in EXPERIMENTS:
        raise ConfigError(f"reproduce {experiment}: the experiment must be one of {', '.join(EXPERIMENTS)}")
    config = load(ReproduceConfig, [*(QUICK if quick else ()), *overrides])
    experiments = EXPERIMENTS[experiment]
    require(list(_needs(config, experiments)))
    paper = yaml.safe_load((data_folder("conf") / "paper" / "tables.yaml").read_text(encoding="utf-8"))
    given = None if config.genome is None else _given(config.genome)
    folder = _folder(experiment, config, given)
    seeds = [0] if given else range(config.first_seed, config.first_seed + config.champions)
    champions = [
        _Champion(experiment=one, name=given.name if given else f"{one}_seed{seed:03d}", seed=seed, given=given)
        for one in experiments
        for seed in seeds
    ]
    study = _Study(experiments=experiments, config=config, folder=folder, champions=champions, given=given, paper=paper)
    for champion in champions:
        if not given and Run(folder).is_as_written(champion.file):
            champion.genome(folder)  # one that cannot be read is found before the others are evolved
    steps = {one: _robot_steps(config, one) for one in experiments}
    tasks = []
    for one in [] if given else champions:
        made = (folder / one.history, folder / one.file)
        tasks.append(Task(f"evolve {one.name}", made, partial(_evolve, study, one), steps[one.experiment][0]))
    for one in champions:
        lifetimes = (folder / one.lifetimes,)
        tasks.append(Task(f"evaluate {one.name}", lifetimes, partial(_evaluate, study, one), steps[one.experiment][1]))
    tasks += [
        Task("tables, figures and report", (), partial(_report, study), sum(count for _, count in steps.values()))
    ]
    jobs.run_tasks(folder, "reproduce", config, [experiment, *(["--quick"] if quick else []), *overrides], tasks)
    return folder


def _needs(config: ReproduceConfig, experiments: tuple[str, ...]) -> Iterator[Need]:
    """The memory that a reproduction takes."""
    room = memory_to_evolve(config.ga.population, config.ga.loops, PAPER_NETWORK.synapses)
    yield Need(room, "a population", "lower ga.population or ga.loops")
    for one in experiments:
        controllers = len(reproduction.controllers(one, config.rates, config.signal.of(one)))
        lifetimes, _ = memory_to_evaluate(controllers, Lifetime(), config.repeats, PAPER_NETWORK)
        lifetimes *= len(reproduction.worlds(one)) * config.champions
        yield Need(
            lifetimes, f"the lifetimes of the {one} experiment", "lower champions or repeats, or give fewer rates"
        )


def _robot_steps(config: ReproduceConfig, experiment: str) -> tuple[float, float]:
    """How long it takes to evolve a champion, and to evaluate it."""
    evolutions = config.ga.generations * config.ga.population * config.ga.loops
    controllers = 1 + len(reproduction.controllers(experiment, config.rates, config.signal.of(experiment)))
    evaluations = len(reproduction.worlds(experiment)) * controllers * config.repeats
    lifetimes = _training(experiment).lifetime, _world(TRAINED[experiment])[1]
    return evolutions * len(SIDES) * lifetimes[0].steps, evaluations * len(SIDES) * lifetimes[1].steps


def _given(where: str) -> Genome:
    """The genome in place of champions; it must be for the paper's robot and network."""
    genome = load_genome(where, "obstacles")
    if (genome.network, genome.robot) != (PAPER_NETWORK, EPUCK.name):
        raise ConfigError(
            f"genome={where} is for robot {genome.robot} and a network of layers {genome.network}; the paper's are "
            f"{EPUCK.name} and {PAPER_NETWORK}"
        )
    return genome


def _folder(experiment: str, config: ReproduceConfig, given: Genome | None) -> Path:
    """The folder of these settings; other settings, or another version of the science, have another folder."""
    depends = {key: value for key, value in config.values.items() if key not in ("threads", "genome")}
    depends |= {"experiment": experiment, "science": provenance.science_version()}
    depends["genome"] = given.sha256 if given else None
    digest = hashlib.sha256(repr(sorted(depends.items())).encode()).hexdigest()[:8]
    who = given.name if given else f"champions{config.champions}"
    return Path("runs") / "reproduce" / f"{experiment}_{who}_seed{config.first_seed}_{digest}"


def _evolve(study: _Study, champion: _Champion, run: RunFolder) -> None:
    """Evolve a champion from its seed."""
    prepared, threads, ga = prepare(_training(champion.experiment)), thread_count(study.config.threads), study.config.ga
    world, lifetime = prepared.config.world, prepared.config.lifetime
    run.advanced(0.0, "compiling …")
    prepared.compile()
    generations: list[Generation] = []
    for generation in evolve(ga, world, lifetime, champion.seed, threads):
        generations.append(generation)
        run.advanced(len(generations) / ga.generations, f"generation {len(generations)} of {ga.generations}")
    history, last = pd.DataFrame(map(history_row, generations)), generations[-1]
    remembered = prepared.remember(last.champion, threads)
    run.keep(champion.history, history)
    run.keep(champion.file, prepared.champion(last, champion.seed, *remembered))


def _evaluate(study: _Study, champion: _Champion, run: RunFolder) -> None:
    """Evaluate a champion in every scenario of its experiment, with every rate and control."""
    genome, config, one = champion.genome(study.folder), study.config, champion.experiment
    before, rows = genome.sha256, []
    worlds, controllers = reproduction.worlds(one), reproduction.controllers(one, config.rates, config.signal.of(one))
    how: Any = {"repeats": config.repeats, "seed": config.seed, "threads": thread_count(config.threads)}
    for number, name in enumerate(worlds):
        scenario, lifetime = _world(name, "lifetime.record_every=0")
        if not number:
            run.advanced(0.0, "compiling …")
            compile_for(controllers[:1], PAPER_NETWORK, scenario)
        run.advanced(number / len(worlds), f"in {name}, world {number + 1} of {len(worlds)}")
        metrics, _ = evaluate(genome.genes, scenario, controllers, lifetime, name=champion.name, **how)
        rows.append(metrics)
    if genome.sha256 != before:
        study.changed.append(champion.experiment)
    run.keep(champion.lifetimes, pd.concat(rows))


def _report(study: _Study, run: RunFolder) -> None:
    """Write the tables, the figures and the report over all lifetimes."""
    found = _findings(study, run)
    pictures = {name: (caption, figures.small(png)) for name, (caption, png) in _figures(study, found).items()}
    text = report.markdown(found, {name: caption for name, (caption, _) in pictures.items()})
    for name, (_, png) in pictures.items():
        run.write(f"figures/{name}", png)
    run.write("report.md", text)
    run.write("report.html", report.html(text, lambda name: pictures[name][1]))


def _table(study: _Study, file: str) -> pd.DataFrame:
    """A table that may be of an earlier call."""
    try:
        return Run(study.folder).table(file)
    except ConfigError as error:
        raise ConfigError(f"{error}; remove it and start again") from error


def _findings(study: _Study, run: RunFolder) -> report.Findings:
    """The findings; their tables are written."""
    config, given = study.config, study.given
    count = 1 if given else config.champions
    last = config.first_seed + config.champions - 1
    who = f"{config.champions} champions of each experiment, evolved from seeds {config.first_seed} to {last}"
    if given:
        who = f"genome {code(given.name)} (SHA-256 {given.sha256[:16]}…)"
    found, tables = reproduction.findings_of(
        pd.concat([_table(study, one.lifetimes) for one in study.champions], ignore_index=True),
        study.paper,
        {one: count - study.changed.count(one) for one in study.experiments},
        champions=count,
        given=given is not None,
        repeats=config.repeats,
        provenance=f"Made by `epuckhebb reproduce`: {who}; {config.repeats} repeats of every condition "
        f"(seed {config.seed}); live fitness: {config.signal.value}.",
    )
    for name, table in tables.items():
        run.write(f"{name}.csv", table)
    return found


def _figures(study: _Study, found: report.Findings) -> dict[str, tuple[str, bytes]]:
    """The figures by the names of their files, each a caption and a PNG."""
    shown, histories = {}, {}
    for one in study.experiments:
        own = [champion for champion in study.champions if champion.experiment == one]
        best = next(champion for champion in own if champion.name == found.showcase[one][0])
        shown[one] = best.genome(study.folder).genes
        if not study.given:
            histories[one] = [_table(study, champion.history) for champion in own]
    signals = {one: study.config.signal.of(one) for one in study.experiments}
    return reproduction.figures_of(found, shown, signals, _world, histories, study.config.seed)


def _training(experiment: str) -> EvolveConfig:
    return load(EvolveConfig, [f"scenario={TRAINED[experiment]}"])


def _world(scenario: str, *more: str) -> tuple[Scenario, Lifetime]:
    config = load(EvaluateConfig, [f"scenario={scenario}", *more])
    return config.world, config.lifetime
