"""What Hydra does again for each composition, to the same result, is done once or not at all.

For each job of a multirun Hydra parses some fifteen small YAML files, and for each of them it lists all choices, which
only an interpolation in a list of defaults needs. That is nearly half of the time that a composition takes. Here a text
is parsed once by a process, and the list is made where it is needed. A Hydra whose insides are others is left as it is.
"""

import copy
from collections.abc import Callable
from pathlib import Path
from typing import Any

from hydra._internal import config_repository, defaults_list
from hydra.core.object_type import ObjectType
from omegaconf import OmegaConf

_FILE, _PACKAGE = "file", "pkg"  # where files are: in a folder, or in an installed package, whose files do not change
_parsed: dict[tuple[object, ...], Any] = {}

Load = Callable[[Any, str], Any]
Choices = Callable[[Any, Any, bool], Any]


def parse_once() -> None:
    """From now on, let Hydra compose without doing its work twice."""
    repository: Any = config_repository.ConfigRepository
    lists: Any = defaults_list
    if hasattr(repository, "load_config") and hasattr(repository, "_find_object_source"):
        repository.load_config = _remembering(repository.load_config)
    if hasattr(lists, "_create_interpolation_map"):
        lists._create_interpolation_map = _where_needed(lists._create_interpolation_map)


def _remembering(load: Load) -> Load:
    def load_config(repository: Any, config_path: str) -> Any:
        source = repository._find_object_source(config_path=config_path, object_type=ObjectType.CONFIG)
        if source is None or source.scheme() not in (_FILE, _PACKAGE):
            return load(repository, config_path)
        key: tuple[object, ...] = (source.scheme(), source.provider, source.path, config_path)
        if source.scheme() == _FILE:  # a user may change it at any time
            key = (*key, Path(source.path, source._normalize_file_name(config_path)).read_bytes())
        if key not in _parsed:
            _parsed[key] = load(repository, config_path)
        return copy.deepcopy(_parsed[key])  # Hydra may put it as it is into what it composes, and change that

    return load_config


def _where_needed(choices: Choices) -> Choices:
    def create_interpolation_map(overrides: Any, entries: Any, self_added: bool) -> Any:
        if any(entry.is_interpolation() for entry in entries):
            return choices(overrides, entries, self_added)
        return OmegaConf.create()

    return create_interpolation_map
