"""Runs jobs on what Hydra composes: one in this process, many with the launchers and sweepers of Hydra."""

import functools
import os
import platform
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from datetime import datetime
from pathlib import Path
from secrets import token_hex
from typing import Any, NamedTuple

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from epuckhebb.config import (
    RUN_DIR,
    SCHEMAS,
    SWEEP_DIR,
    alternatives,
    configurations,
    explain,
    from_values,
    quoted,
    swept_values,
    typed,
    value_of,
    world_name,
)
from epuckhebb.config.catalogue import SEARCH_PATH, USERS, VERSION_BASE, catalogue, choices_of
from epuckhebb.config.compose import composed_with_hydra
from epuckhebb.config.resolve import resolve
from epuckhebb.config.source import folders_of
from epuckhebb.runtime import ConfigError, JobFailedError, data_folder, exit_with_parent, refusing, say, thread_count
from epuckhebb.store import STATUS, check_folder_of_multirun, of_multirun

_CHECKED_IN_FULL = 20  # a longer list of values is checked at its two ends
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
    if named and swept_values(overrides, config_dir):
        raise ConfigError(f"{named[-1]} has many jobs: run `epuckhebb sweep {named[-1].partition('=')[2]}`")
    if not multirun:
        return
    choices = list(alternatives(overrides).values())
    first = tuple(values[0] for values in choices)
    jobs = [first]
    for place, values in enumerate(choices):
        tried = values[1:] if len(values) <= _CHECKED_IN_FULL else values[-1:]
        jobs += [(*first[:place], value, *first[place + 1 :]) for value in tried]
    for _, settings in configurations(command, [], jobs, config_dir):
        prepare(from_values(settings, SCHEMAS[command], command))


def run(
    command: str,
    job: Callable[[Job], None],
    arguments: list[str],
    config_dir: str | None = None,
    report: Report = unreported,
) -> list[Path]:
    """Run a job, or with `--multirun` many, on the configuration that overrides and Hydra's own options describe.

    Returns the folders of the runs, in the order of the jobs. command, arguments: as of `for_hydra`. config_dir: a
    folder with more configuration files. report: of a `Job` that is run alone.
    """
    if not any(argument.startswith("-") for argument in arguments):
        return [_run_one(command, job, arguments, config_dir, report)]
    task = functools.partial(_job_of_hydra, command, job)
    if "--multirun" not in arguments:
        call(command, task, arguments, config_dir)
        return []
    if useless := [argument for argument in arguments if argument.startswith(RUN_DIR)]:
        raise ConfigError(f"{useless[-1]} does nothing in a multirun; give {SWEEP_DIR}FOLDER")
    named = [argument for argument in arguments if argument.startswith(SWEEP_DIR)]
    folder = (
        Path(value_of(named[-1])) if named else Path("runs") / command.partition("_")[0] / f"{new_stamp()}_multirun"
    )
    check_folder_of_multirun(folder)
    others = [argument for argument in arguments if argument not in named]
    call(command, task, [f"{SWEEP_DIR}{quoted(str(folder.absolute()))}", *others], config_dir)
    if not any(folder.rglob(STATUS)):
        raise JobFailedError(f"no job has left a run in {folder.absolute()}; do all machines of the launcher see it?")
    return of_multirun(folder)


def _run_one(
    command: str, job: Callable[[Job], None], overrides: list[str], config_dir: str | None, report: Report
) -> Path:
    """Run one job in this process; its folder is named when its configuration is complete."""
    for override in overrides:
        is_hydras = override.lstrip("+~").startswith(("hydra.", "hydra/"))
        if is_hydras and not override.startswith((RUN_DIR, SEARCH_PATH)):
            raise ConfigError(f"{override} does nothing in one run; give {RUN_DIR}FOLDER, or -m for many runs")
    _, _, cfg, hydras, _ = composed_with_hydra(command, overrides, config_dir)
    config = typed(cfg, SCHEMAS[command])
    cfg.hydra = hydras
    with refusing(explain, OmegaConfBaseException):
        path = Path(cfg.hydra.run.dir)
    del cfg.hydra
    own = [word for word in overrides if not word.lstrip("+~").startswith(("hydra.", "hydra/"))]
    facts, threads = _facts(command, own, config_dir), thread_count(config.threads)
    job(Job(path, config, own, facts, threads, in_multirun=False, report=report))
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
        resolve(command, cfg, choices_of(runtime), overrides, folders_of(runtime))
        config: Any = typed(cfg, SCHEMAS[command])
        facts, is_many = _facts(command, overrides, folder), HydraConfig.get().mode == RunMode.MULTIRUN
        if is_many:
            say(f"job {HydraConfig.get().job.num}: {' '.join(overrides)}")
        job(Job(path, config, overrides, facts, threads_of_job(config.threads), is_many))
    except ConfigError:
        with suppress(OSError):  # something is in it
            for folder in (path, *path.parents):
                if Path.cwd() not in folder.parents:
                    break
                folder.rmdir()
        raise


class LauncherError(JobFailedError):
    """A launcher stopped; which of its jobs go on is not known."""


def _do(task: Callable[[Any], None], errors: list[Exception], parent: int, folder: Path, cfg: Any) -> None:
    """Do a job in the folder of the call, to which its files are relative; a worker may have begun in another one.

    Its error goes into a list if that is in this process: Hydra would print a line about it.
    """
    try:
        if os.getpid() != parent:
            with refusing(lambda _: f"{folder}, where this was called, is not on {platform.node()}", OSError):
                os.chdir(folder)
        task(cfg)
    except (ConfigError, JobFailedError) as error:
        if os.getpid() != parent:
            raise
        errors.append(error)


def call(command: str, task: Callable[[Any], None], arguments: list[str], config_dir: str | None = None) -> None:
    """Call Hydra as its own command line would; see `run`. task: is given each configuration that Hydra composed."""
    errors: list[Exception] = []
    entry = hydra.main(config_path=str(data_folder("conf")), config_name=command, version_base=VERSION_BASE)(
        functools.partial(_do, task, errors, os.getpid(), Path.cwd())
    )
    workers = joblib_workers() if "--multirun" in arguments else nullcontext()
    with catalogue(command, config_dir), _as_command_line(command, arguments), workers:
        try:
            entry()
        except (ConfigError, JobFailedError):
            raise
        except Exception as error:
            if "--multirun" not in arguments or isinstance(error, HydraException | OmegaConfBaseException):
                raise ConfigError(explain(error)) from error
            raise LauncherError(f"the launcher stopped: {type(error).__name__}: {error}") from error
    if errors:
        raise errors[0]


@contextmanager
def _as_command_line(command: str, arguments: list[str]) -> Iterator[None]:
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
    """Let each worker of joblib begin with `_begin`."""
    from joblib.parallel import BACKENDS, register_parallel_backend

    loky = BACKENDS["loky"]
    begun = functools.partial(loky, initializer=_begin, initargs=(os.getpid(), str(Path.cwd())))
    register_parallel_backend("loky", begun)
    try:
        yield
    finally:
        register_parallel_backend("loky", loky)


def _begin(parent: int, folder: str) -> None:
    """Begin a worker, in the folder of its parent, with which it ends.

    One that waited for its next job would hold the terminal for five minutes. joblib lets workers of an earlier call
    go on only if what they began with is the same; in another folder, their results would be there.
    """
    os.chdir(folder)
    sys.stdout = sys.stderr  # what a user's own part prints, as in the parent
    exit_with_parent(parent)


OmegaConf.register_new_resolver(
    "epuckhebb.world", lambda *, _root_: world_name(_root_.scenario.name, _root_.changed), replace=True
)
OmegaConf.register_new_resolver("epuckhebb.stamp", new_stamp, replace=True)
