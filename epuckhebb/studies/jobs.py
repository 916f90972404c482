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
from epuckhebb.runs.jobs import Jobs, Task, names_of_overrides
from epuckhebb.runtime import ConfigError, conf
from epuckhebb.store import SCHEMA, UNFINISHED, Run, RunFolder, as_json, set_aside, write_atomic

LIST, JOBS = "sweep.json", "jobs"


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
        # As they were typed: Hydra's sweeper escapes colons.
        pairs = (override.replace("\\:", ":").lstrip("+").partition("=") for override in self.overrides)
        return {key: value for key, _, value in pairs if key not in ("experiment", *conf.NO_EFFECT)}


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
        """What the call did, as JSON values."""
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


def launch(
    study: RunFolder, name: str, jobs: Sequence[Job], launcher: list[str], do: Callable[[Any], None], batch: int
) -> Outcome:
    """Do the jobs that are not done, on any launcher of Hydra's.

    study: its folder. name: of the study, which every job is given. launcher: the overrides that set it up. do: a
    function at the top of a module that does one or several of them. batch: how many jobs one start does.
    """
    folder, stamp = study.path, hydra.new_stamp()
    missing = todo(folder, jobs)
    for job in missing:
        if os.path.lexists(folder / job.run):  # a run gets there whole, so it was changed since
            set_aside(folder / job.run, folder, "is not a finished run, or was changed since")
    facts = {"name": name, "command_line": study.command_line}
    study.write(LIST, as_json({"schema": SCHEMA, **facts, "jobs": [job.run for job in jobs]}))
    for job in missing:  # the next call would write them anew, so they need not last; there may be ten thousand
        content = json.dumps({"overrides": job.overrides, "config": job.config}).encode()
        write_atomic(folder / JOBS / f"{job.run}.json", content, lasting=False)

    def plan(listed: Sequence[Sequence[str]], _subdir: Callable[[int], str]) -> list[Task]:
        names = names_of_overrides([job.overrides for job in missing])
        return [
            Task(
                name=job.purpose or words or job.run,
                overrides=override,
                path=folder / UNFINISHED / f"{stamp}_{job.run}",
                result=folder / job.run,
            )
            for job, words, override in zip(missing, names, listed, strict=True)
        ]

    def join(tasks: Sequence[Task]) -> list[str]:
        return [f"job=[{','.join(task.result.name for task in tasks)}]"]

    tasks = Jobs(plan, batch=batch, join=join, says_counts=False)  # only what is missing
    if missing:
        sweep_dir = f"{SWEEP_DIR}{quoted(str(folder.absolute()))}"  # a worker may have been started elsewhere
        names = f"job={','.join(job.run for job in missing)}"
        hydra.call("study", do, [names, *launcher, sweep_dir, "--multirun"], jobs=tasks)
    reasons = {task.result.name: reason for task, reason in tasks.failures}
    with suppress(OSError):
        (folder / UNFINISHED).rmdir()  # unless something is left in it
    done = [job for job in jobs if job.run not in reasons]
    failures = [(job, reasons[job.run]) for job in missing if job.run in reasons]
    return Outcome(done=done, before=len(jobs) - len(missing), failures=failures)
