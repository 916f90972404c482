"""`epuckhebb evaluate`: runs the lifetimes of a genome in a scenario, and writes them into a run folder."""

import copy
import functools
import json
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from epuckhebb.adaptation.nominal import Nominal, measure_nominal
from epuckhebb.analysis.evaluate import Traces, evaluate
from epuckhebb.analysis.paper_table import PaperTable, saturation
from epuckhebb.analysis.tables import Rows, plain
from epuckhebb.config import (
    KINDS,
    Checked,
    EvaluateConfig,
    alternatives,
    environment_of_run,
    hand,
    quoted,
    training_world,
    typed_as,
    value_of,
)
from epuckhebb.controller.compiling.sources import own_code
from epuckhebb.controller.genome import GenomePlan, plan_of
from epuckhebb.controller.network import Network
from epuckhebb.controller.own_class import name_of
from epuckhebb.controller.plasticity.control import MOST_KEPT, Control
from epuckhebb.controller.plasticity.rule import InitialWeights, NoRule, Rule, evolved_sizes
from epuckhebb.controller.wiring import LAYERS, Wiring
from epuckhebb.runs import hydra
from epuckhebb.runs.begin import begin
from epuckhebb.runs.hydra import Report, unreported
from epuckhebb.runs.notes import notes_of
from epuckhebb.runtime import LATEST, ConfigError, data_folder, refusing, saying_if_slow
from epuckhebb.store import (
    Genome,
    Run,
    RunFolder,
    as_npz,
    below_runs,
    digest,
    load_genome,
    resolve_run,
    traces_arrays,
)
from epuckhebb.tmaze.batch import load_kernel
from epuckhebb.tmaze.individual import GA_ALONE, Controller, has_control
from epuckhebb.tmaze.own_sensor import reading_names
from epuckhebb.tmaze.robot import EPUCK, STEP_S
from epuckhebb.tmaze.scenario import TRAINED, Scenario
from epuckhebb.tmaze.session import LostRobotError
from epuckhebb.tmaze.tasks.trial import ONE_TRIAL

Figures = dict[str, tuple[Any, ...]]  # functions of `runs.figures` by name, with what they draw


@dataclass(frozen=True, kw_only=True)
class PreparedEvaluation:
    """An evaluation whose settings, genome and memory are checked. A test world may take the place of its own."""

    config: EvaluateConfig
    genome: Genome

    def in_world_of(self, other: EvaluateConfig) -> "PreparedEvaluation":
        """The same evaluation in the world of another one of its experiment, for as long as lifetimes last there.

        The physics is that of the world if a change brings it, as `3d` does.
        """
        world, ours = other.world, self.config.world
        if world.name == ours.name:
            return self
        there = copy.copy(self.config)
        is_brought = any("physics" in brought for brought in other.change.values())
        physics = world.physics if is_brought else ours.physics
        there.world = replace(world, fitness=ours.fitness, physics=physics)
        there.lifetime = replace(self.config.lifetime, duration_s=world.paper_duration_s)
        return PreparedEvaluation(config=there, genome=self.genome)

    def remember(self, threads: int) -> Nominal | None:
        """Nominal statistics for the adaptations, from the champion's file or measured; None where none needs them."""
        config, genome = self.config, self.genome
        adaptations = [controller.adaptation for controller in config.controllers]
        if not any(one.acts for one in adaptations):
            return None
        experiment, known = config.world.experiment, genome.nominal
        if known is not None and known.experiment != experiment:
            memory = f"remembers {known.scenario}, of the {known.experiment} experiment"
            raise ConfigError(f"genome={genome.name} {memory}; give a champion of {experiment}, or adaptation=none")
        gain = config.lifetime.gain_rad_s
        if known is not None and (known.gain_rad_s == gain or not any(one.is_gated for one in adaptations)):
            return known
        world = training_world(config, genome.physics)
        return measure_nominal(genome.network_genes, world, gain, threads, genome.network)

    def run(self, nominal: Nominal | None, threads: int) -> tuple[Rows, Traces]:
        """Run the lifetimes: a row each, and the traces of those that were recorded."""
        config, genome = self.config, self.genome
        return evaluate(
            genome.genes,
            config.world,
            config.controllers,
            config.lifetime,
            nominal,
            repeats=config.repeats,
            seed=config.seed,
            threads=threads,
            name=genome.name,
            changed=config.changed or "",
            network=genome.network,
            plan=genome.plan,
            evolved_signs=genome.signs,
        )

    @property
    def notes(self) -> list[str]:
        """What a reader must know beside the table."""
        return notes_of(self.genome, self.config)

    def compile(self) -> None:
        """Load or compile what the lifetimes need."""
        compile_for(self.config.controllers, self.genome.network, self.config.world)

    def write(self, run: RunFolder, nominal: Nominal | None, threads: int) -> Figures:
        """Run the lifetimes, and write their tables and traces. Returns what its figures need."""
        config, genome, figures = self.config, self.genome, Figures()
        if config.scenario.hand is not None:
            run.write(hand.NAME, hand.content(config.scenario.hand))
        metrics, traces = self.run(nominal, threads)
        run.write("metrics.csv", metrics)
        if config.lifetime.record_every:
            run.write("traces.npz", as_npz(traces_arrays(traces, genome.weights, genome.network)))
        if config.world.task.has_trials:
            import pandas as pd  # takes a while to load

            from epuckhebb.analysis import reversal

            trials = pd.DataFrame(traces.trials)
            shares = reversal.table(pd.DataFrame(metrics), trials, config.world.task, config.seed)
            run.write("reversal_trials.csv", trials)
            run.write("reversal.csv", shares)
            run.write("reversal.md", reversal.readable(shares).markdown())
            figures["reversal"] = shares, trials
        else:
            table, below = PaperTable.from_rows(metrics), [*map(plain, self.notes), saturation(metrics)]
            run.write("table.csv", table.rows)
            run.write("table.md", "\n".join([table.markdown(), *(f"{note}\n" for note in below if note)]))
        if config.lifetime.record_every:
            figures["trajectories"] = (traces,)
        return figures

    @property
    def lifetime_ids(self) -> dict[str, str]:
        """For each controller a digest of what its lifetimes depend on, besides side, repeat and seed."""
        config, genome = self.config, self.genome
        everywhere = (genome.sha256, genome.network, config.world, replace(config.lifetime, record_every=0))
        depends: dict[str, tuple[object, ...]] = {GA_ALONE.name: everywhere}
        for controller in config.controllers:
            nominal = genome.nominal_sha256 if controller.adaptation.acts else ""
            depends[controller.name] = (*everywhere, controller, nominal)
        return {name: digest([repr(values), own_code(values)]) for name, values in depends.items()}


def check_genome(genome: Genome, world: Scenario, shape: tuple[int, ...] | Wiring | None) -> None:
    """Refuse a champion of an environment, another task, wiring or robot, or of a robot with other sensors."""
    if genome.environment:
        raise ConfigError(f"genome={genome.name} was evolved in environment={genome.environment}, and this is the maze")
    task, robot, sensors = world.task, world.robot, reading_names(world.robot.sensors)
    if genome.network.rewarded != task.gives_reward:
        evolved = f"was evolved with task={genome.task or ONE_TRIAL.name}"
        raise ConfigError(f"genome={genome.name} {evolved}, got task={task.name}, with another reward as input")
    has_others = bool(genome.optimizer) and genome.sensors != sensors
    asked = shape.name if isinstance(shape, Wiring) else LAYERS
    if genome.wiring != asked:
        raise ConfigError(f"genome={genome.name} is for network.wiring={genome.wiring}, got network.wiring={asked}")
    lights = robot.light.count
    is_of_another = genome.robot not in ("", robot.name) or (genome.robot and genome.lights != lights)
    if is_of_another or genome.network.inputs != world.inputs or has_others:
        own = genome.sensors or "none"
        evolved = (
            f"robot={genome.robot or 'any'}, {genome.lights} lights, own sensors {own} and layers {genome.network}"
        )
        given = f"robot={robot.name}, {lights} lights, own sensors {sensors or 'none'} and {robot.inputs} readings"
        raise ConfigError(f"genome={genome.name} is for {evolved}, got {given}")


def check_rules(genome: Genome, network: Network, rules: Iterable[tuple[str, Rule]]) -> None:
    """Refuse rules, each with the name of its controller, that do not fit the genome."""
    _check_limits(genome, plan_of(network))
    sizes = {part.name: part.size for part in genome.plan.parts}
    initial_weights = InitialWeights.evolved if genome.weights.any() else InitialWeights.random
    for name, rule in rules:
        kind = type(rule)
        if isinstance(rule, NoRule):
            continue
        missing = [name for name, size in evolved_sizes(kind, network).items() if sizes.get(name) != size]
        is_other = genome.rule not in ("", name_of(kind)) or rule.initial_weights is not initial_weights
        if missing or (genome.plan.of_rule.parts and is_other):
            evolved = f"rule {genome.rule or 'none'} with hebbian.initial_weights={initial_weights.name}"
            has = f"genome={genome.name} has {genome.plan.text()}, of {evolved}"
            raise ConfigError(f"{name} has rule {name_of(kind)}, and {has}")
        _check_limits(genome, plan_of(network, kind))


def _check_limits(genome: Genome, plan: GenomePlan) -> None:
    """Refuse genes beyond the limits within which rules and wirings evolve them."""
    genes = genome.plan.split(genome.genes)
    for part in plan.parts:
        if part.limit is not None and part.name in genes and (most := np.abs(genes[part.name]).max()) > part.limit:
            raise ConfigError(f"genome={genome.name}: {part.name} must lie within +-{part.limit:g}, got {most:g}")


def check_controls(genome: Genome, config: EvaluateConfig) -> None:
    """Refuse yoked controls whose masters would fill the memory, and draws of signs that the genome has of its own."""
    most = MOST_KEPT // genome.network.synapses
    for controller in config.controllers:
        rule = controller.rule
        if rule.control is not Control.none and config.lifetime.steps > most:
            needs = f"keeps all weights, and needs lifetime.duration_s of at most {most * STEP_S:g}"
            given = f"got {config.lifetime.duration_s:g}"
            raise ConfigError(f"hebbian.control={rule.control.name} of {controller.name} {needs}; {given}")
        if rule.sign_draw and rule.control is Control.none and genome.signs is not None:
            evolved = f"genome={genome.name} keeps the shuffled signs with which it evolved"
            raise ConfigError(f"{evolved}: hebbian.sign_draw of {controller.name} must be 0, got {rule.sign_draw}")


@functools.singledispatch
def prepare_evaluation(config: Any, genome: Genome | None = None) -> Any:
    """Check that a genome, the one that the settings name unless given, fits robot, task, network and rules.

    It gives a `PreparedEvaluation`, or one of its like.
    """
    if genome is None:
        genome = load_genome(config.genome, config.world.experiment, config.shape)
    check_genome(genome, config.world, config.shape)
    check_rules(genome, genome.network, [(controller.name, controller.rule) for controller in config.controllers])
    check_controls(genome, config)
    return PreparedEvaluation(config=config, genome=genome)


def evaluate_job(job: hydra.Job) -> None:
    """Evaluate into the folder of a job."""
    words = job.path, job.config, job.overrides, job.facts
    evaluate_into(*words, threads=job.threads, is_many=job.in_multirun, report=job.report)


def as_evolved(words: list[str], config_dir: str | None = None) -> list[str]:
    """Overrides with the robot and the wiring that their champion was evolved for, unless they name one.

    A robot that has no file, a wiring of the user's own, and champions of several are left to `prepare_evaluation`.
    """
    named = [word for word in words if word.startswith("genome=")]
    if environment := [value_of(word) for word in words if word.startswith("environment=")]:
        is_given = named or environment[-1] == "tmaze"
        return words if is_given else [*words, f"genome={quoted(str(_latest_in(environment[-1])))}"]
    if not named:
        return words
    (words_of,) = alternatives(named[-1:]).values()
    if evolution := environment_of_run(value_of(words_of[0])):
        return [*words, f"environment={evolution['environment']['name']}"]
    genomes: list[Genome] = []
    for word in words_of:
        with suppress(ConfigError):  # one that cannot be read is reported later
            genomes.append(load_genome(value_of(word), next(iter(TRAINED))))
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
    return [*words, f"network.wiring={wiring}", *typed_as(own)]


def _latest_in(environment: str) -> Path:
    """The newest evolution in an environment; a ConfigError if there is none."""
    for path in reversed([path for path in below_runs() if path.parts[1] == "evolve"]):
        its = environment_of_run(str(path)).get("environment", {})
        if environment == its.get("name") or str(its.get("id")).endswith(environment):
            return path
    return resolve_run(LATEST, "evolve")


@contextmanager
def compiling() -> Iterator[None]:
    """Time in which kernels are loaded or compiled; what cannot be compiled is a ConfigError."""
    with saying_if_slow("Compiling; a first start takes some ten seconds, later ones do not."), refusing():
        yield


def compile_for(controllers: Sequence[Controller], network: Network, world: Scenario) -> None:
    """Load or compile what lifetimes with these controllers need."""
    with compiling():
        for controller in controllers or [GA_ALONE]:
            with suppress(LostRobotError):  # one step of a network of zeros says nothing about a genome
                load_kernel(controller, network, world, weight_path=has_control(controllers))


def draw(run: RunFolder, config: Any, name: str, figures: Figures) -> None:
    """Draw the figures of a run, unless its settings have none. name: of the genome or the optimizer."""
    kind = config.figures.value
    if kind != "none" and figures:
        from epuckhebb.analysis.image import image
        from epuckhebb.runs import figures as functions  # matplotlib takes a while to load

        for figure, drawn in figures.items():
            run.write(f"figures/{figure}.{kind}", image(vars(functions)[figure](config, name, *drawn), kind))


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
    genome, notes = prepared.genome, prepared.notes
    facts = {
        "seed": config.seed,
        "genome": genome.name,
        "genome_sha256": genome.sha256,
        "nominal_sha256": genome.nominal_sha256,
        "lifetimes": prepared.lifetime_ids,
        **({"notes": notes} if notes else {}),
        **facts,
    }
    prepared.compile()
    nominal = prepared.remember(threads)
    with begin(path, "evaluate", config, overrides, facts, goes_on=is_many, genome=genome) as run:
        figures = prepared.write(run, nominal, threads)
        report(run.path)
        draw(run, config, genome.name, figures)
