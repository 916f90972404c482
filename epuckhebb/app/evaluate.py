"""`epuckhebb evaluate`: the lifetimes of a genome in a scenario, and what a run of them leaves in its folder."""

import importlib
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from omegaconf import DictConfig, OmegaConf

from epuckhebb.app import files, hydra_bridge
from epuckhebb.app.config import EvaluateConfig, typed
from epuckhebb.app.data import data_folder
from epuckhebb.app.errors import ConfigError
from epuckhebb.app.files import Genome
from epuckhebb.app.progress import say
from epuckhebb.app.runs import RunFolder
from epuckhebb.sim.lifetime import load_kernel
from epuckhebb.sim.memory import REPEATS, Memory, remember
from epuckhebb.sim.scenario import TRAINED, Scenario
from epuckhebb.sim.surprise import Surprise
from epuckhebb.study import tables
from epuckhebb.study.evaluate import Traces, evaluate


def evaluate_job(cfg: DictConfig) -> None:
    """Do one job of Hydra's: evaluate into its folder."""
    threads = hydra_bridge.threads_of_job(cfg.threads)
    with hydra_bridge.job_folder() as path:
        evaluate_into(path, cfg, hydra_bridge.job_overrides(), {}, threads=threads)


def asked(cfg: DictConfig) -> tuple[EvaluateConfig, Genome]:
    """What a configuration asks for: its values, and the genome that it names, both checked.

    Raises:
        ConfigError: A value or the genome cannot be used.
    """
    config = typed(cfg, EvaluateConfig)
    return config, files.load_genome(config.genome, config.scenario.experiment)


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
    facts = {"genome": genome.name, "genome_sha256": genome.sha256, **facts}
    memory = memory_for(genome, config, threads, say)
    with RunFolder.new(path, "evaluate", cfg, overrides, facts) as run, ThreadPoolExecutor(1) as aside:
        if config.lifetime.record_every:
            load_kernel()
            aside.submit(importlib.import_module, "epuckhebb.study.figures")  # takes as long as the lifetimes
        metrics, traces = lives(config, genome, memory, threads)
        table = tables.paper_table(metrics)
        run.write("metrics.csv", metrics.to_csv(index=False))
        run.write("table.csv", tables.to_csv(table))
        run.write("table.md", tables.to_markdown(table))
        if config.lifetime.record_every:
            from epuckhebb.study import figures

            written = aside.submit(lambda: run.write(files.TRACES, files.traces_file(traces, genome.genes)))
            title = caption(config, genome.name)
            run.write("figures/trajectories.png", figures.trajectories(traces, config.scenario, title))
            written.result()


def lives(config: EvaluateConfig, genome: Genome, memory: Memory | None, threads: int) -> tuple[pd.DataFrame, Traces]:
    """The lifetimes that a configuration asks for: a row each, and the traces of those that were recorded."""
    return evaluate(
        genome.genes,
        config.scenario,
        config.plasticities,
        config.lifetime,
        memory,
        repeats=config.repeats,
        seed=config.seed,
        threads=threads,
        name=genome.name,
    )


def caption(config: EvaluateConfig, genome_name: str) -> str:
    """Which lifetimes the traces of a run show, in one line."""
    return (
        f"{config.scenario.name} · genome {genome_name} · N = {config.hebbian.N:g} · "
        f"noise repeat 1 of {config.repeats}, seed {config.seed}"
    )


def memory_for(
    genome: Genome, config: EvaluateConfig, threads: int, tell: Callable[[str], None] = lambda _: None
) -> Memory | None:
    """What this genome remembers of its training world at the pace of an evaluation; nothing if no plasticity asks.

    It is in the champion's file, or comes of living in the training world again. A champion that remembers never to
    have arrived is never late.

    Args:
        genome: The genome.
        config: The evaluation.
        threads: How many threads living again may use.
        tell: A function that is told if the genome has to live again.

    Raises:
        ConfigError: The memory is of another experiment, or living there again gave nothing to be late against.
    """
    asking = {hebbian.surprise for hebbian in config.plasticities} - {Surprise.none}
    if not asking:
        return None
    memory, experiment, pace = genome.memory, config.scenario.experiment, config.lifetime.gain_rad_s
    if memory is not None and memory.experiment != experiment:
        raise ConfigError(
            f"genome={genome.name} remembers {memory.scenario}, a world of the {memory.experiment} experiment; it "
            f"cannot tell what is new in a scenario of the {experiment} experiment. Give a champion of that "
            "experiment, or a plasticity without surprise, such as hebbian=paper"
        )
    if memory is None or memory.gain_rad_s != pace:
        why = "has no memory" if memory is None else f"remembers a pace of {memory.gain_rad_s:g} rad/s"
        tell(
            f"genome={genome.name} {why}: it lives {REPEATS} lifetimes a side in {TRAINED[experiment]} first, "
            f"at {pace:g} rad/s."
        )
        memory = remember(genome.genes, training_world(experiment), pace, threads)
        if Surprise.lateness in asking and np.isnan(memory.time_to_goal_s).all():
            raise ConfigError(
                f"hebbian.surprise=lateness needs a time to the goal to remember, and genome={genome.name} reached "
                f"neither goal in {memory.scenario}; give a champion that does, or surprise=novelty or shortfall"
            )
    return memory


def training_world(experiment: str) -> Scenario:
    """The world in which controllers of an experiment are evolved."""
    file = data_folder("conf") / "scenario" / f"{TRAINED[experiment]}.yaml"
    world = OmegaConf.to_object(OmegaConf.merge(OmegaConf.structured(Scenario), OmegaConf.load(file)))
    assert isinstance(world, Scenario)
    return world
