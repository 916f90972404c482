"""What was changed by hand in a lifetime of `epuckhebb play`, in a file: `scenario.hand=FILE`."""

from typing import Any

import msgspec

from epuckhebb.runtime import ConfigError, path_of

NAME = "hand.json"  # of the copy in a run folder
_KEY = "scenario.hand"


def read(text: str) -> tuple[dict[str, Any], ...]:
    """The changes in a file, as those of `scenario.changes`."""
    try:
        return tuple(msgspec.json.decode(content(text), type=list[dict[str, Any]]))
    except msgspec.DecodeError as error:
        raise ConfigError(f"{_KEY}={text} must be a file that `epuckhebb play` wrote: {error}") from error


def content(text: str) -> bytes:
    """The bytes of a file of changes."""
    try:
        return path_of(text, _KEY).read_bytes()
    except OSError as error:
        raise ConfigError(f"{_KEY}={text} cannot be read: {error.strerror}") from error


def written(changes: list[dict[str, Any]]) -> bytes:
    """The content of a file of these changes, one a line."""
    return b"[\n" + b",\n".join(map(msgspec.json.encode, changes)) + b"\n]\n"
