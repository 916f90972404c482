"""All that goes between this program and Hydra: composing a configuration, and running a job on one.

Typer owns the options, Hydra owns `key=value`. A verb builds the argument list that Hydra would have found on a command
line of its own, so that real launchers, sweepers and `.hydra/` work; what Hydra raises becomes one message.
"""

import copy
import functools
import itertools
import math
import os
import re
import sys
from collections.abc import Callable, Iterator, Sequence, Set
from contextlib import contextmanager, nullcontext, redirect_stderr
from datetime import datetime
from importlib.metadata import version
from pathlib import Path
from secrets import token_hex
from typing import Any, TextIO, cast

import hydra
from hydra import compose, initialize_config_dir
from hydra._internal.hydra import Hydra
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import ChoiceSweep, Glob, Override, Sweep
from hydra.errors import HydraException
from hydra.plugins.sweeper import Sweeper
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf, flag_override
from omegaconf.errors import OmegaConfBaseException

from epuckhebb.app import runs
from epuckhebb.app.config import literal, thread_count
from epuckhebb.app.data import LATEST, data_folder, groups
from epuckhebb.app.errors import ConfigError, JobFailedError, end_with
from epuckhebb.app.explain import explain
from epuckhebb.app.hydra_files import parse_once
from epuckhebb.app.machine import path_of
from epuckhebb.app.named import NAMED, completed, world_name
from epuckhebb.app.parts import GENETIC, not_its_settings

IS_HYDRA_1_4 = int(version("hydra-core").split(".")[1]) >= 4
_STAMP = "EPUCKHEBB_STAMP"  # environment variable that conf/ names run folders with
SWEEP_DIR = "hydra.sweep.dir="
_CHECKED_IN_FULL = 20  # a longer list of values is checked at its two ends
_PLAIN = re.compile(r"[A-Za-z0-9_./:%@+-]+")  # what needs no quotes as the value of an override
_HYDRAS_WORDS = "Error executing job with overrides"  # before what a job raised
_MOST_JOBS = 100_000  # of one call
_VALUE_KEY = re.compile(r"[\w.]+")  # of a plain override: nothing added, deleted, or put into another package
_REFERENCE = re.compile(r"\$\{(.*?)\}")
_KEPT = 64  # compositions that are kept for the next combination
_VERSION_BASE: dict[str, Any] = {} if IS_HYDRA_1_4 else {"version_base": "1.3"}  # from 1.4 on it is warned about
parse_once()


Plain = dict[str, Any]  # a configuration of plain values


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
    overrides = list(map(_with_names_compared, overrides))
    more = [f"hydra.searchpath=[{_in_quotes(f'file://{Path(config_dir).absolute()}')}]"] if config_dir else []
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
    sources = _unresolved(runtime.config_sources)
    return [Path(source["path"]) for source in sources if source["schema"] == "file"]


def _unresolved(node: Any) -> Any:
    """What Hydra notes, to the letter: a `${...}` in a folder's name refers to nothing."""
    return OmegaConf.to_container(node, resolve=False)


def output_folder() -> Path:
    """The folder that Hydra has made for the job at work."""
    return Path(_unresolved(HydraConfig.get().runtime)["output_dir"])


def quoted(text: str) -> str:
    """A text as the value of an override that means just this text."""
    if _PLAIN.fullmatch(text):
        return text
    return _in_quotes(literal(text))


def _in_quotes(text: str) -> str:
    escaped = re.sub(r'(\\*)("|$)', lambda found: 2 * found[1] + found[2].replace('"', '\\"'), text)
    return f'"{escaped}"'


def value_of(override: str) -> str:
    """The text that an override gives to its key, without quotes."""
    value = OverridesParser.create().parse_override(override).value()
    try:
        return str(OmegaConf.create({"value": value}).value)
    except OmegaConfBaseException:  # it refers to what only Hydra knows
        return str(value)


def _world(*, _root_: DictConfig) -> str:
    """The world of a run, for the name of its folder."""
    runtime = _root_.hydra.runtime
    own = OmegaConf.create({key: _root_._get_node(key) for key in _root_ if key != "hydra"})
    return world_name(own, runtime.choices, _folders(runtime))


_register: Any = OmegaConf.register_resolver if IS_HYDRA_1_4 else OmegaConf.register_new_resolver  # its name changed
_register("epuckhebb.world", _world, replace=True)


def plain(cfg: DictConfig) -> Plain:
    """A composed configuration as plain values, every reference resolved."""
    values = OmegaConf.to_container(cfg, resolve=True, enum_to_str=True)
    assert isinstance(values, dict)
    return {str(key): value for key, value in values.items()}


def combinations(
    verb: str,
    fixed: list[str],
    choices: dict[str, list[str]],
    config_dir: str | None,
    meet: Callable[[Plain, DictConfig], object] = lambda _config, _cfg: None,
) -> Iterator[tuple[list[str], Plain]]:
    """Every combination of the choices (as from `alternatives`), as overrides and as a configuration of plain values.

    Hydra takes a tenth of a second or two for each composition, so only the groups are composed by it; their values are
    put into a copy, in which the names are filled in. A value to which nothing in a configuration refers is then simply
    put in its place. What cannot be put in so simply is left to Hydra, which may also explain why not.

    Args:
        verb: The verb.
        fixed: Overrides that all have.
        choices: For each key the overrides that it has in turn.
        config_dir: A folder with more configuration files.
        meet: Is told each configuration that others share but for single values, also as Hydra has it.

    Raises:
        ConfigError: An override cannot be used.
    """
    values = {key for key in choices if _VALUE_KEY.fullmatch(key) and key not in groups(verb)}
    free = {key for key in values if key.partition(".")[0] not in NAMED}  # names do not depend on them

    @functools.lru_cache(maxsize=_KEPT)
    def from_groups(overrides: tuple[str, ...]) -> tuple[DictConfig, DictConfig, list[Path]]:
        return _composed(verb, [*fixed, *overrides], config_dir)

    @functools.cache
    def parsed(override: str) -> tuple[str, Any]:
        one = OverridesParser.create().parse_override(override)
        return one.key_or_group, one.value()

    def with_values(told: Sequence[tuple[str, str]], without: Set[str]) -> DictConfig:
        """The configuration of these overrides, but for those of some keys."""
        raw, hydras, folders = from_groups(tuple(override for key, override in told if key not in values))
        cfg = copy.deepcopy(raw)
        try:
            for key, override in told:
                if key in values - without:
                    OmegaConf.update(cfg, *parsed(override))
        except OmegaConfBaseException:
            cfg = _composed(verb, [*fixed, *(override for _, override in told)], config_dir)[0]
        return _with_names(cfg, hydras, folders)

    @functools.cache
    def shared(told: tuple[tuple[str, str], ...]) -> tuple[Plain, frozenset[str] | None]:
        """What the choices of all keys but the free ones lead to, and the keys to which something in it refers."""
        cfg = with_values(told, free)
        config = plain(cfg)
        meet(config, cfg)
        return config, _referred_to(cfg)

    @functools.cache
    def template() -> DictConfig:
        first = tuple(overrides[0] for key, overrides in choices.items() if key not in values)
        return copy.deepcopy(from_groups(first)[0])

    @functools.cache
    def as_declared(override: str) -> tuple[str, Any]:
        """The place and the value of an override, of the type that the schema declares."""
        key, value = parsed(override)
        OmegaConf.update(template(), key, value)
        return key, plain(OmegaConf.create({"value": OmegaConf.select(template(), key)}))["value"]

    for overrides in itertools.product(*choices.values()):
        told = list(zip(choices, overrides, strict=True))
        config, references = shared(tuple(pair for pair in told if pair[0] not in free))
        own = [pair for pair in told if pair[0] in free]
        simple = references is not None and not any(
            "${" in override or any(_overlap(key, other) for other in references) for key, override in own
        )
        try:
            for _, override in own if simple else ():
                config = _put(config, *as_declared(override))
        except (OmegaConfBaseException, KeyError, TypeError):
            simple = False
        yield list(overrides), config if simple else plain(with_values(told, set()))


def _referred_to(cfg: DictConfig) -> frozenset[str] | None:
    """The keys to which values of a configuration refer; None if there are references of another kind."""
    found = _REFERENCE.findall(str(OmegaConf.to_container(cfg, resolve=False)))
    return frozenset(found) if all(_VALUE_KEY.fullmatch(key) for key in found) else None


def _overlap(one: str, other: str) -> bool:
    """Whether a key is another one, or above or below it."""
    return f"{one}.".startswith(f"{other}.") or f"{other}.".startswith(f"{one}.")


def _put(config: Plain, key: str, value: Any) -> Plain:
    """A copy of a configuration with another value in one place; it shares all else with the first."""
    first, _, rest = key.partition(".")
    return {**config, first: _put(config[first], rest, value) if rest else value}


def alternatives(overrides: list[str]) -> dict[str, list[str]]:
    """For each key the overrides that it is to have in turn; a key that comes again replaces the earlier one.

    Raises:
        ConfigError: They cannot be read.
    """

    def choices(override: Override) -> list[str]:
        if not override.is_discrete_sweep():  # or only its sweeper knows what it stands for
            return [override.input_line or ""]
        values = itertools.islice(override.sweep_string_iterator(), _MOST_JOBS + 1)  # a range may be endless
        return [f"{override.get_key_element()}={value}" for value in values]

    try:
        parsed = OverridesParser.create().parse_overrides(overrides)
        found = {override.get_key_element(): choices(override) for override in parsed}
    except HydraException as error:
        raise ConfigError(explain(error)) from error
    if math.prod(map(len, found.values())) > _MOST_JOBS:
        most = max(found, key=lambda key: len(found[key]))
        raise ConfigError(f"at most {_MOST_JOBS} jobs can be asked for in one call; give {most} fewer values")
    return found


def check_words(verb: str, words: list[str]) -> None:
    """Refuse what is no text, `changed`, and what Hydra ends with a traceback.

    That is a group that is given something else than a name, and settings of the GA for another optimizer.

    Raises:
        ConfigError: There is such a word; the message says what is allowed.
    """
    for word in words:
        if any("\ud800" <= sign <= "\udfff" for sign in word):
            raise ConfigError(
                f"{word!r} has signs that are no text in the encoding of this system, {sys.getfilesystemencoding()}; "
                "set PYTHONUTF8=1 if it is UTF-8"
            )
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
        value: Any = override.value()
        if isinstance(value, ChoiceSweep) and any(isinstance(one, Sweep | Glob) for one in value.list):
            raise ConfigError(f"{override.input_line}: a list of values has no ranges in it; give one range, or values")
        value = None if override.is_sweep_override() else value
        is_name = override.is_delete() or override.is_sweep_override() or isinstance(value, str | list)
        if not is_name and (key in known or "/" in key or (data_folder("conf") / key).is_dir()):
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
    arguments = [_with_names_compared(_with_rules_found(argument)) for argument in arguments]
    stamp = new_stamp()
    folders: list[Path] = []

    @functools.wraps(job)
    def noted(cfg: DictConfig) -> None:
        job(cfg)
        folders.append(output_folder())

    if "--multirun" not in arguments:
        call(verb, noted, arguments, stamp)
        return folders
    if not any(argument.startswith(SWEEP_DIR) for argument in arguments):
        # In words, not as an environment variable: workers that a launcher keeps from an earlier call have the old one.
        arguments = [f"{SWEEP_DIR}{Path('runs') / verb / stamp}_multirun", *arguments]
    call(verb, job, arguments, stamp)
    folder = Path(value_of([argument for argument in arguments if argument.startswith(SWEEP_DIR)][-1]))
    return runs.of_multirun(folder)


def with_latest_found(arguments: list[str]) -> list[str]:
    """Overrides in which `genome=latest` and `resume=latest` name the run folder of the latest evolution.

    So what is written down of a call stays true when there are later ones.

    Raises:
        ConfigError: There is none yet.
    """

    def one(argument: str) -> str:
        key, _, value = argument.partition("=")
        if key not in ("genome", "resume") or LATEST not in value.split(","):
            return argument
        folder = str(runs.found(LATEST, "evolve"))
        named = folder if key == "resume" else quoted(folder)
        return f"{key}={','.join(named if word == LATEST else word for word in value.split(','))}"

    return list(map(one, arguments))


def _with_rules_found(argument: str) -> str:
    """An override whose rules of the user's own are found from every folder, where a worker may have been started."""
    if not argument.startswith("hebbian.rule=") or ":" not in argument:
        return argument
    (rules,) = alternatives([argument]).values()
    named = [value_of(rule).rpartition(":") for rule in rules]
    found = [f"{path_of(file, 'hebbian.rule').absolute()}:{name}" if file else name for file, _, name in named]
    return f"hebbian.rule={','.join(map(quoted, found))}"


def _with_names_compared(argument: str) -> str:
    """An override in which a list below `compare` is a mapping of names that have no settings, as the schema has it."""
    if not argument.startswith("compare=["):
        return argument
    try:
        names = OverridesParser.create().parse_override(argument).value()
    except HydraException:
        return argument  # Hydra will say what is wrong with it
    if not isinstance(names, list):
        return argument
    return f"compare={{{','.join(f'{quoted(str(name))}: null' for name in names)}}}"


def check_config_dir(config_dir: str | None) -> None:
    """Refuse a folder of configuration files that is not there, which Hydra only warns of.

    Raises:
        ConfigError: It is not there.
    """
    if config_dir is not None and not Path(config_dir).is_dir():
        raise ConfigError(f"--config-dir={config_dir} is no folder; give one with files such as scenario/mine.yaml")


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
    words = cast(TextIO, _WithoutHydrasWords(sys.stderr))
    workers = _workers_that_end_with_us() if "--multirun" in arguments else nullcontext()
    # Hydra composes all of a configuration to see whether hydra.mode is in it, and then once more.
    known = nullcontext() if any("hydra.mode" in argument for argument in arguments) else _without(Hydra, "get_mode")
    with _as_command_line(verb, arguments, stamp), redirect_stderr(words), workers, known:
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


def call_many(verb: str, job: Callable[[DictConfig], None], arguments: list[str], stamp: str) -> None:
    """Call Hydra for jobs that all have a configuration: it need not compose each of them before the first begins."""
    with _without(Sweeper, "validate_batch_is_legal"):
        call(verb, job, arguments, stamp)


@contextmanager
def _without(owner: type, method: str) -> Iterator[None]:
    """Time in which a method of one of Hydra's classes does nothing, and returns None."""
    before = getattr(owner, method)
    setattr(owner, method, lambda *_, **__: None)
    try:
        yield
    finally:
        setattr(owner, method, before)


def new_stamp() -> str:
    """When, and a random part that keeps apart what begins in the same second."""
    return f"{datetime.now():%Y%m%d-%H%M%S}-{token_hex(4)}"


@contextmanager
def job_folder() -> Iterator[Path]:
    """The folder that Hydra has made for this job; if the job is refused, what is empty of it goes again."""
    path = output_folder()
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
    return list(_unresolved(HydraConfig.get().overrides.task))


def job_command(verb: str) -> list[str]:
    """What could be typed to have this job alone done again in this folder."""
    sources = _unresolved(HydraConfig.get().runtime)["config_sources"]
    found = next((Path(source["path"]) for source in sources if source["provider"] == "command-line"), None)
    if found is None:
        return ["epuckhebb", verb, *job_overrides()]
    here = Path.cwd()
    folder = found.relative_to(here) if found.is_relative_to(here) else found
    return ["epuckhebb", verb, *job_overrides(), "--config-dir", str(folder)]


def in_multirun() -> bool:
    """Whether this job is one of many."""
    return bool(HydraConfig.get().mode == RunMode.MULTIRUN)


def threads_of_job(asked: int) -> int:
    """Threads of this job; jobs of a parallel launcher get one each unless told otherwise, and never more than fit."""
    launcher = HydraConfig.get().launcher
    if not in_multirun() or launcher._target_.endswith("BasicLauncher"):
        return thread_count(asked)
    if _is_joblib(launcher):
        cores = thread_count(0)
        width = launcher.n_jobs if launcher.n_jobs > 0 else max(1, cores + 1 + launcher.n_jobs)
        return int(max(1, min(asked, cores // width)))
    return max(1, asked)


def _is_joblib(launcher: DictConfig) -> bool:
    return str(launcher._target_).endswith("JoblibLauncher")


class _WithoutHydrasWords:
    """Standard error without what Hydra says before it raises what a job raised, which is told once, by us."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        return len(text) if text.startswith(_HYDRAS_WORDS) else self._stream.write(text)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)


@contextmanager
def _as_command_line(verb: str, arguments: list[str], stamp: str) -> Iterator[None]:
    """What Hydra reads: the argument list, and a wish to have errors raised instead of printed."""
    told = {_STAMP: stamp, "HYDRA_FULL_ERROR": "1"}
    argv, environment = sys.argv, {name: os.environ.get(name) for name in told}
    sys.argv = [f"epuckhebb {verb}", *arguments]
    os.environ.update(told)
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
def _workers_that_end_with_us() -> Iterator[None]:
    """Have each worker of joblib's watch, before its first job, whether this process is there: launchers cannot.

    A worker that waits for a job would wait for five minutes more, and hold the terminal's pipe.
    """
    from joblib.parallel import BACKENDS, register_parallel_backend

    loky = BACKENDS["loky"]
    register_parallel_backend("loky", functools.partial(loky, initializer=end_with, initargs=(os.getpid(),)))
    try:
        yield
    finally:
        register_parallel_backend("loky", loky)
