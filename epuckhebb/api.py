"""Evaluates, evolves and sweeps from Python, with the keys of the command line. It writes no run folders."""

import html
import itertools
import webbrowser
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from epuckhebb.analysis import figures, replay, reversal, self_checks, tables
from epuckhebb.analysis.evaluate import Traces
from epuckhebb.analysis.lifetimes import Evaluated, gather
from epuckhebb.analysis.self_checks import Checks
from epuckhebb.config.build import controller_of, network_for, with_controls
from epuckhebb.config.compose import load
from epuckhebb.config.keywords import overrides_of, value_text
from epuckhebb.config.overrides import check_config_dir, quoted
from epuckhebb.config.schema import EvaluateConfig, EvolveConfig, say_unusual
from epuckhebb.evolution.evolve import history_row
from epuckhebb.live.server import Play
from epuckhebb.runs.evaluate import Prepared, as_evolved, caption, prepare
from epuckhebb.runs.evolve import EvolutionProgress
from epuckhebb.runs.evolve import prepare as prepare_evolution
from epuckhebb.runs.notes import notes_of
from epuckhebb.runtime import progress
from epuckhebb.runtime.errors import ConfigError
from epuckhebb.runtime.progress import TaskProgress
from epuckhebb.runtime.resources import LATEST, thread_count
from epuckhebb.sim.adaptation.adaptation import Adaptation
from epuckhebb.sim.genome import plan_of
from epuckhebb.sim.maze import SIDES
from epuckhebb.sim.plasticity.rule import NoRule, Rule
from epuckhebb.sim.tasks.reversal import Reversal
from epuckhebb.store import Genome, checked_genes, resolve_run, traces_arrays, write_atomic

_LIVE = '<iframe src="{}" width="100%" height="860" style="border:0" allow="clipboard-write"></iframe>'
_FRAME = '<iframe srcdoc="{}" width="100%" height="760" style="border:0" sandbox="allow-scripts"></iframe>'


@dataclass(frozen=True)
class Picture:
    """A PNG that a notebook shows. png: its bytes."""

    png: bytes = field(repr=False)

    def _repr_png_(self) -> bytes:
        return self.png

    def save(self, path: str | Path) -> Path:
        """Write it to a file; returns its path."""
        write_atomic(Path(path), self.png)
        return Path(path)


@dataclass(frozen=True)
class Page:
    """A page of HTML that a notebook shows inside itself. text: the page."""

    text: str = field(repr=False)

    def _repr_html_(self) -> str:
        return _FRAME.format(html.escape(self.text))

    def save(self, path: str | Path) -> Path:
        """Write it to a file; returns its path."""
        write_atomic(Path(path), self.text.encode())
        return Path(path)

    def open(self, path: str | Path = "replay.html") -> Path:
        """Write it to a file and show that in a browser; returns its path."""
        webbrowser.open(self.save(path).resolve().as_uri())
        return Path(path)


class Live:
    """A live world that is served until it is closed, or Python ends; a notebook shows its page.

    address: of the page, for a browser of this computer.
    """

    def __init__(self, play: Play) -> None:
        self._play = play.__enter__()
        self.address = play.address

    def _repr_html_(self) -> str:
        return _LIVE.format(html.escape(self.address))

    def open(self) -> None:
        """Show the page in a new tab."""
        webbrowser.open(self.address)

    def close(self) -> None:
        """End the world."""
        self._play.__exit__()


@dataclass(frozen=True, kw_only=True, repr=False)
class Evaluation:
    """The results of an evaluation's lifetimes; a notebook shows the paper's table.

    Attributes:
        metrics: A row a lifetime, with the columns of `metrics.csv`.
    """

    metrics: pd.DataFrame
    prepared: Prepared
    recorded: Traces
    checks: Checks | None

    @property
    def config(self) -> EvaluateConfig:
        """The settings."""
        return self.prepared.config

    @property
    def genome(self) -> Genome:
        """The genome that was evaluated."""
        return self.prepared.genome

    @cached_property
    def table(self) -> pd.DataFrame:
        """The paper's table: a row for each metric, a column for each controller and side; means over the repeats."""
        return tables.paper_table(self.metrics)

    @cached_property
    def traces(self) -> dict[str, NDArray[Any]]:
        """What was recorded of the first repeat: the arrays of `traces.npz`; ValueError if nothing was recorded."""
        self._require_traces()
        return traces_arrays(self.recorded, self.genome.weights, self.genome.network)

    @property
    def trials(self) -> pd.DataFrame:
        """A row for each trial of each lifetime, as in `reversal_trials.csv`; none where a life is one trial."""
        return self.recorded.trials

    @cached_property
    def findings(self) -> pd.DataFrame | None:
        """What robots found in their self-checks, with the columns of `findings.csv`; None if there were none."""
        return None if self.checks is None else self_checks.findings(self.checks)

    def plot(self) -> Picture:
        """The paths of the first repeat, for each controller; ValueError if nothing was recorded."""
        self._require_traces()
        return Picture(figures.trajectories(self.recorded, self.config.world, caption(self.config, self.genome.name)))

    def replay(self) -> Page:
        """The page to watch the first repeat, step by step; ValueError if nothing was recorded."""
        self._require_traces()
        title, notes = caption(self.config, self.genome.name), notes_of(self.genome, self.config)
        gain, network = self.config.lifetime.gain_rad_s, self.genome.network
        weights, world = self.genome.weights, self.config.world
        return Page(replay.page(self.recorded, weights, world, title, gain_rad_s=gain, network=network, notes=notes))

    def __repr__(self) -> str:
        """The paper's table, or that of reversal learning, and what a reader must know beside it."""
        return "\n".join([str(self._shown()), *notes_of(self.genome, self.config)])

    def _repr_html_(self) -> str:
        notes = (f"<p>{html.escape(note)}</p>" for note in notes_of(self.genome, self.config))
        return "".join([self._shown().to_html(), *notes])

    def _shown(self) -> pd.DataFrame:
        task = self.config.world.task
        if isinstance(task, Reversal):
            return reversal.table(self.metrics, self.trials, task, self.config.seed).set_index("controller")
        return tables.formatted(self.table)

    def _require_traces(self) -> None:
        if not self.config.lifetime.record_every:
            raise ConfigError("nothing was recorded with lifetime.record_every=0; give lifetime={'record_every': 8}")


class Evolution(NamedTuple):
    """The result of an evolution. champion: its genes. history: a row a generation, as in `history.csv`."""

    champion: NDArray[np.float64]
    history: pd.DataFrame


def evaluate(
    genome: Any, overrides: Sequence[Any], config_dir: str | Path | None, show: bool, keys: Mapping[str, Any]
) -> Evaluation:
    """See `epuckhebb.evaluate`."""
    progress.be_quiet(not show)
    keys = dict(keys)
    rule = keys.pop("hebbian") if isinstance(keys.get("hebbian"), Rule) else None
    folder, words = _folder(config_dir), overrides_of(overrides, keys)
    if isinstance(genome, str | Path):
        if "=" in str(genome) and not Path(genome).exists():
            raise ConfigError(f"{genome} is no genome; give that first: evaluate('reference', {str(genome)!r})")
        path = resolve_run(genome, "evolve") if str(genome) == LATEST else genome
        words = as_evolved([*words, f"genome={quoted(str(path))}"], folder)
    config = load(EvaluateConfig, words, folder)
    if rule is not None:
        if rule.N == 0 and not isinstance(rule, NoRule):
            raise ConfigError(
                f"hebbian={type(rule).__name__}(...) has N = 0 and would change nothing; give it a rate, for example "
                f"N={config.scenario.paper_N:g}, the paper's in this experiment, or hebbian='none'"
            )
        own = with_controls(controller_of(rule, config.adaptation), config.world.task)
        config.controllers = [*own, *(other for other in config.controllers if other.name in config.compare)]
    prepared = prepare(config, None if isinstance(genome, str | Path) else _genome_of(genome, config))
    say_unusual(config)
    threads = thread_count(config.threads)
    remembered = prepared.remember(threads, progress.say)
    metrics, recorded = prepared.run(remembered, threads)
    return Evaluation(metrics=metrics, prepared=prepared, recorded=recorded, checks=remembered.checks)


def evolve(overrides: Sequence[Any], config_dir: str | Path | None, show: bool, keys: Mapping[str, Any]) -> Evolution:
    """See `epuckhebb.evolve`."""
    progress.be_quiet(not show)
    config = load(EvolveConfig, overrides_of(overrides, keys), _folder(config_dir))
    say_unusual(config)
    prepared = prepare_evolution(config)
    generations = []
    with EvolutionProgress(config.schedule.generations, quiet=not show, each=False) as bar:
        for generation in prepared.generations(thread_count(config.threads)):
            generations.append(generation)
            bar.show(generation)
    return Evolution(generations[-1].champion, pd.DataFrame(map(history_row, generations)))


def sweep(
    genome: Any,
    overrides: Sequence[Any],
    over: Mapping[str, Sequence[Any]] | None,
    config_dir: str | Path | None,
    show: bool,
    keys: Mapping[str, Any],
) -> pd.DataFrame:
    """See `epuckhebb.sweep`."""
    if not isinstance(over, Mapping) or not over:
        raise ConfigError(f"over must be keys with their values, as {{'hebbian.N': [0.0002, 0.002]}}, got {over!r}")
    for key, values in over.items():
        if isinstance(values, str) or not isinstance(values, Sequence | np.ndarray) or not len(values):
            raise ConfigError(f"over: {key} must have a list of values, got {values!r}")
        if key in keys:
            raise ConfigError(f"{key} is given twice, in `over` and by itself")
    progress.be_quiet(not show)
    jobs = [dict(zip(over, values, strict=True)) for values in itertools.product(*over.values())]
    evaluations = []
    with TaskProgress([1.0] * len(jobs), each=False) as bar:
        for number, job in enumerate(jobs):
            settings = {key: _label(key, value) for key, value in job.items()}
            bar.show(number, ", ".join(f"{key}={value}" for key, value in settings.items()))
            quick = {"lifetime.record_every": 0, **keys, **job}
            given = quick.pop("genome", genome)
            result = evaluate(given, overrides, config_dir, False, quick)
            where = str(given) if isinstance(given, str | Path) else ""
            sha256, ids = result.genome.sha256, result.prepared.lifetime_ids
            evaluations.append(Evaluated(settings=settings, where=where, sha256=sha256, ids=ids, rows=result.metrics))
    gathered = gather(evaluations)
    progress.be_quiet(not show)
    if gathered.repeated:
        progress.say(gathered.repeated)
    return gathered.rows


def play(
    genome: str | Path, overrides: Sequence[Any], side: str, config_dir: str | Path | None, keys: Mapping[str, Any]
) -> Live:
    """See `epuckhebb.play`."""
    if side not in SIDES:
        raise ConfigError(f"side must be {' or '.join(SIDES)}, got {side!r}")
    folder = _folder(config_dir)
    words = as_evolved([f"genome={quoted(str(genome))}", *overrides_of(overrides, keys)], folder)
    return Live(Play(words, "right" if side == "right" else "left", folder))


def _label(key: str, value: Any) -> Any:
    """A value of a sweep in a table."""
    if isinstance(value, Rule):
        given = {one.name: getattr(value, one.name) for one in fields(value) if getattr(value, one.name) != one.default}
        facts = (f"{name} = {own:g}" if isinstance(own, float) else f"{name} = {own}" for name, own in given.items())
        return ", ".join([controller_of(value, Adaptation()).name, *facts])
    if key == "genome" and not isinstance(value, str | Path):
        return "array"
    return value if isinstance(value, str | int | float) else value_text(value, key)


def _folder(config_dir: str | Path | None) -> str | None:
    folder = None if config_dir is None else str(config_dir)
    check_config_dir(folder)
    return folder


def _genome_of(given: Any, config: EvaluateConfig) -> Genome:
    """The genome that an array or an evolution is."""
    genes = given.champion if isinstance(given, Evolution) else given
    if not isinstance(genes, np.ndarray | list | tuple):
        raise ConfigError(
            "genome must be genes (an array), `reference`, `reference_7`, or where a champion is, got "
            f"{type(given).__name__}"
        )
    network = network_for(config.world, config.shape)
    plans = [plan_of(network), *(plan_of(network, type(controller.rule)) for controller in config.controllers)]
    array = np.asarray(genes)
    plan = next((plan for plan in plans if array.shape == (plan.genes,)), plans[0])
    robot = config.world.robot
    checked = checked_genes(array, "the given array", plan)
    return Genome(genes=checked, name="genome", network=network, robot=robot.name, lights=robot.light.count, plan=plan)
