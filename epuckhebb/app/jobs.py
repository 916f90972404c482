"""What a verb does with one configuration: claim a run folder, do the science, write the results."""

import importlib
import io
import os
import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from hydra.core.hydra_config import HydraConfig
from hydra.types import RunMode
from numpy.typing import NDArray
from omegaconf import DictConfig

from epuckhebb.app import checkpoint, genomes
from epuckhebb.app.checkpoint import Checkpoint
from epuckhebb.app.config import EvaluateConfig, EvolveConfig, thread_count, typed
from epuckhebb.app.errors import ConfigError
from epuckhebb.app.memories import memory_for
from epuckhebb.app.progress import EvolutionProgress
from epuckhebb.app.runs import RunFolder, remove_if_empty
from epuckhebb.evolution.evolve import evolve
from epuckhebb.sim.lifetime import load_kernel
from epuckhebb.sim.memory import Memory, remember
from epuckhebb.study import tables
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
        evaluate_into(path, cfg, _overrides(), {}, threads=threads_of_job(cfg.threads))
    except ConfigError:
        remove_if_empty(path, Path.cwd())
        raise
    finished.append(path)


def evaluate_into(path: Path, cfg: DictConfig, overrides: list[str], facts: dict[str, Any], *, threads: int) -> None:
    """Claim a folder and evaluate into it.

    facts: what else belongs into its `provenance.json`.

    Raises:
        ConfigError: the configuration, the genome or the folder cannot be used.
        JobFailedError: it began and could not be finished.
    """
    config = typed(cfg, EvaluateConfig)
    genome = genomes.load(config.genome, config.scenario.experiment)
    facts = {"genome": genome.name, "genome_sha256": genome.sha256, **facts}
    gain = config.lifetime.gain_rad_s
    memory = memory_for(genome, config.plasticities, config.scenario.experiment, gain, threads, _say)
    with RunFolder(path, "evaluate", cfg, overrides, facts) as run, ThreadPoolExecutor(1) as aside:
        if config.lifetime.record_every:
            load_kernel()
            aside.submit(importlib.import_module, "epuckhebb.study.figures")  # takes as long as the lifetimes
        metrics, traces = evaluate(
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
        table = tables.paper_table(metrics)
        run.write_text("metrics.csv", metrics.to_csv(index=False))
        run.write_text("table.csv", tables.to_csv(table))
        run.write_text("table.md", tables.to_markdown(table))
        if config.lifetime.record_every:
            from epuckhebb.study import figures

            written = aside.submit(lambda: run.write("traces.npz", _traces_file(traces, genome.genes)))
            title = caption(config, genome.name)
            run.write("figures/trajectories.png", figures.trajectories(traces, config.scenario, title))
            written.result()


def evolve_job(cfg: DictConfig) -> None:
    """One `epuckhebb evolve`: see `epuckhebb.evolution.evolve`."""
    path = _folder()
    try:
        run = evolve_folder(path, cfg, _overrides(), {})
    except ConfigError:
        remove_if_empty(path, Path.cwd())
        raise
    evolve_into(
        run, typed(cfg, EvolveConfig), None, threads=threads_of_job(cfg.threads), quiet=_in_multirun() or is_quiet()
    )
    finished.append(path)


def evolve_folder(path: Path, cfg: DictConfig, overrides: list[str], facts: dict[str, Any]) -> RunFolder:
    """Claim a folder for an evolution.

    Raises:
        ConfigError: the configuration or the folder cannot be used.
    """
    typed(cfg, EvolveConfig)
    return RunFolder(path, "evolve", cfg, overrides, facts)


def evolve_into(run: RunFolder, config: EvolveConfig, after: Checkpoint | None, *, threads: int, quiet: bool) -> None:
    """Evolve, from the beginning or from a checkpoint on, and close the run.

    Raises:
        JobFailedError: it could not be finished.
    """
    with run, _saying_what_is_safe(run), EvolutionProgress(config.ga.generations, quiet=quiet) as progress:
        if after is not None and not _is_written(run, after):
            _write_generation(run, after, config)
        last = after.generation if after else None
        for generation in evolve(config.ga, config.scenario, config.lifetime, config.seed, threads, after=last):
            after = checkpoint.following(after, generation)
            run.write(checkpoint.NAME, after.as_bytes())
            _write_generation(run, after, config)
            progress.show(generation)
        assert after is not None  # there is at least one generation
        memory = remember(after.generation.champion, config.scenario, threads=threads)
        _write_champion(run, after, config, memory)


def _write_generation(run: RunFolder, state: Checkpoint, config: EvolveConfig) -> None:
    """Bring the other files of an evolution to the state of its checkpoint."""
    run.write_text("history.csv", state.history)
    _write_champion(run, state, config, None)


def _is_written(run: RunFolder, state: Checkpoint) -> bool:
    """Whether the other files are at the state of the checkpoint; a champion that remembers is kept as it is."""
    try:
        history = (run.path / "history.csv").read_text()
        champion = genomes.load(str(run.path), "")
    except (OSError, ConfigError):
        return False
    return history == state.history and np.array_equal(champion.genes, state.generation.champion)


def _write_champion(run: RunFolder, state: Checkpoint, config: EvolveConfig, memory: Memory | None) -> None:
    last, experiment = state.generation, config.scenario.experiment
    run.write(
        "champion.npz",
        genomes.champion_file(float(last.fitness.max()), last.champion, experiment, config.seed, last.number, memory),
    )


@contextmanager
def _saying_what_is_safe(run: RunFolder) -> Iterator[None]:
    """Tell who interrupts an evolution what it has left behind."""
    try:
        yield
    except KeyboardInterrupt:
        safe = "before the first generation"
        if (run.path / checkpoint.NAME).is_file():
            safe = (
                f"the last whole generation is in {run.path / checkpoint.NAME}; "
                f"go on with: epuckhebb evolve resume={run.path}"
            )
        raise KeyboardInterrupt(safe) from None


def caption(config: EvaluateConfig, genome_name: str) -> str:
    """Which lifetimes the traces of a run show, in one line."""
    return (
        f"{config.scenario.name} · genome {genome_name} · N = {config.hebbian.N:g} · "
        f"noise repeat 1 of {config.repeats}, seed {config.seed}"
    )


def is_quiet() -> bool:
    """Whether this call was asked to print nothing."""
    return bool(os.environ.get(_QUIET))


def _say(message: str) -> None:
    if not is_quiet():
        print(message, file=sys.stderr)


def _folder() -> Path:
    return Path(HydraConfig.get().runtime.output_dir)


def _overrides() -> list[str]:
    return list(HydraConfig.get().overrides.task)


def _in_multirun() -> bool:
    return HydraConfig.get().mode == RunMode.MULTIRUN


def threads_of_job(asked: int) -> int:
    """Threads of this job; jobs of a parallel launcher get one each unless told otherwise, and never more than fit."""
    launcher = HydraConfig.get().launcher
    if not _in_multirun() or launcher._target_.endswith("BasicLauncher"):
        return thread_count(asked)
    if launcher._target_.endswith("JoblibLauncher"):
        cores = thread_count(0)
        width = launcher.n_jobs if launcher.n_jobs > 0 else max(1, cores + 1 + launcher.n_jobs)
        return int(max(1, min(asked, cores // width)))
    return max(1, asked)


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
