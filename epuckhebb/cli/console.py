"""Where and how the program prints: texts, tables and JSON, and errors as one message and an exit code."""

import json
import sys
import textwrap
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import typer
from rich import box
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text

from epuckhebb.runtime import (
    INTERRUPTED,
    JOB_FAILED,
    USAGE,
    ConfigError,
    JobFailedError,
    discard,
    interrupted,
    interruptible,
)

_GAP = 2  # characters between the columns of a table
_LEAST = 10  # characters that a column of text needs
_HEADING = 8  # characters of a heading's line above narrower figures, where there is no room for it whole
_NARROWEST = 40  # characters of a terminal for which lines are broken
_USUAL, _UNBROKEN = 80, 10_000  # characters where the width is unknown, and where it is too small


class Terminal(Console):
    """Standard output, or standard error, for a reader."""

    def __init__(self, *, stderr: bool = False) -> None:
        """Write names as they are: nothing in them is an emoji. A notebook gets the lines that a file would get."""
        super().__init__(stderr=stderr, highlight=not stderr, emoji=False, force_jupyter=False)
        if self.width < _NARROWEST:
            self.width = _UNBROKEN if self.width > 0 else _USUAL

    def on_broken_pipe(self) -> None:
        """Say nothing more: nobody reads it, and what was to be done is done."""
        discard(self.file)


def print_line(console: Console, text: str) -> None:
    """Print a line as it is, however long, so that it can be copied."""
    console.print(text, markup=False, highlight=False, soft_wrap=True)


def print_text(console: Console, text: Text) -> None:
    """Print a text in lines no longer than the terminal; a word that is longer, such as a path, stays whole."""
    console.print(text, overflow="ignore", crop=False)


def print_table(
    console: Console, title: str, headings: Sequence[str], rows: Iterable[Iterable[object]], *, text: int = 1
) -> None:
    """Print a table no wider than the terminal; nothing in it is cut.

    Args:
        console: Where to print it.
        title: A line above it; none if empty.
        headings: A heading for each column.
        rows: The cells of each row.
        text: The number of leading columns with text, which may break into lines. The others hold figures: they end at
            the right, and stay whole where the text has room beside them.
    """
    written = [[str(cell) for cell in row] for row in rows]
    cells = [max((cell_len(row[k]) for row in written), default=0) for k in range(len(headings))]
    widths = [max(cell_len(heading), cell) for heading, cell in zip(headings, cells, strict=True)]
    if sum(width + _GAP for width in widths) > console.width:
        widths = [max(_HEADING, cell) for cell in cells]
    lines = [
        textwrap.wrap(heading, width, break_long_words=False) for heading, width in zip(headings, widths, strict=True)
    ]
    figures = [max(cell, *map(cell_len, broken), 0) for cell, broken in zip(cells[text:], lines[text:], strict=True)]
    whole = console.width - sum(width + _GAP for width in figures) >= text * _LEAST
    table = Table(box=box.SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, 1, 0, 0))
    for number, heading in enumerate(headings):
        if number < text:
            table.add_column(Text(heading), overflow="fold")
        else:
            table.add_column(Text("\n".join(lines[number])), justify="right", no_wrap=whole, overflow="fold")
    for row in written:
        table.add_row(*map(Text, row))
    if title:
        print_text(console, Text(title, style="bold"))
    console.print(table)


def print_error(message: str) -> None:
    """Print an error message on standard error."""
    console = Terminal(stderr=True)
    console.print("Error: ", style="bold red", end="")
    console.print(message, markup=False, soft_wrap=True)


@contextmanager
def report_errors() -> Iterator[None]:
    """Turn errors into one message and an exit code."""
    message, code = "", USAGE
    try:
        with interruptible():
            yield
    except ConfigError as error:
        message = str(error)
    except KeyboardInterrupt as interruption:
        message, code = interrupted(str(interruption)), INTERRUPTED
    except JobFailedError as error:
        message, code = f"a job failed: {error}", JOB_FAILED
    except (Exception, SystemExit) as error:  # a user's own part may raise anything, and even leave Python
        config = sys.modules.get("epuckhebb.config")  # if it is not loaded, no file of the user's is
        if config is not None and (place := config.user_place(error)):
            message = f"{place}: {type(error).__name__}: {error}"
        elif isinstance(error, BrokenPipeError):  # nobody reads what we say, and what we do is done
            discard(sys.stdout)
        elif isinstance(error, OSError):
            message = f"{error.filename}: {error.strerror}" if error.filename else str(error)
        elif isinstance(error, MemoryError):
            message = f"there is not enough memory for this: {error}"
        else:
            raise
    if message:
        print_error(message)
        raise typer.Exit(code)


def json_text(values: Any) -> str:
    """The text of JSON values; numbers that JSON does not have, nan and infinite ones, are null."""
    return json.dumps(json.loads(json.dumps(values), parse_constant=lambda _: None), allow_nan=False)
