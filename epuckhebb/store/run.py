"""Reads run folders: provenance, status, tables, and whether every file is as the run wrote it."""

import io
from contextlib import suppress
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from epuckhebb.analysis.tables import Rows
from epuckhebb.runtime import LATEST, ConfigError
from epuckhebb.store import disk
from epuckhebb.store.disk import CHECKPOINT, CONFIG, PROVENANCE, STATUS, hash_bytes, parse_json, read_bytes
from epuckhebb.store.lock import is_locked
from epuckhebb.store.rows import TEXTS, parse_csv

if TYPE_CHECKING:
    import pandas as pd

_RESULTS = (".csv", "champion.npz")  # endings of the files on which other runs and tables rely


class Run:
    """A run folder. Every property and method reads the files as they are now, but the recorded status once.

    What cannot be read raises `ConfigError`. Only `recorded_status`, `has` and `is_whole` answer in any case.
    """

    def __init__(self, path: Path) -> None:
        """Name a folder; nothing is read yet."""
        self.path = path

    @property
    def provenance(self) -> dict[str, Any]:
        """Who ran what, with what, where."""
        self._check_files()
        return self.json(PROVENANCE, "command", "command_line", "overrides", "code")

    @property
    def status(self) -> dict[str, Any]:
        """How the run goes, or ended; a run whose process is gone is interrupted."""
        self._check_files()
        status = parse_json(read_bytes(self.path / STATUS), self.path / STATUS, "state")
        if status["state"] == "running" and not is_locked(self.path):
            status |= {"state": "interrupted", "error": "its process ended unexpectedly"}
        return status

    @cached_property
    def recorded_status(self) -> dict[str, Any]:
        """The status that the run wrote down; nothing if it cannot be read."""
        return _json(self.path / STATUS)

    @property
    def config_file(self) -> Path:
        """The file with the resolved configuration, which is as the run wrote it."""
        self.content(CONFIG)
        return self.path / CONFIG

    def content(self, name: str) -> bytes:
        """The content of a file, which must be what the run wrote, as far as its status has its checksum."""
        content = read_bytes(self.path / name)
        if self._sha256.get(name, hash_bytes(content)) != hash_bytes(content):
            raise ConfigError(f"{self.path / name} is not what this run wrote (its SHA-256 differs); put it back")
        return content

    def json(self, name: str, *needed: str) -> dict[str, Any]:
        """The values of a JSON file, which has the needed keys."""
        return parse_json(self.content(name), self.path / name, *needed)

    def table(self, name: str) -> "pd.DataFrame":
        """A table, nan in cells without a value."""
        import pandas as pd  # takes a while to load

        with disk.convert_errors(f"{self.path / name} cannot be read as a table"):
            content = io.BytesIO(self.content(name))
            texts = dict.fromkeys(TEXTS, str)
            return pd.read_csv(content, keep_default_na=False, na_values=[""], dtype=texts, low_memory=False)

    def rows(self, name: str) -> Rows:
        """The rows of a table, None in cells without a value."""
        with disk.convert_errors(f"{self.path / name} cannot be read as a table"):
            return parse_csv(self.content(name).decode())

    def has(self, name: str) -> bool:
        """Whether a file is there, or should be: then reading it says that it was lost."""
        return (self.path / name).is_file() or name in self._sha256

    @property
    def is_whole(self) -> bool:
        """Whether the run is finished and its results are as they were then: not cut, changed or lost."""
        results = {name: sha256 for name, sha256 in self._sha256.items() if name.endswith(_RESULTS)}
        with suppress(OSError):
            whole = all(hash_bytes((self.path / name).read_bytes()) == sha256 for name, sha256 in results.items())
            return whole and self.recorded_status.get("state") == "finished"
        return False

    @property
    def unfinished(self) -> str:
        """Why no table may count this run, and how it goes on; nothing if it is finished and whole."""
        if self.is_whole:
            return ""
        state = self.recorded_status.get("state", "unknown")
        if state == "running" and not is_locked(self.path):
            state = "interrupted"
        is_evolution = state != "finished" and self.has(CHECKPOINT)
        how = f"; resume it with: epuckhebb evolve resume={self.path}" if is_evolution else ""
        return f"{self.path} is not a finished run with whole files, its state is {state}{how}"

    def _check_files(self) -> None:
        """Refuse what is no run folder."""
        for name in (PROVENANCE, STATUS):
            if not (self.path / name).is_file():
                raise ConfigError(f"{self.path} is not a run folder: it has no {name}")

    @property
    def _sha256(self) -> dict[str, str]:
        """The SHA-256 of each file that the run wrote down, by name."""
        return dict(self.recorded_status.get("sha256", {}))


def _json(file: Path) -> dict[str, Any]:
    """The content of a JSON file; nothing if it cannot be read."""
    with suppress(ConfigError):
        return parse_json(read_bytes(file), file)
    return {}


def list_runs() -> list[Path]:
    """All folders below `runs/` in which this program has worked, the one that ended, or else began, last at the end.

    Runs of a multirun come one by one, the jobs of a sweep or a reproduction only as a whole.
    """
    files = [file for pattern in ("*/*", "*/*_multirun/*") for file in Path("runs").glob(f"{pattern}/{STATUS}")]
    statuses = {file.parent: _json(file) for file in files}  # the times of files change when they are copied
    times = {run: str(status.get("finished", status.get("started", ""))) for run, status in statuses.items()}
    return sorted(times, key=lambda run: (times[run], run))


def multirun_runs(path: Path) -> list[Path]:
    """The runs in the folder of a multirun, in the order of its jobs; none if it is the folder of something else."""
    if (path / STATUS).exists():
        return []
    inside = [status.parent for status in path.glob(f"*/{STATUS}")]
    return sorted(inside, key=lambda run: (not run.name.isdigit(), int(run.name) if run.name.isdigit() else 0, run))


def resolve_run(what: str | Path, *commands: str) -> Path:
    """The folder of a run that a user names; for `latest` the newest run of these commands (none: of any)."""
    if str(what) != LATEST:
        return Path(what)
    of_commands = [path for path in list_runs() if not commands or path.relative_to("runs").parts[0] in commands]
    if not of_commands:
        whose = f" of `epuckhebb {'` or `epuckhebb '.join(commands)}`" if commands else ""
        raise ConfigError(f"{LATEST}: there is no run{whose} in {Path('runs').absolute()} yet; give a run folder")
    return of_commands[-1]
