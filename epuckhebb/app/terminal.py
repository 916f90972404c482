"""Where the program speaks: standard output and standard error, whatever they can show and whether or not one reads."""

import os
import sys
from contextlib import suppress
from io import TextIOWrapper
from typing import IO

from rich.console import Console


class Terminal(Console):
    """Standard output, or standard error, for a reader; who stops reading does not stop the work."""

    def __init__(self, *, stderr: bool = False) -> None:
        """Write names as they are: nothing in them is an emoji. A notebook gets the lines that a file would get."""
        super().__init__(stderr=stderr, highlight=not stderr, emoji=False, force_jupyter=False)

    def on_broken_pipe(self) -> None:
        """Say nothing more."""
        fall_silent(self.file)


def fall_silent(stream: IO[str]) -> None:
    """Let nothing come of what else is written to a stream that nobody reads, at the end of the program too."""
    with suppress(OSError, ValueError):  # a stream of a test has no number
        os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())


def show_what_can_be_shown() -> None:
    """Let standard output have a `?` for each sign that its encoding does not have, as standard error has a code."""
    if isinstance(sys.stdout, TextIOWrapper):
        sys.stdout.reconfigure(errors="replace")
