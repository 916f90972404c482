"""Do the jobs of a sweep that are not done, on any launcher, so that nothing half done can be taken for a result.

A job works in `unfinished/`; when its run is whole it is renamed to its place in one step. What a killed or failed job
left in `unfinished/` is thrown away by the next call.
"""

import json
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig, OmegaConf

from epuckhebb.app import hydra_bridge, jobs, locks, runs, sweep_tables
from epuckhebb.app.errors import ConfigError, JobFailedError
from epuckhebb.app.sweep import Job, Sweep, identity
from epuckhebb.app.sweep_progress import JobsProgress

_LIST, _CONFIGS, _UNFINISHED, _STOP = "sweep.json", "jobs", "unfinished", "stop"


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What a call came to: jobs done before it, done by it, failed, and left out because one failed."""

    before: int
    now: int
    failures: list[sweep_tables.Failure]
    left: int

    def as_json(self) -> dict[str, Any]:
        """The same as JSON values."""
        failed = [{"run": failure.job.run, "error": failure.error} for failure in self.failures]
        return {"done_before": self.before, "done_now": self.now, "failed": failed, "left_out": self.left}

    def told(self, folder: Path) -> str:
        """What failed, in short."""
        left = f", {self.left} left out" if self.left else ""
        return f"{len(self.failures)} of the sweep{left}; {folder}/failed.csv has all. {self.failures[0].error}"


def launch(sweep: Sweep, *, fail_fast: bool, quiet: bool) -> Outcome:
    """Do the jobs that are not done, then write the tables over all that are.

    Raises:
        ConfigError: another process works on this sweep, or its folder cannot be written to.
    """
    with _owned(sweep.folder):
        _throw_away(sweep.folder)
        todo = sweep.todo()
        for job in todo:  # a job's place with anything but a whole run in it: someone has been at it
            shutil.rmtree(sweep.folder / job.run, ignore_errors=True)
        stamp, trouble = hydra_bridge.new_stamp(), ""
        if todo:
            _write_configs(sweep, fail_fast)
            watched = JobsProgress(sweep.folder, {job.run for job in todo}, f"{_UNFINISHED}/{stamp}_*", quiet=quiet)
            try:
                with watched:
                    hydra_bridge.run("evaluate", sweep_job, _arguments(sweep, todo, stamp))
            except (ConfigError, JobFailedError) as error:
                trouble = str(error)
            except KeyboardInterrupt:
                done = len(sweep.jobs) - len(sweep.todo())
                raise KeyboardInterrupt(
                    f"{done} of {len(sweep.jobs)} jobs are done; the same command does the rest"
                ) from None
        remaining = {job.run for job in sweep.todo()}
        failures, left = [], 0
        for place, job in enumerate(todo):
            attempt = sweep.folder / _UNFINISHED / f"{stamp}_{place}"
            if job.run in remaining and fail_fast and not attempt.exists():
                left += 1
            elif job.run in remaining:
                failures.append(sweep_tables.Failure(job, _error(attempt) or trouble or "it ended without a word"))
        sweep_tables.write(sweep.folder, [job for job in sweep.jobs if job.run not in remaining], failures)
        with suppress(OSError):
            (sweep.folder / _UNFINISHED).rmdir()  # if nothing is left in it
    return Outcome(before=len(sweep.jobs) - len(todo), now=len(todo) - len(remaining), failures=failures, left=left)


def sweep_job(cfg: DictConfig) -> None:
    """One job of a sweep, in whatever process the launcher gives it."""
    attempt = Path(HydraConfig.get().runtime.output_dir)
    folder, run = attempt.parents[1], HydraConfig.get().overrides.task[0].partition("=")[2]
    stop = attempt.parent / _STOP
    if stop.exists():
        attempt.rmdir()
        return
    told = json.loads((folder / _LIST).read_text())
    facts = {"command": told["command"], "sweep": told["name"]}
    try:
        _check_unchanged(cfg, run)
        jobs.evaluate_into(
            attempt, cfg, told["jobs"][run]["overrides"], facts, threads=jobs.threads_of_job(cfg.threads)
        )
    except Exception:
        if told["fail_fast"]:
            stop.touch()
        raise
    try:
        attempt.rename(folder / run)
    except OSError:
        if not (folder / run).is_dir():  # else a worker of a call that was killed has just done the same
            raise
        shutil.rmtree(attempt)


def _check_unchanged(cfg: DictConfig, run: str) -> None:
    if identity(cfg) != run:
        raise JobFailedError(f"{run}: the genome or the program has changed since the sweep began")


@contextmanager
def _owned(folder: Path) -> Iterator[None]:
    """Make the folder of a sweep, and keep other calls out of it."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        held = locks.hold(folder)
    except BlockingIOError:
        raise ConfigError(f"another process is working on {folder}; wait for it or stop it") from None
    except OSError as error:
        raise ConfigError(f"cannot write a sweep to {folder}: {error.strerror}") from error
    try:
        yield
    except OSError as error:
        raise ConfigError(f"cannot write to {error.filename or folder}: {error.strerror}") from error
    finally:
        locks.release(held)


def _throw_away(folder: Path) -> None:
    """Remove what a call left that was killed, and its jobs, but for those that are still at work."""
    for half in [*folder.glob(".*.tmp"), *(folder / _CONFIGS).rglob(".*.tmp")]:
        half.unlink()
    for attempt in (folder / _UNFINISHED).glob("*"):
        if not attempt.is_dir():
            attempt.unlink()
        elif not locks.is_held(attempt):
            shutil.rmtree(attempt)


def _write_configs(sweep: Sweep, fail_fast: bool) -> None:
    """What the jobs read: one configuration each, which Hydra composes by its name, and the list of them all."""
    for job in sweep.jobs:
        text = f"# @package _global_\n{OmegaConf.to_yaml(job.cfg, resolve=True)}"
        runs.write_whole(sweep.folder / _CONFIGS / "job" / f"{job.run}.yaml", text.encode())
    listed = {job.run: {"number": job.number, "overrides": job.overrides} for job in sweep.jobs}
    told = {"schema": runs.SCHEMA, "name": sweep.name, "command": sweep.command, "fail_fast": fail_fast, "jobs": listed}
    runs.write_whole(sweep.folder / _LIST, runs.as_json(told))


def _arguments(sweep: Sweep, todo: list[Job], stamp: str) -> list[str]:
    return [
        f"+job={','.join(job.run for job in todo)}",
        *sweep.launching,
        f'hydra.sweep.dir="{sweep.folder.absolute()}"',  # a worker may have been started elsewhere
        f'hydra.sweep.subdir="{_UNFINISHED}/{stamp}_${{hydra.job.num}}"',
        "--config-dir",
        str((sweep.folder / _CONFIGS).absolute()),
        "--multirun",
    ]


def _error(attempt: Path) -> str:
    try:
        return str(json.loads((attempt / "status.json").read_text()).get("error", ""))
    except (OSError, ValueError):
        return ""
