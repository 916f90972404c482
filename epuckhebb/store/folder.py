"""A run folder from its start to its end: made, claimed and locked (`lock.py`), written, closed."""

import shutil
import traceback
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from secrets import token_hex
from types import TracebackType
from typing import TYPE_CHECKING, Any, Union

from filelock import BaseFileLock

from epuckhebb.analysis.tables import Rows
from epuckhebb.runtime import (
    ConfigError,
    JobFailedError,
    is_interruption,
    is_of_handler,
    open_folders,
    reason_of_failure,
    say,
    yaml_file,
)
from epuckhebb.store import disk
from epuckhebb.store.disk import CONFIG, MULTIRUN, OVERRIDES, PROVENANCE, SCHEMA, STATUS, as_json
from epuckhebb.store.lock import LOCK, PATIENCE_S, claim, is_locked, lock, release
from epuckhebb.store.provenance import compare_machines, provenance
from epuckhebb.store.rows import as_csv
from epuckhebb.store.run import Run, multirun_runs

if TYPE_CHECKING:
    import pandas as pd

    from epuckhebb.config import OwnFile

Code = Mapping[Path, "OwnFile"] | None  # the user's own Python, by path
Content = Union[bytes, str, Rows, "pd.DataFrame"]  # of a file; rows and tables become CSV
UNFINISHED = "unfinished"  # folder of a study, with a folder for each attempt at a run
SET_ASIDE = "set_aside"  # folder of a study for what was in the way, or holds a user's files


class RunFolder:
    """A folder that this process owns; as a context manager it writes to `status.json` how the work ended.

    Attributes:
        path: The folder.
        command_line: The command that works in it.
        failure: Why the work failed although no error left the block; "" if it did not.
        left_behind: A function that says what an interruption would leave behind.
    """

    def __init__(self, path: Path, held: BaseFileLock | None, facts: dict[str, Any]) -> None:
        """Own what `new` or `resume` has claimed; `facts` is the provenance of this call."""
        self.path = path.absolute()  # a part of the user's may go elsewhere
        self.command_line, self.failure = list(facts["command_line"]), ""
        self.left_behind: Callable[[], str] = lambda: ""
        self._lock, self._started = held, _timestamp()
        self._written: dict[str, str] = {}  # name -> SHA-256 of the files written
        self._earlier: dict[str, str] = {}  # the same for files that an earlier call wrote, and this one not yet

    @classmethod
    def new(
        cls, path: Path, command: str, config: str, arguments: list[str], facts: dict[str, Any], code: Code = None
    ) -> "RunFolder":
        """Claim a folder that holds no run yet, and write down what is about to run.

        path: the folder, which is made. command, arguments: of the command line. config: the configuration as YAML.
        facts: what else belongs into `provenance.json`, for example the SHA-256 of the genome. code: the user's files,
        which the folder keeps as copies.
        """
        content = provenance(command, arguments) | _user_code(code) | facts
        run = cls(path, None, content)
        with _convert_folder_errors(path):
            path.mkdir(parents=True, exist_ok=True)
            if not (path / STATUS).exists():
                _refuse_foreign(path)
            claim(path)
            try:
                with suppress(BlockingIOError):  # the claim is what counts
                    run._lock = lock(path, PATIENCE_S)
                run._begin(content, config, arguments, code)
            except OSError:
                for name in (STATUS, *run._written):
                    (path / name).unlink(missing_ok=True)
                release(run._lock)
                raise
        return run

    @classmethod
    def resume(
        cls,
        path: Path,
        command: str,
        config: str | None,
        arguments: list[str],
        facts: dict[str, Any],
        code: Code = None,
        *,
        overrides: list[str] | None = None,
    ) -> "RunFolder":
        """Resume the work in a folder, or begin it there; one process at a time.

        What killed processes have left half done is removed. If the work was begun before, `provenance.json` keeps its
        content and gets an entry with those of the facts that are others now. The arguments are those of `new`, with
        `config` None where each job has its own. overrides: to be kept in a file, if any.
        """
        content, previous = provenance(command, arguments) | _user_code(code) | facts, Run(path)
        run = cls(path, None, content)
        with _convert_folder_errors(path):
            path.mkdir(parents=True, exist_ok=True)
            _refuse_foreign(path, command)
            run._lock = lock(path, PATIENCE_S)
            with suppress(ConfigError):  # nothing can be read where nothing has begun
                earlier, status = previous.provenance, previous.status
                compare_machines(path, earlier)
                run._started = status.get("started", run._started)
                run._earlier = dict(status.get("sha256", {}))
                changed = {key: fact for key, fact in facts.items() if earlier.get(key) != fact}
                again = {
                    "started": _timestamp(),
                    "command_line": content["command_line"],
                    **changed,
                    "code": content["code"],
                }
                content = {**earlier, "resumed": [*earlier.get("resumed", []), again]}
            try:
                _remove_half_done(path)
                run._begin(content, config, overrides, code)
            except OSError:
                release(run._lock)
                raise
        return run

    def write(self, name: str, content: Content) -> None:
        """Write a file in the folder: whole, or not at all; keep the SHA-256 of its content. A table becomes CSV."""
        content = as_bytes(content)
        self._written.pop(name, None)  # nothing is known of a file while it is replaced
        if self._earlier.pop(name, None) is not None:
            self._write_status("running")  # first without the checksum, as a process may be killed in between
        disk.write_atomic(self.path / name, content)
        if name != STATUS:
            self._written[name] = disk.hash_bytes(content)

    def remove_stale(self) -> None:
        """Remove what an earlier call wrote and this one did not; a file that was changed since is set aside."""
        while self._earlier:
            name, sha256 = self._earlier.popitem()
            file = self.path / name
            if file.is_file() and disk.hash_bytes(file.read_bytes()) == sha256:
                file.unlink()
            elif file.exists():
                set_aside(file, self.path, "is of an earlier call and was changed since")

    def __enter__(self) -> "RunFolder":
        """The folder itself."""
        open_folders.append(self._interrupted)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Write whether the work finished, was interrupted or failed; raise the error for the user."""
        open_folders.remove(self._interrupted)
        try:
            if error is None:
                try:
                    self._write_status("failed" if self.failure else "finished", error=self.failure)
                except OSError as full:
                    raise JobFailedError(f"{self.path / STATUS} cannot be written: {full.strerror}") from full
            elif is_interruption(error):
                raise KeyboardInterrupt(self._interrupted()) from None
            elif is_of_handler(error):
                self._interrupted()  # the launcher has asked for it, and must hear of it
            elif isinstance(error, Exception | SystemExit):  # a user's own part may even leave Python
                reason, text = reason_of_failure(error), "".join(traceback.format_exception(error))
                with suppress(OSError):  # on a full disk the error itself matters
                    self._write_status("failed", error=reason, traceback=text)
                if not isinstance(error, (ConfigError, JobFailedError)):
                    raise JobFailedError(f"{self.path}: {reason}") from error
        finally:
            release(self._lock)

    def _begin(self, facts: dict[str, Any], config: str | None, overrides: list[str] | None, code: Code) -> None:
        """Write down what runs here: its state first, and `provenance.json`, by which a run is known, after that."""
        self._write_status("running")
        if overrides is not None:
            self.write(OVERRIDES, yaml_file.dump(overrides))
        if config is not None:
            self.write(CONFIG, config)
        self.write(PROVENANCE, as_json(facts))
        for file in (code or {}).values():
            for name, content in file.copies.items():
                self.write(name, content)

    def _interrupted(self) -> str:
        """Close the folder as interrupted, if that can be written; returns what is left behind."""
        left = self.left_behind()
        with suppress(OSError):
            self._write_status("interrupted", error=left)
        return left

    def _write_status(self, state: str, **more: str) -> None:
        """Write `status.json`: the state, the times, and the SHA-256 of the files of an ended run."""
        sha256, status = dict(self._earlier), {"schema": SCHEMA, "state": state, "started": self._started}
        if state != "running":
            sha256 |= self._written
            status |= {"finished": _timestamp()} | {key: value for key, value in more.items() if value}
        self.write(STATUS, as_json(status | {"sha256": sha256}))


def as_bytes(content: Content) -> bytes:
    """The content of a file; a table as CSV, with nothing in cells without a value."""
    if isinstance(content, list):
        return as_csv(content).encode()
    if not isinstance(content, bytes | str):
        content = str(content.to_csv(index=False, lineterminator="\n"))
    return content.encode() if isinstance(content, str) else content


def _user_code(code: Code) -> dict[str, Any]:
    """What `provenance.json` says of the user's files; nothing if there are none."""
    copies = {str(path): {"copy": file.copy, "sha256": file.sha256} for path, file in (code or {}).items()}
    return {"own_code": copies} if copies else {}


@contextmanager
def _convert_folder_errors(path: Path) -> Iterator[None]:
    """Say in one message that a folder cannot be written to, or that another process works in it."""
    try:
        yield
    except BlockingIOError:
        raise ConfigError(f"another process is working on {path}; wait for it or stop it") from None
    except OSError as error:
        link = next((folder for folder in (path, *path.parents) if folder.is_symlink() and not folder.exists()), None)
        why = f"{link} is a link to {link.readlink()}, which is missing" if link else error.strerror
        raise ConfigError(f"cannot write to {path}: {why}") from error


def _refuse_foreign(path: Path, command: str | None = None) -> None:
    """Refuse a folder with files that are not of this program, or not of a command, if one is given."""
    begun = (STATUS, PROVENANCE, LOCK, ".hydra", MULTIRUN)  # the first files in a folder of this program
    foreign = [file.name for file in path.iterdir() if file.name not in begun and file.suffix != ".tmp"]
    if not foreign:
        return
    with suppress(ConfigError):  # without provenance nothing has begun here
        if Run(path).provenance["command"] == command:
            return
    raise ConfigError(f"{path} holds other files ({min(foreign)}, ...); give a folder that is new or empty")


def _remove_half_done(path: Path) -> None:
    """Remove what killed processes left half done; attempts that still run stay."""
    for half in path.rglob(".*.tmp"):
        if not {UNFINISHED, SET_ASIDE} & {*half.relative_to(path).parts}:
            half.unlink(missing_ok=True)
    for attempt in (path / UNFINISHED).glob("*"):
        with suppress(FileNotFoundError):  # it has just been finished
            if not attempt.is_dir():
                attempt.unlink()
            elif not is_locked(attempt):
                shutil.rmtree(attempt)


def set_aside(entry: Path, study: Path, why: str) -> None:
    """Move a file or folder out of the way of a study, whole, and report where it is now."""
    target = study / SET_ASIDE / f"{entry.name}_{datetime.now():%Y%m%d-%H%M%S}-{token_hex(4)}"
    target.parent.mkdir(exist_ok=True)
    entry.rename(target)
    say(f"{entry} {why}; nothing in it was deleted, it is now {target}")


def check_multirun_folder(path: Path) -> None:
    """Refuse a folder for a multirun that holds anything but what an earlier one left."""
    if path.is_dir() and not (path / MULTIRUN).is_file() and not multirun_runs(path):
        _refuse_foreign(path)


def _timestamp() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")
