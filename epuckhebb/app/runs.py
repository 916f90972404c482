"""One run folder: claim it, write into it, close it, read it back.

A run of its own belongs to the process that could create its `status.json`, and is never merged or overwritten. A
folder in which work goes on, an evolution that is resumed or a study, belongs to the process that holds its lock.
Files are written beside their place and renamed, so that a file that is there is whole.
"""

import hashlib
import json
import os
import platform
import re
import shutil
import subprocess
import sys
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from pathlib import Path
from types import TracebackType
from typing import Any

from omegaconf import DictConfig, OmegaConf

from epuckhebb import __version__
from epuckhebb.app import errors
from epuckhebb.app.errors import ConfigError, JobFailedError

SCHEMA = 1  # of provenance.json and status.json
UNFINISHED = "unfinished"  # folder of a study, in which each attempt at a run has a folder of its own
_PACKAGE = Path(__file__).resolve().parents[1]
NUMERIC = ("cmaes", "numba", "numpy", "pymunk")  # the packages on which digits may depend
_PACKAGES = ("epuckhebb", "cmaes", "pymunk", "numpy", "numba", "pandas", "hydra-core", "typer", "matplotlib")
_STATUS, _PROVENANCE = "status.json", "provenance.json"
_OVERRIDES, _CONFIG = ".hydra/overrides.yaml", ".hydra/config.yaml"
_HALF = re.compile(r"\..+\.\d+\.tmp")  # what `write_whole` writes beside a file
_ATTEMPT = re.compile(r"\d{8}-\d{6}-[0-9a-f]{8}_\d+|stop")  # what `engine.launch` leaves in `unfinished/`
_NOUN = {"evaluate": "run", "evolve": "run", "reproduce": "reproduction"}


def write_whole(target: Path, content: bytes) -> None:
    """Write a file and its folder: whole, or not at all."""
    target.parent.mkdir(parents=True, exist_ok=True)
    beside = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    try:
        with beside.open("wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        beside.replace(target)
    except OSError:  # a full disk, for example
        beside.unlink(missing_ok=True)
        raise


def hold(folder: Path) -> int | None:
    """Keep other processes of this program out of a folder; give the result to `release`, or just end.

    The system lets go of a folder when the process ends, however it ends. None comes back where the file system or
    the operating system knows no such locks; then nothing is kept out.

    Raises:
        BlockingIOError: Another process holds it.
    """
    if sys.platform == "win32":
        return None
    import fcntl

    descriptor = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise
    except OSError:  # some network file systems
        os.close(descriptor)
        return None
    return descriptor


def release(held: int | None) -> None:
    """Let others in."""
    if held is not None:
        os.close(held)


class RunFolder:
    """A folder that this process owns; as a context manager it says in `status.json` how the work in it ended.

    Attributes:
        path: The folder.
        command: The command that works in it.
        failure: Why the work failed although no error left the block; nothing if it did not.
        left_behind: A function that says what an interruption would leave behind, for who interrupts.
    """

    def __init__(self, path: Path, held: int | None, told: dict[str, Any]) -> None:
        """Take what `new` or `going_on` has claimed; `told` is the provenance of this call."""
        self.path, self.command, self.failure = path, list(told["command"]), ""
        self.left_behind: Callable[[], str] = lambda: ""
        self._held, self._started = held, _now()
        self._tables: dict[str, str] = {}  # name -> SHA-256 of the tables written

    @classmethod
    def new(cls, path: Path, verb: str, cfg: DictConfig, arguments: list[str], facts: dict[str, Any]) -> "RunFolder":
        """Claim a folder that holds no run yet, and write down what is about to run.

        Args:
            path: The folder; it is made.
            verb: The verb of the command line.
            cfg: The configuration.
            arguments: What followed the verb.
            facts: What else belongs into `provenance.json`, for example the genome's SHA-256.

        Raises:
            ConfigError: The folder holds a run already, or cannot be written to.
        """
        try:
            path.mkdir(parents=True, exist_ok=True)
            if not (path / _STATUS).exists():
                _refuse_foreign(path)
            with (path / _STATUS).open("x"):
                pass
        except FileExistsError:
            raise ConfigError(
                f"{path} holds a run already; runs are never overwritten, choose another folder"
            ) from None
        except OSError as error:
            raise ConfigError(f"cannot write a run to {path}: {error.strerror}") from error
        told = provenance(verb, cfg, arguments) | facts
        run = cls(path, None, told)
        with suppress(BlockingIOError):  # someone is just looking whether we hold it; the claim is what counts
            run._held = hold(path)
        try:
            run._begin(told, cfg, arguments)
        except OSError as error:
            for name in (_STATUS, _OVERRIDES, _CONFIG, _PROVENANCE):
                (path / name).unlink(missing_ok=True)
            with suppress(OSError):
                (path / ".hydra").rmdir()
            release(run._held)
            raise ConfigError(f"cannot write a run to {path}: {error.strerror}") from error
        return run

    @classmethod
    def going_on(
        cls, path: Path, verb: str, cfg: DictConfig | None, arguments: list[str], facts: dict[str, Any]
    ) -> "RunFolder":
        """Go on with what was begun in a folder, or begin it there; one process at a time.

        What killed processes have left half done is thrown away. The arguments are those of `new`, but that there is
        no `cfg` where each job has its own. If the work was begun before, `provenance.json` keeps what it said and
        gets an entry with these facts.

        Raises:
            ConfigError: Another process is at work in the folder, or it cannot be written to.
        """
        told = provenance(verb, cfg, arguments) | facts
        try:
            path.mkdir(parents=True, exist_ok=True)
            _refuse_foreign(path, verb)
            held = hold(path)
        except BlockingIOError:
            raise ConfigError(f"another process is working on {path}; wait for it or stop it") from None
        except OSError as error:
            raise ConfigError(f"cannot write a {_NOUN.get(verb, verb)} to {path}: {error.strerror}") from error
        run = cls(path, held, told)
        with suppress(ConfigError):  # it cannot be read back where nothing has begun
            before = read(path)
            run._started = before.pop("status").get("started", run._started)
            again = {"started": _now(), "command": told["command"], **facts, "code": told["code"]}
            told = before | {"resumed": [*before.get("resumed", []), again]}
        try:
            _throw_away(path)
            run._begin(told, cfg, None)
        except OSError as error:
            release(held)
            raise ConfigError(f"cannot go on in {path}: {error.strerror}") from error
        return run

    def write(self, name: str, content: bytes | str) -> None:
        """Write a file in the folder: whole, or not at all; of a table, keep what its content was."""
        written = content.encode() if isinstance(content, str) else content
        write_whole(self.path / name, written)
        if name.endswith(".csv"):
            self._tables[name] = hashlib.sha256(written).hexdigest()

    def __enter__(self) -> "RunFolder":
        """The folder itself."""
        errors.at_work.append(self._interrupted)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Write whether the work finished, was interrupted or failed.

        Raises:
            JobFailedError: It failed; `status.json` has the whole traceback.
            KeyboardInterrupt: It was interrupted; the message says what is left behind.
        """
        errors.at_work.remove(self._interrupted)
        try:
            if error is None:
                self._close("failed" if self.failure else "finished", error=self.failure)
            elif isinstance(error, KeyboardInterrupt):
                raise KeyboardInterrupt(self._interrupted()) from None
            elif isinstance(error, Exception):
                with suppress(OSError):  # on a full disk the error itself is what there is to tell
                    self._close("failed", error=str(error), traceback="".join(traceback.format_exception(error)))
                if not isinstance(error, (ConfigError, JobFailedError)):
                    raise JobFailedError(f"{self.path}: {type(error).__name__}: {error}") from error
        finally:
            release(self._held)

    def _begin(self, told: dict[str, Any], cfg: DictConfig | None, overrides: list[str] | None) -> None:
        """Write down what runs here: its state first, and last the file by which a run that has begun is known."""
        self._write_status("running")
        if overrides is not None:
            self.write(_OVERRIDES, OmegaConf.to_yaml(OmegaConf.create(overrides)))
        if cfg is not None:
            self.write(_CONFIG, OmegaConf.to_yaml(cfg, resolve=True))
        self.write(_PROVENANCE, as_json(told))

    def _interrupted(self) -> str:
        """Close the folder as interrupted, if that can be written; returns what is left behind."""
        told = self.left_behind()
        with suppress(OSError):
            self._close("interrupted", error=told)
        return told

    def _close(self, state: str, **more: str) -> None:
        told = {key: value for key, value in more.items() if value}
        self._write_status(state, finished=_now(), **told, tables=self._tables)

    def _write_status(self, state: str, **more: Any) -> None:
        self.write(_STATUS, as_json({"schema": SCHEMA, "state": state, "started": self._started, **more}))


def _refuse_foreign(path: Path, verb: str | None = None) -> None:
    """Refuse a folder with anything in it that is not of this program; of a verb, if one is given.

    Raises:
        ConfigError: Somebody else's files are in it, or a run of another verb.
    """
    foreign = sorted(entry.name for entry in path.iterdir() if not _is_begun(entry.name))
    if not foreign:
        return
    whose = None
    with suppress(ConfigError):
        whose = read(path).get("verb")
    if verb is None or whose != verb:
        what = f"a run of `epuckhebb {whose}`" if whose else f"files that are not of this program ({foreign[0]}, ...)"
        raise ConfigError(f"{path} holds {what}; nothing there is touched. Give a folder that is new or empty")


def _is_begun(name: str) -> bool:
    """Whether a file is one of those with which a folder of this program begins, whole or half written."""
    return name in (_STATUS, _PROVENANCE, ".hydra") or _HALF.fullmatch(name) is not None


def _throw_away(path: Path) -> None:
    """Remove what was left half done by processes that were killed, but for runs that are still at work.

    Only what bears a name of ours is removed.
    """
    for half in path.rglob(".*.tmp"):
        if UNFINISHED not in half.relative_to(path).parts and _HALF.fullmatch(half.name):
            half.unlink(missing_ok=True)
    for attempt in (path / UNFINISHED).glob("*"):
        if not _ATTEMPT.fullmatch(attempt.name):
            continue
        if not attempt.is_dir():
            attempt.unlink()
            continue
        with suppress(BlockingIOError, FileNotFoundError):  # it is at work; it has just been finished
            release(hold(attempt))
            shutil.rmtree(attempt)


def read(path: Path) -> dict[str, Any]:
    """Provenance and status of a run folder, as one dictionary.

    Raises:
        ConfigError: It is not a run folder.
    """
    if not path.is_dir():
        raise ConfigError(f"{path} is not a folder; give a run folder, for example one below runs/evaluate/")
    try:
        told = json.loads((path / _PROVENANCE).read_text())
        status = json.loads((path / _STATUS).read_text())
    except (OSError, ValueError) as error:
        raise ConfigError(
            f"{path} is not a run folder: it has no readable provenance.json and status.json ({error})"
        ) from error
    return {**told, "status": status}


def status_of(path: Path) -> dict[str, Any]:
    """What a run says of its state; nothing if it cannot be read."""
    try:
        return dict(json.loads((path / _STATUS).read_text()))
    except (OSError, ValueError):
        return {}


def is_whole(path: Path) -> bool:
    """Whether a run is finished and its tables are what they were when it was: not cut, changed or lost since."""
    status = status_of(path)
    try:
        return status.get("state") == "finished" and all(
            hashlib.sha256((path / name).read_bytes()).hexdigest() == sha256
            for name, sha256 in status.get("tables", {}).items()
        )
    except (OSError, AttributeError):
        return False


def provenance(verb: str, cfg: DictConfig | None, arguments: list[str]) -> dict[str, Any]:
    """Who ran what, with what, where."""
    return {
        "schema": SCHEMA,
        "verb": verb,
        "command": ["epuckhebb", verb, *arguments],
        "overrides": arguments,
        **({} if cfg is None else {"seed": cfg.seed}),
        "code": _code_version(),
        "packages": versions(_PACKAGES),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "cores": os.cpu_count(),
    }


def _code_version() -> dict[str, Any]:
    """The version of this program and of its science, and its git commit where it runs from a checkout."""

    def git(*words: str) -> str | None:
        command = ["git", "-C", str(_PACKAGE), *words]
        try:
            return subprocess.run(command, capture_output=True, text=True, timeout=5, check=True).stdout.strip()
        except (OSError, subprocess.SubprocessError):
            return None

    known: dict[str, Any] = {"version": __version__, "science": science_version(), "commit": None, "dirty": None}
    if git("ls-files", "--error-unmatch", "__init__.py") is not None:
        known["commit"] = git("rev-parse", "HEAD")
        known["dirty"] = bool(git("status", "--porcelain", "--", str(_PACKAGE)))
    return known


def versions(packages: Sequence[str]) -> dict[str, str]:
    """The versions of packages that are installed."""
    return {name: version(name) for name in packages}


@cache
def science_version() -> str:
    """A digest of the code that results depend on: the same science gives the same numbers."""
    sources = [file for layer in ("sim", "evolution") for file in sorted((_PACKAGE / layer).rglob("*.py"))]
    sources.append(_PACKAGE / "study" / "evaluate.py")
    return hashlib.sha256(b"\0".join(source.read_bytes() for source in sources)).hexdigest()[:16]


def as_json(content: dict[str, Any]) -> bytes:
    """The content of a JSON file."""
    return (json.dumps(content, indent=2) + "\n").encode()


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")
