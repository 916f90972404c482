"""Reads one choice of a group, with the files that it takes over from, as Hydra puts them together."""

import functools
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from epuckhebb.config import yaml_file
from epuckhebb.config.parts import NONE
from epuckhebb.runtime.errors import ConfigError
from epuckhebb.runtime.resources import data_folder

OURS = [data_folder("conf")]


def choice_files(group: str, folders: Sequence[Path]) -> list[Path]:
    """The files of a group, in all these folders."""
    return [file for folder in folders for file in (folder / group).glob("*.yaml")]


def where_known(group: str, choice: str, folders: Sequence[Path]) -> Sequence[Path]:
    """Where the file is that a name is known for: with the program, if that has one."""
    return OURS if is_choice(group, choice, OURS) else folders


def is_choice(group: str, choice: str, folders: Sequence[Path]) -> bool:
    """Whether a group has a file of this name."""
    return _file(group, choice, folders) is not None


def default_override(group: str, choice: str, override: str, folders: Sequence[Path]) -> str | None:
    """What a file of a group, or one that it takes over from, chooses of another group in its defaults."""
    entries = _defaults(_file(group, choice, folders))
    for entry in entries:
        if isinstance(entry, DictConfig) and override in entry:
            return str(entry[override])
    others = (entry for entry in entries if isinstance(entry, str) and entry not in (NONE, "_self_"))
    parts = (default_override(group, other, override, folders) for other in others)
    return next((chosen for chosen in parts if chosen is not None), None)


def _defaults(file: DictConfig | None) -> list[Any]:
    return [] if file is None else list(file.get("defaults", []))


def choice_settings(group: str, choice: str, folders: Sequence[Path]) -> DictConfig | None:
    """A file of a group with what it takes over from others of its group, as Hydra puts them together."""
    parts = list(_parts(group, choice, folders))
    if not parts:
        return None
    try:
        merged = OmegaConf.merge(*parts)
    except OmegaConfBaseException as error:
        raise ConfigError(f"{group}={choice} cannot be put together: {error}") from error
    assert isinstance(merged, DictConfig)
    merged.pop("defaults", None)
    return merged


def _parts(group: str, choice: str, folders: Sequence[Path]) -> Iterator[DictConfig]:
    """A file of a group, and those of its group that it takes over from, in the order in which Hydra merges them."""
    file = _file(group, choice, folders)
    if file is None:
        return
    entries = _defaults(file)
    for entry in entries if "_self_" in entries else ["_self_", *entries]:
        if entry == "_self_":
            yield file
        elif isinstance(entry, str):
            yield from _parts(group, entry, folders)


def _file(group: str, choice: str, folders: Sequence[Path]) -> DictConfig | None:
    """The file of a group that has this name, not to be changed."""
    name = f"{group}/{choice}.yaml"
    path = next((folder / name for folder in folders if (folder / name).is_file()), None)
    return None if path is None else _read(path, path.read_bytes())


@functools.lru_cache(maxsize=256)
def _read(path: Path, content: bytes) -> DictConfig:
    """A file with this content; the jobs of a sweep ask for the same few again and again."""
    if path.parents[1] not in OURS:
        yaml_file.check(path, path.parents[1])
    own = OmegaConf.create(content.decode())
    assert isinstance(own, DictConfig)
    return own
