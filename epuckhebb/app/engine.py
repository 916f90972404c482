"""The engine of everything that is made of many tasks: sweeps, reproductions, and the studies to come.

A study lives in a folder that is named by what is asked for, so that the same command finds it again and does only
what is missing. One process at a time works in it; `status.json` says whether it is running, finished, failed or was
interrupted. A task is done when its result is there, because results are whole or not there: a file is renamed into
its place, and a run works in `unfinished/` until it is finished and is then renamed in one step. So a study may be
killed at any moment, and the next call ends with the same bytes as one that was never stopped.

To write the next study, list its tasks in the order in which they need each other, and give them to `carry_out`:

    evolutions = [Task(f"evolve {name}", (folder / "champions" / f"{name}.npz",), do=...) for name in names]
    evaluations = [Task(f"evaluate {name}", (folder / "lifetimes" / f"{name}.csv",), do=...) for name in names]
    tables = Task("tables", (), do=...)
    carry_out(folder, "leaderboard", cfg, arguments, [*evolutions, *evaluations, tables])

`do` is a function that gets the folder and writes the results with its `keep`, so that one that is damaged later is
made again; with `advanced` it may say how far it is. A task without results is done in every call: so tables and
reports are always those of all results. Such tasks run in this process, one after the other, and use threads
themselves. Evaluations that are better spread over processes or a cluster are `Job`s: open the folder with `at_work`
and hand them to `launch`, as `epuckhebb.app.sweep` does; jobs of other kinds, which may need each other's results, as
`epuckhebb.app.leaderboard` does.
"""

import hashlib
import json
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from omegaconf import DictConfig

from epuckhebb.app import files, hydra_bridge, runs
from epuckhebb.app.config import EvaluateConfig, as_config, check_counts, typed
from epuckhebb.app.errors import ConfigError, JobFailedError
from epuckhebb.app.evaluate import evaluate_into, fit, own_rules
from epuckhebb.app.formats import JobAsked, ListOfJobs, record
from epuckhebb.app.hydra_bridge import Plain
from epuckhebb.app.parts import sha256_of
from epuckhebb.app.progress import TaskProgress, counting
from epuckhebb.app.runs import UNFINISHED, RunFolder

NO_EFFECT = ("threads",)  # keys on which no result depends
_APART = ("seed", "repeats", "threads")  # keys that are checked by `check_counts` alone
_LIST, _JOBS, _STOP = "sweep.json", "jobs", "stop"
AT_ONCE = 1000  # jobs that a launcher gets at a time: as many as SLURM takes in one array (its MaxArraySize is 1001)


@dataclass(frozen=True)
class Task:
    """Something that a study does in its own process.

    Attributes:
        name: What is told while it is done.
        results: The files that it leaves; none if it is to be done in every call.
        do: A function that does it in the folder of the study.
        size: How long it takes beside the others, in any unit, for the time that is told to be left.
    """

    name: str
    results: tuple[Path, ...]
    do: Callable[[RunFolder], None]
    size: float = 1.0


@dataclass(frozen=True, kw_only=True)
class Job:
    """An evaluation, or something else, that a study has done by whatever launcher Hydra has.

    Attributes:
        number: Its place, from 0.
        overrides: What would be typed to get it.
        run: The name of its run folder, which follows from all that its results depend on; see `Identities`.
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
    """What a call came to.

    Attributes:
        done: The jobs of which there is a run now.
        before: How many of them there were before.
        failures: The jobs that failed, and why.
        left: How many were left out because one failed.
    """

    done: list[Job]
    before: int
    failures: list[tuple[Job, str]]
    left: int

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
    folder: Path, verb: str, cfg: DictConfig | None, arguments: list[str], results: Sequence[tuple[Path, ...]]
) -> Iterator[RunFolder]:
    """Work on a study in its folder, and say in its `status.json` how that ends.

    Args:
        folder: The folder; it is made if it is not there, and what killed calls left half done is thrown away.
        verb: The verb of the command line.
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
    with RunFolder.going_on(folder, verb, cfg, arguments, {}, stay) as study:
        study.left_behind = left_behind
        try:
            yield study
        except OSError as error:
            raise ConfigError(f"cannot write to {error.filename or folder}: {error.strerror}") from error


def carry_out(folder: Path, verb: str, cfg: DictConfig, arguments: list[str], tasks: Sequence[Task]) -> None:
    """Do in this process, in their order, the tasks of a study that are not done; see `at_work`."""
    results = [task.results for task in tasks if task.results]
    with at_work(folder, verb, cfg, arguments, results) as study:
        missing = {number: task for number, task in enumerate(tasks) if not _is_done(task, folder)}
        with TaskProgress([task.size if n in missing else 0.0 for n, task in enumerate(tasks)]) as progress:
            study.advanced = progress.within
            for number, task in missing.items():
                progress.show(number, task.name)
                task.do(study)


def _is_done(task: Task, folder: Path) -> bool:
    names = [result.relative_to(folder).as_posix() for result in task.results]
    return bool(names) and all(runs.is_as_written(folder, name) for name in names)


class Identities:
    """Names the runs that configurations lead to, and checks the configurations.

    What many of them share is looked at once: so thousands of jobs can be named in seconds.
    """

    def __init__(self) -> None:
        self._asked: dict[str, EvaluateConfig] = {}
        self._more: dict[tuple[str, str], Plain] = {}
        self._load_genome = cache(files.load_genome)
        self._texts: dict[int, tuple[Any, str]] = {}

    def of(self, config: Plain, cfg: DictConfig | None = None) -> str:
        """The name of the run that a configuration leads to with all that its results depend on at this moment.

        That is the genome, what it remembers if that is used, rules of the user, the science, and the packages that
        compute. `cfg` is the same configuration as Hydra has it, if that has been made already.

        Raises:
            ConfigError: A value or the genome cannot be used.
        """
        try:
            check_counts(**{key: config[key] for key in _APART})
        except ValueError as error:
            raise ConfigError(str(error)) from error
        shared = self.meet(config, cfg)
        if (shared, config["genome"]) not in self._more:
            self._more[shared, config["genome"]] = self._depends_on(config, self._asked[shared])
        return f"job_{digest([self.settings(config), self._more[shared, config['genome']]])[:12]}"

    def meet(self, config: Plain, cfg: DictConfig | None = None) -> str:
        """Check what many configurations share with this one, once; returns a digest of that.

        Raises:
            ConfigError: A value cannot be used.
        """
        shared = digest(self._texts_of(config, (*_APART, "genome")))
        if shared not in self._asked:
            self._asked[shared] = typed(cfg or as_config(config, "evaluate"), EvaluateConfig)
        return shared

    def settings(self, config: Plain) -> str:
        """A digest of a configuration, but for the keys on which no result depends."""
        return digest(self._texts_of(config, NO_EFFECT))

    def _texts_of(self, config: Plain, without: Sequence[str]) -> dict[str, str]:
        return {key: self._text(value) for key, value in config.items() if key not in without}

    def _text(self, value: Any) -> str:
        """A value as JSON; configurations that were put together have most of their values in common."""
        if not isinstance(value, dict | list):
            return json.dumps(value)
        if id(value) not in self._texts:
            self._texts[id(value)] = value, json.dumps(value, sort_keys=True)
        return self._texts[id(value)][1]

    def _depends_on(self, config: Plain, asked: EvaluateConfig) -> Plain:
        """On what else than its settings the results of a configuration depend."""
        genome = self._load_genome(config["genome"], asked.world.experiment, asked.layers)
        fit(genome, asked)
        over = [controller.adaptation for controller in asked.controllers]
        return {
            "genome": genome.sha256,
            "baseline": genome.baseline_sha256 if any(one.needs_baseline for one in over) else "",
            "self_memory": genome.self_memory_sha256 if any(one.self_check for one in over) else "",
            "rules": {str(file): sha256_of(file) for file in own_rules(config)},
            "science": runs.science_version(),
            "packages": runs.versions(runs.NUMERIC),
        }


def digest(content: object) -> str:
    """A name for any JSON values: the same content gets the same name."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def todo(folder: Path, jobs: Sequence[Job]) -> list[Job]:
    """The jobs of which there is no whole run in the folder yet."""
    return [job for job in jobs if not is_whole(folder / job.run)]


def for_hydra(verb: str, arguments: Sequence[str]) -> list[str]:
    """Those of the arguments that are Hydra's own; they choose joblib for a launcher if they choose none.

    Raises:
        ConfigError: They choose a sweeper, or an empty name for a folder.
    """
    hydras = [argument for argument in arguments if argument.lstrip("+~").startswith(("hydra.", "hydra/"))]
    for argument in hydras:
        if argument.startswith(("hydra/sweeper", "hydra.sweeper", "hydra.sweep.subdir")):
            raise ConfigError(f"{argument}: `{verb}` lists its jobs itself; for another sweeper: evaluate --multirun")
    hydra_bridge.check_folders(hydras)
    if not any(argument.startswith("hydra/launcher=") for argument in hydras):
        hydras.insert(0, "hydra/launcher=joblib")
    return hydras


def folder_and_launcher(hydras: Sequence[str], usual: Path) -> tuple[Path, list[str]]:
    """The folder of a study, the usual one unless Hydra's arguments name another, and those that are the launcher's."""
    named = [hydra_bridge.value_of(argument) for argument in hydras if argument.startswith(hydra_bridge.SWEEP_DIR)]
    launcher = [argument for argument in hydras if not argument.startswith(hydra_bridge.SWEEP_DIR)]
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
    for job in missing:  # a job's place with anything but a whole run in it: someone has been at it
        shutil.rmtree(folder / job.run, ignore_errors=True)
    attempts: dict[str, Path] = {}
    trouble = ""
    if missing:
        _write_jobs(study, {"name": name, "command": study.command, "fail_fast": fail_fast}, jobs, missing)
        with counting(len(missing), lambda: count(folder, missing, list(attempts.values()))):
            for first in range(0, len(missing), AT_ONCE):
                some, stamp = missing[first : first + AT_ONCE], hydra_bridge.new_stamp()
                attempts |= {job.run: folder / UNFINISHED / f"{stamp}_{place}" for place, job in enumerate(some)}
                try:
                    hydra_bridge.call_many("study", do, _arguments(folder, some, launcher, stamp), stamp)
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
            why = runs.status_of(attempts[job.run]).get("error") or trouble or "it ended without a word"
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


def one_job(cfg: DictConfig, work: Callable[[Path, str, JobAsked, dict[str, Any]], None]) -> None:
    """Do one job of a study, in whatever process the launcher gives it.

    Args:
        cfg: What Hydra was told of the job: its name.
        work: A function that does it. It gets a folder, which is renamed when it has come back; the name of the run,
            which must still be what the job leads to; what was asked; and facts for `provenance.json`.
    """
    attempt = hydra_bridge.output_folder()
    folder, run = attempt.parents[1], str(cfg.job)
    stop = attempt.parent / _STOP
    if stop.exists():
        attempt.rmdir()
        return
    told = record(runs.content(folder, _LIST), folder / _LIST, ListOfJobs)
    name = f"{_JOBS}/{run}.json"
    job = record(runs.content(folder, name), folder / name, JobAsked)
    try:
        work(attempt, run, job, {"command": told["command"], "sweep": told["name"]})
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


def evaluate_job(cfg: DictConfig) -> None:
    """Do one evaluation of a study."""
    one_job(cfg, _evaluate)


def _evaluate(path: Path, run: str, job: JobAsked, facts: dict[str, Any]) -> None:
    config = check_unchanged(job["config"], run)
    evaluate_into(path, config, job["overrides"], facts, threads=hydra_bridge.threads_of_job(config.threads))


def check_unchanged(config: Plain, run: str) -> DictConfig:
    """The configuration of a job, which is refused if it would no longer lead to the run that it was listed as.

    Raises:
        ConfigError: Its configuration cannot be used.
        JobFailedError: It would lead to another.
    """
    try:
        cfg = as_config(config, "evaluate")
        now = Identities().of(config, cfg)
    except ConfigError:
        raise
    except Exception as error:  # what damaged settings may raise has no end
        raise ConfigError(f"the settings of {run} cannot be used: {error}") from error
    check_same(now, run)
    return cfg


def check_same(now: str, run: str) -> None:
    """Refuse a job that would lead to another run.

    Raises:
        JobFailedError: It would.
    """
    if now != run:
        raise JobFailedError(f"{run}: the genome or the program has changed since the study began")


def _write_jobs(study: RunFolder, told: dict[str, Any], jobs: Sequence[Job], missing: Sequence[Job]) -> None:
    """Write what the jobs read: a file for each that is missing, and a list of them all."""
    for job in missing:  # the next call would write them anew, so they need not last; there may be ten thousand
        asked = json.dumps({"overrides": job.overrides, "config": job.config}).encode()
        runs.write_whole(study.path / _JOBS / f"{job.run}.json", asked, lasting=False)
    study.write(_LIST, runs.as_json({"schema": runs.SCHEMA, **told, "jobs": [job.run for job in jobs]}))


def _arguments(folder: Path, missing: Sequence[Job], launcher: list[str], stamp: str) -> list[str]:
    return [
        f"job={','.join(job.run for job in missing)}",
        *launcher,
        f"hydra.sweep.dir={hydra_bridge.quoted(str(folder.absolute()))}",  # a worker may have been started elsewhere
        f'hydra.sweep.subdir="{UNFINISHED}/{stamp}_${{hydra.job.num}}"',
        "--multirun",
    ]
