"""`epuckhebb flock`: flocks with every coupling and its controls, in every condition of a sweep, and their tables.

The folder is named by the settings, so the same command resumes it; see `epuckhebb.studies.jobs`. A condition is one
task: its runs share the threads of one process.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import product
from pathlib import Path

import pandas as pd

from epuckhebb.analysis import flock as tables
from epuckhebb.analysis import report
from epuckhebb.config import plugins
from epuckhebb.config.compose import load
from epuckhebb.config.flock import Row, shorter
from epuckhebb.config.schema import FlockConfig
from epuckhebb.runtime.errors import ConfigError
from epuckhebb.runtime.resources import thread_count
from epuckhebb.sim.coupling import CouplingError
from epuckhebb.sim.flock import CHANGE_S, Flock, Record, run
from epuckhebb.store import Run, RunFolder, provenance
from epuckhebb.studies import jobs

QUICK = ("repeats=4", "flock.duration_s=1200", "flock.at_s=600", "flock.sweep={loudness: [], knowers: [], range_m: []}")
_ESTIMATOR, _MINUTES = "estimator.csv", "minutes.csv"
_NOT_SHOWN = ("(shuffled)", "oracle")  # in the picture of couplings


def flock(overrides: list[str], *, quick: bool, config_dir: str | None = None) -> Path:
    """Do what is missing and write the tables, the figures and the page; returns the folder.

    Raises:
        ConfigError: A key or the coupling cannot be used.
    """
    config = load(FlockConfig, [*(QUICK if quick else ()), *overrides], config_dir)
    _run_all(
        config, [(row, shorter(config.cells[0][0]), config.seed) for row in config.rows]
    )  # what cannot be, at once
    own = plugins.own_files(config.values)
    depends = {key: value for key, value in config.values.items() if key not in jobs.NO_EFFECT}
    depends |= {"own": [file.digest for file in own.values()], "science": provenance.science_version()}
    name = config.flock.coupling.rpartition(":")[2]
    folder = Path("runs") / "flock" / f"{name}_seed{config.seed}_{provenance.digest(depends)[:8]}"
    tasks = [jobs.Task("the estimator", (folder / _ESTIMATOR,), partial(_estimate, config), 0.1)]
    for number, cell in enumerate(config.cells):
        results = [folder / _file(cell)] + [folder / _MINUTES] * (number == 0)
        tasks.append(jobs.Task(Path(_file(cell)).stem, tuple(results), partial(_simulate, config, cell)))
    tasks.append(jobs.Task("tables, figures and page", (), partial(_report, config), 0.1))
    jobs.run_tasks(folder, "flock", config, [*(["--quick"] if quick else []), *overrides], tasks, own)
    return folder


def shown(config: FlockConfig) -> tuple[Flock, dict[str, Record]]:
    """The first flock of the usual condition, with the last kind of break, once with each coupling."""
    first = config.cells[0][-1]
    records = _run_all(config, [(row, first, config.seed) for row in config.rows])
    return first, {row.name: record for row, record in zip(config.rows, records, strict=True)}


def _run_all(config: FlockConfig, wanted: Sequence[tuple[Row, Flock, int]]) -> list[Record]:
    def one(what: tuple[Row, Flock, int]) -> Record:
        row, flock, seed = what
        return run(flock, row.coupling, seed, other=row.other)

    try:
        with ThreadPoolExecutor(thread_count(config.threads)) as pool:
            return list(pool.map(one, wanted))
    except CouplingError as error:
        raise ConfigError(f"flock.coupling={config.flock.coupling}: {error}") from error


def _file(cell: list[Flock]) -> str:
    """Where the runs of a condition are."""
    return f"cells/loudness{cell[0].loudness:g}_knowers{cell[0].knowers}_range{cell[0].range_m:g}.csv"


def _estimate(config: FlockConfig, folder: RunFolder) -> None:
    folder.keep(_ESTIMATOR, tables.estimator(config.seed))


def _simulate(config: FlockConfig, cell: list[Flock], folder: RunFolder) -> None:
    """Run all flocks of a condition; of the usual one the cosine by minute is kept, too."""
    seeds, rows, minutes = range(config.seed, config.seed + config.repeats), [], []
    for done, (flock, row) in enumerate(product(cell, config.rows)):
        folder.advanced(done / len(cell) / len(config.rows), f"{flock.breaks}, {row.name}")
        found = {"loudness": flock.loudness, "knowers": flock.knowers, "range_m": flock.range_m}
        found |= {"breaks": flock.breaks, "coupling": row.name}
        for seed, record in zip(seeds, _run_all(config, [(row, flock, seed) for seed in seeds]), strict=True):
            rows.append({**found, "seed": seed, **tables.metrics_of(flock, record)})
            for minute, cosine in enumerate(tables.by_minute(flock, record)):
                own = {"breaks": flock.breaks, "coupling": row.name, "seed": seed}
                minutes.append({**own, "minute": minute + 0.5, "cosine": cosine})
    if cell is config.cells[0]:
        folder.keep(_MINUTES, pd.DataFrame(minutes))
    folder.keep(_file(cell), pd.DataFrame(rows))


def _report(config: FlockConfig, folder: RunFolder) -> None:
    from epuckhebb.analysis import figures, flock_figure  # matplotlib takes a while to load

    run = Run(folder.path)
    runs = pd.concat([run.table(_file(cell)) for cell in config.cells], ignore_index=True)
    table, checks = tables.table(runs, config.seed), run.table(_ESTIMATOR)
    curves = tables.curves(run.table(_MINUTES), config.seed)
    for name, frame in (("runs", runs), ("flock", table), ("curves", curves)):
        folder.write(f"{name}.csv", frame)
    first, records = shown(config)
    at = int(first.at_s / CHANGE_S)
    networks = {
        name: (record.weights[at], record.weights[-1])
        for name, record in records.items()
        if not name.endswith(_NOT_SHOWN)
    }
    pictures = {
        "flock.png": flock_figure.curves(curves, first.at_s, config.repeats),
        "couplings.png": flock_figure.couplings(networks, first.broken, first.knowers),
    }
    if len(config.cells) > 1:
        pictures["sweep.png"] = flock_figure.sweep(table)
    few = "**A smoke test: so few flocks say nothing about a coupling.** " if config.repeats < 8 else ""
    made = (
        f"{few}Made by `epuckhebb flock`: {config.flock.robots} robots, {config.repeats} flocks of each condition, seeds "
        f"{config.seed} to {config.seed + config.repeats - 1}; {first.duration_s / 60:g} minutes, and the break after "
        f"{first.at_s / 60:g}."
    )
    page = tables.page(table, checks, made, list(pictures))
    for name, picture in pictures.items():
        folder.write(f"figures/{name}", picture)
    folder.write("report.md", page)
    small = {name: figures.small(picture) for name, picture in pictures.items()}
    folder.write("report.html", report.html(page, lambda name: small[name], "epuckhebb: flock"))
