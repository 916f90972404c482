"""Runs jobs on what Hydra composes: one in this process, many with the launchers and sweepers of Hydra."""

import functools
import itertools
import os
import platform
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures.process import BrokenProcessPool
from contextlib import chdir, contextmanager, nullcontext, suppress
from datetime import datetime
from pathlib import Path
from secrets import token_hex
from typing import Any, NamedTuple

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.core.plugins import Plugins
from hydra.errors import HydraException
from hydra.plugins.launcher import Launcher
from hydra.plugins.sweeper import Sweeper
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf, open_dict
from omegaconf.errors import OmegaConfBaseException

from epuckhebb.config import (
    RUN_DIR,
    SCHEMAS,
    SWEEP_DIR,
    alternatives,
    configurations,
    explain,
    make_config,
    override_value,
    quoted,
    settings,
    swept_values,
    typed,
    world_name,
)
from epuckhebb.config.catalogue import SEARCH_PATH, USERS, VERSION_BASE, catalogue, group_choices
from epuckhebb.config.compose import composed_with_hydra
from epuckhebb.config.resolve import resolve
from epuckhebb.config.source import search_folders
from epuckhebb.runs import slurm
from epuckhebb.runs.jobs import Jobs, LauncherError, Task, batches, names_of_overrides
from epuckhebb.runtime import (
    ConfigError,
    JobFailedError,
    begin_worker,
    data_folder,
    is_interruption,
    is_of_handler,
    leaving,
    reason_of_failure,
    refusing,
    thread_count,
)
from epuckhebb.store import (
    MULTIRUN,
    PROVENANCE,
    Run,
    check_multirun_folder,
    compare_machines,
    locked,
    write_atomic,
)

_CHECKED_IN_FULL = 20  # a longer list of values is checked at its two ends
# Submitit ends a job by a signal before SLURM would, unless the job may begin again.
_LIMIT = "its time ended (hydra.launcher.timeout_min; max_num_timeout=N begins it again N times)"
_FULL_ERROR = "HYDRA_FULL_ERROR"  # environment variable


Report = Callable[[Path], None]  # is called with the folder of a run when its tables are there, before its figures


def unreported(_path: Path) -> None:
    """Report nothing."""


class Job(NamedTuple):
    """A job: its folder, configuration and overrides, and the command line that does it alone.

    threads: how many it may use. in_multirun: whether it is one of many. report: is called with its folder when its
    tables are there, before its figures are drawn.
    """

    path: Path
    config: Any
    overrides: list[str]
    facts: dict[str, Any]
    threads: int
    in_multirun: bool
    report: Report = unreported


def output_folder() -> Path:
    """The folder that Hydra has made for the job at work."""
    return Path(_unresolved(HydraConfig.get().runtime)["output_dir"])


def _unresolved(node: Any) -> Any:
    """What Hydra notes, to the letter: a `${...}` in a folder's name refers to nothing."""
    return OmegaConf.to_container(node, resolve=False)


def check(
    command: str, overrides: list[str], config_dir: str | None, prepare: Callable[[Any], Any], *, multirun: bool
) -> None:
    """Refuse, before anything runs, a named sweep, and a multirun with a job that would be refused.

    Every value of every swept key is tried once, with the first values of the others: a sum, not a product.

    prepare: a function that raises `ConfigError` if a checked configuration cannot be run.
    """
    named = [override for override in overrides if override.startswith("experiment=")]
    for word in itertools.chain(*alternatives(named[-1:]).values()):
        if swept_values([word], config_dir):
            raise ConfigError(f"{word} has many jobs: run `epuckhebb sweep {word.partition('=')[2]}`")
    if not multirun:
        return
    choices = list(alternatives(overrides).values())
    first = tuple(values[0] for values in choices)
    jobs = [first]
    for place, values in enumerate(choices):
        tried = values[1:] if len(values) <= _CHECKED_IN_FULL else values[-1:]
        jobs += [(*first[:place], value, *first[place + 1 :]) for value in tried]
    wrong: dict[str, None] = {}
    for _, config in configurations(command, [], jobs, config_dir):
        with chdir(Path.cwd()):  # a part of the user's may go elsewhere
            try:
                prepare(make_config(config, SCHEMAS[command], command))
            except ConfigError as error:
                wrong[str(error)] = None
    if wrong:
        raise ConfigError("\n".join(wrong))


def run(
    command: str,
    job: Callable[[Job], None],
    arguments: list[str],
    config_dir: str | None = None,
    report: Report = unreported,
) -> Path | None:
    """Run a job on the configuration that overrides and Hydra's own options describe; returns the folder of its run.

    None where these options only show something.

    command, arguments: as of `hydra_arguments`. config_dir: a
    folder with more configuration files. report: of a `Job` that is run alone.
    """
    if not any(argument.startswith("-") for argument in arguments):
        return _run_one(command, job, arguments, config_dir, report)
    call(command, functools.partial(_job_of_hydra, command, job), arguments, config_dir)
    return None


def run_many(
    command: str,
    job: Callable[[Job], None],
    arguments: list[str],
    config_dir: str | None,
    check_same: Callable[[Path, Any], None],
) -> tuple[Path, Jobs]:
    """Run the jobs of a multirun that are not done in its folder; returns the folder, and how the jobs are.

    command, arguments, config_dir: as of `run`. check_same: refuses a folder that holds a run with other settings.
    """
    if useless := [argument for argument in arguments if argument.startswith(RUN_DIR)]:
        raise ConfigError(f"{useless[-1]} does nothing in a multirun; give {SWEEP_DIR}FOLDER")
    named = [argument for argument in arguments if argument.startswith(SWEEP_DIR)]
    verb, _, _ = command.partition("_")
    folder = Path(override_value(named[-1])) if named else Path("runs") / verb / f"{new_stamp()}_multirun"
    check_multirun_folder(folder)
    words = [f"{SWEEP_DIR}{quoted(str(folder.absolute()))}", *(word for word in arguments if word not in named)]

    def plan(listed: Sequence[Sequence[str]], subdir: Callable[[int], str]) -> list[Task]:
        paths = [folder.absolute() / subdir(place) for place in range(len(listed))]
        if len(set(paths)) < len(paths):
            raise ConfigError("hydra.sweep.subdir must give each job a folder of its own, as with ${hydra.job.num}")
        begun = {path: tuple(own) for path, own in zip(paths, listed, strict=True) if Run(path).has(PROVENANCE)}
        composed = configurations(command, [], begun.values(), config_dir)
        for path, (_, values) in zip(begun, composed, strict=True):
            with chdir(Path.cwd()):
                check_same(path, make_config(values, SCHEMAS[command], command))
        for path in list(begun)[:1]:
            compare_machines(path, Run(path).provenance)
        named = zip(names_of_overrides(listed), listed, paths, strict=True)
        return [Task(name=name, overrides=own, path=path, result=path) for name, own, path in named]

    jobs = Jobs(plan)
    again = f"epuckhebb evolve resume={folder}" if verb == "evolve" else f"the same command with {SWEEP_DIR}{folder}"
    try:
        with locked(folder), leaving(f"{again} does the rest"):  # else the file below may be of a call at work
            before = (folder / MULTIRUN).read_bytes() if (folder / MULTIRUN).is_file() else None
            try:
                call(command, functools.partial(_job_of_hydra, command, job), [*words, "--multirun"], config_dir, jobs)
            except ConfigError:
                if before is None:
                    (folder / MULTIRUN).unlink(missing_ok=True)
                else:
                    write_atomic(folder / MULTIRUN, before)
                raise
    except ConfigError:
        _remove_empty(folder)
        raise
    return folder, jobs


def _remove_empty(path: Path) -> None:
    """Remove a folder, and those above it that are left empty, below the working folder."""
    with suppress(OSError):  # something is in it
        for folder in (path.absolute(), *path.absolute().parents):
            if Path.cwd() not in folder.parents:
                break
            folder.rmdir()


class Call(NamedTuple):
    """What a multirun was called with: its overrides, and the user's folder of configurations."""

    words: list[str]
    config_dir: str | None


def call_of_multirun(folder: Path, changes: Sequence[str]) -> Call:
    """The call that made the folder of a multirun of evolutions. changes: overrides that replace some of its own."""
    values = settings(folder / MULTIRUN)["hydra"]
    if not str(values["job"]["config_name"]).startswith("evolve"):
        again = f"the same command with {SWEEP_DIR}{folder} resumes it"
        raise ConfigError(f"resume={folder} is a multirun of `epuckhebb evaluate`; {again}")
    sources = values["runtime"]["config_sources"]
    config_dir = next((source["path"] for source in sources if source["provider"] == USERS and source["path"]), None)
    its = (*values["overrides"]["task"], *values["overrides"]["hydra"])
    changed = {"hydra.mode", SWEEP_DIR.rstrip("="), *(word.partition("=")[0] for word in changes)}
    kept = [word for word in its if word.partition("=")[0] not in changed]
    return Call([*kept, *changes, f"{SWEEP_DIR}{quoted(str(folder))}"], config_dir)


def _run_one(
    command: str, job: Callable[[Job], None], overrides: list[str], config_dir: str | None, report: Report
) -> Path:
    """Run one job in this process; its folder is named when its configuration is complete."""
    for override in overrides:
        is_hydras = override.lstrip("+~").startswith(("hydra.", "hydra/"))
        if is_hydras and not override.startswith((RUN_DIR, SEARCH_PATH)):
            raise ConfigError(f"{override} does nothing in one run; give {RUN_DIR}FOLDER, or -m for many runs")
    cfg, hydras, _ = composed_with_hydra(command, overrides, config_dir)
    config = typed(cfg, SCHEMAS[command])
    cfg.hydra = hydras
    with refusing(explain, OmegaConfBaseException):
        path = Path(cfg.hydra.run.dir)
    del cfg.hydra
    own = [word for word in overrides if not word.lstrip("+~").startswith(("hydra.", "hydra/"))]
    facts, threads = _facts(command, own, config_dir), thread_count(config.threads)
    with chdir(Path.cwd()):
        job(Job(path.absolute(), config, own, facts, threads, in_multirun=False, report=report))
    return path


def _facts(command: str, overrides: list[str], config_dir: str | None) -> dict[str, Any]:
    """What `provenance.json` has of a job: the command line that does it alone."""
    words = ["epuckhebb", command.partition("_")[0], *overrides]
    if config_dir is not None:
        folder = Path(config_dir).absolute()
        words += ["--config-dir", str(folder.relative_to(Path.cwd()) if folder.is_relative_to(Path.cwd()) else folder)]
    return {"command_line": words}


def _job_of_hydra(command: str, job: Callable[[Job], None], cfg: DictConfig) -> None:
    """Run a job of Hydra's, in the process that a launcher gives it; if it is refused, its empty folder is removed."""
    path, runtime = output_folder(), HydraConfig.get().runtime
    overrides, sources = _unresolved(HydraConfig.get().overrides.task), _unresolved(runtime)["config_sources"]
    folder = next((source["path"] for source in sources if source["provider"] == USERS and source["path"]), None)
    try:
        resolve(command, cfg, group_choices(runtime), overrides, search_folders(runtime))
        config: Any = typed(cfg, SCHEMAS[command])
        facts, is_many = _facts(command, overrides, folder), HydraConfig.get().mode == RunMode.MULTIRUN
        job(Job(path, config, overrides, facts, threads_of_job(config.threads), is_many))
    except ConfigError:
        _remove_empty(path)
        raise


def _do(task: Callable[[Any], None], errors: list[Exception], parent: int, folder: Path, cfg: Any) -> Exception | None:
    """Do a job in the folder of the call, to which its files are relative; a worker may have begun in another one.

    Its error is returned, and put into a list, which is the caller's in its process: Hydra would print a line about it.
    """
    try:
        if os.getpid() != parent:
            with refusing(lambda _: f"{folder}, where this was called, is not on {platform.node()}", OSError):
                os.chdir(folder)
        with chdir(Path.cwd()):
            task(cfg)
    except (ConfigError, JobFailedError) as error:
        failure: Exception = error
    except Exception as error:
        if is_interruption(error):
            raise KeyboardInterrupt from error
        failure = JobFailedError(_LIMIT if is_of_handler(error) else reason_of_failure(error))
    else:
        return None
    errors.append(failure)
    return failure


def call(
    command: str,
    task: Callable[[Any], None],
    arguments: list[str],
    config_dir: str | None = None,
    jobs: Jobs | None = None,
) -> None:
    """Call Hydra as its own command line would; see `run`.

    task: is given each configuration that Hydra composed. jobs: those of a multirun, which says which are launched.
    """
    errors: list[Exception] = []
    entry = hydra.main(config_path=str(data_folder("conf")), config_name=command, version_base=VERSION_BASE)(
        functools.partial(_do, task, errors, os.getpid(), Path.cwd())
    )
    many = nullcontext() if jobs is None else _launching(jobs, command)
    with catalogue(command, config_dir), _set_command_line(command, arguments), many:
        try:
            entry()
        except (HydraException, OmegaConfBaseException) as error:
            raise ConfigError(explain(error)) from error
    if errors and jobs is None:
        raise errors[0]


class _Chosen(Launcher):
    """Gives a launcher those of the jobs that a sweeper lists that are to do."""

    def __init__(self, launcher: Any, jobs: Jobs, hydra_context: Any, config: Any) -> None:
        self._launcher, self._jobs, self._loader, self._config = launcher, jobs, hydra_context.config_loader, config

    def setup(self, **_: Any) -> None:
        """Nothing: the launcher is ready."""

    def launch(self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int) -> Sequence[Any]:
        """Launch the jobs that are to do. No sweeper here asks for what they return."""
        self._jobs.launch(
            self._do, job_overrides, lambda place: self._subdir(job_overrides[place], initial_job_idx + place)
        )
        return []

    def _subdir(self, overrides: Sequence[str], number: int) -> str:
        """The folder of a job in that of the multirun, as the settings say."""
        if _unresolved(self._config.hydra.sweep)["subdir"] == "${hydra.job.num}":
            return str(number)
        config = self._loader.load_sweep_config(self._config, list(overrides))
        with open_dict(config):
            config.hydra.job.id = config.hydra.job.num = number
        HydraConfig.instance().set_config(config)
        return str(config.hydra.sweep.subdir)

    def _do(self, tasks: list[Task]) -> list[Exception | None]:
        """Launch some; returns the error of each."""
        starts = batches(tasks, self._jobs.batch)
        errors = self._start(starts)
        return [error for start, error in zip(starts, errors, strict=True) for _ in start]

    def _start(self, starts: Sequence[Sequence[Task]]) -> Sequence[Exception | None]:
        """Give the launcher what it starts, each one job or several; returns the error of each start."""
        folder = self._config.hydra.sweep.dir
        words = [
            [*self._jobs.join(tasks), f"hydra.sweep.subdir={quoted(os.path.relpath(tasks[0].path, folder))}"]
            for tasks in starts
        ]
        launcher, threads = self._config.hydra.launcher, self._config.get("threads", 1)
        is_slurm = launcher._target_.endswith("SlurmLauncher")
        with slurm.watching(launcher, threads) if is_slurm else nullcontext() as queue:
            try:
                return [done.return_value for done in self._launcher.launch(words, initial_job_idx=0)]
            except (BrokenProcessPool, HydraException, OmegaConfBaseException):
                raise
            except Exception as error:
                if is_interruption(error):
                    raise KeyboardInterrupt from error
                if queue and queue.lost:
                    return [queue.lost.get(place) for place in range(len(starts))]
                if queue and queue.is_refused:
                    choices = [word for word in self._config.hydra.overrides.hydra if "launcher" in word]
                    text = f"SLURM refuses {' '.join(choices)}: {' '.join(str(error).split())}"
                    return [ConfigError(text)] * len(starts)
                raise LauncherError(f"the launcher stopped: {type(error).__name__}: {error}") from error


@contextmanager
def _launching(jobs: Jobs, command: str) -> Iterator[None]:
    """Let Hydra's own sweeper have a launcher that gets the jobs that are to do, and joblib workers that begin here.

    Hydra would first compose each job once more, to see whether it can be; those of studies are known by their names.
    """
    from unittest.mock import patch  # which loads asyncio: one run needs neither

    instantiate = Plugins.instantiate_launcher

    def chosen(self: Plugins, **how: Any) -> Launcher:
        sweeper = str(how["config"].hydra.sweeper._target_).rpartition(".")[2]
        if sweeper != "BasicSweeper":
            raise ConfigError(f"hydra/sweeper must be basic: jobs return no number to {sweeper}")
        return _Chosen(instantiate(self, **how), jobs, how["hydra_context"], how["config"])

    are_legal = patch.object(Sweeper, "validate_batch_is_legal") if command == "study" else nullcontext()
    with joblib_workers(), are_legal, patch.object(Plugins, "instantiate_launcher", chosen):
        yield


@contextmanager
def _set_command_line(command: str, arguments: list[str]) -> Iterator[None]:
    """Set what Hydra reads: the argument list, and that errors are raised, not printed."""
    argv, full_error = sys.argv, os.environ.get(_FULL_ERROR)
    sys.argv = [f"epuckhebb {command}", *arguments]
    os.environ[_FULL_ERROR] = "1"
    try:
        yield
    finally:
        sys.argv = argv
        os.environ.pop(_FULL_ERROR)
        os.environ |= {} if full_error is None else {_FULL_ERROR: full_error}


def new_stamp() -> str:
    """The time, and a random part, since two runs may begin in the same second."""
    return f"{datetime.now():%Y%m%d-%H%M%S}-{token_hex(4)}"


def threads_of_job(threads: int) -> int:
    """The threads of this job, from its setting; under a parallel launcher one by default, and no more than fit."""
    launcher = HydraConfig.get().launcher
    if HydraConfig.get().mode != RunMode.MULTIRUN or launcher._target_.endswith("BasicLauncher"):
        return thread_count(threads)
    if launcher._target_.endswith("JoblibLauncher"):
        cores = thread_count(0)
        width = launcher.n_jobs if launcher.n_jobs > 0 else max(1, cores + 1 + launcher.n_jobs)
        return int(max(1, min(threads, cores // width)))
    return max(1, threads)


@contextmanager
def joblib_workers() -> Iterator[None]:
    """Let each worker of joblib begin in the folder of its parent, and end with it.

    joblib lets workers of an earlier call go on only if what they began with is the same; in another folder, their
    results would be there.
    """
    from joblib.parallel import BACKENDS, register_parallel_backend

    loky = BACKENDS["loky"]
    begun = functools.partial(loky, initializer=begin_worker, initargs=(os.getpid(), str(Path.cwd())))
    register_parallel_backend("loky", begun)
    try:
        yield
    finally:
        register_parallel_backend("loky", loky)


OmegaConf.register_new_resolver("epuckhebb.world", lambda *, _root_: world_name(_root_), replace=True)
OmegaConf.register_new_resolver("epuckhebb.stamp", new_stamp, replace=True)
