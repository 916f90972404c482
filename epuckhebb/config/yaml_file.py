"""A YAML file of the user's, checked before anything is made of it: each refusal names the file, and the line or key.

YAML can name Python objects, repeat a key and refer to itself. None of that is a setting.
"""

import re
from pathlib import Path
from typing import Any

import yaml
from omegaconf import OmegaConf

from epuckhebb.runtime import ConfigError

_GROUP = re.compile(r"^(override +|optional +)*/?|@.*$")  # what stands around a group in a list of defaults


def check(path: Path, root: Path, above: tuple[Path, ...] = ()) -> None:
    """Refuse a file of the configuration that is not plain settings with a list of defaults, which end somewhere.

    root: the folder of its group's folder. above: the files whose defaults name this one.
    """
    if path in above:
        circle = " -> ".join(str(one.relative_to(root)) for one in (*above[above.index(path) :], path))
        raise ConfigError(f"{shown(path)}: its defaults lead back to itself: {circle}")
    defaults = load(path).get("defaults", [])
    for entry in defaults if isinstance(defaults, list) else [None]:
        key, choice = next(iter(entry.items())) if isinstance(entry, dict) and len(entry) == 1 else ("", entry)
        whole = not key and str(choice).startswith("/")  # the whole of a command, this file in it
        if whole or not isinstance(key, str) or not isinstance(choice, str | list | None if key else str):
            raise ConfigError(f"{shown(path)}: defaults must be a list such as [base, maze: t_maze], got {defaults!r}")
        named = (root if key else path.parent) / _GROUP.sub("", key) / f"{choice}.yaml"
        if choice != "_self_" and named.is_file():
            check(named, root, (*above, path))


def load(path: Path) -> dict[str, Any]:
    """The settings in a file, as they stand there."""
    line = None
    try:
        text = path.read_text(encoding="utf-8")
        held = OmegaConf.to_container(OmegaConf.create(text))
    except OSError as error:
        raise ConfigError(f"{shown(path)} cannot be read: {error.strerror}") from error
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line, reason = mark.line if mark else 0, ", ".join(filter(None, (error.context, error.problem)))
    except UnicodeDecodeError as error:
        line, reason = error.object[: error.start].count(b"\n"), "it is no UTF-8 text"
    except Exception as error:  # what damaged values may raise has no end
        reason = str(error).partition("\n")[0]
    else:
        if not isinstance(held, dict):
            raise ConfigError(f"{shown(path)}: settings must be keys with values, got {text.strip()[:40]}")
        return {str(key): value for key, value in held.items()}
    raise ConfigError(f"{shown(path)}{'' if line is None else f', line {line + 1}'}: {reason}")


def shown(path: Path) -> Path:
    """A file as a reader would name it: from the current folder, if it is below that."""
    return path.relative_to(Path.cwd()) if path.is_relative_to(Path.cwd()) else path
