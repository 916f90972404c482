"""YAML files of the user's and of runs: what is no plain setting in one is refused, with its name and line."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml
from omegaconf import OmegaConf

from epuckhebb.config.errors import line_of
from epuckhebb.runtime import ConfigError

_MOST_NODES = 100_000  # that the aliases of a file may stand for
_OTHER_BASE = re.compile(r"[-+]?0[\d_]+|.*:.*")  # a plain number that YAML reads in base 8 or 60
_ALIAS = re.compile(r"\*")
_SUSPECT = re.compile(r"(?<![\w.+-])[-+]?0\d|\d:\d|defaults:")  # what a file without this need not be searched for


def load(path: Path) -> dict[str, Any]:
    """The settings in a file, as they stand there."""
    check_aliases(path)
    check_meaning(path)
    try:
        values = OmegaConf.to_container(OmegaConf.create(path.read_text(encoding="utf-8")))
    except OSError as error:
        raise ConfigError(f"{path} cannot be read: {error.strerror}") from error
    except yaml.MarkedYAMLError as error:
        raise ConfigError(f"{path}{line_of(error)}") from error
    except Exception as error:  # what damaged values may raise has no end
        reason = str(error).partition("\n")[0] or "settings must be keys with values"
        raise ConfigError(f"{path}: {reason}") from error
    if not isinstance(values, dict):
        raise ConfigError(f"{path}: settings must be keys with values, got {values}")
    return {str(key): value for key, value in values.items()}


def check_aliases(path: Path) -> None:
    """Refuse a file whose aliases stand for more than memory holds, or for themselves, before they are expanded."""
    root = _root(path, _ALIAS)
    sizes: dict[int, int] = {}

    def size(node: yaml.Node) -> int:
        """How many nodes a node stands for."""
        if id(node) not in sizes:
            sizes[id(node)] = _MOST_NODES + 1  # while it is counted: of a node that contains itself
            sizes[id(node)] = 1 + sum(map(size, _below(node)))
        return sizes[id(node)]

    if root is not None and size(root) > _MOST_NODES:
        raise ConfigError(f"{path}: its aliases stand for more than {_MOST_NODES:,} values, or for themselves")


def check_meaning(path: Path) -> None:
    """Refuse a file that does not mean what it says, and such files of its folder in its defaults.

    YAML reads 010 as 8 and 1:30 as 90. Defaults that come after `_self_` replace the file's own values.
    """
    root = _root(path, _SUSPECT)
    for node in _scalars(root):
        if node.style is None and node.tag.endswith((":int", ":float")) and _OTHER_BASE.fullmatch(node.value):
            number = yaml.safe_load(node.value)
            raise ConfigError(
                f"{path}, line {node.start_mark.line + 1}: YAML reads {node.value} as {number:g}; write {number:g}, "
                f"or, if it is a text, '{node.value}'"
            )
    values = {key.value: value for key, value in root.value} if isinstance(root, yaml.MappingNode) else {}
    defaults = values.pop("defaults", None)
    after_values = False
    for entry in defaults.value if isinstance(defaults, yaml.SequenceNode) else ():
        name, *_ = (node.value for node in _scalars(entry))
        if name == "_self_":
            after_values = True
            continue
        if isinstance(entry, yaml.ScalarNode):
            check_meaning(path.with_name(f"{name}.yaml"))
        place = re.split(r"[ /.@]", name)[-1]
        replaces = isinstance(entry, yaml.ScalarNode) or place in (*values, "_here_", "_global_")
        if after_values and values and replaces and not name.startswith("override "):
            raise ConfigError(
                f"{path}, line {entry.start_mark.line + 1}: {name} comes after _self_, so it replaces values of this "
                "file; put _self_ last in defaults"
            )


def _scalars(node: yaml.Node | None) -> Iterator[yaml.ScalarNode]:
    """The single values, and the keys, in a node."""
    if isinstance(node, yaml.ScalarNode):
        yield node
    for one in _below(node):
        yield from _scalars(one)


def _below(node: yaml.Node | None) -> Iterator[yaml.Node]:
    """The nodes in a list or a mapping, keys among them."""
    for item in node.value if isinstance(node, yaml.CollectionNode) else ():
        yield from item if isinstance(item, tuple) else (item,)


def _root(path: Path, pattern: re.Pattern[str]) -> yaml.Node | None:
    """The nodes of a file in which a pattern is found; of one that is wrong None, since who reads it reports that."""
    try:
        text = path.read_text(encoding="utf-8")
        return yaml.compose(text, Loader=yaml.SafeLoader) if pattern.search(text) else None
    except (OSError, ValueError, RecursionError, yaml.YAMLError):
        return None
