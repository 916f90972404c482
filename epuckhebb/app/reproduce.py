"""`epuckhebb reproduce`: evolve the champions that are missing, evaluate what is missing, then tables, figures, report.

The folder is named by what is asked for, so that the same command goes on where it was interrupted; a champion or an
evaluation that is there is whole, because files are renamed into place.
"""

import hashlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd
import yaml
from omegaconf import DictConfig, OmegaConf

from epuckhebb.app import genomes, runs
from epuckhebb.app.compose import composed
from epuckhebb.app.config import EvaluateConfig, EvolveConfig, ReproduceConfig, thread_count, typed
from epuckhebb.app.data import data_folder
from epuckhebb.app.errors import ConfigError
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
Step = Callable[[str], None]


@dataclass(frozen=True)
class _Work:
    """What is to be done: the experiments, the settings, the folder, and a given genome, if any."""

    experiments: tuple[str, ...]
    config: ReproduceConfig
    folder: Path
    given: genomes.Genome | None

    def champions(self, experiment: str) -> Iterator[tuple[str, int]]:
        """Names and seeds of the champions of an experiment."""
        if self.given is not None:
            yield self.given.name, 0
            return
        for seed in range(self.config.first_seed, self.config.first_seed + self.config.champions):
            yield f"{experiment}_seed{seed:03d}", seed


def reproduce(experiment: str, overrides: list[str], *, quick: bool, step: Callable[[int], Step]) -> Path:
    """Do what is missing and write the report; returns its folder.

    step: given the number of steps, returns a function that is called with the name of each as it begins.

    Raises:
        ConfigError: the experiment, a key, the genome, or what an earlier run left cannot be used.
    """
    if experiment not in EXPERIMENTS:
        raise ConfigError(f"reproduce {experiment}: the experiment must be one of {', '.join(EXPERIMENTS)}")
    cfg = composed("reproduce", [*(QUICK if quick else ()), *overrides])
    config = typed(cfg, ReproduceConfig)
    paper = _published()
    given = None if config.genome is None else genomes.load(config.genome, "obstacles")
    folder = _folder(experiment, cfg, given)
    work = _Work(EXPERIMENTS[experiment], config, folder, given)
    _begin(work, cfg, ["reproduce", experiment, *(["--quick"] if quick else []), *overrides])
    names = [(one, name, seed) for one in work.experiments for name, seed in work.champions(one)]
    tell = step(2 * len(names) + 2)
    loaded: dict[str, genomes.Genome] = {}
    for one, name, seed in names:
        tell(f"evolve {name}")
        loaded[f"{one}/{name}"] = _champion(work, one, name, seed)
    parts, unchanged = [], dict.fromkeys(work.experiments, 0)
    for one, name, _ in names:
        tell(f"evaluate {name}")
        genome = loaded[f"{one}/{name}"]
        before = genome.sha256
        parts.append(_lifetimes(work, one, name, genome))
        unchanged[one] += genome.sha256 == before
    tell("tables")
    found = _findings(work, pd.concat(parts, ignore_index=True), paper, unchanged)
    tell("figures and report")
    pictures = {name: (told, figures.small(png)) for name, (told, png) in _figures(work, found, loaded).items()}
    text = report.markdown(found, {name: caption for name, (caption, _) in pictures.items()})
    for name, (_, png) in pictures.items():
        runs.write_whole(folder / "figures" / name, png)
    runs.write_whole(folder / "report.md", text.encode())
    runs.write_whole(folder / "report.html", report.html(text, lambda name: pictures[name][1]).encode())
    runs.write_whole(folder / "status.json", b'{"schema": 1, "state": "finished"}\n')
    return folder


def _published() -> Mapping[str, Any]:
    path = data_folder("conf") / "paper" / "tables.yaml"
    try:
        tables: Mapping[str, Any] = yaml.safe_load(path.read_text())
        published.published_success(tables)
    except (OSError, KeyError, TypeError, ValueError, yaml.YAMLError) as error:
        raise ConfigError(f"{path} does not hold the published tables: {error}") from error
    return tables


def _folder(experiment: str, cfg: DictConfig, given: genomes.Genome | None) -> Path:
    """A name that says what was asked for: another question, or another version of the science, gets another folder."""
    asked = OmegaConf.to_container(cfg)
    assert isinstance(asked, dict)
    asked = {key: value for key, value in asked.items() if key not in ("threads", "genome")}
    asked |= {"experiment": experiment, "science": runs.science_version(), "genome": given.sha256 if given else None}
    digest = hashlib.sha256(repr(sorted(asked.items())).encode()).hexdigest()[:8]
    who = given.name if given else f"champions{cfg.champions}"
    return Path("runs") / "reproduce" / f"{experiment}_{who}_seed{cfg.first_seed}_{digest}"


def _begin(work: _Work, cfg: DictConfig, command: list[str]) -> None:
    try:
        work.folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"cannot write to {work.folder}: {error.strerror}") from error
    if not (work.folder / "provenance.json").is_file():
        runs.write_whole(work.folder / ".hydra" / "config.yaml", OmegaConf.to_yaml(cfg).encode())
        told = runs.provenance(command[0], cfg, command[1:])
        runs.write_whole(work.folder / "provenance.json", runs.as_json(told))
    runs.write_whole(work.folder / "status.json", b'{"schema": 1, "state": "running"}\n')


def _champion(work: _Work, experiment: str, name: str, seed: int) -> genomes.Genome:
    """The champion of this seed; evolved if it is not there."""
    if work.given is not None:
        return work.given
    path = work.folder / "champions" / f"{name}.npz"
    if not path.is_file():
        trained = TRAINED[experiment]
        world = typed(composed("evolve", [f"scenario={trained}"]), EvolveConfig)
        threads = thread_count(work.config.threads)
        generations = list(evolve(work.config.ga, world.scenario, world.lifetime, seed, threads))
        history = pd.DataFrame(history_row(generation) for generation in generations)
        last = generations[-1]
        runs.write_whole(work.folder / "history" / f"{name}.csv", history.to_csv(index=False).encode())
        runs.write_whole(
            path,
            genomes.champion_file(
                float(last.fitness.max()),
                last.champion,
                experiment,
                seed,
                last.number,
                remember(last.champion, world.scenario, threads=threads),
            ),
        )
    return genomes.Genome(genes=genomes.load(str(path), experiment).genes, name=name)


def _lifetimes(work: _Work, experiment: str, name: str, genome: genomes.Genome) -> pd.DataFrame:
    """All lifetimes of a champion, in every scenario of its experiment, with every rate and control."""
    path = (
        work.folder / "lifetimes" / f"{experiment}_{name}.csv"
        if work.given
        else work.folder / "lifetimes" / f"{name}.csv"
    )
    if not path.is_file():
        rows = [
            evaluate(
                genome.genes,
                world.scenario,
                _plasticities(work.config, experiment),
                world.lifetime,
                repeats=work.config.repeats,
                seed=work.config.seed,
                threads=thread_count(work.config.threads),
                name=name,
            )[0]
            for world in map(_world, (TRAINED[experiment], *findings.CHANGED[experiment]))
        ]
        runs.write_whole(path, pd.concat(rows).to_csv(index=False).encode())
    try:
        return pd.read_csv(path, keep_default_na=False, na_values=[""])
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path} of an earlier run cannot be read ({error}); remove it and start again") from error


def _world(scenario: str) -> EvaluateConfig:
    return typed(composed("evaluate", [f"scenario={scenario}", "lifetime.record_every=0"]), EvaluateConfig)


def _plasticities(config: ReproduceConfig, experiment: str) -> list[Hebbian]:
    rates = sorted({*config.rates, findings.PAPER_N[experiment]})
    return [
        Hebbian(name="paper", N=rate, sign=sign, signal=config.signal.of(experiment)) for sign in Sign for rate in rates
    ]


def _findings(
    work: _Work, metrics: pd.DataFrame, paper: Mapping[str, Any], unchanged: dict[str, int]
) -> report.Findings:
    each = findings.trials(metrics)
    success = published.published_success(paper)
    showcase = {one: findings.showcase(each, success, one) for one in work.experiments}
    values = published.published_values(paper)
    comparison = published.compare(values, each, {one: name for one, (name, *_) in showcase.items()})
    comparison["title"] = [paper[table]["title"] for table in comparison.table]
    found = report.Findings(
        claims=findings.claims(each, unchanged),
        success=findings.success(each),
        rescue_and_harm=findings.rescue_and_harm(each),
        retention=findings.retention(each),
        dose_response=findings.dose_response(each),
        comparison=comparison,
        showcase=showcase,
        champions=1 if work.given else work.config.champions,
        given=work.given is not None,
        repeats=work.config.repeats,
        rule=RULE,
        provenance=_provenance(work),
    )
    tables = {
        "metrics": metrics,
        "trials": each,
        "claims": found.claims,
        "success": found.success,
        "rescue_and_harm": found.rescue_and_harm,
        "retention": found.retention,
        "dose_response": found.dose_response,
        "comparison": comparison.drop(columns="title"),
    }
    for name, table in tables.items():
        runs.write_whole(work.folder / f"{name}.csv", table.to_csv(index=False).encode())
    return found


def _provenance(work: _Work) -> str:
    config = work.config
    last = config.first_seed + config.champions - 1
    who = (
        f"genome `{work.given.name}` (SHA-256 {work.given.sha256[:16]}…)"
        if work.given
        else f"{config.champions} champions of each experiment, evolved from seeds {config.first_seed} to {last}"
    )
    return (
        f"Made by `epuckhebb reproduce`: {who}; {config.repeats} noise repeats of every condition "
        f"(seed {config.seed}); live fitness: {config.signal.value}."
    )


def _figures(work: _Work, found: report.Findings, loaded: Mapping[str, genomes.Genome]) -> dict[str, tuple[str, bytes]]:
    """File name -> (caption, PNG), in the order of the report."""
    made: dict[str, tuple[str, bytes]] = {}
    for one in work.experiments:
        name = found.showcase[one][0]
        genome, rate = loaded[f"{one}/{name}"], findings.PAPER_N[one]
        plastic = Hebbian(name="paper", N=rate, signal=work.config.signal.of(one))
        lived: dict[tuple[str, str], dict[str, Samples]] = {}
        for scenario in (TRAINED[one], *findings.CHANGED[one]):
            world = typed(composed("evaluate", [f"scenario={scenario}"]), EvaluateConfig)
            _, traces = evaluate(
                genome.genes, world.scenario, [plastic], world.lifetime, repeats=1, seed=work.config.seed, name=name
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
        if work.given is None:
            made[f"dose_response_{one}.png"] = (
                f"{one}: success, time to goal, weight change, and rescue and harm with their controls, against N; "
                f"{found.champions} champions.",
                charts.dose_response(found.dose_response, found.rescue_and_harm, one, found.champions),
            )
    if work.given is None:
        histories = {
            one: [pd.read_csv(work.folder / "history" / f"{name}.csv") for name, _ in work.champions(one)]
            for one in work.experiments
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
