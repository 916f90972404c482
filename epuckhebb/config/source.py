"""Serves the choices of groups to Hydra, from `conf/` and from folders of the user's, each read when it is asked for.

A choice is a file of its group's folder, or a row of the group's table. A file wins over a row.
"""

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple, cast

from hydra.core.object_type import ObjectType
from hydra.plugins.config_source import ConfigResult, ConfigSource
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from epuckhebb.config.errors import explain
from epuckhebb.runtime import ConfigError, conf, did_you_mean, refusing, yaml_file

ROOT = "_global_"  # the package of settings that also change other groups
BROUGHT = ("maze", "physics")  # groups of which a change of the world may name another choice
RULES = "hebbian"  # the group of rules, of which FILE.py:NAME is a choice, too
_FROM_ROOT = ("adaptation", "change")  # groups whose rows are settings of the whole configuration


class Choice(NamedTuple):
    """The settings of a choice as they stand in its file or row, and the package they belong to; None: its own."""

    settings: Mapping[str, Any]
    package: str | None


def choice(folder: Path, group: str, name: str) -> Choice | None:
    """A choice of a group in a folder; None if it is not there."""
    file = Path(os.path.normpath(folder / group / f"{name}.yaml"))
    if _is_own_rule(group, name):
        return Choice({"rule": name}, None)
    if file.is_file():
        settings, package = yaml_file.read(file)
    elif group in conf.TABLES and name in (rows := conf.table(group, folder)):
        settings, package = (rows[name] or {}), ROOT if group in _FROM_ROOT else None
        if not isinstance(settings, Mapping):
            raise ConfigError(f"{folder / conf.TABLES[group]}: {name} must be settings, got {settings}")
    else:
        return None
    if group == "experiment" and package != ROOT:
        raise ConfigError(f"{group}/{name}: its first line must be `# @package {ROOT}`")
    return Choice(_whole_settings(name, settings), ROOT) if group == "change" else Choice(settings, package)


def _is_own_rule(group: str, name: str) -> bool:
    """Whether a choice is a rule of the user's own, FILE.py:NAME, which has no row."""
    return group == RULES and ".py:" in name


def _whole_settings(name: str, row: Mapping[str, Any]) -> dict[str, Any]:
    """A change of the world as settings of the whole configuration."""
    overrides = [{f"override /{group}@{ROOT}.{group}": str(row[group])} for group in BROUGHT if group in row]
    scenario = {key: value for key, value in row.items() if key not in BROUGHT}
    return {"defaults": [*overrides, "_self_"], "scenario": scenario, "change": {name: None}}


def change_row(name: str, folders: Sequence[Path]) -> Mapping[str, Any]:
    """The row of a change of the world: keys of a scenario with their new values, and what else it brings."""
    for folder in folders:
        if (file := folder / "change" / f"{name}.yaml").is_file():
            return yaml_file.load(file)
        if name in (rows := conf.table("change", folder)):
            return dict(rows[name] or {})
    return {}


def names(folder: Path, group: str) -> set[str]:
    """The names of the choices of a group in a folder."""
    rows = conf.table(group, folder) if group in conf.TABLES else {}
    return {*rows, *(file.stem for file in (folder / group).glob("*.yaml"))}


def named(group: str, name: str, folders: Sequence[Path]) -> dict[str, Any]:
    """The settings of the whole configuration that a choice brings, with those that it begins with.

    The choices that it makes in other groups stand below `choices`. folders: are searched in turn.
    """
    found = next((one for folder in folders if (one := choice(folder, group, name)) is not None), None)
    if found is None:
        known = sorted({one for folder in folders for one in names(folder, group)})
        raise ConfigError(f"{group} must be one of {', '.join(known)}, got {name}{did_you_mean(name, known)}")
    settings: dict[str, Any] = {"choices": {}}
    own = {key: value for key, value in found.settings.items() if key != yaml_file.DEFAULTS}
    defaults = found.settings.get(yaml_file.DEFAULTS) or []
    for entry in defaults if yaml_file.SELF in defaults else [*defaults, yaml_file.SELF]:
        if isinstance(entry, Mapping):
            for key, other in entry.items():
                settings["choices"][key.removeprefix("override ").strip("/").partition("@")[0]] = other
        elif entry == yaml_file.SELF:
            merge(settings, own if found.package == ROOT else {group: own})
        else:
            merge(settings, named(group, entry, folders))
    return settings


def merge(settings: dict[str, Any], others: Mapping[str, Any]) -> None:
    """Put other settings into settings, which win."""
    for key, value in others.items():
        if isinstance(value, Mapping):
            before = settings.get(key)
            settings[key] = inner = dict(before) if isinstance(before, Mapping) else {}
            merge(inner, value)
        else:
            settings[key] = value


def search_folders(runtime: Any) -> list[Path]:
    """The folders in which Hydra looks for choices, in turn, from what it notes of a composition."""
    sources = OmegaConf.to_container(runtime.config_sources, resolve=False)  # a `${` in a folder's name is only that
    return [Path(one["path"]) for one in cast(Any, sources) if one["schema"] in ("file", Choices.scheme())]


class Choices(ConfigSource):
    """One folder, as Hydra asks for what is in it."""

    @staticmethod
    def scheme() -> str:
        """What the path of such a folder begins with."""
        return "choices"

    def _parts(self, config_path: str) -> tuple[Path, str, str]:
        path = config_path.strip("/").removesuffix(".yaml")
        first, _, rest = path.partition("/")
        group, _, name = (first, "/", rest) if _is_own_rule(first, rest) else os.path.normpath(path).rpartition("/")
        return Path(self.path), group, name

    def load_config(self, config_path: str) -> ConfigResult:
        """The settings of a choice."""
        found = choice(*self._parts(config_path))
        assert found is not None  # Hydra has asked before
        with refusing(lambda error: f"{Path(self.path, config_path)}.yaml: {explain(error)}", OmegaConfBaseException):
            settings = OmegaConf.create(dict(found.settings))
        return ConfigResult(self.provider, f"{self.scheme()}://{self.path}", settings, {"package": found.package})

    def available(self) -> bool:
        """Whether the folder is there."""
        return Path(self.path).is_dir()

    def is_group(self, config_path: str) -> bool:
        """Whether it has choices of a group."""
        group = config_path.strip("/")
        return Path(self.path, group).is_dir() or bool(group in conf.TABLES and conf.table(group, Path(self.path)))

    def is_config(self, config_path: str) -> bool:
        """Whether it has a choice."""
        folder, group, name = self._parts(config_path)
        is_row = group in conf.TABLES and name in conf.table(group, folder)
        return bool(is_row or _is_own_rule(group, name) or (folder / group / f"{name}.yaml").is_file())

    def list(self, config_path: str, results_filter: ObjectType | None) -> list[str]:
        """The names of groups, of choices, or of both."""
        group = config_path.strip("/")
        folder = Path(self.path, group)
        known = set() if results_filter == ObjectType.GROUP else names(Path(self.path), group)
        if results_filter != ObjectType.CONFIG and folder.is_dir():
            known |= {inner.name for inner in folder.iterdir() if inner.is_dir()}
        return sorted(known)
