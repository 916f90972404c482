"""All that goes between this program and Hydra: composing a configuration, and running a job on one.

Typer owns the options, Hydra owns `key=value`. A verb builds the argument list that Hydra would have found on a command
line of its own, so that real launchers, sweepers and `.hydra/` work; what Hydra raises becomes one message.
"""

import copy
import functools
import itertools
import os
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import datetime
from importlib.metadata import version
from pathlib import Path
from secrets import token_hex
from typing import Any

import hydra
from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.errors import HydraException
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf, flag_override
from omegaconf.errors import OmegaConfBaseException

from epuckhebb.app.config import SCHEMAS, near_keys, thread_count
from epuckhebb.app.data import data_folder, groups
from epuckhebb.app.errors import ConfigError, JobFailedError
from epuckhebb.app.named import NAMED, completed, world_name
from epuckhebb.app.parts import GENETIC, not_its_settings

IS_HYDRA_1_4 = int(version("hydra-core").split(".")[1]) >= 4
_STAMP = "EPUCKHEBB_STAMP"  # environment variable that conf/ names run folders with
_EXTRAS = {"submitit": "slurm", "ray": "ray"}
_SWEEP_DIR = "hydra.sweep.dir="
_CHECKED_IN_FULL = 20  # a longer list of values is checked at its two ends
_RULE_FILE = re.compile(r"(?<=hebbian\.rule=)[^,:=~]+\.py(?=:)")  # a worker may have been started elsewhere
_VALUE_KEY = re.compile(r"[\w.]+")  # of a plain override: nothing added, deleted, or put into another package
_VERSION_BASE: dict[str, Any] = {} if IS_HYDRA_1_4 else {"version_base": "1.3"}  # from 1.4 on it is warned about


def composed(verb: str, overrides: list[str], config_dir: str | None = None, *, with_hydra: bool = False) -> DictConfig:
    """The configuration that a verb would run with these overrides.

    Args:
        verb: The verb.
        overrides: As on the command line.
        config_dir: A folder with more configuration files.
        with_hydra: Whether to include what Hydra keeps for itself.

    Raises:
        ConfigError: They do not make one.
    """
    return _with_names(*_composed(verb, overrides, config_dir), with_hydra=with_hydra)


def _composed(verb: str, overrides: list[str], config_dir: str | None) -> tuple[DictConfig, DictConfig, list[Path]]:
    """A configuration as Hydra composes it, what Hydra keeps for itself, and where it looked for files."""
    check_words(verb, overrides)
    more = [f'hydra.searchpath=["file://{Path(config_dir).absolute()}"]'] if config_dir else []
    GlobalHydra.instance().clear()
    try:
        with initialize_config_dir(str(data_folder("conf")), **_VERSION_BASE):
            cfg = compose(verb, [*overrides, *more], return_hydra_config=True)
    except (HydraException, OmegaConfBaseException) as error:
        raise ConfigError(explain(error)) from error
    with flag_override(cfg, ["struct", "readonly"], [False, False]):
        hydras = cfg.pop("hydra")
    return cfg, hydras, _folders(hydras.runtime)


def _with_names(cfg: DictConfig, hydras: DictConfig, folders: list[Path], *, with_hydra: bool = False) -> DictConfig:
    completed(cfg, hydras.runtime.choices, folders)
    if with_hydra:
        with flag_override(cfg, ["struct", "readonly"], [False, False]):
            cfg.hydra = hydras
    return cfg


def named(cfg: DictConfig) -> DictConfig:
    """The configuration of the job that Hydra runs, with all names in it; see `epuckhebb.app.named`."""
    runtime = HydraConfig.get().runtime
    return completed(cfg, runtime.choices, _folders(runtime))


def _folders(runtime: Any) -> list[Path]:
    """Where Hydra looks for files."""
    return [Path(source.path) for source in runtime.config_sources if source.schema == "file"]


def _world(*, _root_: DictConfig) -> str:
    """The world of a run, for the name of its folder."""
    runtime = _root_.hydra.runtime
    own = OmegaConf.create({key: _root_._get_node(key) for key in _root_ if key != "hydra"})
    return world_name(own, runtime.choices, _folders(runtime))


OmegaConf.register_new_resolver("epuckhebb.world", _world, replace=True)


def combinations(
    verb: str, fixed: list[str], choices: dict[str, list[str]], config_dir: str | None
) -> Iterator[tuple[list[str], DictConfig]]:
    """Every combination of the choices (as from `alternatives`), as overrides and composed.

    Hydra takes a tenth of a second for each composition, so values are put into a copy of what is composed from the
    groups alone; what cannot be put in so simply is left to Hydra, which may also explain why not.

    Raises:
        ConfigError: An override cannot be used.
    """
    values = {key for key in choices if _VALUE_KEY.fullmatch(key) and key not in groups(verb)}
    are_named = not any(key.partition(".")[0] in NAMED for key in values)  # whatever these values are

    @functools.cache
    def prepared(overrides: tuple[str, ...]) -> tuple[DictConfig, DictConfig, list[Path]]:
        raw, hydras, folders = _composed(verb, [*fixed, *overrides], config_dir)
        return _with_names(raw, hydras, folders) if are_named else raw, hydras, folders

    @functools.cache
    def parsed(override: str) -> tuple[str, Any]:
        one = OverridesParser.create().parse_override(override)
        return one.key_or_group, one.value()

    for overrides in itertools.product(*choices.values()):
        told = list(zip(choices, overrides, strict=True))
        raw, hydras, folders = prepared(tuple(override for key, override in told if key not in values))
        cfg = copy.deepcopy(raw)
        try:
            for key, override in told:
                if key in values:
                    OmegaConf.update(cfg, *parsed(override))
        except OmegaConfBaseException:
            cfg = _composed(verb, [*fixed, *overrides], config_dir)[0]
        yield list(overrides), _with_names(cfg, hydras, folders)


def alternatives(overrides: list[str]) -> dict[str, list[str]]:
    """For each key the overrides that it is to have in turn; a key that comes again replaces the earlier one.

    Raises:
        ConfigError: They cannot be read.
    """

    def choices(override: Override) -> list[str]:
        if not override.is_discrete_sweep():  # or only its sweeper knows what it stands for
            return [override.input_line or ""]
        return [f"{override.get_key_element()}={value}" for value in override.sweep_string_iterator()]

    try:
        parsed = OverridesParser.create().parse_overrides(overrides)
        return {override.get_key_element(): choices(override) for override in parsed}
    except HydraException as error:
        raise ConfigError(explain(error)) from error


def check_words(verb: str, words: list[str]) -> None:
    """Refuse `changed`, and what Hydra ends with a traceback.

    That is a group that is given something else than a name, and settings of the GA for another optimizer.

    Raises:
        ConfigError: There is such a word; the message says what is allowed.
    """
    try:
        overrides = OverridesParser.create().parse_overrides([word for word in words if not word.startswith("-")])
    except HydraException:
        return  # Hydra will say what is wrong with it
    known = groups(verb)
    optimizer = next((one.value() for one in reversed(overrides) if one.key_or_group == "optimizer"), GENETIC)
    for override in overrides:
        key = override.key_or_group
        if key.partition(".")[0] == GENETIC and isinstance(optimizer, str) and optimizer != GENETIC:
            raise not_its_settings(optimizer)
        if key == "changed":
            raise ConfigError("changed is filled in by the program, with what differs from the named scenario")
        value = None if override.is_sweep_override() else override.value()
        is_name = override.is_delete() or override.is_sweep_override() or isinstance(value, str | list)
        if not is_name and (key in known or "/" in key):
            allowed = f"one of {', '.join(known[key])}" if key in known else "the name of a file"
            raise ConfigError(f"{override.input_line}: {key} must be {allowed}")


def check(
    verb: str, overrides: list[str], config_dir: str | None, asked: Callable[[DictConfig], Any], *, multirun: bool
) -> None:
    """Refuse, before anything runs, what Hydra would run without a word, or only after other jobs.

    That is a named sweep as one job; and a multirun of which a job would be refused. Every value of every swept key is
    tried once, with the first values of the others: a sum, not a product.

    Args:
        verb: The verb.
        overrides: As on the command line.
        config_dir: A folder with more configuration files.
        asked: A function that raises `ConfigError` if a composed configuration cannot be used.
        multirun: Whether there may be many jobs.

    Raises:
        ConfigError: A key, a value or the genome cannot be used.
    """
    if not multirun:
        named = [override for override in overrides if override.lstrip("+").startswith("experiment=")]
        if named and composed(verb, overrides, config_dir, with_hydra=True).hydra.sweeper.params:
            name = named[-1].partition("=")[2]
            raise ConfigError(
                f"experiment={name} is a sweep of many jobs: run `epuckhebb sweep {name}`, or add --multirun"
            )
        return
    choices = list(alternatives(overrides).values())
    first = [values[0] for values in choices]
    asked(composed(verb, first, config_dir))
    for place, values in enumerate(choices):
        for value in values[1:] if len(values) <= _CHECKED_IN_FULL else values[-1:]:
            asked(composed(verb, [*first[:place], value, *first[place + 1 :]], config_dir))


def run(verb: str, job: Callable[[DictConfig], None], arguments: list[str]) -> list[Path]:
    """Run a job, or with `--multirun` many, on the configuration that overrides and Hydra's own options describe.

    Returns the folders of the runs, in the order of the jobs.

    Raises:
        ConfigError: The arguments do not make a configuration; or the job said so.
        JobFailedError: A job failed, or the launcher of several.
    """
    check_folders(arguments)
    arguments = [_RULE_FILE.sub(lambda file: str(Path(file[0]).absolute()), argument) for argument in arguments]
    stamp = new_stamp()
    folders: list[Path] = []

    @functools.wraps(job)
    def noted(cfg: DictConfig) -> None:
        job(cfg)
        folders.append(Path(HydraConfig.get().runtime.output_dir))

    if "--multirun" not in arguments:
        refused: list[ConfigError | JobFailedError] = []

        @functools.wraps(job)
        def told_once(cfg: DictConfig) -> None:
            try:
                noted(cfg)
            except (ConfigError, JobFailedError) as error:  # what leaves a job, Hydra tells in its own words first
                refused.append(error)

        call(verb, told_once, arguments, stamp)
        if refused:
            raise refused[0]
        return folders
    if not any(argument.startswith(_SWEEP_DIR) for argument in arguments):
        # In words, not as an environment variable: workers that a launcher keeps from an earlier call have the old one.
        arguments = [f"{_SWEEP_DIR}{Path('runs') / verb / stamp}_multirun", *arguments]
    call(verb, job, arguments, stamp)
    folder = Path([argument for argument in arguments if argument.startswith(_SWEEP_DIR)][-1].partition("=")[2])
    runs = [status.parent for status in folder.glob("*/status.json")]
    return sorted(runs, key=lambda run: (not run.name.isdigit(), int(run.name) if run.name.isdigit() else 0, run.name))


def check_folders(arguments: list[str]) -> None:
    """Refuse an empty name of a folder, which would be the current one.

    Raises:
        ConfigError: One is empty.
    """
    for argument in arguments:
        key, _, value = argument.partition("=")
        if key in ("hydra.run.dir", "hydra.sweep.dir") and not value.strip("'\""):
            raise ConfigError(f"{key} must name a folder, got nothing; leave it out for one below runs/")


def call(verb: str, job: Callable[[DictConfig], None], arguments: list[str], stamp: str) -> None:
    """Call Hydra as its own command line would; see `run`. The folders of the runs bear the stamp."""
    options: dict[str, Any] = {"execution_whitelist": ("epuckhebb.*",)} if IS_HYDRA_1_4 else _VERSION_BASE
    entry = hydra.main(config_path=str(data_folder("conf")), config_name=verb, **options)(job)
    with _as_command_line(verb, arguments, stamp):
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


def new_stamp() -> str:
    """When, and a random part that keeps apart what begins in the same second."""
    return f"{datetime.now():%Y%m%d-%H%M%S}-{token_hex(4)}"


@contextmanager
def job_folder() -> Iterator[Path]:
    """The folder that Hydra has made for this job; if the job is refused, what is empty of it goes again."""
    path = Path(HydraConfig.get().runtime.output_dir)
    try:
        yield path
    except ConfigError:
        here = Path.cwd()
        try:
            while path != here and here in path.parents:
                path.rmdir()
                path = path.parent
        except OSError:  # something is in it
            pass
        raise


def job_overrides() -> list[str]:
    """The overrides of this job, as they would be typed."""
    return list(HydraConfig.get().overrides.task)


def in_multirun() -> bool:
    """Whether this job is one of many."""
    return bool(HydraConfig.get().mode == RunMode.MULTIRUN)


def threads_of_job(asked: int) -> int:
    """Threads of this job; jobs of a parallel launcher get one each unless told otherwise, and never more than fit."""
    launcher = HydraConfig.get().launcher
    if not in_multirun() or launcher._target_.endswith("BasicLauncher"):
        return thread_count(asked)
    if launcher._target_.endswith("JoblibLauncher"):
        cores = thread_count(0)
        width = launcher.n_jobs if launcher.n_jobs > 0 else max(1, cores + 1 + launcher.n_jobs)
        return int(max(1, min(asked, cores // width)))
    return max(1, asked)


@contextmanager
def _as_command_line(verb: str, arguments: list[str], stamp: str) -> Iterator[None]:
    """What Hydra reads: the argument list, and a wish to have errors raised instead of printed."""
    argv, environment = sys.argv, {name: os.environ.get(name) for name in (_STAMP, "HYDRA_FULL_ERROR")}
    sys.argv = [f"epuckhebb {verb}", *arguments]
    os.environ.update({_STAMP: stamp, "HYDRA_FULL_ERROR": "1"})
    try:
        yield
    finally:
        sys.argv = argv
        for name, value in environment.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def explain(error: BaseException) -> str:
    """Hydra's message, made fit for a reader: causes included, advice that does not apply left out, near keys named."""
    lines: list[str] = []
    current: BaseException | None = error
    while current is not None:
        for line in str(current).splitlines():
            kept = line.strip()
            if kept and kept not in lines and not kept.startswith(("object_type=", "reference_type=", "full_key:")):
                lines.append(kept)
        current = current.__cause__
    full_key = re.search(r"full_key: (\S+)", str(error))
    if full_key and not any(full_key[1] in line for line in lines):
        lines.insert(0, f"{full_key[1]}:")
    lines = [
        line
        for line in lines
        if not line.startswith(("Config search path", "To append to your config use +")) and "provider=" not in line
    ]
    text = re.sub(r"Did you mean: '(.+?)'\?", r"Did you mean: \1?", "\n".join(lines))
    missing = re.search(r"Could not (?:find|load) 'hydra/launcher/(submitit|ray)(?:_\w+)?'", text)
    if missing:
        text += f'\nThis launcher is a plug-in: pip install "epuckhebb[{_EXTRAS[missing[1]]}]"'
    if "LexerNoViableAlt" in type(error).__name__ or "mismatched input" in text or "missing EQUAL" in text:
        text += "\nSettings are written KEY=VALUE, for example scenario=4obstacles or hebbian.N=0.002"
    wrong = re.search(r"Could not override '([^']+)'", text)
    if wrong and "Did you mean" not in text:
        near = near_keys(wrong[1], _known_keys())
        if near:
            text += f"\nDid you mean: {near}?"
    return text


def _known_keys() -> list[str]:
    """All keys and groups of the configuration, as they are written in an override."""

    def below(node: Any, prefix: str) -> Iterator[str]:
        for key, value in node.items():
            yield prefix + key
            if isinstance(value, dict):
                yield from below(value, f"{prefix}{key}.")

    schemas = [OmegaConf.to_container(OmegaConf.structured(SCHEMAS[verb])) for verb in ("evaluate", "evolve")]
    return sorted({key for schema in schemas for key in below(schema, "")})
