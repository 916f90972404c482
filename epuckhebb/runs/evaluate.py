"""`epuckhebb evaluate`: runs the lifetimes of a genome in a world, and writes them into a run folder."""

import json
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from epuckhebb.analysis.tables import Rows
from epuckhebb.config import KINDS, Checked, alternatives, environment_of_run, format_overrides, override_value, quoted
from epuckhebb.controller.compiling.sources import user_code
from epuckhebb.controller.genome import GenomePlan, make_plan
from epuckhebb.controller.network import Network
from epuckhebb.controller.own_class import class_name
from epuckhebb.controller.plasticity.control import Control
from epuckhebb.controller.plasticity.rule import InitialWeights, NoRule, Rule, evolved_sizes
from epuckhebb.runs import hydra
from epuckhebb.runs.begin import begin
from epuckhebb.runs.hydra import Report, unreported
from epuckhebb.runs.world import make_world
from epuckhebb.runtime import ConfigError, data_folder
from epuckhebb.store import Genome, Run, RunFolder, checked_genes, digest, list_runs, load_genome, shaped
from epuckhebb.tmaze.individual import GA_ALONE
from epuckhebb.tmaze.robot import EPUCK
from epuckhebb.tmaze.scenario import TRAINED
from epuckhebb.worlds.world import Figures, World


@dataclass(frozen=True, kw_only=True)
class PreparedEvaluation:
    """An evaluation whose settings and genome are checked. config: of its world."""

    config: Any
    genome: Genome

    @property
    def world(self) -> World:
        """The world in which the lifetimes run."""
        return make_world(self.config)

    def run(self, threads: int, *, record: bool = True) -> tuple[Rows, Any]:
        """Run the lifetimes: a row each, and what else was recorded, if any is."""
        return self.world.run(self.genome, self.world.nominal(self.genome, threads), threads, record=record)

    @property
    def lifetime_ids(self) -> dict[str, str]:
        """For each controller a digest of what its lifetimes depend on, besides repeat and seed."""
        genome, world = self.genome, self.world
        everywhere, ids = (genome.sha256, genome.network, *world.identity), dict[str, str]()
        for controller in (GA_ALONE, *self.config.controllers):
            nominal = genome.nominal_sha256 if controller.adaptation.acts else ""
            depends = *everywhere, controller, nominal
            ids[controller.name] = digest([repr(depends), user_code(depends)])
        return ids


def check_rules(genome: Genome, network: Network, rules: Iterable[tuple[str, Rule]]) -> None:
    """Refuse rules, each with the name of its controller, that do not fit the genome, or the signs that it keeps."""
    _check_limits(genome, make_plan(network))
    sizes = {part.name: part.size for part in genome.plan.parts}
    initial_weights = InitialWeights.evolved if genome.weights.any() else InitialWeights.random
    for name, rule in rules:
        kind = type(rule)
        if isinstance(rule, NoRule):
            if genome.plan.rule_parts.parts and initial_weights is InitialWeights.random:
                draws = (
                    f"genome={genome.name} has no weights, since its rule {genome.rule} draws them for each lifetime"
                )
                raise ConfigError(f"{name}: {draws}; keep the rule, with hebbian.N=0, or N: 0 in compare")
            continue
        missing = [name for name, size in evolved_sizes(kind, network).items() if sizes.get(name) != size]
        is_other = genome.rule not in ("", class_name(kind)) or rule.initial_weights is not initial_weights
        if missing or (genome.plan.rule_parts.parts and is_other):
            evolved = f"rule {genome.rule or 'none'} with hebbian.initial_weights={initial_weights.name}"
            has = f"genome={genome.name} has {genome.plan.text()}, of {evolved}"
            raise ConfigError(f"{name} has rule {class_name(kind)}, and {has}")
        _check_limits(genome, make_plan(network, kind))
        if rule.sign_draw and rule.control is Control.none and genome.signs is not None:
            evolved = f"genome={genome.name} keeps the shuffled signs with which it evolved"
            raise ConfigError(f"{evolved}: hebbian.sign_draw of {name} must be 0, got {rule.sign_draw}")


def _check_limits(genome: Genome, plan: GenomePlan) -> None:
    """Refuse genes beyond the limits within which rules and wirings evolve them."""
    genes = genome.plan.split(genome.genes)
    for part in plan.parts:
        if part.limit is not None and part.name in genes and (most := np.abs(genes[part.name]).max()) > part.limit:
            raise ConfigError(f"genome={genome.name}: {part.name} must lie within +-{part.limit:g}, got {most:g}")


def prepare_evaluation(config: Any, genome: Genome | None = None) -> PreparedEvaluation:
    """Check that a genome, the one that the settings name unless given, fits the world, the network and the rules."""
    world = make_world(config)
    if genome is None:
        genome = load_genome(config.genome, config.world.experiment, config.shape)
    world.check_genome(genome)
    check_rules(genome, genome.network, [(controller.name, controller.rule) for controller in config.controllers])
    return PreparedEvaluation(config=world.champion_settings(genome), genome=genome)


def evaluate_job(job: hydra.Job) -> None:
    """Evaluate into the folder of a job."""
    words = job.path, job.config, job.overrides, job.facts
    evaluate_into(*words, threads=job.threads, is_many=job.in_multirun, report=job.report)


def inherit_choices(words: list[str], config_dir: str | None = None) -> list[str]:
    """Overrides with the robot and the wiring that their champion was evolved for, unless they name one.

    A robot that has no file, a wiring of the user's own, and champions of several are left to `prepare_evaluation`.
    """
    named = [word for word in words if word.startswith("genome=")]
    if environment := [override_value(word) for word in words if word.startswith("environment=")]:
        is_given = named or environment[-1] == "tmaze"
        ids = [override_value(word) for word in words if word.startswith("environment.id=")]
        return words if is_given else [*words, f"genome={quoted(str(_latest_in([*environment, *ids][-1])))}"]
    if not named:
        return words
    (words_of,) = alternatives(named[-1:]).values()
    if evolution := environment_of_run(override_value(words_of[0])):
        return [*words, f"environment={evolution['environment']['name']}"]
    genomes: list[Genome] = []
    for word in words_of:
        with suppress(ConfigError):  # one that cannot be read is reported later
            genomes.append(load_genome(override_value(word), next(iter(TRAINED))))
    if len(genomes) < len(words_of):
        return words
    keys = {word.lstrip("+~").partition("=")[0] for word in words}
    robot, *others = {genome.robot for genome in genomes}
    folders = [Path(folder) / "robot" for folder in (config_dir, data_folder("conf")) if folder]
    is_known = robot != EPUCK.name and any((folder / f"{robot}.yaml").is_file() for folder in folders)
    if is_known and not others and not any(key.split(".")[0] == "robot" for key in keys):
        words = [*words, f"robot={quoted(robot)}"]
    (wiring, settings), *several = {(genome.wiring, genome.wiring_settings) for genome in genomes}
    if several or not settings or wiring not in KINDS["wiring"].names or keys & {"network", "network.wiring"}:
        return words
    own = {f"network.{key}": value for key, value in json.loads(settings).items() if f"network.{key}" not in keys}
    return [*words, f"network.wiring={wiring}", *format_overrides(own)]


def _latest_in(environment: str) -> Path:
    """The newest evolution in an environment; a ConfigError if there is none."""
    for path in reversed([path for path in list_runs() if path.parts[1] == "evolve"]):
        its = environment_of_run(str(path)).get("environment", {})
        if environment == its.get("name") or f"/{its.get('id')}".endswith(f"/{environment}"):
            return path
    raise ConfigError(f"environment={environment} has no champion below runs/evolve; evolve one, or give genome=FOLDER")


def make_genome(genes: Any, config: Any) -> Genome:
    """A genome from Python, for the network of some settings.

    An array has the parameters of their rules, or none.
    """
    if isinstance(genes, Genome):
        return replace(genes, network=shaped(genes.network, genes.name, config.shape))
    network, array = config.network_made, np.asarray(genes)
    plans = [make_plan(network), *(make_plan(network, type(controller.rule)) for controller in config.controllers)]
    plan = next((plan for plan in plans if array.shape == (plan.genes,)), plans[0])
    return Genome(
        genes=checked_genes(array, "the given array", plan), name="genome", network=network, plan=plan, robot=""
    )


def drawn(config: Any, name: str, figures: Figures) -> Iterator[tuple[str, Any]]:
    """The figures of a run by their names, one by one. name: of the genome or the optimizer."""
    from epuckhebb.runs import figures as functions  # matplotlib takes a while to load

    for figure, parts in figures.items():
        yield figure, vars(functions)[figure](config, name, *parts)


def draw(run: RunFolder, config: Any, name: str, figures: Figures) -> None:
    """Draw the figures of a run, unless its settings have none. name: of the genome or the optimizer."""
    kind = config.figures
    if kind != "none" and figures:
        from epuckhebb.analysis.image import image

        for title, figure in drawn(config, name, figures):
            run.write(f"figures/{title}.{kind}", image(figure, kind))


def evaluate_into(
    path: Path,
    config: Checked,
    overrides: list[str],
    facts: dict[str, Any],
    *,
    threads: int,
    is_many: bool = False,
    report: Report = unreported,
) -> None:
    """Evaluate into a folder. overrides, facts: as of `RunFolder`. report: as of a `Job`.

    is_many: whether it is one of many, which begins again if it was stopped in this folder.

    Figures come last. If one cannot be drawn, the run has failed, and keeps its tables.
    """
    if is_many and Run(path).is_whole:
        return
    prepared = prepare_evaluation(config)
    genome, world = prepared.genome, prepared.world
    notes = world.notes(genome)
    facts = {
        "seed": config.seed,
        "genome": genome.name,
        "genome_sha256": genome.sha256,
        "nominal_sha256": genome.nominal_sha256,
        "lifetimes": prepared.lifetime_ids,
        **({"notes": notes} if notes else {}),
        **facts,
    }
    world.compile(genome.network)
    nominal = world.nominal(genome, threads)
    with begin(path, "evaluate", config, overrides, facts, goes_on=is_many, genome=genome) as run:
        rows, recorded = world.run(genome, nominal, threads)
        run.write("metrics.csv", rows)
        figures = world.write(run.write, genome, rows, recorded)
        report(run.path)
        draw(run, config, genome.name, figures)
