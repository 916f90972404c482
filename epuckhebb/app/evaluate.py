"""`epuckhebb evaluate`: the lifetimes of a genome in a scenario, and what a run of them leaves in its folder."""

import importlib
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np
import pandas as pd
from omegaconf import DictConfig

from epuckhebb.app import files, hydra_bridge
from epuckhebb.app.config import EvaluateConfig, typed
from epuckhebb.app.data import data_folder
from epuckhebb.app.errors import ConfigError
from epuckhebb.app.files import Genome
from epuckhebb.app.machine import Need, require
from epuckhebb.app.named import maze_asked, scenario_of
from epuckhebb.app.parts import NONE, rule_file, sha256_of
from epuckhebb.app.progress import say, saying_if_slow
from epuckhebb.app.runs import RunFolder
from epuckhebb.sim.adaptation.baseline import REPEATS, Baseline, live_at_home, remember, room_to_remember
from epuckhebb.sim.adaptation.self_check.memory import SelfMemory, remember_self
from epuckhebb.sim.block import LostRobotError, load_kernel
from epuckhebb.sim.controller import GA_ALONE, Controller
from epuckhebb.sim.network import Network
from epuckhebb.sim.plasticity.rule import Births, NoRule, evolved_sizes, name_of
from epuckhebb.sim.scenario import TRAINED, Scenario
from epuckhebb.sim.tasks.reversal import Reversal
from epuckhebb.sim.tasks.trial import ONE_TRIAL
from epuckhebb.study import tables
from epuckhebb.study.evaluate import Traces, evaluate, room_to_evaluate
from epuckhebb.study.self_checks import Checks, findings, self_checks

_Memory = TypeVar("_Memory", Baseline, SelfMemory)
_made: dict[tuple[object, ...], Baseline | SelfMemory] = {}
_MOST_MADE = 256  # a self-check's memory takes 0.2 MB


def evaluate_job(cfg: DictConfig) -> None:
    """Do one job of Hydra's: evaluate into its folder."""
    threads = hydra_bridge.threads_of_job(cfg.threads)
    with hydra_bridge.job_folder() as path:
        cfg = hydra_bridge.named(cfg)
        facts = {"command": hydra_bridge.job_command("evaluate")}
        evaluate_into(path, cfg, hydra_bridge.job_overrides(), facts, threads=threads)


def recorded_job(cfg: DictConfig) -> None:
    """Do one job of Hydra's whose lifetimes are to be watched."""
    if not cfg.lifetime.record_every:
        with hydra_bridge.job_folder():
            raise ConfigError("--open shows what was recorded; give lifetime.record_every=8, or leave it out")
    evaluate_job(cfg)


def asked(cfg: DictConfig) -> tuple[EvaluateConfig, Genome]:
    """What a configuration asks for: its values, and the genome that it names, both checked.

    Raises:
        ConfigError: A value or the genome cannot be used, or they do not fit each other.
    """
    config = typed(cfg, EvaluateConfig)
    genome = files.load_genome(config.genome, config.world.experiment, config.layers)
    fit(genome, config)
    require(needs(config, genome))
    return config, genome


def needs(config: EvaluateConfig, genome: Genome) -> list[Need]:
    """The memory that an evaluation takes."""
    lives, records = room_to_evaluate(len(config.controllers), config.lifetime, config.repeats, genome.network)
    needed = [
        Need(lives, f"{config.repeats} lifetimes a side and controller", "lower repeats"),
        Need(records, "what is recorded", "lower lifetime.duration_s, or raise lifetime.record_every"),
    ]
    pace = config.lifetime.gain_rad_s
    if _lacks(config, genome.baseline):
        home = training_world(config)
        room = room_to_remember(home.paper_duration_s, pace, genome.network)
        needed.append(Need(room, "life in the training world at this pace", "raise lifetime.gain_rad_s"))
    return needed


def fit(genome: Genome, config: EvaluateConfig) -> None:
    """Refuse a genome that is for another robot, or has not what a rule takes from it.

    Raises:
        ConfigError: It is, or it has not.
    """
    world, robot = config.world, config.world.robot
    if genome.network.rewarded != world.task.tells_reward:
        told = (
            "has no input for the reward of" if world.task.tells_reward else "has one for a reward, and none is told in"
        )
        other = genome.task or ONE_TRIAL.name
        raise ConfigError(
            f"genome={genome.name} is for a network of layers {genome.network}, which {told} task={world.task.name}; "
            f"give task={other}, or a champion that was evolved with task={world.task.name}"
        )
    if genome.robot != robot.name or genome.network.inputs != world.inputs:
        raise ConfigError(
            f"genome={genome.name} is for robot {genome.robot} and a network of layers {genome.network}; robot "
            f"{robot.name} has {robot.inputs} readings. Give robot={genome.robot}, or a champion evolved for "
            f"{robot.name}"
        )
    sizes = {part.name: part.size for part in genome.plan.parts}
    for controller in config.controllers:
        rule = type(controller.rule)
        if isinstance(controller.rule, NoRule):
            continue
        if genome.plan.of_rule.parts and genome.rule not in ("", name_of(rule)):
            raise ConfigError(
                f"genome={genome.name} was evolved with rule {genome.rule}, and {controller.name} has rule "
                f"{name_of(rule)}; give hebbian={genome.rule} (your own: hebbian.rule=FILE.py:{genome.rule}), "
                "or hebbian=none for a life of its weights alone"
            )
        births = Births.evolved if genome.weights.any() else Births.random
        if genome.plan.of_rule.parts and controller.rule.births is not births:
            raise ConfigError(
                f"genome={genome.name} was evolved with hebbian.births={births.name}, and {controller.name} has "
                f"{controller.rule.births.name}; give hebbian.births={births.name}"
            )
        taken = evolved_sizes(rule, genome.network)
        missing = [name for name, size in taken.items() if sizes.get(name) != size]
        if missing:
            raise ConfigError(
                f"rule {rule.__name__} takes {', '.join(missing)} from the genome, and "
                f"genome={genome.name} has only {genome.plan.told()}; give a champion that was evolved with this rule"
            )


def compile_for(config: EvaluateConfig, network: Network) -> None:
    """Load or compile what the lifetimes of a run need, before its folder is claimed.

    Raises:
        ConfigError: A rule does not compile.
    """
    for controller in config.controllers or [GA_ALONE]:
        compiled_for(controller, network, config.world)


def compiled_for(controller: Controller, network: Network, world: Scenario) -> None:
    """Load or compile what a life with this controller needs.

    Raises:
        ConfigError: The rule does not compile.
    """
    try:
        with suppress(LostRobotError):  # what one step of a network of zeros comes to says nothing of the genome's life
            load_kernel(controller, network, world)
    except ValueError as error:  # a RuleError among them
        raise ConfigError(str(error)) from error


def evaluate_into(path: Path, cfg: DictConfig, overrides: list[str], facts: dict[str, Any], *, threads: int) -> None:
    """Claim a folder and evaluate into it.

    Args:
        path: The folder.
        cfg: The composed configuration.
        overrides: What was typed to get it.
        facts: What else belongs into `provenance.json`.
        threads: How many threads the lifetimes may use.

    Raises:
        ConfigError: The configuration, the genome or the folder cannot be used.
        JobFailedError: The run began and could not be finished.
    """
    config, genome = asked(cfg)
    rules = own_rules(cfg)
    facts = {
        "genome": genome.name,
        "genome_sha256": genome.sha256,
        "baseline_sha256": genome.baseline_sha256,
        "self_memory_sha256": genome.self_memory_sha256,
        **({"rules": {str(file): sha256_of(file) for file in rules}} if rules else {}),
        **facts,
    }
    with saying_if_slow("Compiling; a first start takes some ten seconds, later ones do not."):
        compile_for(config, genome.network)
    baseline = baseline_for(genome, config, threads, say)
    checks = self_checks_for(genome, config, threads, say)
    with RunFolder.new(path, "evaluate", cfg, overrides, facts) as run, ThreadPoolExecutor(1) as aside:
        for file in rules:
            run.write(f"rules/{file.name}", file.read_bytes())
        if config.lifetime.record_every:
            aside.submit(importlib.import_module, "epuckhebb.study.figures")  # takes as long as the lifetimes
        metrics, traces = lives(config, genome, baseline, checks, threads)
        table = tables.paper_table(metrics)
        run.write("metrics.csv", metrics.to_csv(index=False))
        if isinstance(config.world.task, Reversal):
            _write_reversal(run, config, config.world.task, metrics, traces)
        if checks is not None:
            run.write(files.FINDINGS, findings(checks).to_csv(index=False))
        run.write("table.csv", tables.to_csv(table))
        run.write("table.md", tables.to_markdown(table))
        if config.lifetime.record_every:
            from epuckhebb.study import figures

            written = aside.submit(
                lambda: run.write(files.TRACES, files.traces_file(traces, genome.weights, genome.network))
            )
            title = caption(config, genome.name)
            run.write("figures/trajectories.png", figures.trajectories(traces, config.world, title))
            written.result()


def _write_reversal(
    run: RunFolder, config: EvaluateConfig, task: Reversal, metrics: pd.DataFrame, traces: Traces
) -> None:
    """Write what reversal learning came to: every trial, the rewarded shares, and their figure."""
    from epuckhebb.study import reversal

    told = reversal.table(metrics, traces.trials, task, config.seed)
    title = f"{config.world.name} ({config.changed}) · genome {metrics.genome[0]} · {2 * config.repeats} lives each"
    run.write(files.REVERSAL_TRIALS, traces.trials.to_csv(index=False))
    run.write(files.REVERSAL, told.to_csv(index=False))
    run.write("reversal.md", reversal.to_markdown(told))
    run.write("figures/reversal.png", reversal.figure(told, traces.trials, title))


def own_rules(cfg: Mapping[str, Any]) -> list[Path]:
    """The files of the user's own rules that a configuration names."""
    named = [cfg["hebbian"], *(cfg.get("compare") or {}).values()]
    found = [rule_file(settings) for settings in named if isinstance(settings, Mapping)]
    return list(dict.fromkeys(file for file in found if file is not None))


def lives(
    config: EvaluateConfig, genome: Genome, baseline: Baseline | None, checks: Checks | None, threads: int
) -> tuple[pd.DataFrame, Traces]:
    """The lifetimes that a configuration asks for: a row each, and the traces of those that were recorded."""
    return evaluate(
        genome.genes,
        config.world,
        config.controllers,
        config.lifetime,
        baseline,
        repeats=config.repeats,
        seed=config.seed,
        threads=threads,
        name=genome.name,
        changed=config.changed or "",
        network=genome.network,
        plan=genome.plan,
        checks=checks,
    )


def caption(config: EvaluateConfig, genome_name: str) -> str:
    """Which lifetimes the traces of a run show, in one line."""
    rate = tables.rates([(controller.name, float(controller.rule.N)) for controller in config.controllers])
    changed = f" ({config.changed})" if config.changed else ""
    return (
        f"{config.world.name}{changed} · genome {genome_name} · {f'{rate} · ' if rate else ''}"
        f"noise repeat 1 of {config.repeats}, seed {config.seed}"
    )


def baseline_for(
    genome: Genome, config: EvaluateConfig, threads: int, tell: Callable[[str], None] = lambda _: None
) -> Baseline | None:
    """What this genome remembers of its training world at the pace of an evaluation; nothing if no adaptation asks.

    It is in the champion's file, or comes of living in the training world again. A champion that remembers never to
    have arrived is never late.

    Args:
        genome: The genome.
        config: The evaluation.
        threads: How many threads living again may use.
        tell: A function that is told if the genome has to live again.

    Raises:
        ConfigError: The baseline is of another experiment, or living there again gave nothing to be late against.
    """
    if not any(controller.adaptation.needs_baseline for controller in config.controllers):
        return None
    baseline, experiment, pace = genome.baseline, config.world.experiment, config.lifetime.gain_rad_s
    if baseline is not None:
        _check_home(genome.name, baseline, experiment)
    why = _lacks(config, baseline)
    if why:
        tell(
            f"genome={genome.name} {why}: it lives {REPEATS} lifetimes a side in {TRAINED[experiment]} first, "
            f"at {pace:g} rad/s."
        )
        home = training_world(config)
        baseline = _once(
            ("baseline", genome.sha256, genome.network, repr(home), pace),
            lambda: remember(genome.weights, home, pace, threads, genome.network),
        )
        was_known = genome.baseline is not None and genome.baseline.gain_rad_s == pace
        never_arrived = np.isnan(baseline.time_to_goal_s).all()
        if "lateness" in _change_signals(config) and never_arrived and not was_known:
            raise ConfigError(
                f"adaptation.change_signal=lateness needs a time to the goal to remember, and genome={genome.name} "
                f"reached neither goal in {baseline.scenario}; give a champion that does, or change_signal=novelty or "
                "shortfall"
            )
    return baseline


def _lacks(config: EvaluateConfig, baseline: Baseline | None) -> str:
    """Why a champion has to live in the training world again, so that adaptations have something to compare with."""
    over = [controller.adaptation for controller in config.controllers]
    pace = config.lifetime.gain_rad_s
    if not any(one.needs_baseline for one in over):
        return ""
    if baseline is None:
        return "has no baseline"
    if any(one.is_gated for one in over) and baseline.gain_rad_s != pace:
        return f"remembers a pace of {baseline.gain_rad_s:g} rad/s"
    if any(one.homeostasis for one in over) and not len(baseline.patterns):
        return "does not remember what the light looks like"
    return ""


def _change_signals(config: EvaluateConfig) -> set[str]:
    """What the adaptations of a run compare with the baseline."""
    return {controller.adaptation.change_signal for controller in config.controllers} - {NONE}


def self_checks_for(
    genome: Genome, config: EvaluateConfig, threads: int, tell: Callable[[str], None] = lambda _: None
) -> Checks | None:
    """The self-checks of the lifetimes of an evaluation; nothing if no adaptation asks for them.

    What they compare with is in the champion's file, or comes of dancing and living in the training world again.

    Args:
        genome: The genome.
        config: The evaluation.
        threads: How many threads living again may use.
        tell: A function that is told if the genome has to live again.

    Raises:
        ConfigError: What is remembered is of another experiment or robot, or the robot cannot dance at home.
    """
    if not any(controller.adaptation.self_check for controller in config.controllers):
        return None
    memory, experiment = genome.self_memory, config.world.experiment
    try:
        if memory is not None:
            _check_home(genome.name, memory, experiment)
        else:
            tell(
                f"genome={genome.name} has no memory for a self-check: it dances, and lives {REPEATS} lifetimes a side "
                f"in {TRAINED[experiment]} first."
            )
            home = training_world(config)

            def remembered() -> SelfMemory:
                lived = live_at_home(genome.weights, home, 1.0, threads, genome.network)
                return remember_self(home, [samples.sensors for side in lived for _, samples in side])

            memory = _once(("self-check", genome.sha256, genome.network, repr(home)), remembered)
        return self_checks(memory, config.world, config.lifetime.noise, repeats=config.repeats, seed=config.seed)
    except (ValueError, LostRobotError) as error:
        raise error if isinstance(error, ConfigError) else ConfigError(str(error)) from error


def _once(key: tuple[object, ...], make: Callable[[], _Memory]) -> _Memory:
    """What a champion remembers, made once a process: the jobs of a sweep ask for the same ones again and again."""
    if key not in _made:
        if len(_made) >= _MOST_MADE:
            _made.clear()
        _made[key] = make()
    return cast(_Memory, _made[key])


def _check_home(name: str, remembered: Baseline | SelfMemory, experiment: str) -> None:
    """Refuse a champion that remembers a world of another experiment.

    Raises:
        ConfigError: It does.
    """
    if remembered.experiment != experiment:
        raise ConfigError(
            f"genome={name} remembers {remembered.scenario}, a world of the {remembered.experiment} experiment; it "
            f"cannot tell what is new in a scenario of the {experiment} experiment. Give a champion of that "
            "experiment, or adaptation=none"
        )


def training_world(config: EvaluateConfig) -> Scenario:
    """The world in which controllers of this experiment are evolved, in the maze that is home, for this robot."""
    maze = maze_asked(config.scenario.name, config.maze)
    world = scenario_of(TRAINED[config.world.experiment], [data_folder("conf")], maze, config.robot)
    assert world is not None  # the program has these files
    return world
