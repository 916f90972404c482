"""Reads YAML files, and refuses one of the user's in which something does not mean what it says.

YAML reads a plain 010 as 8, 1:30 as 90 and 0x10 as 16, and the command line reads 010 as 10 and 1_0 as 10.
"""

import re
from contextlib import suppress
from pathlib import Path
from typing import Any

import yaml
from omegaconf import OmegaConf

from epuckhebb.config.errors import explain
from epuckhebb.runtime import ConfigError, refusing

_LOADER: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_NUMBER = r"[-+]?(0[\d_]+(\.[\d_]*)?|0[xob][\da-fA-F_]+|\d+_[\d_]*(\.[\d_]*)?|[\d_]+(:[\d_]+)+(\.[\d_]*)?)"
_MANY_READINGS = re.compile(rf"{_NUMBER}(e[-+]?\d+)?", re.IGNORECASE)
_QUOTED = re.compile(r"""("(\\.|[^"\\])*"|'(\\.|[^'\\])*')""")
_BETWEEN = re.compile(r"[\[\]{}(),\s]+|(?<![\d_]):|:(?!\d)")  # the plain values in an override


def check_number(text: str, where: str) -> None:
    """Refuse a plain value that YAML and the command line read as different numbers. where: it stands, for messages."""
    if _MANY_READINGS.fullmatch(text):
        raise ConfigError(f"{where}: {text} has several readings; write a number in plain digits, or a text in quotes")


def check_numbers(override: str) -> None:
    """The same for all plain values of an override."""
    for text in _BETWEEN.split(_QUOTED.sub("", override.partition("=")[2])):
        check_number(text, override)


def load(path: Path) -> dict[str, Any]:
    """The settings in a file, as they stand there."""
    _check_numbers_of(path)
    with refusing(lambda error: f"{path}: {explain(error)}", Exception):  # what damaged values may raise has no end
        values = OmegaConf.to_container(OmegaConf.load(path))
    if not isinstance(values, dict):
        raise ConfigError(f"{path}: settings must be keys with values, got {values}")
    return {str(key): value for key, value in values.items()}


def check_order(path: Path) -> None:
    """Refuse a file in which defaults come after `_self_`, and so replace its values; a file that is not there passes.

    The files of its folder among its defaults are looked at, too.
    """
    if not path.is_file():
        return
    _check_numbers_of(path)
    values = yaml.safe_load(path.read_text(encoding="utf-8"))
    defaults = (values.pop("defaults", None) or []) if isinstance(values, dict) else []
    for entry in defaults:
        name = entry if isinstance(entry, str) else str(next(iter(entry)))
        if isinstance(entry, str) and entry != "_self_":
            check_order(path.with_name(f"{entry}.yaml"))
        is_late = "_self_" in defaults[: defaults.index(entry)] and not name.startswith("override ")
        if values and is_late and (isinstance(entry, str) or re.split(r"[ /.@]", name)[-1] in values):
            raise ConfigError(f"{path}: {name} comes after _self_, and replaces values of this file; put _self_ last")


def _check_numbers_of(path: Path) -> None:
    """Check the plain values of a file; one that is no YAML is left to those that read it."""
    with suppress(OSError, UnicodeError, yaml.YAMLError):
        for event in yaml.parse(path.read_text(encoding="utf-8"), _LOADER):
            if isinstance(event, yaml.ScalarEvent) and not event.style:  # the two loaders differ
                mark: Any = event.start_mark
                check_number(event.value, f"{path}, line {mark.line + 1}")
