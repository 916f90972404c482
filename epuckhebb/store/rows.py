"""The rows of a table as CSV and back, with all digits of the numbers and nothing in cells without a value.

pandas takes a tenth of a second to load, and one run needs nothing else of it. Bytes and types are those of pandas.
"""

import csv
import io
import math
import re
from collections.abc import Callable, Sequence
from numbers import Integral
from typing import Any

from epuckhebb.analysis.tables import Rows

TEXTS = (  # columns of text that might look like numbers
    *("genome", "scenario", "controller", "changed", "run", "error", "champion", "test", "tests", "coupling"),
    *("method", "matched_control", "dead_sensors", "reached_side", "succeeds"),
)
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*([eE][+-]?\d+)?|\.\d+([eE][+-]?\d+)?|inf)", re.ASCII)


def as_csv(rows: Rows, *, header: bool = True) -> str:
    """A table as CSV; a column of whole numbers with an empty cell, or with a fraction, is written as 3.0."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    names = list(dict.fromkeys(name for row in rows for name in row))
    if header:
        writer.writerow(names)
    columns = [_cells([row.get(name) for row in rows]) for name in names]
    writer.writerows(zip(*columns, strict=True))
    return text.getvalue()


def _cells(values: Sequence[Any]) -> list[Any]:
    """A column as cells of CSV: empty without a value; all with a fraction if one has it, or one is empty."""
    cells = ["" if value is None or (isinstance(value, float) and math.isnan(value)) else value for value in values]
    filled = [value for value in cells if not isinstance(value, str)]
    is_whole = all(isinstance(value, Integral) and not isinstance(value, bool) for value in filled)
    has_fraction = any(isinstance(value, float) for value in filled) or (is_whole and "" in cells)
    return [float(value) if has_fraction and not isinstance(value, str) else value for value in cells]


def parse_csv(text: str) -> Rows:
    """The rows of a table in CSV, None in cells without a value; whole numbers beside these are read as 3.0."""
    names, *lines = csv.reader(io.StringIO(text)) or [[]]
    columns = [_values(name, cells) for name, cells in zip(names, zip(*lines, strict=True), strict=False)]
    return [dict(zip(names, values, strict=True)) for values in zip(*columns, strict=True)]


def _values(name: str, cells: Sequence[str]) -> list[Any]:
    """The values of a column of CSV: texts, whole numbers, other numbers, or truth values; None in empty cells."""
    filled = [cell for cell in cells if cell]
    kind: Callable[[str], Any] = str
    if name not in TEXTS and filled:
        if all(_NUMBER.fullmatch(cell) for cell in filled):
            is_whole = len(filled) == len(cells) and all(cell.lstrip("+-").isdigit() for cell in filled)
            kind = int if is_whole else float
        elif {*filled} <= {"True", "False"}:
            kind = "True".__eq__
    return [kind(cell) if cell else None for cell in cells]
