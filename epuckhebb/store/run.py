"""Finds and reads run folders: status, provenance, tables, and whether every file is as it was written."""

import hashlib
from pathlib import Path
from typing import Any

import pandas as pd

from epuckhebb.runtime.errors import ConfigError
from epuckhebb.runtime.resources import LATEST
from epuckhebb.store import records
from epuckhebb.store.columns import Columns
from epuckhebb.store.disk import PROVENANCE, STATUS, bytes_of, is_locked
from epuckhebb.store.records import Provenance, Status, record

_RESULTS = (".csv", "champion.npz")  # how the names of files end on which other runs and tables rely


def below_runs() -> list[Path]:
    """All folders below `runs/` in which this program has worked, the one of the last call last.

    Runs of a multirun come one by one, the jobs of a sweep or a reproduction only as a whole.
    """
    found = [status for pattern in ("*/*", "*/*_multirun/*") for status in Path("runs").glob(f"{pattern}/{STATUS}")]
    return [status.parent for status in sorted(found, key=lambda status: (status.stat().st_mtime_ns, status))]


def of_multirun(path: Path) -> list[Path]:
    """The runs in the folder of a multirun, in the order of its jobs; none if it is the folder of something else."""
    if (path / STATUS).exists():
        return []
    inside = [status.parent for status in path.glob(f"*/{STATUS}")]
    return sorted(inside, key=lambda run: (not run.name.isdigit(), int(run.name) if run.name.isdigit() else 0, run))


def found(what: str | Path, *commands: str) -> Path:
    """The folder of a run that a user names, or the latest one of these verbs (none: of any) if it is `latest`."""
    if str(what) != LATEST:
        return Path(what)
    of_commands = [path for path in below_runs() if not commands or path.relative_to("runs").parts[0] in commands]
    if not of_commands:
        whose = f" of `epuckhebb {'` or `epuckhebb '.join(commands)}`" if commands else ""
        raise ConfigError(f"{LATEST}: there is no run{whose} in {Path('runs').absolute()} yet; give a run folder")
    return of_commands[-1]


def read(path: Path) -> dict[str, Any]:
    """Provenance and status of a run folder, as one dictionary."""
    if not path.is_dir():
        raise ConfigError(f"{path} is not a folder; give a run folder, for example one below runs/evaluate/")
    inside = next(path.glob(f"*/{STATUS}"), None)
    if inside is not None and not (path / STATUS).exists():
        raise ConfigError(f"{path} is a folder with runs in it; give one of them, for example {inside.parent}")
    for name in (PROVENANCE, STATUS):
        if not (path / name).is_file():
            raise ConfigError(f"{path} is not a run folder: it has no {name}")
    status = record(bytes_of(path / STATUS), path / STATUS, Status)
    told = record(content(path, PROVENANCE), path / PROVENANCE, Provenance)
    for name in ("genome", "genome_sha256") if told["command"] == "evaluate" else ():
        if name not in told:
            raise ConfigError(f"{path / PROVENANCE} cannot be used: it has no {name}")
    if status["state"] == "running" and not is_locked(path):
        status |= {"state": "interrupted", "error": "its process ended unexpectedly"}
    return {**told, "status": status}


def status_of(path: Path) -> dict[str, Any]:
    """What a run says of its state; nothing if it cannot be read."""
    try:
        return {**record(bytes_of(path / STATUS), path / STATUS, Status)}
    except ConfigError:
        return {}


def content(run: Path, name: str) -> bytes:
    """The content of a file of a run, which must be what the run wrote as far as its `status.json` tells."""
    found = bytes_of(run / name)
    sha256 = hashlib.sha256(found).hexdigest()
    if status_of(run).get("sha256", {}).get(name, sha256) != sha256:
        raise ConfigError(
            f"{run / name} is not what this run wrote (its SHA-256 differs); put it back as it was, or run it again"
        )
    return found


def table(run: Path, name: str, columns: Columns, *, rows: bool = True) -> pd.DataFrame:
    """A table of a run; see `content` and `records.table`."""
    return records.table(content(run, name), run / name, columns, rows=rows)


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
