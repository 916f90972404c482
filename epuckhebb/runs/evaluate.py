"""`epuckhebb evaluate`: runs the lifetimes of a genome in a scenario, and writes them into a run folder."""

import copy
import functools
import hashlib
import json
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from epuckhebb.adaptation.controller import GA_ALONE, Controller
from epuckhebb.adaptation.nominal import Nominal
from epuckhebb.analysis import tables
from epuckhebb.analysis.evaluate import Rows, Traces, evaluate
from epuckhebb.config import (
    EvaluateConfig,
    alternatives,
    brings_physics,
    check_library,
    dump,
    hand,
    own_files,
    part_names,
    quoted,
    say_unusual,
    typed_as,
    value_of,
)
from epuckhebb.controller.compiling.code_digest import UnknownPartError, digest
from epuckhebb.controller.network import Network
from epuckhebb.controller.own_class import name_of
from epuckhebb.controller.plasticity.rule import InitialWeights, NoRule, evolved_sizes
from epuckhebb.runs import hydra
from epuckhebb.runs.nominal import nominal_for
from epuckhebb.runs.notes import notes_of
from epuckhebb.runtime import ConfigError, JobFailedError, data_folder, say, saying_if_slow
from epuckhebb.store import Genome, RunFolder, check_wiring, load_genome, traces_file
from epuckhebb.tmaze.batch import load_kernel
from epuckhebb.tmaze.goal_signal import GoalSignal
from epuckhebb.tmaze.own_sensor import own_sensors, reading_names
from epuckhebb.tmaze.robot import EPUCK, Robot
from epuckhebb.tmaze.scenario import TRAINED, Scenario
from epuckhebb.tmaze.session import LostRobotError
from epuckhebb.tmaze.tasks.reversal import Reversal
from epuckhebb.tmaze.tasks.trial import ONE_TRIAL

if TYPE_CHECKING:
    import pandas as pd

Report = Callable[[Path, Rows], object]


def _no_report(*_: object) -> None:
    """Report nothing: what a job of a study does."""


@dataclass(frozen=True, kw_only=True)
class PreparedEvaluation:
    """An evaluation whose settings, genome and memory are checked. A test world may take the place of its own."""

    config: EvaluateConfig
    genome: Genome

    def in_world(self, world: Scenario) -> "PreparedEvaluation":
        """The same evaluation in another world of its experiment, for as long as lifetimes last there.

        Physics and goal signal are those of the world if this brings its own, as `base_3d` does.
        """
        if world.name == self.config.world.name:
            return self
        there = copy.copy(self.config)
        ours = self.config.world
        physics = world.physics if brings_physics(world.name) else ours.physics
        signal = ours.goal_signal if world.goal_signal == GoalSignal() else world.goal_signal
        there.world = replace(world, fitness=ours.fitness, physics=physics, goal_signal=signal)
        there.lifetime = replace(self.config.lifetime, duration_s=world.paper_duration_s)
        return PreparedEvaluation(config=there, genome=self.genome)

    def compile(self) -> None:
        """Load or compile what the lifetimes need."""
        compile_for(self.config.controllers, self.genome.network, self.config.world)

    def remember(self, threads: int, report: Callable[[str], None] = lambda _: None) -> Nominal | None:
        """Nominal statistics for the adaptations; `report` is given a sentence if they must be measured first."""
        return nominal_for(self.genome, self.config, threads, report)

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
        )

    @property
    def lifetime_ids(self) -> dict[str, str]:
        """For each controller a digest of what its lifetimes depend on, besides side, repeat and seed."""
        config, genome = self.config, self.genome
        fitness, lifetime = config.world.fitness, replace(config.lifetime, record_every=0)
        own = [_identity(fitness, fitness.functions())]
        own += [_identity(one, one.functions()) for one in own_sensors(config.world.robot.sensors)]
        if genome.network.wiring is not None:
            own += [_identity(genome.network.wiring, genome.network.wiring.functions())]
        everywhere = (genome.sha256, genome.network, config.world, lifetime, *own)
        depends: dict[str, tuple[object, ...]] = {GA_ALONE.name: everywhere}
        for controller in config.controllers:
            rule, adaptation = type(controller.rule), controller.adaptation
            parts = (*everywhere, controller, *_identity(controller.rule, rule.functions()))
            depends[controller.name] = (*parts, *((genome.nominal_sha256,) if adaptation.acts else ()))
        return {name: hashlib.sha256(repr(parts).encode()).hexdigest()[:16] for name, parts in depends.items()}


def _identity(part: object, functions: Sequence[Callable[..., object]]) -> tuple[str, ...]:
    """The code of a part of the user's, which distinguishes it from another one with the same settings."""
    module = type(part).__module__
    with suppress(UnknownPartError):  # then the module must do, whose name has the SHA-256 of a user's file
        return (module, *map(digest, functions))
    return (module,)


def prepare_evaluation(config: EvaluateConfig, genome: Genome | None = None) -> PreparedEvaluation:
    """Check that a genome, the one that the settings name unless given, fits them."""
    check_library(config.world)
    if genome is None:
        genome = load_genome(config.genome, config.world.experiment, config.shape)
    _check_genome(genome, config)
    return PreparedEvaluation(config=config, genome=genome)


def evaluate_job(job: hydra.Job, report: Report = _no_report) -> None:
    """Evaluate into the folder of a job. report: as in `evaluate_into`."""
    evaluate_into(job.path, job.config, job.overrides, job.facts, threads=job.threads, report=report)


def recorded_job(job: hydra.Job, report: Report = _no_report) -> None:
    """Evaluate into the folder of a job that must record its lifetimes."""
    if not job.config.lifetime.record_every:
        raise ConfigError("--open shows what was recorded; give lifetime.record_every=8, or leave it out")
    evaluate_job(job, report)


def as_evolved(words: list[str], config_dir: str | None = None) -> list[str]:
    """Overrides with the robot and the wiring that their champion was evolved for, unless they name one.

    A robot that has no file, a wiring of the user's own, and champions of several are left to `prepare_evaluation`.
    """
    named = [word for word in words if word.startswith("genome=")]
    if not named:
        return words
    (words_of,) = alternatives(named[-1:]).values()
    genomes = [_loaded(value_of(word)) for word in words_of]
    given = [word.lstrip("+~") for word in words]
    robot, *others = {EPUCK.name if genome is None else genome.robot for genome in genomes}
    folders = [Path(folder) / "robot" for folder in (config_dir, data_folder("conf")) if folder]
    is_known = robot != EPUCK.name and any((folder / f"{robot}.yaml").is_file() for folder in folders)
    if is_known and not others and not any(word.startswith(("robot=", "robot.")) for word in given):
        words = [*words, f"robot={quoted(robot)}"]
    (called, settings), *several = {("", "") if one is None else (one.wiring, one.wiring_settings) for one in genomes}
    keys = {word.partition("=")[0] for word in given}
    if several or not settings or called not in part_names("wiring") or keys & {"network", "network.wiring"}:
        return words
    own = {f"network.{key}": value for key, value in json.loads(settings).items() if f"network.{key}" not in keys}
    return [*words, f"network.wiring={called}", *typed_as(own)]


def _loaded(genome: str) -> Genome | None:
    """A champion; None if it cannot be read, which is reported later."""
    try:
        return load_genome(genome, next(iter(TRAINED)))
    except ConfigError:
        return None


def check_sensors(genome: Genome, robot: Robot) -> None:
    """Refuse a champion whose robot had other sensors of the user's own."""
    sensors = reading_names(robot.sensors)
    if genome.optimizer and genome.sensors != sensors:
        raise ConfigError(
            f"genome={genome.name} is for a robot whose own sensors are {genome.sensors or 'none'}; those of robot "
            f"{robot.name} are {sensors or 'none'}. Give robot.sensors=[...] as in training, or another champion"
        )


def _check_genome(genome: Genome, config: EvaluateConfig) -> None:
    """Refuse a genome for another robot or task, or without what a rule takes from it."""
    world, robot = config.world, config.world.robot
    named = f"genome={genome.name}"
    if genome.network.rewarded != world.task.gives_reward:
        has = "has no input for the reward of" if world.task.gives_reward else "has an input for a reward, unlike"
        raise ConfigError(
            f"{named} is for a network of layers {genome.network}, which {has} task={world.task.name}; "
            f"give task={genome.task or ONE_TRIAL.name}, or a champion that was evolved with task={world.task.name}"
        )
    check_wiring(genome.wiring, config.shape, genome.name)
    check_sensors(genome, robot)
    if genome.robot != robot.name or genome.network.inputs != world.inputs:
        raise ConfigError(
            f"{named} is for robot {genome.robot} and a network of layers {genome.network}; robot {robot.name} has "
            f"{robot.inputs} readings. Give robot={genome.robot}, or a champion evolved for {robot.name}"
        )
    sizes = {part.name: part.size for part in genome.plan.parts}
    initial_weights = InitialWeights.evolved if genome.weights.any() else InitialWeights.random
    for controller in config.controllers:
        rule, kind = controller.rule, type(controller.rule)
        if isinstance(rule, NoRule):
            continue
        if genome.plan.of_rule.parts and genome.rule not in ("", name_of(kind)):
            given = f"hebbian{'=' if genome.rule in part_names('rule') else '.rule=FILE.py:'}{genome.rule}"
            raise ConfigError(
                f"{named} was evolved with rule {genome.rule}, and {controller.name} has rule {name_of(kind)}; give "
                f"{given}, or hebbian=none for a life of its weights alone"
            )
        if genome.plan.of_rule.parts and rule.initial_weights is not initial_weights:
            raise ConfigError(
                f"{named} was evolved with hebbian.initial_weights={initial_weights.name}, and {controller.name} has "
                f"{rule.initial_weights.name}; give hebbian.initial_weights={initial_weights.name}"
            )
        missing = [name for name, size in evolved_sizes(kind, genome.network).items() if sizes.get(name) != size]
        if missing:
            raise ConfigError(
                f"rule {kind.__name__} takes {', '.join(missing)} from the genome, and {named} has only "
                f"{genome.plan.text()}; give a champion that was evolved with this rule"
            )


def compile_for(controllers: Sequence[Controller], network: Network, world: Scenario) -> None:
    """Load or compile what lifetimes with these controllers need."""
    try:
        for controller in controllers or [GA_ALONE]:
            with suppress(LostRobotError):  # one step of a network of zeros says nothing about a genome
                load_kernel(controller, network, world)
    except ValueError as error:  # a NotCompiledError among them
        raise ConfigError(str(error)) from error


def evaluate_into(
    path: Path,
    config: EvaluateConfig,
    overrides: list[str],
    facts: dict[str, Any],
    *,
    threads: int,
    report: Report = _no_report,
) -> None:
    """Claim a folder and evaluate into it. overrides, facts: as for `RunFolder.new`.

    report: is given the folder and the lifetimes as soon as its tables are written. Figures come later: they take
    longer than lifetimes. If one cannot be drawn, the run has failed, and keeps what it wrote.
    """
    prepared = prepare_evaluation(config)
    genome = prepared.genome
    say_unusual(config)
    own, notes = own_files(config.values), notes_of(genome, config)
    facts = {
        "seed": config.seed,
        "genome": genome.name,
        "genome_sha256": genome.sha256,
        "nominal_sha256": genome.nominal_sha256,
        "lifetimes": prepared.lifetime_ids,
        **({"notes": notes} if notes else {}),
        **facts,
    }
    with saying_if_slow("Compiling; a first start takes some ten seconds, later ones do not."):
        prepared.compile()
    nominal = prepared.remember(threads, say)
    with RunFolder.new(path, "evaluate", dump(config), overrides, facts, own) as run:
        if config.scenario.hand is not None:
            run.write(hand.NAME, hand.content(config.scenario.hand))
        metrics, traces = prepared.run(nominal, threads)
        recorded, figures = bool(config.lifetime.record_every), dict[str, tuple[Any, ...]]()
        if isinstance(config.world.task, Reversal):
            figures["reversal"] = config, genome.name, *_write_reversal(run, config, config.world.task, metrics, traces)
        else:
            run.write("metrics.csv", metrics)
            table, below = tables.paper_table(metrics), [*map(tables.plain, notes), tables.saturation(metrics)]
            run.write("table.csv", tables.flat(table))
            run.write("table.md", "\n".join([tables.to_markdown(table), *(f"{note}\n" for note in below if note)]))
        if recorded:
            figures["trajectories"] = config, caption(config, genome.name), traces
        kind = config.figures.value
        files = {f"figures/{name}.{kind}": (name, kind, *data) for name, data in figures.items() if kind != "none"}
        run.left_behind = functools.partial(_left_behind, path, [*(["traces.npz"] if recorded else []), *files])
        report(path, metrics)
        with ThreadPoolExecutor(1) as aside:
            drawn = {file: aside.submit(_figure, *what) for file, what in files.items()}
            if recorded:
                run.write("traces.npz", traces_file(traces, genome.weights, genome.network))
            for file, figure in drawn.items():
                try:
                    run.write(file, figure.result())
                except Exception as error:  # of matplotlib: what a user's fonts and styles may raise has no end
                    raise JobFailedError(f"{run.left_behind()}: {type(error).__name__}: {error}") from error


def _left_behind(path: Path, files: Sequence[str]) -> str:
    """Which of the files that follow the tables a run lacks."""
    missing = [name for name in files if not (path / name).exists()]
    return f"{path} has its tables, and lacks {' and '.join(missing) or 'nothing'}"


def _figure(*what: Any) -> bytes:
    """The content of a figure's file; what: the arguments of `figures.file_of`."""
    from epuckhebb.runs import figures  # matplotlib takes a while to load

    return figures.file_of(*what)


def _write_reversal(
    run: RunFolder, config: EvaluateConfig, task: Reversal, rows: Rows, traces: Traces
) -> "tuple[pd.DataFrame, pd.DataFrame]":
    """Write the tables of reversal learning. Returns the rewarded shares, and every trial."""
    import pandas as pd

    from epuckhebb.analysis import reversal

    metrics, trials = pd.DataFrame(rows), pd.DataFrame(traces.trials)
    shares = reversal.table(metrics, trials, task, config.seed)
    run.write("metrics.csv", metrics)
    run.write("reversal_trials.csv", trials)
    run.write("reversal.csv", shares)
    run.write("reversal.md", reversal.to_markdown(shares))
    return shares, trials


def caption(config: EvaluateConfig, genome_name: str, controllers: Sequence[tuple[str, float]] | None = None) -> str:
    """Which lifetimes the traces of a run show, in one line; controllers: names and N, if not the configured."""
    if controllers is None:
        controllers = [(controller.name, float(controller.rule.N)) for controller in config.controllers]
    rate = tables.rates(controllers)
    changed = f" ({config.changed})" if config.changed else ""
    return (
        f"{config.world.name}{changed} · genome {genome_name} · {f'{rate} · ' if rate else ''}"
        f"repeat 1 of {config.repeats}, seed {config.seed}"
    )
