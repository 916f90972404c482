"""`epuckhebb flock`: flocks with every coupling and its controls, in every condition of a sweep, and their tables.

The folder is named by the settings, so the same command resumes it; see `epuckhebb.studies.jobs`. Each condition is a
job, whose runs share the threads of one process.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from epuckhebb.analysis import flock as tables
from epuckhebb.analysis import flock_replay
from epuckhebb.config import FlockConfig, Plain, Row, dump, from_values, load, own_files, settings, shorter
from epuckhebb.flock.coupling import CouplingError
from epuckhebb.flock.plane import CHANGE_S, Flock, Record, run
from epuckhebb.runs import hydra
from epuckhebb.runtime import ConfigError, thread_count
from epuckhebb.store import Run, RunFolder, digest, fingerprint
from epuckhebb.studies import jobs
from epuckhebb.studies.jobs import Job

if TYPE_CHECKING:
    from matplotlib.figure import Figure

QUICK = (
    "seed=1",  # those of the study are not looked at in a smoke test
    "repeats=4",
    "flock.duration_s=1200",
    "flock.at_s=600",
    "flock.sweep={loudness: [], knowers: [], range_m: [], repeats: 4}",
)
_NOT_SHOWN = ("(shuffled)", "oracle")  # in the picture of couplings, and in a replay


def flock(arguments: list[str], *, quick: bool, config_dir: str | None = None) -> Path:
    """Do what is missing and write the tables, the figures and the page; returns the folder.

    arguments: overrides, of the study and of Hydra.
    """
    own, of_hydra = jobs.split("flock", arguments)
    config = load(FlockConfig, [*(QUICK if quick else ()), *own], config_dir)
    smoke_test = shorter(config.cells[0].flocks[0])
    _run_all([(row, smoke_test, config.seed) for row in config.rows], 1)  # a coupling that gives no weights ends here
    planned = [_job(config.values, number) for number in range(len(config.cells))]
    name = f"{config.flock.coupling.rpartition(':')[2]}_seed{config.seed}"
    usual = Path("runs") / "flock" / f"{name}_{digest([job.run for job in planned])[:8]}"
    folder, launcher = jobs.folder_and_launcher(of_hydra, usual, len(planned))
    words = [*(["--quick"] if quick else []), *arguments]
    with jobs.open_study(folder, "flock", config, words, planned, own_files(config.values)) as study:
        jobs.launch_in_turn(study, [("run flocks", planned)], launcher, flock_job)
        _report(study, config, [Run(folder / job.run) for job in planned])
    return folder


def flock_job(cfg: Any) -> None:
    """Do one condition, as a job of Hydra's."""
    jobs.one_job(cfg, _identity, _work)


def _job(values: Plain, number: int) -> Job:
    config = {"config": values, "cell": number}
    return Job(number=number, overrides=[], run=_identity(config), config=config)


def _identity(job: Plain) -> str:
    """The name of the run of a job, from what it depends on: other conditions of the sweep leave it as it is."""
    config = from_values(job["config"], FlockConfig, "a job of flock")
    rows = [(row.name, repr(row.coupling), row.other) for row in config.rows]
    own = [file.digest for file in own_files(job["config"]).values()]  # wherever they are
    return f"flock_{fingerprint([rows, repr(config.cells[job['cell']]), config.seed], own=own)}"


def shown(config: FlockConfig) -> tuple[Flock, dict[str, Record]]:
    """The first flock of the usual condition, with the last kind of break, once with each coupling but the controls."""
    first, rows = config.cells[0].flocks[-1], [row for row in config.rows if not row.name.endswith(_NOT_SHOWN)]
    records = _run_all([(row, first, config.seed) for row in rows], thread_count(config.threads))
    return first, {row.name: record for row, record in zip(rows, records, strict=True)}


def replay_page(path: Path) -> str:
    """The page that replays a finished study: its first flock runs again."""
    done = Run(path)
    config = from_values(settings(done.config_file), FlockConfig, str(path))
    flock, records = shown(config)
    runs = done.table("runs.csv")
    for name, record in records.items():
        row = runs[(runs.coupling == name) & (runs.breaks == flock.breaks) & (runs.seed == config.seed)].iloc[0]
        if tables.metrics_of(flock, record)["long_after"] != row.long_after:
            raise ConfigError(f"{path} was made by another version of the program, or of its coupling; run it again")
    return flock_replay.page(flock, records, f"{path.name}: seed {config.seed}")


def _run_all(wanted: Sequence[tuple[Row, Flock, int]], threads: int) -> list[Record]:
    def one(what: tuple[Row, Flock, int]) -> Record:
        row, flock, seed = what
        return run(flock, row.coupling, seed, other=row.other)

    try:
        with ThreadPoolExecutor(threads) as pool:
            return list(pool.map(one, wanted))
    except CouplingError as error:
        raise ConfigError(f"flock.coupling: {error}") from error


def _work(path: Path, job: Plain, facts: dict[str, Any]) -> None:
    """Run all flocks of a condition."""
    config = from_values(job["config"]["config"], FlockConfig, f"job {path}")
    condition, threads = config.cells[job["config"]["cell"]], hydra.threads_of_job(config.threads)
    seeds = range(config.seed, config.seed + condition.repeats)
    rows, minutes = [], []
    own = own_files(config.values)
    with RunFolder.new(path, "flock", dump(config), job["overrides"], {"seed": config.seed, **facts}, own) as folder:
        for flock, row in product(condition.flocks, config.rows):
            here = {"breaks": flock.breaks, "coupling": row.name}
            found = {"loudness": flock.loudness, "knowers": flock.knowers, "range_m": flock.range_m, **here}
            for seed, record in zip(seeds, _run_all([(row, flock, seed) for seed in seeds], threads), strict=True):
                rows.append({**found, "seed": seed, **tables.metrics_of(flock, record)})
                for minute, cosine in enumerate(tables.by_minute(flock, record)):
                    minutes.append({**here, "seed": seed, "minute": minute + 0.5, "cosine": cosine})
        folder.write("runs.csv", pd.DataFrame(rows))
        folder.write("minutes.csv", pd.DataFrame(minutes))


def figures(config: FlockConfig, curves: pd.DataFrame, table: pd.DataFrame) -> "dict[str, Figure]":
    """The figures of a study by the names of their files, of two of its tables; its first flock runs again."""
    from epuckhebb.analysis import flock_figure  # matplotlib takes a while to load

    first, records = shown(config)
    at = int(first.at_s / CHANGE_S)
    networks = {name: (record.weights[at], record.weights[-1]) for name, record in records.items()}
    drawn = {
        "flock.png": flock_figure.curves(curves, first.at_s, config.repeats),
        "couplings.png": flock_figure.couplings(networks, first.broken, first.knowers),
    }
    return drawn | ({"sweep.png": flock_figure.sweep(table)} if len(config.cells) > 1 else {})


def _report(folder: RunFolder, config: FlockConfig, done: list[Run]) -> None:
    runs = pd.concat([one.table("runs.csv") for one in done], ignore_index=True)
    table, checks = tables.table(runs, config.seed), tables.estimator(config.seed)
    curves = tables.curves(done[0].table("minutes.csv"), config.seed)
    for name, frame in (("runs", runs), ("flock", table), ("curves", curves), ("estimator", checks)):
        folder.write(f"{name}.csv", frame)
    drawn, first = figures(config, curves, table), config.cells[0].flocks[-1]
    few = "**A smoke test: so few flocks say nothing about a coupling.** " if config.repeats < 8 else ""
    made = (
        f"{few}Made by `epuckhebb flock`: {config.flock.robots} robots, {config.repeats} flocks of the usual "
        f"condition, seeds {config.seed} to {config.seed + config.repeats - 1}; {first.duration_s / 60:g} minutes, and "
        f"the break after {first.at_s / 60:g}."
    )
    jobs.write_report(folder, tables.page(table, checks, made, list(drawn)), drawn, "epuckhebb: flock")
