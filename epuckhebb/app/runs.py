"""One run folder: claim it, write into it, close it, read it back.

A folder belongs to the process that could create its `status.json`; nothing is ever merged or overwritten. Files are
written beside their place and renamed, so that a file that is there is whole.
"""

import hashlib
import json
import os
import platform
import subprocess
import traceback
from contextlib import suppress
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from types import TracebackType
from typing import Any

from omegaconf import DictConfig, OmegaConf

import epuckhebb
from epuckhebb.app import locks
from epuckhebb.app.errors import ConfigError, JobFailedError

SCHEMA = 1  # of provenance.json and status.json
_PACKAGES = ("epuckhebb", "pymunk", "numpy", "numba", "pandas", "hydra-core", "typer", "matplotlib")


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


class RunFolder:
    """A folder that this process owns."""

    def __init__(self, path: Path, verb: str, cfg: DictConfig, overrides: list[str], facts: dict[str, Any]) -> None:
        """Claim `path` and write down what is about to run.

        facts: what else belongs into `provenance.json`, for example the genome's SHA-256.

        Raises:
            ConfigError: the folder holds a run already, or cannot be written to.
        """
        self.path = path
        self._started = _now()
        self._held: int | None = None
        try:
            path.mkdir(parents=True, exist_ok=True)
            with (path / "status.json").open("x"):
                pass
        except FileExistsError:
            raise ConfigError(
                f"{path} holds a run already; runs are never overwritten, choose another folder"
            ) from None
        except OSError as error:
            raise ConfigError(f"cannot write a run to {path}: {error.strerror}") from error
        with suppress(BlockingIOError):  # someone is just looking whether we hold it; the claim is what counts
            self._held = locks.hold(path)
        try:
            self.write_text("status.json", _json(self._status("running")))
            self.write_text(".hydra/overrides.yaml", OmegaConf.to_yaml(OmegaConf.create(overrides)))
            self.write_text(".hydra/config.yaml", OmegaConf.to_yaml(cfg, resolve=True))
            self.write_text("provenance.json", _json(provenance(verb, cfg, overrides) | facts))
        except OSError as error:
            self._give_back()
            raise ConfigError(f"cannot write a run to {path}: {error.strerror}") from error

    @classmethod
    def reopened(cls, path: Path, cfg: DictConfig, resumed: dict[str, Any]) -> "RunFolder":
        """Go on in the folder of an unfinished run; the one case in which an existing run is written into.

        resumed: what `provenance.json` shall say of this continuation.

        Raises:
            ConfigError: it is not a run folder, another process is at work in it, or it cannot be written to.
        """
        told = read(path)
        run = cls.__new__(cls)
        run.path, run._started = path, told["status"].get("started", _now())
        try:
            run._held = locks.hold(path)
        except BlockingIOError:
            raise ConfigError(f"another process is working on {path}; wait for it or stop it") from None
        del told["status"]
        told["resumed"] = [*told.get("resumed", []), {"started": _now(), **resumed, "code": code_version()}]
        try:
            for left_over in path.rglob(".*.tmp"):
                left_over.unlink()
            run.write_text(".hydra/config.yaml", OmegaConf.to_yaml(cfg, resolve=True))
            run.write_text("provenance.json", _json(told))
            run.write_text("status.json", _json(run._status("running")))
        except OSError as error:
            locks.release(run._held)
            raise ConfigError(f"cannot go on in {path}: {error.strerror}") from error
        return run

    def write(self, name: str, content: bytes) -> None:
        """Write a file in the folder: whole, or not at all."""
        write_whole(self.path / name, content)

    def write_text(self, name: str, content: str) -> None:
        """Write a text file in the folder: whole, or not at all."""
        self.write(name, content.encode())

    def __enter__(self) -> "RunFolder":
        """The folder itself; leaving the block says in `status.json` how the run ended."""
        open_runs.append(self)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Write whether the run finished, was interrupted or failed.

        Raises:
            JobFailedError: it failed; `status.json` has the whole traceback.
        """
        open_runs.remove(self)
        try:
            if error is None:
                self._close("finished")
            elif isinstance(error, KeyboardInterrupt):
                self.close_interrupted(str(error))
            elif isinstance(error, Exception):
                with suppress(OSError):  # on a full disk the error itself is what there is to tell
                    self._close("failed", error=str(error), traceback="".join(traceback.format_exception(error)))
                raise JobFailedError(f"{self.path}: {type(error).__name__}: {error}") from error
        finally:
            locks.release(self._held)

    def close_interrupted(self, message: str) -> None:
        """Say in `status.json` that the run was interrupted, if that can be written."""
        with suppress(OSError):
            self._close("interrupted", error=message)

    def _close(self, state: str, **more: str) -> None:
        self.write_text("status.json", _json(self._status(state, finished=_now(), **more)))

    def _give_back(self) -> None:
        """Leave nothing in a folder that was claimed and could not be used."""
        for name in ("status.json", ".hydra/overrides.yaml", ".hydra/config.yaml", "provenance.json"):
            (self.path / name).unlink(missing_ok=True)
        with suppress(OSError):
            (self.path / ".hydra").rmdir()
        locks.release(self._held)

    def _status(self, state: str, **more: str) -> dict[str, Any]:
        return {"schema": SCHEMA, "state": state, "started": self._started, **more}


open_runs: list[RunFolder] = []  # those that this process is working on


def read(path: Path) -> dict[str, Any]:
    """Provenance and status of a run folder, as one dictionary.

    Raises:
        ConfigError: it is not a run folder.
    """
    if not path.is_dir():
        raise ConfigError(f"{path} is not a folder; give a run folder, for example one below runs/evaluate/")
    try:
        told = json.loads((path / "provenance.json").read_text())
        status = json.loads((path / "status.json").read_text())
    except (OSError, ValueError) as error:
        raise ConfigError(
            f"{path} is not a run folder: it has no readable provenance.json and status.json ({error})"
        ) from error
    return {**told, "status": status}


def provenance(verb: str, cfg: DictConfig, overrides: list[str]) -> dict[str, Any]:
    """Who ran what, with what, where."""
    return {
        "schema": SCHEMA,
        "verb": verb,
        "command": ["epuckhebb", verb, *overrides],
        "overrides": overrides,
        "seed": cfg.seed,
        "code": code_version(),
        "packages": {name: version(name) for name in _PACKAGES},
        "python": platform.python_version(),
        "platform": platform.platform(),
        "cores": os.cpu_count(),
    }


def code_version() -> dict[str, Any]:
    """The version of this program and of its science, and its git commit where it runs from a checkout."""
    here = Path(epuckhebb.__file__).resolve().parent

    def git(*words: str) -> str | None:
        try:
            done = subprocess.run(
                ["git", "-C", str(here), *words], capture_output=True, text=True, timeout=5, check=True
            )
        except (OSError, subprocess.SubprocessError):
            return None
        return done.stdout.strip()

    known: dict[str, Any] = {
        "version": epuckhebb.__version__,
        "science": science_version(),
        "commit": None,
        "dirty": None,
    }
    if git("ls-files", "--error-unmatch", "__init__.py") is not None:
        known["commit"] = git("rev-parse", "HEAD")
        known["dirty"] = bool(git("status", "--porcelain", "--", str(here)))
    return known


def science_version() -> str:
    """A digest of the code that results depend on: the same science, the same numbers."""
    package = Path(epuckhebb.__file__).parent
    sources = [file for layer in ("sim", "evolution") for file in sorted((package / layer).glob("*.py"))]
    sources.append(package / "study" / "evaluate.py")
    return hashlib.sha256(b"\0".join(source.read_bytes() for source in sources)).hexdigest()[:16]


def as_json(content: dict[str, Any]) -> bytes:
    """Content of a JSON file."""
    return _json(content).encode()


def remove_if_empty(path: Path, until: Path) -> None:
    """Remove the folder and its parents below `until` as long as they are empty; leave everything else."""
    while path != until and until in path.parents:
        try:
            path.rmdir()
        except OSError:
            return
        path = path.parent


def _json(content: dict[str, Any]) -> str:
    return json.dumps(content, indent=2) + "\n"


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")
