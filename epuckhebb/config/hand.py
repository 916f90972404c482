"""What was changed by hand in a lifetime of `epuckhebb play`, in a file: `scenario.hand=FILE`."""

from typing import Any

import msgspec

from epuckhebb.runtime import refusing, user_path

NAME = "hand.json"  # of the copy in a run folder
_KEY = "scenario.hand"


def read(text: str) -> tuple[dict[str, Any], ...]:
    """The changes in a file, as those of `scenario.changes`."""
    with refusing(lambda error: f"{_KEY}={text} must be a file of `epuckhebb play`: {error}", msgspec.DecodeError):
        return tuple(msgspec.json.decode(content(text), type=list[dict[str, Any]]))


def content(text: str) -> bytes:
    """The bytes of a file of changes."""
    with refusing(lambda error: f"{_KEY}={text} cannot be read: {error.strerror}", OSError):
        return user_path(text, _KEY).read_bytes()


def written(changes: list[dict[str, Any]]) -> bytes:
    """The content of a file of these changes, one a line."""
    return b"[\n" + b",\n".join(map(msgspec.json.encode, changes)) + b"\n]\n"
