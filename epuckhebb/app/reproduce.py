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

from epuckhebb.app import engine, files, runs
from epuckhebb.app.config import EvaluateConfig, EvolveConfig, ReproduceConfig, thread_count, typed
from epuckhebb.app.data import data_folder
from epuckhebb.app.engine import Task
from epuckhebb.app.errors import ConfigError
from epuckhebb.app.evolve import champion_of
from epuckhebb.app.files import Genome
from epuckhebb.app.hydra_bridge import composed
from epuckhebb.evolution.evolve import evolve, history_row
from epuckhebb.sim.lifetime import Samples
from epuckhebb.sim.memory import remember
from epuckhebb.sim.plasticity import Hebbian, Sign
from epuckhebb.sim.scenario import TRAINED
from epuckhebb.study import charts, figures, findings, published, report
from epuckhebb.study.evaluate import HEBBIAN, evaluate

EXPERIMENTS = {"light": ("light",), "obstacles": ("obstacles",), "all": ("light", "obstacles")}
QUICK = ("champions=3", "repeats=3", "rates=[0.000015,0.002]")
RULE = (
    "It is the champion whose successes and failures agree with the paper's in most cells, among those that reach both "
    "goals in their training world (of all, if none does); of equals the one with the lowest seed. Chosen for its "
    "likeness, it shows that the pattern exists, not how often."
)


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
    paper = _published()
    given = None if config.genome is None else files.load_genome(config.genome, "obstacles")
    folder = _folder(experiment, cfg, given)
    experiments = EXPERIMENTS[experiment]
    champions = list(_champions(experiments, config, folder, given))
    study = _Study(experiments=experiments, config=config, folder=folder, champions=champions, given=given, paper=paper)
    for champion in champions:
        if engine.is_whole(champion.file):
            champion.genome()  # one that cannot be read is found before the others are evolved
    tasks = [] if given else [Task(f"evolve {one.name}", one.file, partial(_evolve, study, one)) for one in champions]
    tasks += [Task(f"evaluate {one.name}", one.lifetimes, partial(_evaluate, study, one)) for one in champions]
    tasks += [Task("tables, figures and report", None, partial(_tell, study))]
    engine.carry_out(folder, "reproduce", cfg, [experiment, *(["--quick"] if quick else []), *overrides], tasks)
    return folder


def _published() -> Mapping[str, Any]:
    path = data_folder("conf") / "paper" / "tables.yaml"
    try:
        tables: Mapping[str, Any] = yaml.safe_load(path.read_text())
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


def _evolve(study: _Study, champion: _Champion) -> None:
    """Evolve a champion from its seed."""
    world = typed(composed("evolve", [f"scenario={TRAINED[champion.experiment]}"]), EvolveConfig)
    threads = thread_count(study.config.threads)
    generations = list(evolve(study.config.ga, world.scenario, world.lifetime, champion.seed, threads))
    history = pd.DataFrame(map(history_row, generations))
    last = generations[-1]
    memory = remember(last.champion, world.scenario, threads=threads)
    runs.write_whole(champion.history, history.to_csv(index=False).encode())
    runs.write_whole(champion.file, champion_of(last, champion.experiment, champion.seed, memory))


def _evaluate(study: _Study, champion: _Champion) -> None:
    """Let a champion live in every scenario of its experiment, with every rate and control."""
    genome, config = champion.genome(), study.config
    before = genome.sha256
    rows = [
        evaluate(
            genome.genes,
            world.scenario,
            _plasticities(config, champion.experiment),
            world.lifetime,
            repeats=config.repeats,
            seed=config.seed,
            threads=thread_count(config.threads),
            name=champion.name,
        )[0]
        for world in map(_world, (TRAINED[champion.experiment], *findings.CHANGED[champion.experiment]))
    ]
    if genome.sha256 != before:
        study.changed.append(champion.experiment)
    runs.write_whole(champion.lifetimes, pd.concat(rows).to_csv(index=False).encode())


def _tell(study: _Study) -> None:
    """Write the tables, the figures and the report over all lifetimes."""
    lifetimes = pd.concat([_lifetimes(champion.lifetimes) for champion in study.champions], ignore_index=True)
    found = _findings(study, lifetimes)
    pictures = {name: (told, figures.small(png)) for name, (told, png) in _figures(study, found).items()}
    text = report.markdown(found, {name: caption for name, (caption, _) in pictures.items()})
    for name, (_, png) in pictures.items():
        runs.write_whole(study.folder / "figures" / name, png)
    runs.write_whole(study.folder / "report.md", text.encode())
    runs.write_whole(study.folder / "report.html", report.html(text, lambda name: pictures[name][1]).encode())


def _lifetimes(file: Path) -> pd.DataFrame:
    try:
        return pd.read_csv(file, keep_default_na=False, na_values=[""])
    except (OSError, ValueError) as error:
        raise ConfigError(f"{file} of an earlier run cannot be read ({error}); remove it and start again") from error


def _world(scenario: str) -> EvaluateConfig:
    return typed(composed("evaluate", [f"scenario={scenario}", "lifetime.record_every=0"]), EvaluateConfig)


def _plasticities(config: ReproduceConfig, experiment: str) -> list[Hebbian]:
    rates = sorted({*config.rates, findings.PAPER_N[experiment]})
    return [
        Hebbian(name="paper", N=rate, sign=sign, signal=config.signal.of(experiment)) for sign in Sign for rate in rates
    ]


def _findings(study: _Study, metrics: pd.DataFrame) -> report.Findings:
    each, paper = findings.trials(metrics), study.paper
    success = published.published_success(paper)
    showcase = {one: findings.showcase(each, success, one) for one in study.experiments}
    count = 1 if study.given else study.config.champions
    unchanged = {one: count - study.changed.count(one) for one in study.experiments}
    values = published.published_values(paper)
    comparison = published.compare(values, each, {one: name for one, (name, *_) in showcase.items()})
    comparison["title"] = [paper[table]["title"] for table in comparison.table]
    found = report.Findings(
        claims=findings.claims(each, unchanged),
        success=findings.success(each),
        rescue_and_harm=findings.rescue_and_harm(each),
        dose_response=findings.dose_response(each),
        comparison=comparison,
        showcase=showcase,
        champions=count,
        given=study.given is not None,
        repeats=study.config.repeats,
        rule=RULE,
        provenance=_provenance(study),
    )
    tables = {
        "metrics": metrics,
        "trials": each,
        "claims": found.claims,
        "success": found.success,
        "rescue_and_harm": found.rescue_and_harm,
        "dose_response": found.dose_response,
        "comparison": comparison.drop(columns="title"),
    }
    for name, table in tables.items():
        runs.write_whole(study.folder / f"{name}.csv", table.to_csv(index=False).encode())
    return found


def _provenance(study: _Study) -> str:
    config = study.config
    last = config.first_seed + config.champions - 1
    who = (
        f"genome `{study.given.name}` (SHA-256 {study.given.sha256[:16]}…)"
        if study.given
        else f"{config.champions} champions of each experiment, evolved from seeds {config.first_seed} to {last}"
    )
    return (
        f"Made by `epuckhebb reproduce`: {who}; {config.repeats} noise repeats of every condition "
        f"(seed {config.seed}); live fitness: {config.signal.value}."
    )


def _figures(study: _Study, found: report.Findings) -> dict[str, tuple[str, bytes]]:
    """File name -> (caption, PNG), in the order of the report."""
    made: dict[str, tuple[str, bytes]] = {}
    for one in study.experiments:
        name = found.showcase[one][0]
        shown = next(own for own in study.champions if (own.experiment, own.name) == (one, name))
        genome, rate = shown.genome(), findings.PAPER_N[one]
        plastic = Hebbian(name="paper", N=rate, signal=study.config.signal.of(one))
        lived: dict[tuple[str, str], dict[str, Samples]] = {}
        for scenario in (TRAINED[one], *findings.CHANGED[one]):
            world = typed(composed("evaluate", [f"scenario={scenario}"]), EvaluateConfig)
            _, traces = evaluate(
                genome.genes, world.scenario, [plastic], world.lifetime, repeats=1, seed=study.config.seed, name=name
            )
            title = f"{scenario}, {name}, N = {rate:g}, one lifetime a side"
            made[f"trajectories_{scenario}.png"] = (
                f"{scenario}: trajectories of `{name}` alone and with plasticity at N = {rate:g}; one lifetime a side.",
                figures.trajectories(traces, world.scenario, title),
            )
            for place, key in enumerate(zip(traces.controller, traces.side, strict=True)):
                samples = Samples(*(array[place] for array in traces.samples))
                lived.setdefault((scenario, key[0]), {})[key[1]] = samples
        changed = {scenario: lived[scenario, HEBBIAN] for scenario in findings.CHANGED[one]}
        for against in ("fitness", "light" if one == "light" else "proximity"):
            made[f"weight_change_{one}_{against}.png"] = (
                f"{one}: change of the weights between samples against {against}, `{name}`, N = {rate:g}; left blue, "
                "right red.",
                charts.weight_change(changed, against, f"{name}, N = {rate:g}"),
            )
        last = findings.CHANGED[one][-1]
        made[f"network_{one}.png"] = (
            f"{last}: how plasticity at N = {rate:g} has changed the network of `{name}` by the end of a lifetime.",
            charts.network(genome.genes, lived[last, HEBBIAN], f"{name} in {last}, N = {rate:g}"),
        )
        if study.given is None:
            made[f"dose_response_{one}.png"] = (
                f"{one}: success, time to goal, weight change, and rescue and harm with their controls, against N; "
                f"{found.champions} champions.",
                charts.dose_response(found.dose_response, found.rescue_and_harm, one, found.champions),
            )
    if study.given is None:
        histories = {
            one: [pd.read_csv(own.history) for own in study.champions if own.experiment == one]
            for one in study.experiments
        }
        made["learning_curves.png"] = (
            f"Learning curves: best and mean fitness, median and quartiles of {found.champions} evolutions.",
            charts.learning_curves(histories),
        )
    maze = figures.maze(_world("4obstacles").scenario)
    return {
        "maze.png": ("The maze: robot at the start, lamp, goals with their 5 cm circles, four obstacles.", maze),
        **made,
    }
