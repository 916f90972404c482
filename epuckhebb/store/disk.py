"""Writes files atomically, reads JSON and arrays, and names the files of a run folder."""

import hashlib
import io
import json
import os
from collections.abc import Mapping
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epuckhebb.runtime import refusing

CHAMPION, CHECKPOINT, TRACES = "champion.npz", "checkpoint.npz", "traces.npz"
SCHEMA = 2  # of provenance.json and status.json
STATUS, PROVENANCE, MULTIRUN = "status.json", "provenance.json", "multirun.yaml"
_NUMPY = (b"\x93NUMPY", b"PK")  # how a .npy and a .npz file begin
OVERRIDES, CONFIG = ".hydra/overrides.yaml", ".hydra/config.yaml"


def write_atomic(target: Path, content: bytes, *, lasting: bool = True) -> None:
    """Write a file whole, or not at all, and make its folder; if `lasting`, wait until it is safe on the disk."""
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


def read_bytes(file: Path) -> bytes:
    """The content of a file."""
    with refusing(lambda error: f"{file} cannot be read: {error.strerror}", OSError):
        return file.read_bytes()


def hash_bytes(content: bytes) -> str:
    """The SHA-256 of a content, as hexadecimal digits."""
    return hashlib.sha256(content).hexdigest()


def as_json(content: dict[str, Any]) -> bytes:
    """The content of a JSON file."""
    return (json.dumps(content, indent=2) + "\n").encode()


def parse_json(content: bytes, file: Path, *needed: str) -> dict[str, Any]:
    """The object in a JSON file, which has the needed keys."""
    with convert_errors(f"{file} cannot be used"):
        values = json.loads(content)
        if not isinstance(values, dict):
            raise TypeError("it is not a JSON object")
        for key in needed:
            if key not in values:
                raise ValueError(f"it has no {key}")
        return values


def as_npz(arrays: Mapping[str, Any]) -> bytes:
    """The content of a compressed `.npz` file."""
    buffer = io.BytesIO()
    np.savez_compressed(buffer, **arrays)
    return buffer.getvalue()


def parse_arrays(content: bytes) -> dict[str, NDArray[Any]]:
    """The arrays of a `.npz` file by name; the one of a `.npy` file is called `genome`."""
    if not content.startswith(_NUMPY):
        raise ValueError("it is no file of NumPy; save the numbers with numpy.save")
    loaded = np.load(io.BytesIO(content), allow_pickle=False)
    if isinstance(loaded, np.ndarray):
        return {"genome": loaded}
    if twice := sorted({name for name in loaded.files if loaded.files.count(name) > 1}):
        raise ValueError(f"it holds two arrays of the name {twice[0]}")
    return dict(loaded)


def convert_errors(what: str) -> AbstractContextManager[None]:
    """Turn whatever goes wrong while a file is read into a `ConfigError` that begins with `what`."""
    return refusing(lambda error: f"{what}: {error}", Exception)  # damaged bytes may raise anything
