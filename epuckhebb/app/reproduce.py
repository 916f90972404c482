"""`epuckhebb reproduce`: a study of two stages, which evolves champions and evaluates each, and tells what came out.

The folder is named by what is asked for, so that the same command goes on where it was interrupted; see
`epuckhebb.app.engine`. All conditions of a champion are one task, so that its lifetimes share the threads of one
process.
"""

import hashlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd
import yaml
from omegaconf import DictConfig, OmegaConf

from epuckhebb.app import engine, files, formats, runs
from epuckhebb.app.config import EvaluateConfig, EvolveConfig, ReproduceConfig, thread_count, typed
from epuckhebb.app.data import data_folder
from epuckhebb.app.engine import Task
from epuckhebb.app.errors import ConfigError
from epuckhebb.app.evaluate import compiled_for
from epuckhebb.app.evolve import champion_of, home
from epuckhebb.app.files import Genome
from epuckhebb.app.hydra_bridge import composed
from epuckhebb.app.machine import Need, require
from epuckhebb.app.runs import RunFolder
from epuckhebb.evolution.evolve import Generation, evolve, history_row, room_to_evolve
from epuckhebb.sim.controller import GA_ALONE
from epuckhebb.sim.lifetime import Lifetime
from epuckhebb.sim.maze import SIDES
from epuckhebb.sim.network import PAPER_NETWORK
from epuckhebb.sim.robot import EPUCK
from epuckhebb.sim.scenario import TRAINED, Scenario
from epuckhebb.study import figures, published, report, reproduction
from epuckhebb.study.evaluate import evaluate, room_to_evaluate
from epuckhebb.study.tables import code

EXPERIMENTS = {"light": ("light",), "obstacles": ("obstacles",), "all": ("light", "obstacles")}
QUICK = ("champions=3", "repeats=3", "rates=[0.000015,0.002]")


@dataclass(frozen=True, kw_only=True)
class _Champion:
    """A champion of the study, and where it, its history and its lifetimes are kept; one that is given has no file."""

    experiment: str
    name: str
    seed: int
    file: Path
    history: Path
    lifetimes: Path
    given: Genome | None

    def genome(self) -> Genome:
        """Its genome.

        Raises:
            ConfigError: The file cannot be read.
        """
        if self.given is not None:
            return self.given
        return Genome(genes=files.load_genome(str(self.file), self.experiment).genes, name=self.name)


@dataclass(frozen=True, kw_only=True)
class _Study:
    """What was asked for.

    Attributes:
        experiments: The names of the experiments.
        config: The settings.
        folder: Where everything is kept.
        champions: All champions, in the order of the tables.
        given: The genome that takes the place of champions, if one was given.
        paper: The published tables.
        changed: The experiments of champions whose genome was another after their lifetimes; the paper claims none is.
    """

    experiments: tuple[str, ...]
    config: ReproduceConfig
    folder: Path
    champions: list[_Champion]
    given: Genome | None
    paper: Mapping[str, Any]
    changed: list[str] = field(default_factory=list)


def reproduce(experiment: str, overrides: list[str], *, quick: bool) -> Path:
    """Do what is missing and write the report; returns its folder.

    Raises:
        ConfigError: The experiment, a key, the genome, or what an earlier run left cannot be used; or another process
            works in the folder.
        JobFailedError: It began and could not be finished.
    """
    if experiment not in EXPERIMENTS:
        raise ConfigError(f"reproduce {experiment}: the experiment must be one of {', '.join(EXPERIMENTS)}")
    cfg = composed("reproduce", [*(QUICK if quick else ()), *overrides])
    config = typed(cfg, ReproduceConfig)
    require(list(_needs(config, EXPERIMENTS[experiment])))
    paper = _published()
    given = None if config.genome is None else _given(config.genome)
    folder = _folder(experiment, cfg, given)
    experiments = EXPERIMENTS[experiment]
    champions = list(_champions(experiments, config, folder, given))
    study = _Study(experiments=experiments, config=config, folder=folder, champions=champions, given=given, paper=paper)
    for champion in champions:
        if not given and runs.is_as_written(folder, f"champions/{champion.name}.npz"):
            champion.genome()  # one that cannot be read is found before the others are evolved
    evolving, living = (
        {one: size(config, one) for one in experiments} for size in (_steps_to_evolve, _steps_to_evaluate)
    )
    tasks = [
        Task(f"evolve {one.name}", (one.history, one.file), partial(_evolve, study, one), evolving[one.experiment])
        for one in ([] if given else champions)
    ]
    tasks += [
        Task(f"evaluate {one.name}", (one.lifetimes,), partial(_evaluate, study, one), living[one.experiment])
        for one in champions
    ]
    tasks += [Task("tables, figures and report", (), partial(_tell, study), sum(living.values()))]
    engine.carry_out(folder, "reproduce", cfg, [experiment, *(["--quick"] if quick else []), *overrides], tasks)
    return folder


def _needs(config: ReproduceConfig, experiments: tuple[str, ...]) -> Iterator[Need]:
    """The memory that a reproduction takes."""
    room = room_to_evolve(config.ga.population, config.ga.loops, PAPER_NETWORK.synapses)
    yield Need(room, "a population", "lower ga.population or ga.loops")
    for one in experiments:
        controllers = len(reproduction.controllers(one, config.rates, config.signal.of(one)))
        lives, _ = room_to_evaluate(controllers, Lifetime(), config.repeats, PAPER_NETWORK)
        lives *= len(reproduction.worlds(one)) * config.champions
        yield Need(lives, f"the lifetimes of the {one} experiment", "lower champions or repeats, or give fewer rates")


def _steps_to_evolve(config: ReproduceConfig, experiment: str) -> float:
    """The robot-steps of an evolution, which is how long it takes beside an evaluation."""
    lifetime = _training(experiment).lifetime
    return config.ga.generations * config.ga.population * config.ga.loops * len(SIDES) * lifetime.steps


def _steps_to_evaluate(config: ReproduceConfig, experiment: str) -> float:
    """The robot-steps of the evaluation of a champion."""
    controllers = 1 + len(reproduction.controllers(experiment, config.rates, config.signal.of(experiment)))
    _, lifetime = _world(TRAINED[experiment])
    return len(reproduction.worlds(experiment)) * controllers * config.repeats * len(SIDES) * lifetime.steps


def _given(where: str) -> Genome:
    """The genome that takes the place of champions.

    Raises:
        ConfigError: There is none, or it is for another robot or network than the paper's.
    """
    genome = files.load_genome(where, "obstacles")
    if (genome.network, genome.robot) != (PAPER_NETWORK, EPUCK.name):
        raise ConfigError(
            f"genome={where} is for robot {genome.robot} and a network of layers {genome.network}; the paper's are "
            f"{EPUCK.name} and {PAPER_NETWORK}"
        )
    return genome


def _published() -> Mapping[str, Any]:
    path = data_folder("conf") / "paper" / "tables.yaml"
    try:
        tables: Mapping[str, Any] = yaml.safe_load(path.read_text(encoding="utf-8"))
        published.published_success(tables)
    except (OSError, KeyError, TypeError, ValueError, yaml.YAMLError) as error:
        raise ConfigError(f"{path} does not hold the published tables: {error}") from error
    return tables


def _folder(experiment: str, cfg: DictConfig, given: Genome | None) -> Path:
    """A name that says what was asked for: another question, or another version of the science, gets another folder."""
    asked = OmegaConf.to_container(cfg)
    assert isinstance(asked, dict)
    asked = {key: value for key, value in asked.items() if key not in ("threads", "genome")}
    asked |= {"experiment": experiment, "science": runs.science_version(), "genome": given.sha256 if given else None}
    digest = hashlib.sha256(repr(sorted(asked.items())).encode()).hexdigest()[:8]
    who = given.name if given else f"champions{cfg.champions}"
    return Path("runs") / "reproduce" / f"{experiment}_{who}_seed{cfg.first_seed}_{digest}"


def _champions(
    experiments: tuple[str, ...], config: ReproduceConfig, folder: Path, given: Genome | None
) -> Iterator[_Champion]:
    """The champions of each experiment in turn; the given genome is that of all."""
    for experiment in experiments:
        for seed in [0] if given else range(config.first_seed, config.first_seed + config.champions):
            name = given.name if given else f"{experiment}_seed{seed:03d}"
            lived = f"{experiment}_{name}" if given else name
            yield _Champion(
                experiment=experiment,
                name=name,
                seed=seed,
                file=folder / "champions" / f"{name}.npz",
                history=folder / "history" / f"{name}.csv",
                lifetimes=folder / "lifetimes" / f"{lived}.csv",
                given=given,
            )


def _evolve(study: _Study, champion: _Champion, run: RunFolder) -> None:
    """Evolve a champion from its seed."""
    world = _training(champion.experiment)
    threads, ga = thread_count(study.config.threads), study.config.ga
    run.advanced(0.0, "compiling …")
    compiled_for(GA_ALONE, PAPER_NETWORK, world.world)
    generations: list[Generation] = []
    for generation in evolve(ga, world.world, world.lifetime, champion.seed, threads):
        generations.append(generation)
        run.advanced(len(generations) / ga.generations, f"generation {len(generations)} of {ga.generations}")
    history = pd.DataFrame(map(history_row, generations))
    last = generations[-1]
    remembered = home(last.champion, world.world, threads, PAPER_NETWORK)
    run.keep(f"history/{champion.history.name}", history.to_csv(index=False).encode())
    run.keep(f"champions/{champion.file.name}", champion_of(last, world, champion.seed, *remembered))


def _evaluate(study: _Study, champion: _Champion, run: RunFolder) -> None:
    """Let a champion live in every scenario of its experiment, with every rate and control."""
    genome, config, one = champion.genome(), study.config, champion.experiment
    before, rows = genome.sha256, []
    worlds, controllers = reproduction.worlds(one), reproduction.controllers(one, config.rates, config.signal.of(one))
    for number, name in enumerate(worlds):
        scenario, lifetime = _world(name, "lifetime.record_every=0")
        if not number:
            run.advanced(0.0, "compiling …")
            compiled_for(controllers[0], PAPER_NETWORK, scenario)
        run.advanced(number / len(worlds), f"in {name}, world {number + 1} of {len(worlds)}")
        metrics, _ = evaluate(
            genome.genes,
            scenario,
            controllers,
            lifetime,
            repeats=config.repeats,
            seed=config.seed,
            threads=thread_count(config.threads),
            name=champion.name,
        )
        rows.append(metrics)
    if genome.sha256 != before:
        study.changed.append(champion.experiment)
    run.keep(f"lifetimes/{champion.lifetimes.name}", pd.concat(rows).to_csv(index=False).encode())


def _tell(study: _Study, run: RunFolder) -> None:
    """Write the tables, the figures and the report over all lifetimes."""
    found = _findings(study, run)
    pictures = {name: (told, figures.small(png)) for name, (told, png) in _figures(study, found).items()}
    text = report.markdown(found, {name: caption for name, (caption, _) in pictures.items()})
    for name, (_, png) in pictures.items():
        run.write(f"figures/{name}", png)
    run.write("report.md", text)
    run.write("report.html", report.html(text, lambda name: pictures[name][1]))


def _table(study: _Study, file: Path, columns: formats.Columns) -> pd.DataFrame:
    """A table that is perhaps of an earlier call."""
    try:
        return runs.table(study.folder, file.relative_to(study.folder).as_posix(), columns)
    except ConfigError as error:
        raise ConfigError(f"{error}; remove it and start again") from error


def _findings(study: _Study, run: RunFolder) -> report.Findings:
    """What came out; its tables are written."""
    config, given = study.config, study.given
    count = 1 if given else config.champions
    last = config.first_seed + config.champions - 1
    who = (
        f"genome {code(given.name)} (SHA-256 {given.sha256[:16]}…)"
        if given
        else f"{config.champions} champions of each experiment, evolved from seeds {config.first_seed} to {last}"
    )
    found, tables = reproduction.findings_of(
        pd.concat([_table(study, one.lifetimes, formats.METRICS) for one in study.champions], ignore_index=True),
        study.paper,
        {one: count - study.changed.count(one) for one in study.experiments},
        champions=count,
        given=given is not None,
        repeats=config.repeats,
        provenance=f"Made by `epuckhebb reproduce`: {who}; {config.repeats} noise repeats of every condition "
        f"(seed {config.seed}); live fitness: {config.signal.value}.",
    )
    for name, table in tables.items():
        run.write(f"{name}.csv", table.to_csv(index=False))
    return found


def _figures(study: _Study, found: report.Findings) -> dict[str, tuple[str, bytes]]:
    """The figures by the names of their files, each a caption and a PNG."""
    shown, histories = {}, {}
    for one in study.experiments:
        own = [champion for champion in study.champions if champion.experiment == one]
        shown[one] = next(champion for champion in own if champion.name == found.showcase[one][0]).genome().genes
        if not study.given:
            histories[one] = [_table(study, champion.history, formats.HISTORY) for champion in own]
    signals = {one: study.config.signal.of(one) for one in study.experiments}
    return reproduction.figures_of(found, shown, signals, _world, histories, study.config.seed)


def _training(experiment: str) -> EvolveConfig:
    return typed(composed("evolve", [f"scenario={TRAINED[experiment]}"]), EvolveConfig)


def _world(scenario: str, *more: str) -> tuple[Scenario, Lifetime]:
    config = typed(composed("evaluate", [f"scenario={scenario}", *more]), EvaluateConfig)
    return config.world, config.lifetime
