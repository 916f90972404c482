"""Reads YAML files, and refuses one of the user's whose defaults would replace its own values."""

import re
from pathlib import Path
from typing import Any

import yaml
from omegaconf import OmegaConf

from epuckhebb.config.errors import explain
from epuckhebb.runtime import ConfigError, refusing


def load(path: Path) -> dict[str, Any]:
    """The settings in a file, as they stand there."""
    with refusing(lambda error: f"{path}: {explain(error)}", Exception):  # what damaged values may raise has no end
        values = OmegaConf.to_container(OmegaConf.load(path))
    if not isinstance(values, dict):
        raise ConfigError(f"{path}: settings must be keys with values, got {values}")
    return {str(key): value for key, value in values.items()}


def check_order(path: Path) -> None:
    """Refuse a file in which defaults come after `_self_`, and so replace its values; a file that is not there passes.

    The files of its folder among its defaults are looked at, too.
    """
    values = yaml.safe_load(path.read_text(encoding="utf-8")) if path.is_file() else None
    defaults = (values.pop("defaults", None) or []) if isinstance(values, dict) else []
    for entry in defaults:
        name = entry if isinstance(entry, str) else str(next(iter(entry)))
        if isinstance(entry, str) and entry != "_self_":
            check_order(path.with_name(f"{entry}.yaml"))
        is_late = "_self_" in defaults[: defaults.index(entry)] and not name.startswith("override ")
        if values and is_late and (isinstance(entry, str) or re.split(r"[ /.@]", name)[-1] in values):
            raise ConfigError(f"{path}: {name} comes after _self_, and replaces values of this file; put _self_ last")
