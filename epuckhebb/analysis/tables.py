"""Tables to read, in Markdown or in the terminal, and names and numbers in them."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

Rows = list[dict[str, Any]]  # of a table, None or nan in cells without a value; pandas takes a while to load
BAR = r"\|"
NEW_LINE = "<br>"  # in a cell of a table in Markdown
_SIGNS = re.compile(r"[\\`*<>&\[\]~$#]|(?<!\w)_|_(?!\w)")  # Markdown shows an underscore within a word as it is


@dataclass(frozen=True)
class Table:
    """A table to read. `markdown` is here; `epuckhebb.cli.console.print_table` shows it in the terminal.

    headings: of the columns. rows: the cells of each, as Markdown has them. title: for the terminal. text: how many
    leading columns hold text; in the terminal, the others hold figures. numbers: align all but the first column on the
    right in Markdown.
    """

    headings: Sequence[str]
    rows: Iterable[Sequence[str]]
    title: str = ""
    text: int = 1
    numbers: bool = False

    def markdown(self) -> str:
        """The table in Markdown; a bar in a cell does not end it."""
        rule = ["---", *["---:" if self.numbers else "---"] * (len(self.headings) - 1)]
        lines = (self.headings, rule, *self.rows)
        return "".join(f"| {' | '.join(cell.replace('|', BAR) for cell in line)} |\n" for line in lines)

    def only(self, *headings: str, text: int = 1) -> "Table":
        """The table with these columns alone, in this order. text: how many of them hold text."""
        columns = [list(self.headings).index(heading) for heading in headings]
        rows = [[row[column] for column in columns] for row in self.rows]
        return Table(headings, rows, self.title, text)


def interval_text(row: Any, name: str, form: str = ".2f", unit: str = "") -> str:
    """A number of a row of a table as text, with its interval, as far as they are known; a dash without the number.

    name: of the column. Its interval is in `NAME_low` and `NAME_high`, or that of `A_share` in `A_low` and `A_high`.
    """
    stem = f"{name}_" if hasattr(row, f"{name}_low") else name.removesuffix("share")
    value, low, high = (getattr(row, key, math.nan) for key in (name, f"{stem}low", f"{stem}high"))
    if math.isnan(value):
        return "–"
    return f"{value:{form}}{unit}" + (
        "" if math.isnan(low) else f" [{low:{form}}, {'–' if math.isnan(high) else f'{high:{form}}'}]"
    )


def rates(of: Sequence[tuple[str, float]]) -> str:
    """The base rates of controllers in words, with the controllers where they differ; empty without a rate.

    of: the name of each controller and its N; a name may come several times.
    """
    named = {rate: [name for name, value in dict.fromkeys(of) if value == rate] for _, rate in of if rate > 0}
    if len(named) < 2:
        return "".join(f"N = {rate:g}" for rate in named)
    return "N = " + ", ".join(f"{rate:g} ({', '.join(names)})" for rate, names in named.items())


def plain(name: str) -> str:
    """A name in one line that Markdown shows as it is, whatever signs it has."""
    return _SIGNS.sub(r"\\\g<0>", " ".join(name.split()))


def short_headings(keys: Sequence[str]) -> list[str]:
    """Keys without the groups in which they stand, where they stay different: a terminal is narrow."""
    names = [key.rpartition(".")[2] for key in keys]
    return names if len(set(names)) == len(names) else list(keys)


def cell(value: object) -> str:
    """A setting in a table in Markdown; `none` where there is no such setting."""
    return "none" if value is None or value == "" or value != value else plain(str(value))  # noqa: PLR0124  # nan


def unmarked(cell: str) -> str:
    """A cell without the signs of Markdown."""
    return re.sub(r"\*\*|`|\\(.)", lambda sign: sign[1] or "", cell)


def code(name: str) -> str:
    """A name in one line, as code in Markdown, whatever signs it has."""
    name = " ".join(name.split()) or " "
    fence = "`" * (1 + max(map(len, re.findall("`+", name)), default=0))
    space = " " if "`" in name else ""
    return f"{fence}{space}{name}{space}{fence}"


def pictures(captions: Mapping[str, str]) -> list[str]:
    """Figures and their captions in Markdown. captions: by the names of the files in `figures/`."""
    return [f"![{caption}](figures/{name})\n\n*{caption}*\n" for name, caption in captions.items()]
