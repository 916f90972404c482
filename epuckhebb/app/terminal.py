"""Where the program speaks: standard output and standard error, whatever they can show and whether or not one reads."""

import itertools
import os
import sys
from collections.abc import Iterable, Sequence
from contextlib import suppress
from io import TextIOWrapper
from typing import IO, Any

from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text

_GAP = 2  # characters between the columns of a table without lines


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


def print_table(
    console: Console, title: str, headings: Iterable[str], rows: Iterable[Iterable[Any]], *, numbers: bool = False
) -> None:
    """Print a table of which no cell is cut: lines of a cell end between words.

    A table that is too wide for that loses its lines; if it still is, it turns on its side, with a column for each row;
    and if that is too wide as well, each row becomes a block of lines.

    Args:
        console: Where to.
        title: What stands above it; nothing if empty.
        headings: What stands above each column.
        rows: The cells of each row.
        numbers: Whether all but the first column are numbers, which end at the right.
    """
    upright = [list(map(str, row)) for row in (headings, *rows)]
    on_its_side = [[cell.replace("\n", " ") for cell in row] for row in zip(*upright, strict=True)]
    for cells, lined in itertools.product((upright, on_its_side), (True, False)):
        widths = _widths(cells, console.width, lined)
        if widths:
            console.print(_table(title, cells, widths, numbers, lined))
            return
    if title:
        console.print(Text(title, style="bold"), soft_wrap=True)
    widest = max(cell_len(heading) for heading, *_ in on_its_side)
    for row in zip(*(own[1:] for own in on_its_side), strict=True):
        for (heading, *_), cell in zip(on_its_side, row, strict=True):
            console.print(Text.assemble((f"{heading:<{widest}}  ", "bold"), cell), soft_wrap=True)
        console.print()


def _table(title: str, cells: Sequence[Sequence[str]], widths: Sequence[int], numbers: bool, lined: bool) -> Table:
    shown = Table(title=Text(title, style="bold") if title else None, title_justify="left")
    if not lined:
        shown.box, shown.padding, shown.pad_edge = None, (0, _GAP, 0, 0), False
    for number, (heading, width) in enumerate(zip(cells[0], widths, strict=True)):
        shown.add_column(Text(heading), width=width, justify="right" if numbers and number else "left")
    for row in cells[1:]:
        shown.add_row(*map(Text, row))
    return shown


def _widths(cells: Sequence[Sequence[str]], room: int, lined: bool) -> list[int]:
    """The width of each column, so that the table has room and no word is cut; none if it cannot be."""
    columns = list(zip(*cells, strict=True))
    least = [max(cell_len(word) for cell in column for word in (*cell.split(), "")) for column in columns]
    widths = [max(cell_len(line) for cell in column for line in (*cell.splitlines(), "")) for column in columns]
    room -= 3 * len(columns) + 1 if lined else _GAP * (len(columns) - 1)  # a line, and a space on either side of it
    if sum(least) > room:
        return []
    while sum(widths) > room:
        place = max(range(len(widths)), key=lambda column: widths[column] - least[column])
        widths[place] -= 1
    return widths
