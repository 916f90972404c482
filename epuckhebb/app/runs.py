"""One run folder: claim it, write into it, close it, read it back.

A run of its own belongs to the process that could create its `status.json`, and is never merged or overwritten. A
folder in which work goes on, an evolution that is resumed or a study, belongs to the process that holds its lock.
Files are written beside their place and renamed, so that a file that is there is whole.
"""

import errno
import hashlib
import json
import os
import platform
import re
import shutil
import subprocess
import traceback
from collections.abc import Callable, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import version
from pathlib import Path
from types import TracebackType
from typing import Any

import pandas as pd
from filelock import BaseFileLock, FileLock, Timeout
from omegaconf import DictConfig, OmegaConf

from epuckhebb import __version__
from epuckhebb.app import errors, formats, machine
from epuckhebb.app.data import LATEST
from epuckhebb.app.errors import ConfigError, JobFailedError
from epuckhebb.app.formats import Columns, Provenance, Status, record

SCHEMA = 1  # of provenance.json and status.json
UNFINISHED = "unfinished"  # folder of a study, in which each attempt at a run has a folder of its own
_PACKAGE = Path(__file__).resolve().parents[1]
NUMERIC = ("cmaes", "numba", "numpy", "pymunk")  # the packages on which digits may depend
_PACKAGES = ("epuckhebb", "cmaes", "pymunk", "numpy", "numba", "pandas", "hydra-core", "typer", "matplotlib")
_STATUS, _PROVENANCE = "status.json", "provenance.json"
_LOCK = ".epuckhebb.lock"  # there while a process is at work in the folder, or after one that was killed
_PATIENCE_S = 1.0  # with who holds a folder for the moment in which it is looked whether it is held
_OVERRIDES, CONFIG = ".hydra/overrides.yaml", ".hydra/config.yaml"
_HALF = re.compile(r"\..+\.\d+\.tmp")  # what `write_whole` writes beside a file
_ATTEMPT = re.compile(r"\d{8}-\d{6}-[0-9a-f]{8}_\d+|stop")  # what `engine.launch` leaves in `unfinished/`
_RESULTS = (".csv", "champion.npz")  # how the names of files end on which other runs and tables rely
_NOUN = {"evaluate": "run", "evolve": "run", "reproduce": "reproduction"}


def write_whole(target: Path, content: bytes, *, lasting: bool = True) -> None:
    """Write a file and its folder: whole, or not at all.

    Args:
        target: The file.
        content: What it is to hold.
        lasting: Whether to wait until it would outlast a power failure.
    """
    target.parent.mkdir(parents=True, exist_ok=True)
    beside = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    try:
        with beside.open("wb") as file:
            file.write(content)
            if lasting:
                file.flush()
                os.fsync(file.fileno())
        beside.replace(target)
    except OSError:  # a full disk, for example
        beside.unlink(missing_ok=True)
        raise


def hold(folder: Path, patience_s: float = 0.0) -> BaseFileLock | None:
    """Keep other processes of this program out of a folder; give the result to `release`, or just end.

    The system lets go of a folder when the process ends, however it ends. None comes back where the file system knows
    no such locks; then nothing is kept out.

    Args:
        folder: The folder.
        patience_s: For how long to try while another process holds it; one may just be looking.

    Raises:
        BlockingIOError: Another process holds it.
        FileNotFoundError: There is no such folder.
        PermissionError: It cannot be written to.
    """
    lock = FileLock(folder / _LOCK, timeout=patience_s, thread_local=False, fallback_to_soft=False)
    try:
        lock.acquire()
    except Timeout:
        raise BlockingIOError(errno.EWOULDBLOCK, "another process is at work in it", str(folder)) from None
    except (FileNotFoundError, PermissionError):
        raise
    except OSError:  # some network file systems
        return None
    return lock


def release(held: BaseFileLock | None) -> None:
    """Let others in."""
    if held is not None:
        with suppress(OSError):  # Windows removes it itself, once nobody has it open
            Path(held.lock_file).unlink()  # first: who has just opened it sees that it is gone, and does not hold it
        held.release()


def is_held(folder: Path) -> bool:
    """Whether a process is at work in a folder; yes, where that cannot be known. Looking leaves nothing there."""
    if not (folder / _LOCK).exists():
        return False
    try:
        held = hold(folder)
    except OSError:
        return True
    release(held)
    return held is None


class RunFolder:
    """A folder that this process owns; as a context manager it says in `status.json` how the work in it ended.

    Attributes:
        path: The folder.
        command: The command that works in it.
        failure: Why the work failed although no error left the block; nothing if it did not.
        left_behind: A function that says what an interruption would leave behind, for who interrupts.
        advanced: A function that is told how far the work at hand is, from 0 to 1 and in words, for who watches.
    """

    def __init__(self, path: Path, held: BaseFileLock | None, told: dict[str, Any]) -> None:
        """Take what `new` or `going_on` has claimed; `told` is the provenance of this call."""
        self.path, self.command, self.failure = path, list(told["command"]), ""
        self.left_behind: Callable[[], str] = lambda: ""
        self.advanced: Callable[[float, str], None] = lambda *_: None
        self._held, self._started = held, _now()
        self._kept: dict[str, str] = {}  # name -> SHA-256 of the results on which a later call relies
        self._written: dict[str, str] = {}  # the same of all files written

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
        try:
            with suppress(BlockingIOError):  # the claim is what counts
                run._held = hold(path, _PATIENCE_S)
            run._begin(told, cfg, arguments)
        except OSError as error:
            for name in (_STATUS, _OVERRIDES, CONFIG, _PROVENANCE):
                (path / name).unlink(missing_ok=True)
            with suppress(OSError):
                (path / ".hydra").rmdir()
            release(run._held)
            raise ConfigError(f"cannot write a run to {path}: {error.strerror}") from error
        return run

    @classmethod
    def going_on(
        cls,
        path: Path,
        verb: str,
        cfg: DictConfig | None,
        arguments: list[str],
        facts: dict[str, Any],
        results: Sequence[Path] = (),
    ) -> "RunFolder":
        """Go on with what was begun in a folder, or begin it there; one process at a time.

        What killed processes have left half done is thrown away. The arguments are those of `new`, but that there is
        no `cfg` where each job has its own; `results` are files of earlier calls that stay. If the work was begun
        before, `provenance.json` keeps what it said and gets an entry with these facts.

        Raises:
            ConfigError: Another process is at work in the folder, or it cannot be written to.
        """
        told = provenance(verb, cfg, arguments) | facts
        try:
            path.mkdir(parents=True, exist_ok=True)
            _refuse_foreign(path, verb)
            held = hold(path, _PATIENCE_S)
        except BlockingIOError:
            raise ConfigError(f"another process is working on {path}; wait for it or stop it") from None
        except OSError as error:
            raise ConfigError(f"cannot write a {_NOUN.get(verb, verb)} to {path}: {error.strerror}") from error
        run = cls(path, held, told)
        with suppress(ConfigError):  # it cannot be read back where nothing has begun
            before = read(path)
            status = before.pop("status")
            run._started = status.get("started", run._started)
            names = {result.relative_to(path).as_posix() for result in results}
            run._kept = {name: sha256 for name, sha256 in status.get("sha256", {}).items() if name in names}
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
        """Write a file in the folder: whole, or not at all; keep what its content was, but for `status.json` itself."""
        written = content.encode() if isinstance(content, str) else content
        self._written.pop(name, None)  # while it is being replaced, nothing is known of it
        write_whole(self.path / name, written)
        if name != _STATUS:
            self._written[name] = hashlib.sha256(written).hexdigest()

    def keep(self, name: str, content: bytes) -> None:
        """Write a result on which a later call relies; what it must be is known before it is there."""
        self._kept[name] = hashlib.sha256(content).hexdigest()
        self._write_status("running", sha256=self._kept)
        self.write(name, content)

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
                try:
                    self._close("failed" if self.failure else "finished", error=self.failure)
                except OSError as full:
                    raise JobFailedError(f"{self.path / _STATUS} cannot be written: {full.strerror}") from full
            elif errors.is_interruption(error):
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
        self._write_status("running", sha256=self._kept)
        if overrides is not None:
            self.write(_OVERRIDES, OmegaConf.to_yaml(OmegaConf.create(overrides)))
        if cfg is not None:
            self.write(CONFIG, OmegaConf.to_yaml(cfg, resolve=True))
        self.write(_PROVENANCE, as_json(told))

    def _interrupted(self) -> str:
        """Close the folder as interrupted, if that can be written; returns what is left behind."""
        told = self.left_behind()
        with suppress(OSError):
            self._close("interrupted", error=told)
        return told

    def _close(self, state: str, **more: str) -> None:
        told = {key: value for key, value in more.items() if value}
        self._write_status(state, finished=_now(), **told, sha256=self._kept | self._written)

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
    return name in (_STATUS, _PROVENANCE, _LOCK, ".hydra") or _HALF.fullmatch(name) is not None


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
        with suppress(FileNotFoundError):  # it has just been finished
            if not is_held(attempt):
                shutil.rmtree(attempt)


def below_runs() -> list[Path]:
    """All folders below `runs/` in which this program has worked, the one of the last call last.

    Runs of a multirun come one by one, the jobs of a sweep or a reproduction only as a whole.
    """
    found = [status for pattern in ("*/*", "*/*_multirun/*") for status in Path("runs").glob(f"{pattern}/{_STATUS}")]
    return [status.parent for status in sorted(found, key=lambda status: (status.stat().st_mtime_ns, status))]


def of_multirun(path: Path) -> list[Path]:
    """The runs in the folder of a multirun, in the order of its jobs; none if it is the folder of something else."""
    if (path / _STATUS).exists():
        return []
    inside = [status.parent for status in path.glob(f"*/{_STATUS}")]
    return sorted(inside, key=lambda run: (not run.name.isdigit(), int(run.name) if run.name.isdigit() else 0, run))


def found(what: str | Path, *verbs: str) -> Path:
    """The folder of a run that a user names, or the latest one of these verbs (none: of any) if it is `latest`.

    Raises:
        ConfigError: There is none yet.
    """
    if str(what) != LATEST:
        return Path(what)
    of_verbs = [path for path in below_runs() if not verbs or path.relative_to("runs").parts[0] in verbs]
    if not of_verbs:
        whose = f" of `epuckhebb {'` or `epuckhebb '.join(verbs)}`" if verbs else ""
        raise ConfigError(f"{LATEST}: there is no run{whose} in {Path('runs').absolute()} yet; give a run folder")
    return of_verbs[-1]


def read(path: Path) -> dict[str, Any]:
    """Provenance and status of a run folder, as one dictionary.

    Raises:
        ConfigError: It is not a run folder, or one of the two is damaged.
    """
    if not path.is_dir():
        raise ConfigError(f"{path} is not a folder; give a run folder, for example one below runs/evaluate/")
    inside = next(path.glob(f"*/{_STATUS}"), None)
    if inside is not None and not (path / _STATUS).exists():
        raise ConfigError(f"{path} is a folder with runs in it; give one of them, for example {inside.parent}")
    for name in (_PROVENANCE, _STATUS):
        if not (path / name).is_file():
            raise ConfigError(f"{path} is not a run folder: it has no {name}")
    status = record(_bytes(path / _STATUS), path / _STATUS, Status)
    told = record(content(path, _PROVENANCE), path / _PROVENANCE, Provenance)
    missing = {"genome", "genome_sha256"} - told.keys() if told["verb"] == "evaluate" else None
    if missing:
        raise ConfigError(f"{path / _PROVENANCE} cannot be used: it has no {min(missing)}")
    if status["state"] == "running" and not is_held(path):
        status |= {"state": "interrupted", "error": "its process ended without a word"}
    return {**told, "status": status}


def status_of(path: Path) -> dict[str, Any]:
    """What a run says of its state; nothing if it cannot be read."""
    try:
        return {**record(_bytes(path / _STATUS), path / _STATUS, Status)}
    except ConfigError:
        return {}


def content(run: Path, name: str) -> bytes:
    """The content of a file of a run, which must be what the run wrote as far as its `status.json` tells.

    Raises:
        ConfigError: It cannot be read, or was changed since.
    """
    found = _bytes(run / name)
    sha256 = hashlib.sha256(found).hexdigest()
    if status_of(run).get("sha256", {}).get(name, sha256) != sha256:
        raise ConfigError(
            f"{run / name} is not what this run wrote (its SHA-256 differs); put it back as it was, or run it again"
        )
    return found


def table(run: Path, name: str, columns: Columns, *, rows: bool = True) -> pd.DataFrame:
    """A table of a run; see `content` and `formats.table`."""
    return formats.table(content(run, name), run / name, columns, rows=rows)


def has(run: Path, name: str) -> bool:
    """Whether a file of a run is there, or should be: then who reads it tells that it was lost."""
    return (run / name).is_file() or name in status_of(run).get("sha256", {})


def is_as_written(run: Path, name: str) -> bool:
    """Whether a file of a run is there and, as far as is known, what the run wrote."""
    try:
        content(run, name)
    except ConfigError:
        return False
    return True


def is_whole(path: Path) -> bool:
    """Whether a run is finished and its results are what they were when it was: not cut, changed or lost since."""
    status = status_of(path)
    try:
        return status.get("state") == "finished" and all(
            hashlib.sha256((path / name).read_bytes()).hexdigest() == sha256
            for name, sha256 in status.get("sha256", {}).items()
            if name.endswith(_RESULTS)
        )
    except OSError:
        return False


def _bytes(file: Path) -> bytes:
    try:
        return file.read_bytes()
    except OSError as error:
        raise ConfigError(f"{file} cannot be read: {error.strerror}") from error


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
        "cores": machine.cores(),
    }


def _code_version() -> dict[str, Any]:
    """The version of this program and of its science, and its git commit where it runs from a checkout."""

    def git(*words: str) -> str | None:
        command = ["git", "-C", str(_PACKAGE), *words]
        try:
            done = subprocess.run(command, capture_output=True, timeout=5, check=True)
        except (OSError, subprocess.SubprocessError):
            return None
        return done.stdout.decode(errors="replace").strip()

    known: dict[str, Any] = {"version": __version__, "science": science_version(), "commit": None, "dirty": None}
    if git("ls-files", "--error-unmatch", "__init__.py") is not None:
        known["commit"] = git("rev-parse", "HEAD")
        known["dirty"] = bool(git("status", "--porcelain", "--", str(_PACKAGE)))
    return known


@cache
def versions(packages: tuple[str, ...]) -> dict[str, str]:
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
