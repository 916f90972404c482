"""`epuckhebb evaluate`: the lifetimes of a genome in a scenario, and what a run of them leaves in its folder."""

import hashlib
import importlib
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd
from omegaconf import DictConfig

from epuckhebb.analysis import tables
from epuckhebb.analysis.evaluate import Traces, evaluate, memory_to_evaluate
from epuckhebb.analysis.self_checks import Checks, findings
from epuckhebb.config import plugins
from epuckhebb.config.overrides import alternatives, quoted, value_of
from epuckhebb.config.plugins import FOLDER, OwnFile
from epuckhebb.config.schema import EvaluateConfig, say_unusual, typed
from epuckhebb.runs import hydra
from epuckhebb.runs.nominal import missing_nominal, nominal_for, self_checks_for, training_world
from epuckhebb.runs.notes import notes_of
from epuckhebb.runtime.errors import ConfigError
from epuckhebb.runtime.progress import say, saying_if_slow
from epuckhebb.runtime.resources import Need, data_folder, require
from epuckhebb.sim.adaptation.nominal import Nominal, memory_to_measure_nominal
from epuckhebb.sim.block import load_kernel
from epuckhebb.sim.controller import GA_ALONE, Controller
from epuckhebb.sim.digest import UnknownPartError, digest
from epuckhebb.sim.network import Network
from epuckhebb.sim.plasticity.rule import InitialWeights, NoRule, evolved_sizes, functions_of, name_of
from epuckhebb.sim.robot import EPUCK
from epuckhebb.sim.scenario import TRAINED, Scenario
from epuckhebb.sim.session import LostRobotError
from epuckhebb.sim.tasks.reversal import Reversal
from epuckhebb.sim.tasks.trial import ONE_TRIAL
from epuckhebb.store import disk
from epuckhebb.store.folder import RunFolder
from epuckhebb.store.genome import Genome, load_genome
from epuckhebb.store.records import OwnCode
from epuckhebb.store.traces import traces_file


def own_code(own: Mapping[Path, OwnFile]) -> dict[str, dict[str, OwnCode]]:
    """What `provenance.json` says of the user's files; nothing if there are none."""
    told = {str(file): OwnCode(copy=one.copy, sha256=one.sha256) for file, one in own.items()}
    return {FOLDER: told} if told else {}


def evaluate_job(cfg: DictConfig) -> None:
    """Do one job of Hydra's: evaluate into its folder."""
    threads = hydra.threads_of_job(cfg.threads)
    with hydra.job_folder() as path:
        facts = {"command_line": hydra.job_command("evaluate")}
        evaluate_into(path, hydra.named(cfg), hydra.job_overrides(), facts, threads=threads)


def recorded_job(cfg: DictConfig) -> None:
    """Do one job of Hydra's whose lifetimes are to be watched."""
    if not cfg.lifetime.record_every:
        with hydra.job_folder():
            raise ConfigError("--open shows what was recorded; give lifetime.record_every=8, or leave it out")
    evaluate_job(cfg)


def prepare(cfg: DictConfig) -> tuple[EvaluateConfig, Genome]:
    """What a configuration asks for: its values, and the genome that it names, both checked."""
    config = typed(cfg, EvaluateConfig)
    genome = load_genome(config.genome, config.world.experiment, config.layers)
    check_genome(genome, config)
    check_memory(config, genome)
    return config, genome


def with_robot(words: list[str], config_dir: str | None = None) -> list[str]:
    """Overrides with the robot that their champion was evolved for, unless they name one.

    A robot that has no file, and champions of several robots, are left to `check_genome`.
    """
    given = [word for word in words if word.startswith("genome=")]
    if not given or any(word.lstrip("+~").startswith(("robot=", "robot.")) for word in words):
        return words
    (named,) = alternatives(given[-1:]).values()
    robots = {_robot_of(value_of(word)) for word in named}
    robot = robots.pop()
    folders = [Path(folder) / "robot" for folder in (config_dir, data_folder("conf")) if folder]
    if robots or robot == EPUCK.name or not any((folder / f"{robot}.yaml").is_file() for folder in folders):
        return words
    return [*words, f"robot={quoted(robot)}"]


def _robot_of(genome: str) -> str:
    """The robot of a champion; the usual one if it cannot be read, which is told later."""
    try:
        return load_genome(genome, next(iter(TRAINED))).robot
    except ConfigError:
        return EPUCK.name


def check_memory(config: EvaluateConfig, genome: Genome) -> None:
    """Refuse an evaluation that takes more memory than there is."""
    lives, records = memory_to_evaluate(len(config.controllers), config.lifetime, config.repeats, genome.network)
    needed = [
        Need(lives, f"{config.repeats} lifetimes a side and controller", "lower repeats"),
        Need(records, "what is recorded", "lower lifetime.duration_s, or raise lifetime.record_every"),
    ]
    if missing_nominal(config, genome.nominal):
        duration_s, gain = training_world(config).paper_duration_s, config.lifetime.gain_rad_s
        room = memory_to_measure_nominal(duration_s, gain, genome.network)
        needed.append(Need(room, "lifetimes in the training world at this gain", "raise lifetime.gain_rad_s"))
    require(needed)


def check_genome(genome: Genome, config: EvaluateConfig) -> None:
    """Refuse a genome that is for another robot or task, or has not what a rule takes from it."""
    world, robot = config.world, config.world.robot
    named = f"genome={genome.name}"
    if genome.network.rewarded != world.task.gives_reward:
        has = (
            "has no input for the reward of" if world.task.gives_reward else "has one for a reward, and none is told in"
        )
        raise ConfigError(
            f"{named} is for a network of layers {genome.network}, which {has} task={world.task.name}; "
            f"give task={genome.task or ONE_TRIAL.name}, or a champion that was evolved with task={world.task.name}"
        )
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
            raise ConfigError(
                f"{named} was evolved with rule {genome.rule}, and {controller.name} has rule {name_of(kind)}; give "
                f"hebbian={genome.rule} (your own: hebbian.rule=FILE.py:{genome.rule}), or hebbian=none for a life of "
                "its weights alone"
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
    """Load or compile what lifetimes with these controllers need, before a folder is claimed for them."""
    try:
        for controller in controllers or [GA_ALONE]:
            with suppress(LostRobotError):  # one step of a network of zeros says nothing of a genome's lifetime
                load_kernel(controller, network, world)
    except ValueError as error:  # a RuleError among them
        raise ConfigError(str(error)) from error


def evaluate_into(path: Path, cfg: DictConfig, overrides: list[str], facts: dict[str, Any], *, threads: int) -> None:
    """Claim a folder and evaluate into it; the arguments are those of `RunFolder.new`."""
    config, genome = prepare(cfg)
    say_unusual(config)
    own, notes = plugins.own_files(cfg), notes_of(genome, config)
    facts = {
        "genome": genome.name,
        "genome_sha256": genome.sha256,
        "nominal_sha256": genome.nominal_sha256,
        "self_memory_sha256": genome.self_memory_sha256,
        "lifetimes": lifetime_ids(config, genome),
        **({"notes": notes} if notes else {}),
        **own_code(own),
        **facts,
    }
    with saying_if_slow("Compiling; a first start takes some ten seconds, later ones do not."):
        compile_for(config.controllers, genome.network, config.world)
    nominal = nominal_for(genome, config, threads, say)
    checks = self_checks_for(genome, config, threads, say)
    with RunFolder.new(path, "evaluate", cfg, overrides, facts) as run, ThreadPoolExecutor(1) as aside:
        for place, content in plugins.copies(own).items():
            run.write(place, content)
        if config.lifetime.record_every:
            aside.submit(importlib.import_module, "epuckhebb.analysis.figures")  # takes as long as the lifetimes
        metrics, traces = run_lifetimes(config, genome, nominal, checks, threads)
        run.write("metrics.csv", metrics.to_csv(index=False))
        if isinstance(config.world.task, Reversal):
            _write_reversal(run, config, config.world.task, metrics, traces)
        else:
            table, below = tables.paper_table(metrics), [*map(tables.plain, notes), tables.saturation(metrics)]
            run.write("table.csv", tables.to_csv(table))
            run.write("table.md", "\n".join([tables.to_markdown(table), *(f"{note}\n" for note in below if note)]))
        if checks is not None:
            run.write(disk.FINDINGS, findings(checks).to_csv(index=False))
        if config.lifetime.record_every:
            from epuckhebb.analysis import figures

            written = aside.submit(lambda: run.write(disk.TRACES, traces_file(traces, genome.weights, genome.network)))
            title = caption(config, genome.name)
            run.write("figures/trajectories.png", figures.trajectories(traces, config.world, title))
            written.result()


def lifetime_ids(config: EvaluateConfig, genome: Genome) -> dict[str, str]:
    """For each controller a digest of what its lifetimes depend on, besides side, repeat and seed."""
    everywhere = (genome.sha256, genome.network, config.world, replace(config.lifetime, record_every=0))
    remembered = (genome.nominal_sha256, genome.self_memory_sha256)
    depends: dict[str, tuple[object, ...]] = {GA_ALONE.name: everywhere}
    for controller in config.controllers:
        rule, adaptation = type(controller.rule), controller.adaptation
        depends[controller.name] = (*everywhere, controller, rule.__module__, *(remembered if adaptation.acts else ()))
        with suppress(UnknownPartError):  # then the module must do, which is named by the content of the user's file
            depends[controller.name] += tuple(map(digest, functions_of(rule)))
    return {name: hashlib.sha256(repr(parts).encode()).hexdigest()[:16] for name, parts in depends.items()}


def _write_reversal(
    run: RunFolder, config: EvaluateConfig, task: Reversal, metrics: pd.DataFrame, traces: Traces
) -> None:
    """Write what reversal learning came to: every trial, the rewarded shares, and their figure."""
    from epuckhebb.analysis import reversal

    told = reversal.table(metrics, traces.trials, task, config.seed)
    title = f"{config.world.name} ({config.changed}) · genome {metrics.genome[0]} · {2 * config.repeats} lives each"
    run.write(disk.REVERSAL_TRIALS, traces.trials.to_csv(index=False))
    run.write(disk.REVERSAL, told.to_csv(index=False))
    run.write("reversal.md", reversal.to_markdown(told))
    run.write("figures/reversal.png", reversal.figure(told, traces.trials, title))


def run_lifetimes(
    config: EvaluateConfig, genome: Genome, nominal: Nominal | None, checks: Checks | None, threads: int
) -> tuple[pd.DataFrame, Traces]:
    """The lifetimes that a configuration asks for: a row each, and the traces of those that were recorded."""
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
        checks=checks,
    )


def caption(config: EvaluateConfig, genome_name: str, controllers: Sequence[tuple[str, float]] | None = None) -> str:
    """Which lifetimes the traces of a run show, in one line; controllers: their names and N, if not the configured."""
    if controllers is None:
        controllers = [(controller.name, float(controller.rule.N)) for controller in config.controllers]
    rate = tables.rates(controllers)
    changed = f" ({config.changed})" if config.changed else ""
    return (
        f"{config.world.name}{changed} · genome {genome_name} · {f'{rate} · ' if rate else ''}"
        f"noise repeat 1 of {config.repeats}, seed {config.seed}"
    )
