"""What a verb does with one configuration: claim a run folder, do the science, write the results."""

import io
import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from numpy.typing import NDArray
from omegaconf import DictConfig

from epuckhebb.app import genomes
from epuckhebb.app.config import EvaluateConfig, EvolveConfig, thread_count, typed
from epuckhebb.app.errors import ConfigError
from epuckhebb.app.progress import EvolutionProgress
from epuckhebb.app.runs import RunFolder, remove_if_empty
from epuckhebb.evolution.evolve import Generation, evolve, history_row
from epuckhebb.study import figures, tables
from epuckhebb.study.evaluate import Traces, evaluate

finished: list[Path] = []  # run folders completed by this process, for the command line to report
_QUIET = "EPUCKHEBB_QUIET"  # environment variable, so that the workers of a launcher see it too


def begin(*, quiet: bool) -> None:
    """Forget earlier calls in this process, and say whether jobs may show their progress."""
    finished.clear()
    os.environ[_QUIET] = "1" if quiet else ""


def evaluate_job(cfg: DictConfig) -> None:
    """One `epuckhebb evaluate`: see `epuckhebb.study.evaluate`."""
    path = _folder()
    try:
        config = typed(cfg, EvaluateConfig)
        genome = genomes.load(config.genome, config.scenario.experiment)
        run = RunFolder(path, "evaluate", cfg, _overrides(), {"genome": genome.name, "genome_sha256": genome.sha256})
    except ConfigError:
        remove_if_empty(path, Path.cwd())
        raise
    with run:
        metrics, traces = evaluate(
            genome.genes,
            config.scenario,
            [] if config.hebbian.name == "none" else [config.hebbian],
            config.lifetime,
            repeats=config.repeats,
            seed=config.seed,
            threads=_threads(config.threads),
            name=genome.name,
        )
        table = tables.paper_table(metrics)
        run.write_text("metrics.csv", metrics.to_csv(index=False))
        run.write_text("table.csv", tables.to_csv(table))
        run.write_text("table.md", tables.to_markdown(table))
        if config.lifetime.record_every:
            run.write("traces.npz", _traces_file(traces, genome.genes))
            title = caption(config, genome.name)
            run.write("figures/trajectories.png", figures.trajectories(traces, config.scenario, title))
    finished.append(path)


def evolve_job(cfg: DictConfig) -> None:
    """One `epuckhebb evolve`: see `epuckhebb.evolution.evolve`."""
    path = _folder()
    try:
        config = typed(cfg, EvolveConfig)
        run = RunFolder(path, "evolve", cfg, _overrides(), {})
    except ConfigError:
        remove_if_empty(path, Path.cwd())
        raise
    history: list[dict[str, Any]] = []
    quiet = _in_multirun() or bool(os.environ.get(_QUIET))
    with run, _saying_what_is_safe(run), EvolutionProgress(config.ga.generations, quiet=quiet) as progress:
        for generation in evolve(config.ga, config.scenario, config.lifetime, config.seed, _threads(config.threads)):
            history.append(history_row(generation))
            run.write("checkpoint.npz", _checkpoint_file(generation, history))
            run.write_text("history.csv", pd.DataFrame(history).to_csv(index=False))
            run.write(
                "champion.npz",
                genomes.champion_file(
                    float(generation.fitness.max()),
                    generation.champion,
                    config.scenario.experiment,
                    config.seed,
                    generation.number,
                ),
            )
            progress.show(generation)
    finished.append(path)


@contextmanager
def _saying_what_is_safe(run: RunFolder) -> Iterator[None]:
    """Tell who interrupts an evolution what it has left behind."""
    try:
        yield
    except KeyboardInterrupt:
        checkpoint = run.path / "checkpoint.npz"
        safe = (
            f"the last whole generation is in {checkpoint}" if checkpoint.is_file() else "before the first generation"
        )
        raise KeyboardInterrupt(safe) from None


def caption(config: EvaluateConfig, genome_name: str) -> str:
    """Which lifetimes the traces of a run show, in one line."""
    return (
        f"{config.scenario.name} · genome {genome_name} · N = {config.hebbian.N:g} · "
        f"noise repeat 1 of {config.repeats}, seed {config.seed}"
    )


def _folder() -> Path:
    return Path(HydraConfig.get().runtime.output_dir)


def _overrides() -> list[str]:
    return list(HydraConfig.get().overrides.task)


def _in_multirun() -> bool:
    return HydraConfig.get().mode == RunMode.MULTIRUN


def _threads(asked: int) -> int:
    """Threads of this job; jobs of a parallel launcher get one each, unless told otherwise."""
    parallel = _in_multirun() and not HydraConfig.get().launcher._target_.endswith("BasicLauncher")
    return 1 if parallel and asked == 0 else thread_count(asked)


def _traces_file(traces: Traces, genome: NDArray[np.float64]) -> bytes:
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer,
        controller=np.array(traces.controller),
        side=np.array(traces.side),
        genome=genome,
        **traces.samples._asdict(),
    )
    return buffer.getvalue()


def _checkpoint_file(generation: Generation, history: list[dict[str, Any]]) -> bytes:
    buffer = io.BytesIO()
    np.savez(
        buffer,
        generation=np.int64(generation.number),
        population=generation.population,
        fitness=generation.fitness,
        success=generation.success,
        champion=generation.champion,
        rng_state=np.str_(json.dumps(generation.rng_state)),
        history=np.str_(pd.DataFrame(history).to_csv(index=False)),
    )
    return buffer.getvalue()
