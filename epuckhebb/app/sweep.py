"""`epuckhebb sweep NAME`: the jobs that `conf/experiment/NAME.yaml` and the command line make, and tables over all.

A job is known by a digest of its resolved configuration, its genome and the version of the science; what is in the run
folder of that name is its result, whenever it was made. The folder of a sweep is named by its jobs, so that the same
command finds it again.
"""

import csv
import io
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from epuckhebb.app import engine, files, formats, hydra_bridge, runs
from epuckhebb.app.engine import Job, Outcome
from epuckhebb.app.errors import ConfigError
from epuckhebb.app.runs import RunFolder
from epuckhebb.study import rescue, summary
from epuckhebb.study.evaluate import COLUMNS

_SWEEP = "sweep.csv"
_IN_METRICS = ("scenario", "seed")  # settings that every row of metrics.csv tells of anyway


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """A named sweep: its jobs, its folder, what was typed to ask for it, and what of that is for Hydra's launcher."""

    name: str
    jobs: list[Job]
    folder: Path
    arguments: list[str]
    launcher: list[str]


def plan(name: str, arguments: list[str], config_dir: str | None = None) -> Sweep:
    """List the jobs of a sweep, each composed and checked; two that would do the same are one.

    Raises:
        ConfigError: There is no such sweep, or a key, a value or the genome cannot be used.
    """
    hydras = engine.for_hydra("sweep", arguments)
    hydra_bridge.check_words("evaluate", arguments)
    named = [f"experiment={name}"]
    params = hydra_bridge.composed("evaluate", [*named, *hydras], config_dir, with_hydra=True).hydra.sweeper.params
    if not params:
        raise ConfigError(f"experiment={name} has no hydra.sweeper.params: it is one job, for `epuckhebb evaluate`")
    swept = [f"{key}={values}" for key, values in params.items()]
    choices = hydra_bridge.alternatives([*swept, *(argument for argument in arguments if argument not in hydras)])
    listed: dict[str, Job] = {}
    identities = engine.Identities()
    for overrides, config in hydra_bridge.combinations("evaluate", named, choices, config_dir, identities.meet):
        run = identities.of(config)
        if run not in listed:
            listed[run] = Job(number=len(listed), overrides=[*named, *overrides], run=run, config=config)
    jobs = list(listed.values())
    usual = Path("runs") / "sweep" / f"{name}_{engine.digest([identities.settings(job.config) for job in jobs])[:8]}"
    folder, launcher = engine.folder_and_launcher(hydras, usual)
    asked = [name, *arguments, *(["--config-dir", config_dir] if config_dir else [])]
    return Sweep(name=name, jobs=jobs, folder=folder, arguments=asked, launcher=launcher)


def sweep(planned: Sweep, *, fail_fast: bool) -> Outcome:
    """Do the jobs that are not done, then write the tables over all that are.

    Raises:
        ConfigError: Another process works on this sweep, or its folder cannot be written to.
    """
    results = [(planned.folder / job.run,) for job in planned.jobs]
    with engine.at_work(planned.folder, "sweep", None, planned.arguments, results) as study:
        outcome = engine.launch(
            study, planned.name, planned.jobs, planned.launcher, engine.evaluate_job, fail_fast=fail_fast
        )
        _write_tables(study, outcome.done, outcome.failures)
        study.failure = told(planned, outcome)
    return outcome


def told(planned: Sweep, outcome: Outcome) -> str:
    """What failed, in short; nothing if nothing did."""
    if not outcome.failures:
        return ""
    left = f", {outcome.left} left out" if outcome.left else ""
    return f"{len(outcome.failures)} of the sweep{left}; {planned.folder}/failed.csv has all. {outcome.failures[0][1]}"


def _write_tables(study: RunFolder, done: Sequence[Job], failures: Sequence[tuple[Job, str]]) -> None:
    """Write `sweep.csv`, `summary.csv` and `failed.csv`; the same jobs give the same bytes."""
    failed = [_place(job) | {"error": error} for job, error in failures]
    failed_columns = [*_columns([job for job, _ in failures]), "error"]
    study.write("failed.csv", _csv(pd.DataFrame(failed, columns=failed_columns)))
    rows = [_place(job) | row for job in done for row in _lifetimes(study.path / job.run)]
    whole = pd.DataFrame(rows, dtype=str) if rows else pd.DataFrame(columns=[*_columns([]), *COLUMNS])
    content = _csv(whole)
    formats.table(content, study.path / _SWEEP, formats.METRICS, rows=False)
    study.write(_SWEEP, content)
    _write_summary(study.write, whole, _columns(done)[2:])
    told = summary.rescue_and_harm(whole)
    if told is not None:
        tables, page, figure = told
        for name, table in tables.items():
            study.write(f"{name}.csv", _csv(table))
        study.write("report.md", page)
        study.write(f"figures/{rescue.FIGURE}", figure)


def write_summary_of_multirun(folder: Path, finished: Sequence[Path]) -> None:
    """Write what the runs of a multirun of `evaluate` came to, as of a sweep, into its folder."""
    told = enumerate(zip(finished, map(runs.read, finished), strict=True))
    jobs = [Job(number=n, overrides=run["overrides"], run=path.name, config={}) for n, (path, run) in told]
    rows = [_place(job) | row for job in jobs for row in _lifetimes(folder / job.run)]
    _write_summary(
        lambda name, content: runs.write_whole(folder / name, content),
        pd.DataFrame(rows, dtype=str),
        _columns(jobs)[2:],
    )


def _write_summary(write: Callable[[str, bytes], None], rows: pd.DataFrame, settings: list[str]) -> None:
    write(files.SUMMARY, _csv(summary.summary(rows, settings)))
    figure = summary.dose_response(rows, settings) if len(rows) else None
    if figure:
        write(files.DOSE_RESPONSE, figure)


def _lifetimes(run: Path) -> Iterator[dict[str, str]]:
    """The rows of the table of a run, whose numbers stay as they stand there."""
    yield from csv.DictReader(io.StringIO(runs.content(run, "metrics.csv").decode(), newline=""))


def _place(job: Job) -> dict[str, str]:
    """The first columns: which job, which run folder, and what was set for it."""
    settings = {key: value for key, value in job.settings.items() if key not in _IN_METRICS}
    named = {f"override.{key}" if key in COLUMNS else key: value for key, value in settings.items()}
    return {"job": str(job.number), "run": job.run, **named}


def _columns(jobs: Sequence[Job]) -> list[str]:
    return list(_place(jobs[0])) if jobs else ["job", "run"]


def _csv(frame: pd.DataFrame) -> bytes:
    return str(frame.to_csv(index=False, lineterminator="\n")).encode()
