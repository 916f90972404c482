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
_MOST_VALUES = 10_000  # with what anchors stand for
_MOST_LEVELS = 40
_TAG = "tag:yaml.org,2002:"
_KINDS = {"str", "int", "float", "bool", "null", "map", "seq", "merge", "timestamp"}  # what a setting may be
_SHOWN = 40  # characters of a text in a message
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
        held = _checked(content.decode(), path, configuration=configuration)
    except ConfigError:
        raise
    except UnicodeDecodeError as error:
        raise _wrong(path, content[: error.start].count(b"\n"), "it is no UTF-8 text") from error
    except yaml.reader.ReaderError as error:
        line = content.decode()[: error.position].count("\n")
        raise _wrong(path, line, f"the character {chr(error.character)!r} is not allowed") from error
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        told = ", ".join(filter(None, (error.context, error.problem)))
        raise _wrong(path, mark.line if mark else 0, told) from error
    except RecursionError as error:
        raise ConfigError(f"{shown(path)}: it has too many brackets within brackets") from error
    except Exception as error:  # what damaged values may raise has no end
        raise ConfigError(f"{shown(path)} cannot be used: {error}") from error
    return {str(key): value for key, value in held.items()}


def shown(path: Path) -> Path:
    """A file as a reader would name it: from the current folder, if it is below that."""
    here = Path.cwd()
    return path.relative_to(here) if path.is_relative_to(here) else path


def _checked(text: str, path: Path, *, configuration: bool) -> dict[Any, Any]:
    """The values of a text, made when its nodes have been checked: an anchor is not written out before."""
    root = yaml.compose(text, Loader=yaml.SafeLoader)
    if root is None:
        return {}
    if not isinstance(root, yaml.MappingNode):
        raise _wrong(path, root.start_mark.line, f"settings must be keys with values, got {text.strip()[:_SHOWN]}")
    _Check(path, configuration=configuration).size(root, "", ())
    held = OmegaConf.to_container(OmegaConf.create(text))
    assert isinstance(held, dict)
    return held


class _Check:
    """What is counted and refused in the nodes of one file."""

    def __init__(self, path: Path, *, configuration: bool) -> None:
        self._path, self._configuration = path, configuration
        self._sizes: dict[yaml.Node, int] = {}

    def size(self, node: yaml.Node, key: str, above: tuple[yaml.Node, ...]) -> int:
        """How many values a node has, those of anchors counted wherever they are used."""
        if node in above:
            raise self._wrong(node, f"the anchor of {key} holds itself")
        if node not in self._sizes:
            if len(above) >= _MOST_LEVELS:
                raise self._wrong(node, f"{key} is nested more than {_MOST_LEVELS} levels deep")
            if node.tag.removeprefix(_TAG) not in _KINDS:
                tag = node.tag.replace(_TAG, "!!")
                raise self._wrong(node, f"{key}: the tag {tag} is not allowed; write plain values")
            size = 1 + sum(self.size(part, inner, (*above, node)) for inner, part in self._parts(node, key))
            if size > _MOST_VALUES:
                raise self._wrong(node, f"{key} holds more than {_MOST_VALUES} values, anchors written out")
            self._sizes[node] = size
        return self._sizes[node]

    def _parts(self, node: yaml.Node, key: str) -> list[tuple[str, yaml.Node]]:
        """The values in a node, each with its key."""
        if isinstance(node, yaml.SequenceNode):
            return [(f"{key}[{place}]", part) for place, part in enumerate(node.value)]
        if not isinstance(node, yaml.MappingNode):
            if self._configuration and _ENVIRONMENT.search(node.value):
                raise self._wrong(node, f"{key}: {NO_ENVIRONMENT}")
            return []
        parts: dict[str, yaml.Node] = {}
        for name, value in node.value:
            if not isinstance(name, yaml.ScalarNode):
                raise self._wrong(name, "a key must be text")
            inner = f"{key}.{name.value}" if key else name.value
            if inner in parts:
                raise self._wrong(name, f"{inner} is given twice")
            parts[inner] = value
        return list(parts.items())

    def _wrong(self, node: yaml.Node, told: str) -> ConfigError:
        return _wrong(self._path, node.start_mark.line, told)


def _wrong(path: Path, line: int, told: str) -> ConfigError:
    """An error in a line, counted from 0."""
    return ConfigError(f"{shown(path)}, line {line + 1}: {told}")
