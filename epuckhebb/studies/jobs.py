"""The engine of all studies: does jobs that are missing, on any launcher of Hydra's. It knows no command.

The folder of a study is named by its settings, so the same command finds it again and does only what is missing. One
process at a time works in it. Results are whole or absent: a file is renamed into its place. A run works in
`unfinished/` until it is finished, and is then renamed in one step. A study may be killed at any moment: the next call
ends bit-identical to one that was never stopped.
"""

import json
import os
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from epuckhebb.config import RUN_DIR, SWEEP_DIR, Plain, quoted
from epuckhebb.runs import hydra
from epuckhebb.runtime import ConfigError, JobFailedError, counting
from epuckhebb.store import SCHEMA, UNFINISHED, Run, RunFolder, as_json, is_locked, set_aside, write_atomic

NO_EFFECT = ("threads", "figures")  # keys on which no result depends
LIST, JOBS = "sweep.json", "jobs"
AT_ONCE = 1000  # jobs that a launcher gets at a time: as many as SLURM takes in one array (its MaxArraySize is 1001)


@dataclass(frozen=True, kw_only=True)
class Job:
    """A part of a study that any launcher of Hydra's can do.

    number: its place, from 0. overrides: the settings to type for it. run: the name of its run folder, which follows
    from all that its results depend on. config: what the study's `work` is given. purpose: what it is for.
    """

    number: int
    overrides: list[str]
    run: str
    config: Plain
    purpose: str = ""

    @property
    def settings(self) -> dict[str, str]:
        """The settings of this job on which results may depend, by key."""
        pairs = (override.lstrip("+").partition("=") for override in self.overrides)
        return {key: value for key, _, value in pairs if key not in ("experiment", *NO_EFFECT)}


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """What a call did.

    done: the jobs that have a run now. before: how many of them had one before. failures: the jobs that failed, and
    why.
    """

    done: list[Job]
    before: int
    failures: list[tuple[Job, str]]

    def as_json(self) -> dict[str, Any]:
        """The same as JSON values."""
        failed = [{"run": job.run, "error": error} for job, error in self.failures]
        return {"done_before": self.before, "done_now": len(self.done) - self.before, "failed": failed}


def todo(folder: Path, jobs: Sequence[Job]) -> list[Job]:
    """The jobs that have no whole run in the folder yet."""
    return [job for job in jobs if not Run(folder / job.run).is_whole]


def split(command: str, arguments: Sequence[str]) -> tuple[list[str], list[str]]:
    """The arguments of the study, and those of Hydra; a sweeper is refused."""
    hydras = [argument for argument in arguments if argument.lstrip("+~").startswith(("hydra.", "hydra/"))]
    for argument in hydras:
        if argument.lstrip("+~").startswith(("hydra/sweeper", "hydra.sweeper", "hydra.sweep.subdir", RUN_DIR)):
            raise ConfigError(f"{argument} does nothing here: `{command}` lists its jobs itself, in {SWEEP_DIR}FOLDER")
    return [argument for argument in arguments if argument not in hydras], hydras


def launch(study: RunFolder, name: str, jobs: Sequence[Job], launcher: list[str], do: Callable[[Any], None]) -> Outcome:
    """Do the jobs that are not done, on any launcher of Hydra's.

    study: its folder. name: of the study, which every job is given. launcher: the overrides that set it up. do: a
    function at the top of a module that does one of them.
    """
    folder = study.path
    missing = todo(folder, jobs)
    for job in missing:
        if os.path.lexists(folder / job.run):  # a run gets there whole, so it was changed since
            set_aside(folder / job.run, folder, "is not a finished run, or was changed since")
    facts = {"name": name, "command_line": study.command_line}
    study.write(LIST, as_json({"schema": SCHEMA, **facts, "jobs": [job.run for job in jobs]}))
    attempts: dict[str, Path] = {}
    trouble = ""
    if missing:
        for job in missing:  # the next call would write them anew, so they need not last; there may be ten thousand
            content = json.dumps({"overrides": job.overrides, "config": job.config}).encode()
            write_atomic(folder / JOBS / f"{job.run}.json", content, lasting=False)
        with counting(len(missing), lambda: count(folder, missing, list(attempts.values()))):
            for first in range(0, len(missing), AT_ONCE):
                some, stamp = missing[first : first + AT_ONCE], hydra.new_stamp()
                attempts |= {job.run: folder / UNFINISHED / f"{stamp}_{place}" for place, job in enumerate(some)}
                arguments = [
                    f"job={','.join(job.run for job in some)}",
                    *launcher,
                    f"{SWEEP_DIR}{quoted(str(folder.absolute()))}",  # a worker may have been started elsewhere
                    f'hydra.sweep.subdir="{UNFINISHED}/{stamp}_${{hydra.job.num}}"',
                    "--multirun",
                ]
                try:
                    hydra.call("study", do, arguments)
                except hydra.LauncherError as error:
                    trouble = f"; {error}"
                except (ConfigError, JobFailedError) as error:
                    if isinstance(error, ConfigError) and not any(path.exists() for path in attempts.values()):
                        raise  # nothing has begun
    remaining = {job.run for job in todo(folder, jobs)}
    failures = [(job, _reason(attempts[job.run], trouble)) for job in missing if job.run in remaining]
    with suppress(OSError):
        (folder / UNFINISHED).rmdir()  # unless something is left in it
    done = [job for job in jobs if job.run not in remaining]
    return Outcome(done=done, before=len(jobs) - len(missing), failures=failures)


def _reason(attempt: Path, trouble: str) -> str:
    """Why a job has no run. attempt: the folder in which it works. trouble: of the launcher, if it stopped."""
    status = Run(attempt).recorded_status
    if "error" in status:
        return str(status["error"])
    if status.get("state") == "running":
        return f"{'it may be at work' if trouble or is_locked(attempt) else 'it ended unexpectedly'}{trouble}"
    return f"it has not begun{trouble}"


def count(folder: Path, jobs: Sequence[Job], attempts: Sequence[Path]) -> tuple[int, int]:
    """How many of the jobs have their run folder, and how many of the attempts have failed."""
    done = len({job.run for job in jobs} & {path.name for path in folder.iterdir()})
    unfinished = folder / UNFINISHED
    there = {path.name for path in unfinished.iterdir()} if unfinished.is_dir() else set()
    return done, sum(Run(path).recorded_status.get("state") == "failed" for path in attempts if path.name in there)
