"""One run folder: claim it, write into it, close it, read it back.

A folder belongs to the process that could create its `status.json`; nothing is ever merged or overwritten. Files are
written beside their place and renamed, so that a file that is there is whole.
"""

import json
import os
import platform
import subprocess
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from types import TracebackType
from typing import Any

from omegaconf import DictConfig, OmegaConf

import epuckhebb
from epuckhebb.app.errors import ConfigError

SCHEMA = 1  # of provenance.json and status.json
_PACKAGES = ("epuckhebb", "pymunk", "numpy", "numba", "pandas", "hydra-core", "typer", "matplotlib")


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
        try:
            path.mkdir(parents=True, exist_ok=True)
            with (path / "status.json").open("x") as file:
                json.dump(self._status("running"), file)
        except FileExistsError:
            raise ConfigError(
                f"{path} holds a run already; runs are never overwritten, choose another folder"
            ) from None
        except OSError as error:
            raise ConfigError(f"cannot write a run to {path}: {error.strerror}") from error
        self.write_text(".hydra/config.yaml", OmegaConf.to_yaml(cfg))
        self.write_text(".hydra/overrides.yaml", OmegaConf.to_yaml(OmegaConf.create(overrides)))
        self.write_text("provenance.json", _json(provenance(verb, cfg, overrides) | facts))

    def write(self, name: str, content: bytes) -> None:
        """Write a file in the folder: whole, or not at all."""
        target = self.path / name
        target.parent.mkdir(parents=True, exist_ok=True)
        write_whole(target, content)

    def write_text(self, name: str, content: str) -> None:
        """Write a text file in the folder: whole, or not at all."""
        self.write(name, content.encode())

    def __enter__(self) -> "RunFolder":
        """The folder itself; leaving the block says in `status.json` how the run ended."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Finished, failed (with the error) or interrupted."""
        state = "finished" if kind is None else "interrupted" if kind is KeyboardInterrupt else "failed"
        self.write_text("status.json", _json(self._status(state, finished=_now(), error=str(error or ""))))

    def _status(self, state: str, **more: str) -> dict[str, Any]:
        return {"schema": SCHEMA, "state": state, "started": self._started, **more}


def write_whole(target: Path, content: bytes) -> None:
    """Write a file beside its place and rename it: whole, or not at all."""
    beside = target.with_name(f".{target.name}.{os.getpid()}.tmp")
    with beside.open("wb") as file:
        file.write(content)
        file.flush()
        os.fsync(file.fileno())
    beside.replace(target)


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
    """The version of this program, and its git commit where it runs from a checkout."""
    here = Path(epuckhebb.__file__).resolve().parent

    def git(*words: str) -> str | None:
        try:
            done = subprocess.run(
                ["git", "-C", str(here), *words], capture_output=True, text=True, timeout=5, check=True
            )
        except (OSError, subprocess.SubprocessError):
            return None
        return done.stdout.strip()

    known: dict[str, Any] = {"version": epuckhebb.__version__, "commit": None, "dirty": None}
    if git("ls-files", "--error-unmatch", "__init__.py") is not None:
        known["commit"] = git("rev-parse", "HEAD")
        known["dirty"] = bool(git("status", "--porcelain", "--", str(here)))
    return known


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
