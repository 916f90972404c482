"""Reads one choice of a group, with the files that it takes over from, as Hydra puts them together.

A change of the world is a row of `conf/changes.yaml`, or a file of the user's. A scenario with changes is called by
their names: `base_slip_left` is the scenario `base` with the change `slip_left`, as if a file said so.
"""

import functools
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from epuckhebb.config import yaml_file
from epuckhebb.config.conf import TABLES, flat, rows, table_file
from epuckhebb.config.parts import NONE
from epuckhebb.runtime.errors import ConfigError
from epuckhebb.runtime.resources import data_folder

OURS = [data_folder("conf")]
BRINGS_MAZE = "override /maze@_global_.maze"  # in the defaults of a scenario that has a maze of its own


def choice_names(group: str, folders: Sequence[Path]) -> list[str]:
    """The choices of a group in all these folders, the longest name first."""
    files = {file.stem for folder in folders for file in (folder / group).glob("*.yaml")}
    in_table = rows(group) if group in TABLES else ()
    return sorted({*files, *in_table}, key=lambda name: (-len(name), name))


def where_known(group: str, choice: str, folders: Sequence[Path]) -> Sequence[Path]:
    """Where the file is that a name is known for: with the program, if that has one."""
    return OURS if is_choice(group, choice, OURS) else folders


def is_choice(group: str, choice: str, folders: Sequence[Path]) -> bool:
    """Whether a group has a choice of this name."""
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
    """The file of a group that has this name, or what stands for it; not to be changed."""
    path = choice_file(group, choice, folders)
    if path is not None:
        return _read(path, path.read_bytes())
    if group in TABLES:
        row: DictConfig | None = _table(group).get(choice)
        return row
    return _changed_scenario(choice, folders) if group == "scenario" else None


def choice_file(group: str, choice: str, folders: Sequence[Path]) -> Path | None:
    """The file of a group that has this name, first found first taken."""
    name = f"{group}/{choice}.yaml"
    return next((folder / name for folder in folders if (folder / name).is_file()), None)


@functools.cache
def _table(group: str) -> DictConfig:
    table = OmegaConf.load(table_file(group))
    assert isinstance(table, DictConfig)
    return table


def found_by_hydra(group: str, choice: str, folders: Sequence[Path]) -> DictConfig | None:
    """A change of the world as Hydra is to compose it, or a scenario with changes; None for other choices."""
    if group == "scenario" and choice_file(group, choice, folders) is None:
        return _changed_scenario(choice, folders)
    settings = choice_settings(group, choice, folders) if group == "change" else None
    if settings is None:
        return None
    defaults = _with_maze(settings).pop("defaults")
    return OmegaConf.create({"defaults": defaults, "scenario": settings, "change": {choice: None}})


def _changed_scenario(name: str, folders: Sequence[Path]) -> DictConfig | None:
    """What a file of this name would hold, if the name is made of a scenario and changes."""
    known = choice_names("change", folders)
    scenario, *changes = _names_in(name, choice_names("scenario", folders), known) or [""]
    if not changes:
        return None
    settings = OmegaConf.create({})
    set_by: dict[str, str] = {}
    for change in changes:
        own = choice_settings("change", change, folders)
        assert own is not None  # its name is known
        held: Any = OmegaConf.to_container(own)
        for key, _ in flat(held):
            if key in set_by:
                raise ConfigError(f"scenario={name}: {set_by[key]} and {change} both change {key}; give one of the two")
            set_by[key] = change
        settings.merge_with(own)
    return _with_maze(settings, scenario, "_self_")


def _with_maze(settings: DictConfig, *defaults: str) -> DictConfig:
    """Settings of a scenario in which the maze that they name stands among the defaults, as Hydra wants it."""
    maze = settings.pop("maze", None)
    settings.defaults = [*defaults, *([] if maze is None else [{BRINGS_MAZE: maze}])]
    return settings


def _names_in(text: str, first: Sequence[str], later: Sequence[str]) -> list[str]:
    """The names that a text joins with `_`, one of the first and then later ones; nothing if it joins no names."""
    for name in first:
        rest = text.removeprefix(f"{name}_")
        others = _names_in(rest, later, later) if rest != text else []
        if others or text == name:
            return [name, *others]
    return []


@functools.lru_cache(maxsize=256)
def _read(path: Path, content: bytes) -> DictConfig:
    """A file with this content; the jobs of a sweep ask for the same few again and again."""
    if path.parents[1] not in OURS:
        yaml_file.check(path, path.parents[1])
    own = OmegaConf.create(content.decode())
    assert isinstance(own, DictConfig)
    return own
