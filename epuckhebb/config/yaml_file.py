"""YAML files of the user's and of runs: what is no plain setting in one is refused, with its name and line."""

from pathlib import Path
from typing import Any

import yaml
from omegaconf import OmegaConf

from epuckhebb.config.errors import line_of
from epuckhebb.runtime import ConfigError

_MOST_NODES = 100_000  # that the aliases of a file may stand for


def load(path: Path) -> dict[str, Any]:
    """The settings in a file, as they stand there."""
    check_aliases(path)
    try:
        values = OmegaConf.to_container(OmegaConf.create(path.read_text(encoding="utf-8")))
    except OSError as error:
        raise ConfigError(f"{path} cannot be read: {error.strerror}") from error
    except yaml.MarkedYAMLError as error:
        raise ConfigError(f"{path}{line_of(error)}") from error
    except Exception as error:  # what damaged values may raise has no end
        raise ConfigError(f"{path}: {str(error).partition(chr(10))[0]}") from error
    if not isinstance(values, dict):
        raise ConfigError(f"{path}: settings must be keys with values, got {values}")
    return {str(key): value for key, value in values.items()}


def check_aliases(path: Path) -> None:
    """Refuse a file whose aliases stand for more than memory holds, or for themselves, before any of them is expanded.

    What else is wrong with a file is reported by who reads it.
    """
    try:
        text = path.read_text(encoding="utf-8")
        root = yaml.compose(text, Loader=yaml.SafeLoader) if "*" in text else None
    except (OSError, ValueError, RecursionError, yaml.YAMLError):
        return
    sizes: dict[int, int] = {}

    def size(node: yaml.Node) -> int:
        """How many nodes a node stands for."""
        if id(node) not in sizes:
            sizes[id(node)] = _MOST_NODES + 1  # while it is counted: of a node that contains itself
            value = node.value if isinstance(node, yaml.CollectionNode) else []
            below = (one for item in value for one in (item if isinstance(item, tuple) else (item,)))
            sizes[id(node)] = 1 + sum(map(size, below))
        return sizes[id(node)]

    if root is not None and size(root) > _MOST_NODES:
        raise ConfigError(f"{path}: its aliases stand for more than {_MOST_NODES:,} values, or for themselves")
