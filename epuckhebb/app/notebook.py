"""The Python interface behind `epuckhebb.evaluate`, `evolve` and `sweep`: the same keys, no folders."""

import difflib
import html
import itertools
import webbrowser
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from enum import Enum
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from epuckhebb.app import files, progress, runs
from epuckhebb.app.config import EvaluateConfig, EvolveConfig, thread_count, typed
from epuckhebb.app.data import LATEST, groups
from epuckhebb.app.errors import ConfigError
from epuckhebb.app.evaluate import baseline_for, caption, fit, lives, needs, self_checks_for
from epuckhebb.app.evolve import given_weights
from epuckhebb.app.evolve import needs as evolve_needs
from epuckhebb.app.hydra_bridge import check_config_dir, composed, quoted
from epuckhebb.app.machine import require
from epuckhebb.app.parts import controller_of, network_for, with_controls
from epuckhebb.app.progress import EvolutionProgress, TaskProgress
from epuckhebb.evolution.evolve import evolve as generations
from epuckhebb.evolution.evolve import history_row
from epuckhebb.sim.adaptation.adaptation import NONE, Adaptation
from epuckhebb.sim.genome import plan_of
from epuckhebb.sim.plasticity.rule import NoRule, Rule
from epuckhebb.study import figures, replay, self_checks, tables
from epuckhebb.study.evaluate import COLUMNS, Traces
from epuckhebb.study.self_checks import Checks

_PARAMETERS = ("config_dir", "over", "progress")  # keywords of these functions that are no keys of the configuration
_FRAME = '<iframe srcdoc="{}" width="100%" height="760" style="border:0" sandbox="allow-scripts"></iframe>'


@dataclass(frozen=True)
class Picture:
    """A PNG that a notebook shows. png: its bytes."""

    png: bytes

    def _repr_png_(self) -> bytes:
        return self.png

    def save(self, path: str | Path) -> Path:
        """Write it to a file; returns its path."""
        runs.write_whole(Path(path), self.png)
        return Path(path)


@dataclass(frozen=True)
class Page:
    """A page of HTML that a notebook shows inside itself. text: the page."""

    text: str

    def _repr_html_(self) -> str:
        return _FRAME.format(html.escape(self.text))

    def save(self, path: str | Path) -> Path:
        """Write it to a file; returns its path."""
        runs.write_whole(Path(path), self.text.encode())
        return Path(path)

    def open(self, path: str | Path = "replay.html") -> Path:
        """Write it to a file and show that in a browser; returns its path."""
        webbrowser.open(self.save(path).resolve().as_uri())
        return Path(path)


@dataclass(frozen=True, kw_only=True, repr=False)
class Evaluation:
    """What the lifetimes of an evaluation came to; a notebook shows the paper's table.

    Attributes:
        metrics: A row a lifetime, with the columns of `metrics.csv`.
        config: The settings.
        genome: Who lived.
    """

    metrics: pd.DataFrame
    config: EvaluateConfig
    genome: files.Genome
    recorded: Traces
    checks: Checks | None

    @cached_property
    def table(self) -> pd.DataFrame:
        """The paper's table: a row for each metric, a column for each controller and side; means over the repeats."""
        return tables.paper_table(self.metrics)

    @cached_property
    def traces(self) -> dict[str, NDArray[Any]]:
        """What was recorded of the first repeat: the arrays of `traces.npz`.

        Raises:
            ValueError: Nothing was recorded.
        """
        self._require_traces()
        return files.traces_arrays(self.recorded, self.genome.weights, self.genome.network)

    @property
    def trials(self) -> pd.DataFrame:
        """A row for each trial of each lifetime, as in `reversal_trials.csv`; none where a life is one trial."""
        return self.recorded.trials

    @cached_property
    def findings(self) -> pd.DataFrame | None:
        """What robots found in their self-checks, with the columns of `findings.csv`; None if there were none."""
        return None if self.checks is None else self_checks.findings(self.checks)

    def plot(self) -> Picture:
        """The paths of the first repeat, for each controller.

        Raises:
            ValueError: Nothing was recorded.
        """
        self._require_traces()
        return Picture(figures.trajectories(self.recorded, self.config.world, caption(self.config, self.genome.name)))

    def replay(self) -> Page:
        """The page to watch the first repeat, step by step.

        Raises:
            ValueError: Nothing was recorded.
        """
        self._require_traces()
        text = replay.page(
            self.recorded,
            self.genome.weights,
            self.config.world,
            caption(self.config, self.genome.name),
            gain_rad_s=self.config.lifetime.gain_rad_s,
            network=self.genome.network,
        )
        return Page(text)

    def __repr__(self) -> str:
        """The paper's table."""
        return str(tables.formatted(self.table))

    def _repr_html_(self) -> str:
        return str(tables.formatted(self.table).to_html())

    def _require_traces(self) -> None:
        if not self.config.lifetime.record_every:
            raise ConfigError("nothing was recorded with lifetime.record_every=0; give lifetime={'record_every': 8}")


class Evolution(NamedTuple):
    """What an evolution came to. champion: its genes. history: a row a generation, as in `history.csv`."""

    champion: NDArray[np.float64]
    history: pd.DataFrame


def evaluate(
    genome: Any, overrides: Sequence[Any], config_dir: str | Path | None, show: bool, keys: Mapping[str, Any]
) -> Evaluation:
    """See `epuckhebb.evaluate`."""
    progress.be_quiet(not show)
    rule = keys.get("hebbian")
    given = {key: value for key, value in keys.items() if not (key == "hebbian" and isinstance(rule, Rule))}
    config = typed(composed("evaluate", _words(overrides, given), _folder(config_dir)), EvaluateConfig)
    if isinstance(rule, Rule):
        if rule.N == 0 and not isinstance(rule, NoRule):
            raise ConfigError(
                f"hebbian={type(rule).__name__}(...) has N = 0 and would change nothing; give it a rate, for example "
                f"N={config.scenario.paper_N:g}, the paper's in this experiment, or hebbian='none'"
            )
        own = with_controls(controller_of(rule, config.adaptation), config.world.task)
        config.controllers = [*own, *(other for other in config.controllers if other.name in config.compare)]
    lived = _genome(genome, config)
    fit(lived, config)
    require(needs(config, lived))
    threads = thread_count(config.threads)
    checks = self_checks_for(lived, config, threads, progress.say)
    baseline = baseline_for(lived, config, threads, progress.say)
    metrics, recorded = lives(config, lived, baseline, checks, threads)
    return Evaluation(metrics=metrics, config=config, genome=lived, recorded=recorded, checks=checks)


def evolve(overrides: Sequence[Any], config_dir: str | Path | None, show: bool, keys: Mapping[str, Any]) -> Evolution:
    """See `epuckhebb.evolve`."""
    config = typed(composed("evolve", _words(overrides, keys), _folder(config_dir)), EvolveConfig)
    network = network_for(config.world, config.layers)
    require(evolve_needs(config, network))
    lived = []
    with EvolutionProgress(config.schedule.generations, quiet=not show) as bar:
        for generation in generations(
            config.algorithm,
            config.world,
            config.lifetime,
            config.seed,
            thread_count(config.threads),
            training=config.training,
            network=network,
            controller=config.controller,
            weights=given_weights(config),
        ):
            lived.append(generation)
            bar.show(generation)
    return Evolution(lived[-1].champion, pd.DataFrame(map(history_row, lived)))


def sweep(
    genome: Any,
    overrides: Sequence[Any],
    over: Mapping[str, Sequence[Any]] | None,
    config_dir: str | Path | None,
    show: bool,
    keys: Mapping[str, Any],
) -> pd.DataFrame:
    """See `epuckhebb.sweep`."""
    _check_keywords(keys)
    if not isinstance(over, Mapping) or not over:
        raise ConfigError(f"over must be keys with their values, as {{'hebbian.N': [0.0002, 0.002]}}, got {over!r}")
    for key, values in over.items():
        if isinstance(values, str) or not isinstance(values, Sequence | np.ndarray) or not len(values):
            raise ConfigError(f"over: {key} must have a list of values, got {values!r}")
        if key in keys:
            raise ConfigError(f"{key} is given twice, in `over` and by itself")
    jobs = list(itertools.product(*over.values()))
    found = []
    with TaskProgress([1.0] * len(jobs), quiet=not show) as bar:
        for number, values in enumerate(jobs):
            one = dict(zip(over, values, strict=True))
            bar.show(number, ", ".join(f"{key}={_label(value)}" for key, value in one.items()))
            quick = {"lifetime.record_every": 0, **keys, **one}
            who = quick.pop("genome", genome)
            metrics = evaluate(who, overrides, config_dir, False, quick).metrics
            told = {key: _label(value) for key, value in one.items() if key not in COLUMNS}
            found.append(pd.concat([pd.DataFrame(told, index=metrics.index), metrics], axis=1))
    return pd.concat(found, ignore_index=True)


def _label(value: Any) -> Any:
    """A value of a sweep in a table."""
    if isinstance(value, Rule):
        return f"{controller_of(value, Adaptation()).name}, N = {value.N:g}"
    return value if isinstance(value, str | int | float) else str(value)


def _folder(config_dir: str | Path | None) -> str | None:
    folder = None if config_dir is None else str(config_dir)
    check_config_dir(folder)
    return folder


def _genome(given: Any, config: EvaluateConfig) -> files.Genome:
    """Who is to live: the array, or what a text names.

    Raises:
        ConfigError: There is no such genome, or it is something else.
    """
    if isinstance(given, str) and "=" in given and not Path(given).exists():
        raise ConfigError(f"{given} is no genome; give that first: evaluate('reference', {given!r})")
    if isinstance(given, str | Path):
        where = str(runs.found(given, "evolve")) if str(given) == LATEST else str(given)
        return files.load_genome(where, config.world.experiment, config.layers)
    genes = getattr(given, "champion", given)  # of an Evolution
    if not isinstance(genes, np.ndarray | list | tuple):
        raise ConfigError(
            "genome must be genes (an array), `reference`, `reference_7`, or where a champion is, got "
            f"{type(given).__name__}"
        )
    network = network_for(config.world, config.layers)
    plans = [plan_of(network), *(plan_of(network, type(controller.rule)) for controller in config.controllers)]
    array = np.asarray(genes)
    plan = next((plan for plan in plans if array.shape == (plan.genes,)), plans[0])
    robot = config.world.robot
    checked = files.checked_genes(array, "the given array", plan)
    return files.Genome(genes=checked, name="genome", network=network, robot=robot.name, lights=robot.lights, plan=plan)


def _words(overrides: Sequence[Any], keys: Mapping[str, Any]) -> list[str]:
    """Overrides as on the command line, of texts and of keywords.

    Raises:
        ConfigError: One is neither.
    """
    for override in overrides:
        if not isinstance(override, str) or "=" not in override:
            raise ConfigError(
                f"overrides are texts such as 'scenario=4obstacles', or keywords such as scenario='4obstacles'; got "
                f"{override!r}"
            )
    _check_keywords(keys)
    for key, value in keys.items():
        if key in groups("evaluate") and isinstance(value, list | tuple | np.ndarray):
            raise ConfigError(f"{key} must be one, got {value!r}; for several in turn: sweep(over={{{key!r}: [...]}})")
    words = [word for key, value in keys.items() for word in _override(key, value)]
    return [*words, *overrides]


def _check_keywords(keys: Mapping[str, Any]) -> None:
    """Refuse a parameter of these functions that is misspelt, and would be taken for a key of the configuration.

    Raises:
        ConfigError: There is one.
    """
    for key in keys:
        near = difflib.get_close_matches(key, _PARAMETERS, n=1, cutoff=0.7)
        if near:
            raise ConfigError(f"there is no keyword {key}; did you mean {near[0]}?")


def _override(key: str, value: Any) -> Iterator[str]:
    """The overrides that a keyword stands for: one, or those of the keys below it."""
    if isinstance(value, type):
        raise ConfigError(f"{key} must be an object or a name, got a class; give an object of it, with its settings")
    if isinstance(value, Rule):
        raise ConfigError(
            f"{key} of this call cannot be an object; give {key}='FILE.py:{type(value).__name__}' by its file"
        )
    if isinstance(value, Adaptation) and value.acts and value.name == NONE:
        raise ConfigError(f"{key} needs a name for tables and figures; give Adaptation(name='mine', ...)")
    if is_dataclass(value):
        value = {field.name: getattr(value, field.name) for field in fields(value)}
    if isinstance(value, Mapping):
        for name, inner in value.items():
            yield f"{key}.{name}={_text(inner, f'{key}.{name}')}"
    else:
        yield f"{key}={_text(value, key)}"


def _text(value: Any, key: str) -> str:
    """A value as an override has it.

    Raises:
        ConfigError: It is nothing that a setting can be.
    """
    if isinstance(value, np.generic):
        value = value.item()
    if value is None:
        return "null"
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int | float):
        return repr(value)
    if isinstance(value, str | Path):
        return quoted(str(value))
    if isinstance(value, Mapping):
        return "{" + ",".join(f"{name}:{_text(inner, f'{key}.{name}')}" for name, inner in value.items()) + "}"
    if isinstance(value, list | tuple | np.ndarray):
        return "[" + ",".join(_text(inner, key) for inner in value) + "]"
    raise ConfigError(f"{key} must be text, a number, a list or settings, got {type(value).__name__}")
