"""The call of Hydra: it composes each job's configuration, and gives the job its folder, overrides and threads."""

import functools
import os
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, redirect_stderr, suppress
from datetime import datetime
from pathlib import Path
from secrets import token_hex
from typing import Any, NamedTuple, TextIO, cast

import hydra
from hydra._internal.hydra import Hydra
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from hydra.plugins.sweeper import Sweeper
from hydra.types import RunMode
from omegaconf import DictConfig
from omegaconf.errors import OmegaConfBaseException

from epuckhebb.config import (
    KINDS,
    SCHEMAS,
    SWEEP_DIR,
    alternatives,
    explain,
    load,
    quoted,
    swept_values,
    value_of,
    with_names_compared,
)
from epuckhebb.config.compose import IS_HYDRA_1_4, STAMP, VERSION_BASE, of_job, unresolved
from epuckhebb.config.hydra_cache import USERS, users_first
from epuckhebb.runtime import ConfigError, JobFailedError, data_folder, exit_with_parent, path_of, thread_count
from epuckhebb.store import check_folder_of_multirun, of_multirun

_SENSOR = re.compile(r"(sensor: *)([^\s,}:]+\.py)(?=:)")  # the file of a sensor of the user's own
_CHECKED_IN_FULL = 20  # a longer list of values is checked at its two ends
_HYDRAS_WORDS = "Error executing job with overrides"  # before what a job raised


class Job(NamedTuple):
    """A job of Hydra's: its folder, configuration and overrides, and the command line that does it alone."""

    path: Path
    config: Any
    overrides: list[str]
    facts: dict[str, Any]


def output_folder() -> Path:
    """The folder that Hydra has made for the job at work."""
    return Path(unresolved(HydraConfig.get().runtime)["output_dir"])


def check(
    command: str, overrides: list[str], config_dir: str | None, prepare: Callable[[Any], Any], *, multirun: bool
) -> None:
    """Refuse, before anything runs, a named sweep as one job, and a multirun with a job that would be refused.

    Every value of every swept key is tried once, with the first values of the others: a sum, not a product.

    prepare: a function that raises `ConfigError` if a checked configuration cannot be run.
    """
    if not multirun:
        named = [override for override in overrides if override.lstrip("+").startswith("experiment=")]
        if named and swept_values(overrides, config_dir):
            name = named[-1].partition("=")[2]
            raise ConfigError(
                f"experiment={name} is a sweep of many jobs: run `epuckhebb sweep {name}`, or add --multirun"
            )
        return
    choices = list(alternatives(overrides).values())
    first = [values[0] for values in choices]
    jobs = [first]
    for place, values in enumerate(choices):
        tried = values[1:] if len(values) <= _CHECKED_IN_FULL else values[-1:]
        jobs += [[*first[:place], value, *first[place + 1 :]] for value in tried]
    for job in jobs:
        prepare(load(SCHEMAS[command], job, config_dir))


def run(command: str, job: Callable[[Any], None], arguments: list[str], config_dir: str | None = None) -> list[Path]:
    """Run a job, or with `--multirun` many, on the configuration that overrides and Hydra's own options describe.

    Returns the folders of the runs, in the order of the jobs. config_dir: a folder with more configuration files.
    """
    arguments = [with_names_compared(_with_own_files_found(argument)) for argument in arguments]
    stamp = new_stamp()
    folders: list[Path] = []

    @functools.wraps(job)
    def noted(cfg: DictConfig) -> None:
        job(cfg)
        folders.append(output_folder())

    if "--multirun" not in arguments:
        call(command, noted, arguments, stamp, config_dir)
        return folders
    given = [value_of(argument) for argument in arguments if argument.startswith(SWEEP_DIR)]
    folder = Path(given[-1]) if given else Path("runs") / command / f"{stamp}_multirun"
    check_folder_of_multirun(folder)
    if not given:  # in words, not as an environment variable: workers kept from an earlier call have the old one
        arguments = [f"{SWEEP_DIR}{folder}", *arguments]
    call(command, job, arguments, stamp, config_dir)
    return of_multirun(folder)


def _with_own_files_found(argument: str) -> str:
    """An override in which the user's files have absolute paths: a worker may start in another folder."""
    key = argument.partition("=")[0]
    if key == "robot.sensors":
        return _SENSOR.sub(lambda found: f"{found[1]}{path_of(found[2], key).absolute()}", argument)
    if key not in [f"{kind.group}.{kind.key}" for kind in KINDS.values()] or ":" not in argument:
        return argument
    (choices,) = alternatives([argument]).values()
    named = [value_of(choice).rpartition(":") for choice in choices]
    found = [f"{path_of(file, key).absolute()}:{name}" if file else name for file, _, name in named]
    return f"{key}={','.join(map(quoted, found))}"


def call(
    command: str, job: Callable[[Any], None], arguments: list[str], stamp: str, config_dir: str | None = None
) -> None:
    """Call Hydra as its own command line would; see `run`. The stamp is part of the names of folders."""
    options: dict[str, Any] = {"execution_whitelist": ("epuckhebb.*",)} if IS_HYDRA_1_4 else VERSION_BASE
    entry = hydra.main(config_path=str(data_folder("conf")), config_name=command, **options)(job)
    words = cast(TextIO, _WithoutHydrasWords(sys.stderr))
    workers = _workers_of_ours() if "--multirun" in arguments else nullcontext()
    # Hydra composes all of a configuration to see whether hydra.mode is in it, and then once more.
    known = nullcontext() if any("hydra.mode" in argument for argument in arguments) else _without(Hydra, "get_mode")
    with users_first(config_dir), _as_command_line(command, arguments, stamp), redirect_stderr(words), workers, known:
        GlobalHydra.instance().clear()
        try:
            entry()
        except (HydraException, OmegaConfBaseException) as error:
            raise ConfigError(explain(error)) from error
        except (ConfigError, JobFailedError):
            raise
        except Exception as error:
            if "--multirun" in arguments:  # jobs wrap what goes wrong in them, so this is the launcher's
                raise JobFailedError(f"the launcher stopped: {type(error).__name__}: {error}") from error
            raise


def call_many(command: str, job: Callable[[Any], None], arguments: list[str], stamp: str) -> None:
    """Call Hydra for jobs that have their configurations already: it does not compose them before the first begins."""
    with _without(Sweeper, "validate_batch_is_legal"):
        call(command, job, arguments, stamp)


@contextmanager
def _without(owner: type, method: str) -> Iterator[None]:
    """Replace a method of one of Hydra's classes by one that does nothing and returns None."""
    before = getattr(owner, method)
    setattr(owner, method, lambda *_, **__: None)
    try:
        yield
    finally:
        setattr(owner, method, before)


def new_stamp() -> str:
    """The time, and a random part, since two runs may begin in the same second."""
    return f"{datetime.now():%Y%m%d-%H%M%S}-{token_hex(4)}"


@contextmanager
def job_of(command: str, cfg: DictConfig) -> Iterator[Job]:
    """The job at work, checked, with all names in its settings; if it is refused, its folder is removed if it is empty.

    cfg: as Hydra composed it; see `epuckhebb.config.names`.
    """
    path, runtime = output_folder(), HydraConfig.get().runtime
    try:
        config = of_job(command, cfg, runtime)
        overrides = list(unresolved(HydraConfig.get().overrides.task))
        words, sources = ["epuckhebb", command, *overrides], unresolved(runtime)["config_sources"]
        found = next((Path(one["path"]) for one in sources if one["provider"] == USERS and one["path"]), None)
        if found is not None:
            words += ["--config-dir", str(found.relative_to(Path.cwd()) if found.is_relative_to(Path.cwd()) else found)]
        yield Job(path, config, overrides, {"command_line": words})
    except (ConfigError, OmegaConfBaseException):
        with suppress(OSError):  # something is in it
            for folder in (path, *path.parents):
                if Path.cwd() not in folder.parents:
                    break
                folder.rmdir()
        raise


def in_multirun() -> bool:
    """Whether this job is one of many."""
    return bool(HydraConfig.get().mode == RunMode.MULTIRUN)


def threads_of_job(threads: int) -> int:
    """The threads of this job, from its setting; under a parallel launcher one by default, and no more than fit."""
    launcher = HydraConfig.get().launcher
    if not in_multirun() or launcher._target_.endswith("BasicLauncher"):
        return thread_count(threads)
    if launcher._target_.endswith("JoblibLauncher"):
        cores = thread_count(0)
        width = launcher.n_jobs if launcher.n_jobs > 0 else max(1, cores + 1 + launcher.n_jobs)
        return int(max(1, min(threads, cores // width)))
    return max(1, threads)


class _WithoutHydrasWords:
    """Standard error without what Hydra prints before it raises the error of a job, which we print once."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        return len(text) if text.startswith(_HYDRAS_WORDS) else self._stream.write(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def _as_command_line(command: str, arguments: list[str], stamp: str) -> Iterator[None]:
    """Set what Hydra reads: the argument list, and that errors are raised, not printed."""
    variables = {STAMP: stamp, "HYDRA_FULL_ERROR": "1"}
    argv, environment = sys.argv, {name: os.environ.get(name) for name in variables}
    sys.argv = [f"epuckhebb {command}", *arguments]
    os.environ.update(variables)
    try:
        yield
    finally:
        sys.argv = argv
        for name, value in environment.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


@contextmanager
def _workers_of_ours() -> Iterator[None]:
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
    exit_with_parent(parent)
