"""Reads and checks the overrides of a command line before Hydra does, and writes values as overrides."""

import filecmp
import itertools
import math
import re
from pathlib import Path

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from hydra.errors import HydraException
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException

from epuckhebb.config.conf import TABLES, rows
from epuckhebb.config.explain import explain
from epuckhebb.runtime.errors import ConfigError
from epuckhebb.runtime.progress import say
from epuckhebb.runtime.resources import data_folder

SWEEP_DIR = "hydra.sweep.dir="
_PLAIN = re.compile(r"[A-Za-z0-9_./:%@+-]+")  # what needs no quotes as the value of an override
_MOST_JOBS = 100_000  # of one call


def literal(text: str) -> str:
    """A text as a configuration has to be given it, so that a `${...}` in it, of a folder's name, means nothing."""
    return re.sub(r"(\\*)\$\{", lambda found: f"{2 * found[1]}\\${{", text)


def quoted(text: str) -> str:
    """A text as the value of an override that means just this text."""
    if _PLAIN.fullmatch(text):
        return text
    return _in_quotes(literal(text))


def _in_quotes(text: str) -> str:
    escaped = re.sub(r'(\\*)("|$)', lambda found: 2 * found[1] + found[2].replace('"', '\\"'), text)
    return f'"{escaped}"'


def value_of(override: str) -> str:
    """The text that an override gives to its key, without quotes."""
    value = OverridesParser.create().parse_override(override).value()
    try:
        return str(OmegaConf.create({"value": value}).value)
    except OmegaConfBaseException:  # it refers to what only Hydra knows
        return str(value)


def alternatives(overrides: list[str]) -> dict[str, list[str]]:
    """For each key the overrides that it is to have in turn; a key that comes again replaces the earlier one."""

    def choices(override: Override) -> list[str]:
        if not override.is_discrete_sweep():  # or only its sweeper knows what it stands for
            return [override.input_line or ""]
        values = itertools.islice(override.sweep_string_iterator(), _MOST_JOBS + 1)  # a range may be endless
        return [f"{override.get_key_element()}={value}" for value in values]

    try:
        parsed = OverridesParser.create().parse_overrides(overrides)
        found = {override.get_key_element(): choices(override) for override in parsed}
    except HydraException as error:
        raise ConfigError(explain(error)) from error
    if math.prod(map(len, found.values())) > _MOST_JOBS:
        most = max(found, key=lambda key: len(found[key]))
        raise ConfigError(f"at most {_MOST_JOBS} jobs fit one call; give {most} fewer values")
    return found


def with_names_compared(argument: str) -> str:
    """An override in which a list below `compare` is a mapping of names that have no settings, as the schema has it."""
    if not argument.startswith("compare=["):
        return argument
    try:
        names = OverridesParser.create().parse_override(argument).value()
    except HydraException:
        return argument  # Hydra will say what is wrong with it
    if not isinstance(names, list):
        return argument
    return f"compare={{{','.join(f'{quoted(str(name))}: null' for name in names)}}}"


def check_config_dir(config_dir: str | None) -> None:
    """Refuse a folder of configuration files that is not there, and name its files that win over the program's."""
    if config_dir is None:
        return
    mine, ours = Path(config_dir), data_folder("conf")
    if not mine.is_dir():
        raise ConfigError(f"--config-dir={config_dir} is no folder; give one with files such as scenario/mine.yaml")
    both = (file.relative_to(ours) for file in sorted(ours.rglob("*.yaml")))
    there = (file for file in both if (mine / file).is_file())
    instead = [file for file in there if not filecmp.cmp(mine / file, ours / file, shallow=False)]
    in_tables = (Path(group, f"{name}.yaml") for group in TABLES for name in sorted(rows(group)))
    instead += [file for file in in_tables if (mine / file).is_file()]
    if instead:
        names = ", ".join("=".join(str(file.with_suffix("")).rsplit("/", 1)) for file in instead)
        say(f"Files of yours in {mine} replace the program's: {names}.")


def check_folders(arguments: list[str]) -> None:
    """Refuse an empty name of a folder, which would be the current one."""
    for argument in arguments:
        key, _, value = argument.partition("=")
        if key in ("hydra.run.dir", "hydra.sweep.dir") and not value.strip("'\""):
            raise ConfigError(f"{key} must name a folder, got nothing; leave it out for one below runs/")
