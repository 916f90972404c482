"""The engine of everything that is made of many tasks: sweeps, leaderboards, reproductions, and the studies to come.

A study lives in a folder that is named by what is asked for, so that the same command finds it again and does only
what is missing. One process at a time works in it. Results are whole or not there: a file is renamed into its place,
and a run works in `unfinished/` until it is finished and is then renamed in one step. So a study may be killed at any
moment, and the next call ends with the same bytes as one that was never stopped.

`Job`s are evaluations and evolutions that are spread over processes or a cluster: open the folder with `at_work` and
hand them to `launch`. `Task`s run in this process, one after the other, and use threads themselves: `run_tasks` does
them in the order in which they need each other.
"""

import json
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from epuckhebb.config import overrides
from epuckhebb.config.compose import Plain
from epuckhebb.runs import hydra
from epuckhebb.runtime.errors import ConfigError, JobFailedError
from epuckhebb.runtime.progress import TaskProgress, counting
from epuckhebb.store import disk
from epuckhebb.store import run as runs
from epuckhebb.store.folder import UNFINISHED, RunFolder, discard, set_aside
from epuckhebb.store.records import JobAsked, ListOfJobs, record
from epuckhebb.studies.identity import NO_EFFECT

_LIST, _JOBS, _STOP = "sweep.json", "jobs", "stop"
AT_ONCE = 1000  # jobs that a launcher gets at a time: as many as SLURM takes in one array (its MaxArraySize is 1001)


@dataclass(frozen=True)
class Task:
    """Something that a study does in its own process.

    `do` writes the results with `keep` of the folder, so that one that is damaged later is made again; with `advanced`
    it may say how far it is.
    """

    name: str  # shown while it is done
    results: tuple[Path, ...]  # the files that it leaves; none if it is to be done in every call
    do: Callable[[RunFolder], None]
    size: float = 1.0  # how long it takes beside the others, in any unit, for the time that is told to be left


@dataclass(frozen=True, kw_only=True)
class Job:
    """An evaluation, or something else, that a study has done by whatever launcher Hydra has.

    Attributes:
        number: Its place, from 0.
        overrides: What would be typed to get it.
        run: The name of its run folder, which follows from all that its results depend on.
        config: Its configuration, as plain values.
    """

    number: int
    overrides: list[str]
    run: str
    config: Plain

    @property
    def settings(self) -> dict[str, str]:
        """What was set for this job and may matter, by key."""
        pairs = (override.lstrip("+").partition("=") for override in self.overrides)
        return {key: value for key, _, value in pairs if key not in ("experiment", *NO_EFFECT)}


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What a call did."""

    done: list[Job]  # of which there is a run now
    before: int  # how many of them there were before
    failures: list[tuple[Job, str]]  # the jobs that failed, and why
    left: int  # how many were left out because one failed

    def as_json(self) -> dict[str, Any]:
        """The same as JSON values."""
        failed = [{"run": job.run, "error": error} for job, error in self.failures]
        now = len(self.done) - self.before
        return {"done_before": self.before, "done_now": now, "failed": failed, "left_out": self.left}


def is_whole(result: Path) -> bool:
    """Whether a result is there: a file, or a run that is finished and whose tables are as they were then."""
    return result.is_file() or runs.is_whole(result)


@contextmanager
def at_work(
    folder: Path, command: str, cfg: DictConfig | None, arguments: list[str], results: Sequence[tuple[Path, ...]]
) -> Iterator[RunFolder]:
    """Work on a study in its folder, and say in its `status.json` how that ends.

    Args:
        folder: The folder; it is made if it is not there, and what killed calls left half done is thrown away.
        command: The command of the command line.
        cfg: The configuration, if there is one of the whole study.
        arguments: What followed the verb.
        results: What each of its jobs will leave; who interrupts it is told how many of them are done.

    Raises:
        ConfigError: Another process works on this study, or its folder cannot be written to.
        JobFailedError: The study began and could not be finished.
    """

    def left_behind() -> str:
        done = sum(all(map(is_whole, job)) for job in results)
        return f"{done} of {len(results)} jobs are done; the same command does the rest"

    stay = [result for job in results for result in job]
    with RunFolder.resume(folder, command, cfg, arguments, {}, stay) as study:
        study.left_behind = left_behind
        try:
            yield study
        except OSError as error:
            raise ConfigError(f"cannot write to {error.filename or folder}: {error.strerror}") from error


def run_tasks(folder: Path, command: str, cfg: DictConfig, arguments: list[str], tasks: Sequence[Task]) -> None:
    """Do in this process, in their order, the tasks of a study that are not done; see `at_work`."""
    results = [task.results for task in tasks if task.results]
    with at_work(folder, command, cfg, arguments, results) as study:
        missing = {}
        for number, task in enumerate(tasks):
            names = [result.relative_to(folder).as_posix() for result in task.results]
            if not names or not all(runs.is_as_written(folder, name) for name in names):
                missing[number] = task
        with TaskProgress([task.size if n in missing else 0.0 for n, task in enumerate(tasks)]) as progress:
            study.advanced = progress.within
            for number, task in missing.items():
                progress.show(number, task.name)
                task.do(study)


def todo(folder: Path, jobs: Sequence[Job]) -> list[Job]:
    """The jobs of which there is no whole run in the folder yet."""
    return [job for job in jobs if not runs.is_whole(folder / job.run)]


def for_hydra(command: str, arguments: Sequence[str]) -> list[str]:
    """Those of the arguments that are Hydra's own; they choose joblib for a launcher if they choose none.

    A sweeper, or an empty name for a folder, is refused.
    """
    hydras = [argument for argument in arguments if argument.lstrip("+~").startswith(("hydra.", "hydra/"))]
    for argument in hydras:
        if argument.startswith(("hydra/sweeper", "hydra.sweeper", "hydra.sweep.subdir")):
            raise ConfigError(
                f"{argument}: `{command}` lists its jobs itself; for another sweeper: evaluate --multirun"
            )
    overrides.check_folders(hydras)
    if not any(argument.startswith("hydra/launcher=") for argument in hydras):
        hydras.insert(0, "hydra/launcher=joblib")
    return hydras


def folder_and_launcher(hydras: Sequence[str], usual: Path) -> tuple[Path, list[str]]:
    """The folder of a study, the usual one unless Hydra's arguments name another, and those that are the launcher's."""
    named = [overrides.value_of(argument) for argument in hydras if argument.startswith(overrides.SWEEP_DIR)]
    launcher = [argument for argument in hydras if not argument.startswith(overrides.SWEEP_DIR)]
    return Path(named[-1]) if named else usual, launcher


def launch(
    study: RunFolder,
    name: str,
    jobs: Sequence[Job],
    launcher: list[str],
    do: Callable[[DictConfig], None],
    *,
    fail_fast: bool,
) -> Outcome:
    """Do the jobs that are not done, on any launcher of Hydra's.

    Args:
        study: The folder, from `at_work`.
        name: The name of the study, for the provenance of its runs.
        jobs: All jobs of the study.
        launcher: The overrides that choose and set up the launcher.
        do: A function of a module that calls `one_job`; `evaluate_job`, or that of another study.
        fail_fast: Whether to start no job after one has failed.
    """
    folder = study.path
    missing = todo(folder, jobs)
    for job in missing:
        if os.path.lexists(folder / job.run):  # a run gets there whole, so someone has been at it
            set_aside(folder / job.run, folder, "is not a finished run, or was changed since")
    attempts: dict[str, Path] = {}
    trouble = ""
    if missing:
        _write_jobs(study, {"name": name, "command_line": study.command_line, "fail_fast": fail_fast}, jobs, missing)
        with counting(len(missing), lambda: count(folder, missing, list(attempts.values()))):
            for first in range(0, len(missing), AT_ONCE):
                some, stamp = missing[first : first + AT_ONCE], hydra.new_stamp()
                attempts |= {job.run: folder / UNFINISHED / f"{stamp}_{place}" for place, job in enumerate(some)}
                try:
                    hydra.call_many("study", do, _arguments(folder, some, launcher, stamp), stamp)
                except (ConfigError, JobFailedError) as error:
                    trouble = str(error)
                if trouble and fail_fast:
                    break
    remaining = {job.run for job in todo(folder, jobs)}
    failures, left = [], 0
    for job in missing:
        begun = job.run in attempts and attempts[job.run].exists()
        if job.run in remaining and fail_fast and not begun:
            left += 1
        elif job.run in remaining:
            why = runs.status_of(attempts[job.run]).get("error") or trouble or "it ended unexpectedly"
            failures.append((job, str(why)))
    with suppress(OSError):
        (folder / UNFINISHED).rmdir()  # if nothing is left in it
    done = [job for job in jobs if job.run not in remaining]
    return Outcome(done=done, before=len(jobs) - len(missing), failures=failures, left=left)


def count(folder: Path, jobs: Sequence[Job], attempts: Sequence[Path]) -> tuple[int, int]:
    """How many of the jobs have their run folder, and how many of the attempts have failed."""
    done = len({job.run for job in jobs} & {path.name for path in folder.iterdir()})
    unfinished = folder / UNFINISHED
    there = {path.name for path in unfinished.iterdir()} if unfinished.is_dir() else set()
    return done, sum(runs.status_of(path).get("state") == "failed" for path in attempts if path.name in there)


def one_job(
    cfg: DictConfig, name_of: Callable[[Plain], str], work: Callable[[Path, JobAsked, dict[str, Any]], None]
) -> None:
    """Do one job of a study, in whatever process the launcher gives it.

    Args:
        cfg: What Hydra was told of the job: its name.
        name_of: The name of the run that a configuration leads to; it must still be that of the job.
        work: A function that does it. It gets a folder, which is renamed when it has come back; what was asked; and
            facts for `provenance.json`.
    """
    attempt = hydra.output_folder()
    folder, run = attempt.parents[1], str(cfg.job)
    stop = attempt.parent / _STOP
    if stop.exists():
        attempt.rmdir()
        return
    told = record(runs.content(folder, _LIST), folder / _LIST, ListOfJobs)
    try:
        work(attempt, job_asked(folder, run, name_of), {"command_line": told["command_line"], "sweep": told["name"]})
    except Exception:
        if told["fail_fast"]:
            stop.touch()
        raise
    try:
        attempt.rename(folder / run)
    except OSError:
        if not runs.is_whole(folder / run):  # else a worker of a call that was killed has just done the same
            raise
        discard(attempt, folder)


def job_asked(folder: Path, run: str, name_of: Callable[[Plain], str]) -> JobAsked:
    """What was asked of a job, which is refused if it would no longer lead to the run that it was listed as."""
    name = f"{_JOBS}/{run}.json"
    job = record(runs.content(folder, name), folder / name, JobAsked)
    try:
        now = name_of(job["config"])
    except ConfigError:
        raise
    except Exception as error:  # what damaged settings may raise has no end
        raise ConfigError(f"the settings of {run} cannot be used: {error}") from error
    if now != run:
        raise JobFailedError(f"{run}: the genome or the program has changed since the study began")
    return job


def _write_jobs(study: RunFolder, told: dict[str, Any], jobs: Sequence[Job], missing: Sequence[Job]) -> None:
    """Write what the jobs read: a file for each that is missing, and a list of them all."""
    for job in missing:  # the next call would write them anew, so they need not last; there may be ten thousand
        asked = json.dumps({"overrides": job.overrides, "config": job.config}).encode()
        disk.write_atomic(study.path / _JOBS / f"{job.run}.json", asked, lasting=False)
    study.write(_LIST, disk.as_json({"schema": disk.SCHEMA, **told, "jobs": [job.run for job in jobs]}))


def _arguments(folder: Path, missing: Sequence[Job], launcher: list[str], stamp: str) -> list[str]:
    return [
        f"job={','.join(job.run for job in missing)}",
        *launcher,
        f"hydra.sweep.dir={overrides.quoted(str(folder.absolute()))}",  # a worker may have been started elsewhere
        f'hydra.sweep.subdir="{UNFINISHED}/{stamp}_${{hydra.job.num}}"',
        "--multirun",
    ]
