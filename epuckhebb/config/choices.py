"""Reads one choice of a group, with the choices that it takes over from, as Hydra puts them together.

A change of the world is a row of `conf/changes.yaml`, or a file of the user's. A scenario with changes is called by
their names: `base_slip_left` is the scenario `base` with the change `slip_left`, as if a file said so.
"""

import copy
import functools
import operator
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from epuckhebb.config import yaml_file
from epuckhebb.runtime import ConfigError, conf, data_folder

OURS = [data_folder("conf")]
BROUGHT = {  # in the defaults of a scenario that has a maze or a physics of its own
    group: f"override /{group}@_global_.{group}" for group in ("maze", "physics")
}


class Choice(NamedTuple):
    """A choice of a group.

    settings: in its file, not to be changed. brings: what its defaults choose of other groups, by their keys. parts: of
    which the settings are put together.
    """

    settings: DictConfig
    brings: dict[str, str]
    parts: list[DictConfig]


_MOST_KNOWN = 256
_known: dict[tuple[str, str, tuple[Path, ...]], Choice] = {}  # a run asks for the same few again and again


def choice_names(group: str, folders: Sequence[Path]) -> list[str]:
    """The choices of a group in all these folders, the longest name first."""
    files = {file.stem for folder in folders for file in (folder / group).glob("*.yaml")}
    in_table = conf.rows(group) if group in conf.TABLES else ()
    return sorted({*files, *in_table}, key=lambda name: (-len(name), name))


def known_choice(group: str, name: str, folders: Sequence[Path]) -> Choice | None:
    """The choice that a name is known for: that of the program, if it has one."""
    return choice_of(group, name, OURS) or choice_of(group, name, folders)


def choice_of(group: str, name: str, folders: Sequence[Path], above: tuple[str, ...] = ()) -> Choice | None:
    """A choice of a group, first found first taken, with what it takes over from others; None if there is none.

    above: the choices whose defaults name this one.
    """
    held = _held(group, name, folders)
    if held is None:
        return None
    if name in above:
        circle = " -> ".join((*above[above.index(name) :], name))
        raise ConfigError(f"{group}={name}: its defaults lead back to itself: {circle}")
    parts, own, taken = list[DictConfig](), dict[str, str](), dict[str, str]()
    defaults = list(held.get("defaults", []))
    for entry in defaults if "_self_" in defaults else ["_self_", *defaults]:
        named = isinstance(entry, str) and entry != "_self_"
        other = choice_of(group, entry, folders, (*above, name)) if named else None
        if entry == "_self_":
            parts.append(held)
        elif isinstance(entry, DictConfig):
            own |= {str(key): str(value) for key, value in entry.items()}
        elif other is not None:
            parts.append(other.settings)
            taken = other.brings | taken
    place = (group, name, tuple(folders))
    known = _known.get(place)
    if known and len(known.parts) == len(parts) and all(map(operator.is_, known.parts, parts)):
        return known  # its files are as they were: `_read` has one object for a content
    try:
        settings = OmegaConf.merge(*parts)
    except OmegaConfBaseException as error:
        raise ConfigError(f"{group}={name} cannot be put together: {error}") from error
    assert isinstance(settings, DictConfig)
    settings.pop("defaults", None)
    if len(_known) >= _MOST_KNOWN:
        _known.clear()
    _known[place] = Choice(settings, taken | own, parts)
    return _known[place]


def choice_file(group: str, name: str, folders: Sequence[Path]) -> Path | None:
    """The file of a group that has this name, first found first taken."""
    files = (folder / group / f"{name}.yaml" for folder in folders)
    return next((file for file in files if file.is_file()), None)


def found_by_hydra(group: str, name: str, folders: Sequence[Path]) -> DictConfig | None:
    """A row of a table as Hydra is to compose it, or a scenario with changes; None for other choices."""
    if group in ("adaptation", "scenario") and choice_file(group, name, folders) is None:
        held = _held(group, name, folders)
        return None if held is None else DictConfig(OmegaConf.to_container(held))
    change = choice_of(group, name, folders) if group == "change" else None
    if change is None:
        return None
    settings = copy.deepcopy(change.settings)
    defaults = _with_groups(settings).pop("defaults")
    return OmegaConf.create({"defaults": defaults, "scenario": settings, "change": {name: None}})


def _held(group: str, name: str, folders: Sequence[Path]) -> DictConfig | None:
    """What the file of a choice holds, or what stands for it; not to be changed."""
    path = choice_file(group, name, folders)
    if path is not None:
        return _read(path, path.read_bytes())
    if group in conf.TABLES:
        row: DictConfig | None = _read(conf.table_file(group), b"").get(name)
        return row
    return _changed_scenario(name, folders) if group == "scenario" else None


@functools.lru_cache(maxsize=256)
def _read(path: Path, content: bytes) -> DictConfig:
    """A file with this content; the jobs of a sweep ask for the same few again and again."""
    if not path.is_relative_to(OURS[0]):
        yaml_file.check(path, path.parents[1])
    own = OmegaConf.create((content or path.read_bytes()).decode())
    assert isinstance(own, DictConfig)
    return own


def _changed_scenario(name: str, folders: Sequence[Path]) -> DictConfig | None:
    """What a file of this name would hold, if the name is made of a scenario and changes."""
    known = choice_names("change", folders)
    scenario, *changes = _names_in(name, choice_names("scenario", folders), known) or [""]
    if not changes:
        return None
    settings = OmegaConf.create({})
    set_by: dict[str, str] = {}
    for change in changes:
        found = choice_of("change", change, folders)
        assert found is not None  # its name is known
        held: Any = OmegaConf.to_container(found.settings)
        for key, _ in conf.flat(held):
            if key in set_by:
                raise ConfigError(f"scenario={name}: {set_by[key]} and {change} both change {key}; give one of the two")
            set_by[key] = change
        settings.merge_with(found.settings)
    return _with_groups(settings, scenario, "_self_")


def _with_groups(settings: DictConfig, *defaults: str) -> DictConfig:
    """Settings of a scenario in which maze and physics, if they name one, are among the defaults, as Hydra wants it."""
    named = {key: settings.pop(group, None) for group, key in BROUGHT.items()}
    settings.defaults = [*defaults, *({key: name} for key, name in named.items() if name is not None)]
    return settings


def _names_in(text: str, first: Sequence[str], later: Sequence[str]) -> list[str]:
    """The names that a text joins with `_`, one of the first and then later ones; nothing if it joins no names."""
    for name in first:
        rest = text.removeprefix(f"{name}_")
        others = _names_in(rest, later, later) if rest != text else []
        if others or text == name:
            return [name, *others]
    return []
