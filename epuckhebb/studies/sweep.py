"""`epuckhebb sweep NAME`: plans the jobs that `conf/experiment/NAME.yaml` describes, and writes tables over all.

A job is named by a digest of its resolved configuration, its genome and the version of the science. A whole run in the
folder of that name is its result. The folder of a sweep is named by its jobs, so the same command finds it again.
"""

import csv
import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from epuckhebb.analysis import rescue, summary
from epuckhebb.analysis.lifetimes import Evaluated, Gathered, gather, repeated
from epuckhebb.config import EvaluateConfig, Plain, alternatives, check_words, combinations, from_values, swept_values
from epuckhebb.runs import evaluate_into, hydra
from epuckhebb.runtime import ConfigError, say
from epuckhebb.store import Run, RunFolder, as_bytes, digest, write_atomic
from epuckhebb.studies import identity
from epuckhebb.studies.jobs import Job, Outcome, folder_and_launcher, launch, one_job, open_study, split

_JOB_S, _STEP_S = 0.3, 1e-6  # CPU time of a job besides its lifetimes, and of a step of a robot: docs/scale.md
_STEP_IN_3D_S = 21e-6  # docs/ode.md


def evaluate_job(cfg: Any) -> None:
    """Do one evaluation of a study."""
    one_job(cfg, identity.Identities().of, _evaluate)


def _evaluate(path: Path, job: Plain, facts: dict[str, Any]) -> None:
    config = from_values(job["config"], EvaluateConfig, f"job {path}")
    evaluate_into(path, config, job["overrides"], facts, threads=hydra.threads_of_job(config.threads))


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """A named sweep: its jobs, its folder, the arguments of its command, and those for Hydra's launcher.

    cpu_s: about how long each run takes on one core [s].
    """

    name: str
    jobs: list[Job]
    cpu_s: dict[str, float]
    folder: Path
    arguments: list[str]
    launcher: list[str]


def plan(name: str, arguments: list[str], config_dir: str | None = None) -> Sweep:
    """List the jobs of a sweep, each composed and checked; two that would do the same are one."""
    own, of_hydra = split("sweep", arguments)
    check_words("evaluate", arguments, several=True)
    named = [f"experiment={name}"]
    no_launcher = [word for word in of_hydra if not word.startswith("hydra.launcher.")]  # it is chosen for the jobs
    params = swept_values([*named, *no_launcher], config_dir)
    if not params:
        raise ConfigError(f"experiment={name} has no hydra.sweeper.params: it is one job, for `epuckhebb evaluate`")
    swept = [f"{key}={values}" for key, values in params.items()]
    choices = alternatives([*swept, *own])
    listed: dict[str, Job] = {}
    again: list[Job] = []
    identities, cpu_s = identity.Identities(), dict[str, float]()
    for overrides, config in combinations("evaluate", named, choices, config_dir, identities.validate_shared):
        run = identities.of(config)
        steps, in_plane = identities.robot_steps(config)
        cpu_s[run] = _JOB_S + (_STEP_S if in_plane else _STEP_IN_3D_S) * steps
        job = Job(number=len(listed), overrides=[*named, *overrides], run=run, config=config)
        if listed.setdefault(run, job) is not job:
            again.append(job)
    jobs = list(listed.values())
    if again:
        say(repeated(len(again), again[0].settings, listed[again[0].run].settings))
    settings = digest([digest(identity.settings(job.config)) for job in jobs])
    usual = Path("runs") / "sweep" / f"{name}_{settings[:8]}"
    folder, launcher = folder_and_launcher(of_hydra, usual, len(jobs))
    words_typed = [name, *arguments, *(["--config-dir", config_dir] if config_dir else [])]
    return Sweep(name=name, jobs=jobs, cpu_s=cpu_s, folder=folder, arguments=words_typed, launcher=launcher)


def sweep(planned: Sweep, *, fail_fast: bool) -> Outcome:
    """Do the jobs that are not done, then write the tables over all that are."""
    with open_study(planned.folder, "sweep", None, planned.arguments, planned.jobs) as study:
        outcome = launch(study, planned.name, planned.jobs, planned.launcher, evaluate_job, fail_fast=fail_fast)
        _write_tables(study, outcome.done, outcome.failures)
        study.remove_stale()  # an earlier sweep of other jobs may have used the folder
        study.failure = failure_of(planned, outcome)
    return outcome


def failure_of(planned: Sweep, outcome: Outcome) -> str:
    """What failed, in short; "" if nothing did."""
    if not outcome.failures:
        return ""
    left = f", {outcome.left} left out" if outcome.left else ""
    return f"{len(outcome.failures)} of the sweep{left}; {planned.folder}/failed.csv has all. {outcome.failures[0][1]}"


def _write_tables(study: RunFolder, done: Sequence[Job], failures: Sequence[tuple[Job, str]]) -> None:
    """Write `sweep.csv`, `summary.csv` and `failed.csv`; the same jobs give bit-identical files."""
    failed = [{**_place(job), **job.settings, "error": error} for job, error in failures]
    failed_columns = list(failed[0]) if failed else ["job", "run", "error"]
    study.write("failed.csv", pd.DataFrame(failed, columns=failed_columns))
    gathered = gather([_evaluated(study.path / job.run, job.settings, _place(job)) for job in done])
    study.write("sweep.csv", gathered.rows)
    _write_over_all(study.write, gathered)


def write_summary_of_multirun(folder: Path, finished: Sequence[Path]) -> None:
    """Write the tables over all runs of a multirun of `evaluate`, as of a sweep, into its folder."""
    jobs = [
        Job(number=number, overrides=Run(path).provenance["overrides"], run=path.name, config={})
        for number, path in enumerate(finished)
    ]
    gathered = gather([_evaluated(folder / job.run, job.settings, {}) for job in jobs])
    _write_over_all(lambda name, content: write_atomic(folder / name, as_bytes(content)), gathered)


def _write_over_all(write: Callable[[str, bytes | str | pd.DataFrame], None], gathered: Gathered) -> None:
    """Write the tables, the page and the figures over all lifetimes, and say what else a reader must know."""
    rows, settings = gathered.rows, gathered.settings
    write("summary.csv", summary.summary(rows, settings))
    if gathered.repeated:
        say(gathered.repeated)
    if rows.empty:
        return
    if summary.has_champions(rows):
        write("over_champions.csv", summary.over_champions(rows, settings))
    doses = summary.dose_response(rows, settings)
    if doses:
        write("figures/dose_response.png", _image(doses))
    found = summary.rescue_and_harm(rows)
    if found is not None:
        tables, page, figure = found
        for name, table in tables.items():
            write(f"{name}.csv", table)
        write("report.md", page)
        write(f"figures/{rescue.FIGURE}", _image(figure))
    elif missing := summary.no_rescue(rows, settings):
        say(missing)


def _image(figure: Any) -> bytes:
    from epuckhebb.analysis.image import image  # matplotlib takes a while to load

    return image(figure)


def _evaluated(path: Path, settings: Mapping[str, str], place: Mapping[str, str]) -> Evaluated:
    """A run and its lifetimes, whose numbers stay as text."""
    run = Run(path)
    facts = run.provenance
    rows = csv.DictReader(io.StringIO(run.content("metrics.csv").decode(), newline=""))
    return Evaluated(
        settings=settings,
        where=settings.get("genome", facts["genome"]),
        sha256=facts["genome_sha256"],
        ids=facts["lifetimes"],
        rows=pd.DataFrame(list(rows), dtype=str),
        place=place,
    )


def _place(job: Job) -> dict[str, str]:
    """The first columns: which job, and which run folder."""
    return {"job": str(job.number), "run": job.run}
