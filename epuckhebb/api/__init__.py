"""Evaluates, evolves, sweeps and plays from Python, with the keys of the command line; it writes no run folders.

It is what `import epuckhebb` gives. What cannot be used raises a ValueError, whose message says why.
"""

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from epuckhebb.adaptation.adaptation import Adaptation
from epuckhebb.analysis.evolutions import distinct, summary
from epuckhebb.analysis.lifetimes import Evaluated, gather
from epuckhebb.api.results import Evaluation, Evolution, Live
from epuckhebb.config import (
    load_any,
    make_controller,
    make_overrides,
    object_text,
    quoted,
    value_text,
)
from epuckhebb.controller.plasticity.rule import NoRule, Rule
from epuckhebb.evolution.evolve import history_row
from epuckhebb.runs import (
    evolved,
    inherit_choices,
    make_genome,
    prepare_evaluation,
    prepare_evolution,
    settings_but_seed,
    settings_of,
)
from epuckhebb.runtime import ConfigError, bar, be_quiet, conf, refusing, say, thread_count
from epuckhebb.store import load_genome, resolve_run

Genes = NDArray[np.float64]
_NEEDS_WAYS = "evolutions must be names with lists of evolutions or run folders, as {'ga': ['runs/evolve/A']}"


def load(where: str | Path = "reference", experiment: str = "obstacles") -> Genes:
    """The genes of a champion, alone: settings and signs with which it evolved stay in its run, which `evaluate` takes.

    Args:
        where: `reference`, the bundled champion of an experiment; `reference_7`, the one of seed 7; a run folder of
            `epuckhebb evolve`, `latest`, a `.npz` or a `.npy`.
        experiment: `light` or `obstacles`, for the bundled ones.

    Returns:
        The genes, 234 in the paper's network.
    """
    return load_genome(str(resolve_run(str(where), "evolve")), experiment).genes


def evaluate(
    genome: Genes | Evolution | str | Path = "reference",
    *overrides: str,
    config_dir: str | Path | None = None,
    progress: bool = True,
    **keys: Any,
) -> Evaluation:
    """Run a genome's lifetimes with and without plasticity, on the same random numbers. Nothing is written.

    Every key of the command line is a keyword: `scenario="4obstacles"`, `repeats=5`, `threads=1`. What has a dot is
    given as settings, `lifetime={"duration_s": 60}`, or as text, `"lifetime.duration_s=60"`. Objects go where they
    belong: `hebbian=Hebbian(N=0.0002)` or a rule of your own, `lifetime=Lifetime(...)`, `adaptation=Adaptation(...)`,
    `environment=Mine`, a class of `gymnasium.Env` or a function that makes one.

    Args:
        genome: Genes, or where they are, as for `load`.
        overrides: Settings as on the command line; they come after the keywords.
        config_dir: A folder with YAML files of your own.
        progress: Whether to say on standard error what takes long.
        keys: Settings as keywords.

    Returns:
        The results: `.metrics` (a row a lifetime), `.table` (means of each controller), `.traces` (arrays by name),
        `.plot()` (the main figure) and `.replay()` (a page, or an environment's film); a notebook shows the last two.
    """
    be_quiet(not progress)
    return _evaluated(genome, overrides, config_dir, keys)


def _evaluated(
    genome: Genes | Evolution | str | Path,
    overrides: Sequence[str],
    config_dir: str | Path | None,
    keys: dict[str, Any],
    *,
    record: bool = True,
) -> Evaluation:
    """Run the lifetimes of a genome. record: keep more of them than a row each."""
    rule = keys.pop("hebbian") if isinstance(keys.get("hebbian"), Rule) else None
    folder, words = _folder(config_dir), make_overrides(overrides, keys)
    if isinstance(genome, str | Path):
        words = inherit_choices([*words, f"genome={quoted(str(resolve_run(genome, 'evolve')))}"], folder)
    config = load_any("evaluate", words, folder)
    config = _take(config, rule)
    given = genome.genome if isinstance(genome, Evolution) else genome
    loaded = None if isinstance(given, str | Path) else make_genome(given, config)
    prepared = prepare_evaluation(config, loaded)
    prepared.world.compile(prepared.genome.network)
    rows, recorded = prepared.run(thread_count(config.threads), record=record)
    return Evaluation(metrics=pd.DataFrame(rows), prepared=prepared, recorded=recorded)


def _take(config: Any, rule: Rule | None) -> Any:
    """A configuration whose controllers learn by a rule that is an object, if one is given."""
    if rule is None:
        return config
    if rule.N == 0 and not isinstance(rule, NoRule):
        raise ConfigError(f"hebbian={type(rule).__name__}(...) has N = 0; give N, or hebbian='none'")
    with refusing():
        return config.take(rule)


def evolve(*overrides: str, config_dir: str | Path | None = None, progress: bool = True, **keys: Any) -> Evolution:
    """Evolve a controller. Nothing is written.

    Args:
        overrides: Settings as on the command line, for example "seed=7".
        config_dir: A folder with YAML files of your own.
        progress: Whether to show how far it is: a bar.
        keys: Settings as keywords: `seed=7`, `scenario="highlight"`, `ga=GA(population=20)`; a rule and an environment
            may be objects, as for `evaluate`.

    Returns:
        The champion of the last generation, `.champion` and `.genome`, and the rows of `history.csv`, `.history`.
    """
    be_quiet(not progress)
    rule = keys.pop("hebbian") if isinstance(keys.get("hebbian"), Rule) else None
    config = load_any("evolve", make_overrides(overrides, keys), _folder(config_dir))
    config = _take(config, rule)
    prepared = prepare_evolution(config)
    for note in prepared.world.notes():
        say(note)
    prepared.compile()
    threads = thread_count(config.threads)
    *_, last = generations = list(prepared.generations(threads))
    genome, rows = prepared.genome(last, prepared.nominal(last, threads)), map(history_row, generations)
    known = settings_but_seed(config.values)
    settings = known if rule is None else {**known, "hebbian": f"{object_text(type(rule))} {config.rule}"}
    return Evolution(genome=genome, history=pd.DataFrame(rows), settings=settings)


def compare(evolutions: Mapping[Any, Sequence[Evolution | str | Path]], fitness: float | None = None) -> pd.DataFrame:
    """A table over many evolutions, as `summary.csv` of `epuckhebb evolve -m`.

    Args:
        evolutions: For each way to evolve, by its name, the evolutions with different seeds, or their run folders.
        fitness: The robot-hours are those until the best fitness reaches this; without it, until all lifetimes of the
            fittest end at the goal.

    Returns:
        A row a way, with 95 % bootstrap intervals over seeds if there are six or more. Each evolution counts once.

    Raises:
        ValueError: The evolutions of a way differ in more than their seeds, or one of them is not finished.
    """
    ways = [(way, _listed(way, own)) for way, own in evolutions.items()] if isinstance(evolutions, Mapping) else []
    if not ways:
        raise ConfigError(f"{_NEEDS_WAYS}, got {evolutions!r}")
    return summary([({"evolution": way}, _histories(way, own)) for way, own in ways], fitness)


def _listed(way: Any, evolutions: Any) -> list[Evolution | Path]:
    is_list = isinstance(evolutions, Sequence) and not isinstance(evolutions, str)
    if not is_list or not evolutions or not all(isinstance(one, Evolution | str | Path) for one in evolutions):
        raise ConfigError(f"{_NEEDS_WAYS}, got {evolutions!r} for {way!r}")
    return [one if isinstance(one, Evolution) else resolve_run(one, "evolve") for one in evolutions]


def _histories(way: Any, evolutions: list[Evolution | Path]) -> list[pd.DataFrame]:
    """The histories of evolutions that differ in their seeds alone, each of them once."""
    settings = [one.settings if isinstance(one, Evolution) else settings_of(one) for one in evolutions]
    first, *others = [dict(conf.flat(one)) for one in settings]
    for number, own in enumerate(others, 1):
        if differ := [key for key in {**own, **first} if own.get(key) != first.get(key)]:
            names = f"{evolutions[0]} and {evolutions[number]}"
            raise ConfigError(f"evolutions of {way!r} may differ in seed alone, {names} in {differ[0]}")
    found = [(one.champion, one.history) if isinstance(one, Evolution) else evolved(one) for one in evolutions]
    lengths = sorted({len(history) for _, history in found})
    if len(lengths) > 1:
        raise ConfigError(f"evolutions of {way!r} must have as many generations, got {', '.join(map(str, lengths))}")
    return distinct(found)


def play(
    genome: str | Path = "reference",
    *overrides: str,
    side: str = "left",
    config_dir: str | Path | None = None,
    **keys: Any,
) -> Live:
    """Open a live world that one disturbs by hand; a notebook shows its page below the cell.

    Args:
        genome: Where the genes are, as for `load`.
        overrides: Settings as on the command line; they come after the keywords.
        side: The side of the goal, `left` or `right`.
        config_dir: A folder with YAML files of your own.
        keys: Settings as keywords.

    Returns:
        The live world: `.address` of its page, `.close()` ends it. Runs that the page saves are in `runs/evaluate/`.
    """
    folder, path = _folder(config_dir), resolve_run(genome, "evolve")
    words = inherit_choices([f"genome={quoted(str(path))}", *make_overrides(overrides, keys)], folder)
    return Live(words, side, folder).__enter__()


def sweep(
    genome: Genes | Evolution | str | Path = "reference",
    *overrides: str,
    over: Mapping[str, Sequence[Any]],
    config_dir: str | Path | None = None,
    progress: bool = True,
    **keys: Any,
) -> pd.DataFrame:
    """Every combination of values, in one table. Nothing is written; `epuckhebb sweep` does it on many machines.

    Args:
        genome: As for `evaluate`.
        overrides: As for `evaluate`.
        over: For each key its values, for example `{"scenario": ["base", "lowlight"], "hebbian.N": [0.0002, 0.002]}`;
            `genome`, `seed` and objects, as `{"hebbian": [Hebbian(N=0.001), MyRule(N=0.001)]}`, too.
        config_dir: As for `evaluate`.
        progress: Whether to show how far it is: a bar.
        keys: Settings that all have in common; the same `seed` gives the same numbers.

    Returns:
        A row a lifetime, each of them once, with the columns of `metrics.csv`. Before them is a column for each key of
        `over` that `metrics.csv` has no column for; it says `any` for the GA if the key is one of plasticity.
    """
    lists = over.values() if isinstance(over, Mapping) else []
    if not lists or not all(isinstance(values, list | tuple | np.ndarray) and len(values) for values in lists):
        raise ConfigError(f"over must be keys with lists of values, as {{'hebbian.N': [0.0002, 0.002]}}, got {over!r}")
    be_quiet(not progress)
    labels = [_labels(key, values) for key, values in over.items()]
    jobs = [dict(zip(over, pairs, strict=True)) for pairs in itertools.product(*labels)]
    evaluations = []
    with bar("job", len(jobs)) as shown:
        be_quiet(True)
        for job in jobs:
            settings = {key: label for key, (_, label) in job.items()}
            own = {**keys, **{key: value for key, (value, _) in job.items()}}
            result = _evaluated(own.pop("genome", genome), overrides, config_dir, own, record=False)
            sha256, ids = result.genome.sha256, result.prepared.lifetime_ids
            known = dict(conf.flat(result.config.values))  # also what the champion brings along
            evaluations.append(Evaluated(settings=settings, sha256=sha256, ids=ids, rows=result.metrics, config=known))
            shown.update()
    gathered = gather(evaluations)
    be_quiet(not progress)
    return gathered.rows


def _labels(key: str, values: Sequence[Any]) -> list[tuple[Any, Any]]:
    """The values of a key in a sweep, each with its text in tables: another object of one name has a number."""
    labels, known = [], dict[Any, Any]()
    for value in values:
        label, numbers = (name := _label(key, value)), itertools.count(2)
        while (isinstance(value, Rule) or callable(value)) and known.setdefault(label, value) != value:
            label = f"{name} ({next(numbers)})"
        labels.append((value, label))
    return labels


def _label(key: str, value: Any) -> Any:
    """A value of a sweep in a table."""
    if isinstance(value, Rule):
        given = {one.name: getattr(value, one.name) for one in fields(value) if getattr(value, one.name) != one.default}
        facts = (f"{name} = {own:g}" if isinstance(own, float) else f"{name} = {own}" for name, own in given.items())
        return ", ".join([make_controller(value, Adaptation()).name, *facts])
    if callable(value):
        return object_text(value).rpartition(":")[2]
    if key == "genome" and not isinstance(value, str | Path):
        return "array"
    return value if isinstance(value, str | int | float) else value_text(value, key)


def _folder(config_dir: str | Path | None) -> str | None:
    return None if config_dir is None else str(config_dir)
