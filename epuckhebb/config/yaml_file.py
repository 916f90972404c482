"""A YAML file of the user's, checked before anything is made of it: each refusal names the file, the line and the key.

YAML can name Python objects, repeat a key, refer to itself and grow without end. None of that is a setting.
"""

import re
from pathlib import Path
from typing import Any

import yaml
from omegaconf import OmegaConf

from epuckhebb.runtime.errors import ConfigError

_MOST_BYTES = 2**18
_MOST_VALUES = 10_000
_MOST_USES = 10  # of anchors: they stand for at most some forty times what the file holds
_MOST_LEVELS = 40
_ENVIRONMENT = re.compile(r"\$\{\s*oc\.env\b")
_GROUP = re.compile(r"^(override +|optional +)*/?|@.*$")  # what stands around a group in a list of defaults
NO_ENVIRONMENT = "environment variables are not read by a configuration; write the value itself"


def check(path: Path, root: Path, above: tuple[Path, ...] = ()) -> None:
    """Refuse a file of the configuration that is not plain settings with a list of defaults, which end somewhere.

    Args:
        path: The file.
        root: The folder of its group's folder.
        above: The files whose defaults name this one.
    """
    if path in above:
        circle = " -> ".join(str(one.relative_to(root)) for one in (*above[above.index(path) :], path))
        raise ConfigError(f"{shown(path)}: its defaults lead back to itself: {circle}")
    defaults = load(path, configuration=True).get("defaults", [])
    for entry in defaults if isinstance(defaults, list) else [None]:
        key, choice = next(iter(entry.items())) if isinstance(entry, dict) and len(entry) == 1 else ("", entry)
        if not isinstance(key, str) or not isinstance(choice, str | list | None if key else str):
            raise ConfigError(f"{shown(path)}: defaults must be a list such as [base, _self_], got {defaults!r}")
        if not key and str(choice).rpartition("/")[:2] == ("", "/"):  # the whole of a command, this file in it
            raise ConfigError(f"{shown(path)}: defaults must name choices of groups (maze: t_maze), got {choice}")
        named = (root if key else path.parent) / _GROUP.sub("", key) / f"{choice}.yaml"
        if choice != "_self_" and named.is_file():
            check(named, root, (*above, path))


def load(path: Path, *, configuration: bool = False) -> dict[str, Any]:
    """The settings in a file.

    Args:
        path: The file.
        configuration: Whether a `${...}` in it refers to another value.
    """
    try:
        with path.open("rb") as file:
            content = file.read(_MOST_BYTES + 1)
    except OSError as error:
        raise ConfigError(f"{shown(path)} cannot be read: {error.strerror}") from error
    if len(content) > _MOST_BYTES:
        raise ConfigError(f"{shown(path)}: a file of settings must have at most {_MOST_BYTES // 1024} KiB")
    try:
        text = content.decode()
        _check_text(text, path, configuration=configuration)
        held = OmegaConf.to_container(OmegaConf.create(text))
    except ConfigError:
        raise
    except UnicodeDecodeError as error:
        raise _wrong(path, content[: error.start].count(b"\n"), "it is no UTF-8 text") from error
    except yaml.reader.ReaderError as error:
        raise _wrong(
            path, text[: error.position].count("\n"), f"the character {chr(error.character)!r} is not allowed"
        ) from error
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        message = ", ".join(filter(None, (error.context, error.problem)))
        raise _wrong(path, mark.line if mark else 0, message) from error
    except Exception as error:  # what damaged values may raise has no end
        reason, *_ = str(error).split("\n")
        raise ConfigError(f"{shown(path)} cannot be used: {reason}") from error
    if not isinstance(held, dict):
        raise ConfigError(f"{shown(path)}: settings must be keys with values, got {text.strip()[:40]}")
    return {str(key): value for key, value in held.items()}


def shown(path: Path) -> Path:
    """A file as a reader would name it: from the current folder, if it is below that."""
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path


def _check_text(text: str, path: Path, *, configuration: bool) -> None:
    """Refuse text that would grow without end, is nested too deep, or reads the environment, before it is made values.

    An anchor may stand for others, so a few uses of anchors can stand for very many values.
    """
    level = uses = 0
    event: Any
    for values, event in enumerate(yaml.parse(text, Loader=yaml.SafeLoader)):
        line = event.start_mark.line
        level += isinstance(event, yaml.CollectionStartEvent) - isinstance(event, yaml.CollectionEndEvent)
        uses += isinstance(event, yaml.AliasEvent)
        if level > _MOST_LEVELS:
            raise _wrong(path, line, f"it has more than {_MOST_LEVELS} brackets within brackets")
        if values > _MOST_VALUES or uses > _MOST_USES:
            raise _wrong(path, line, f"it has more than {_MOST_VALUES} values, or {_MOST_USES} uses of anchors")
        if configuration and isinstance(event, yaml.ScalarEvent) and _ENVIRONMENT.search(event.value):
            raise _wrong(path, line, NO_ENVIRONMENT)


def _wrong(path: Path, line: int, message: str) -> ConfigError:
    """An error in a line, counted from 0."""
    return ConfigError(f"{shown(path)}, line {line + 1}: {message}")
