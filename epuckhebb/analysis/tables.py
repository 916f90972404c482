"""The paper's tables: a row for each metric, a column for each controller and side."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence

import pandas as pd

from epuckhebb.sim.controller import GA

ROWS: Mapping[str, str] = {
    "Success": "success",
    "Time-to-Goal (s)": "time_to_goal_s",
    "Path Length (m)": "path_length_m",
    "Average Speed (m/s)": "average_speed_m_s",
    "Final Position Error (m)": "final_position_error_m",
    "Weight Change Mean": "weight_change_mean",
}
BAR = r"\|"
_SIGNS = re.compile(r"[\\`*<>&\[\]~$#]|(?<!\w)_|_(?!\w)")  # Markdown shows an underscore within a word as it is
_DECIMALS = {"Success": 2, "Time-to-Goal (s)": 2}


def paper_table(metrics: pd.DataFrame) -> pd.DataFrame:
    """Means over the repeats, in the paper's layout: index `ROWS`, columns (controller, side).

    Success is the share of lifetimes that end at the goal. The time to the goal is a mean over those that reach it.
    The GA has no weight change.
    """
    means = metrics.groupby(["controller", "side"], sort=False)[list(ROWS.values())].mean()
    table = means.rename(columns={column: row for row, column in ROWS.items()}).T
    table.loc["Weight Change Mean", [column for column in table.columns if column[0] == GA]] = math.nan
    table.index.name = "metric"
    return table


def formatted(table: pd.DataFrame) -> pd.DataFrame:
    """The same table as text, with the paper's decimals and a dash where there is no value."""

    def text(value: float, row: str) -> str:
        if math.isnan(value):
            return "–"
        if row == "Weight Change Mean":
            return f"{value:#.4g}".rstrip(".")
        return f"{value:.{_DECIMALS.get(row, 4)}f}"

    rows = {row: [text(value, str(row)) for value in table.loc[row]] for row in table.index}
    return pd.DataFrame.from_dict(rows, orient="index", columns=table.columns)


def saturation(metrics: pd.DataFrame) -> str:
    """A line on the controllers with more than half of their weights saturated at the end; empty without such."""
    shares = metrics[metrics.controller != GA].groupby("controller", sort=False).saturated_fraction.mean()
    named = ", ".join(f"{100 * share:.0f} % ({name})" for name, share in shares[shares > 0.5].items())
    return f"More than half of the weights end at their bound, hebbian.w_max: {named}." if named else ""


def to_csv(table: pd.DataFrame) -> str:
    """The table as CSV, one header line: metric, then `<controller> <side>` for each column."""
    flat = table.copy()
    flat.columns = [" ".join(column) for column in table.columns]
    return str(flat.to_csv())


def to_markdown(table: pd.DataFrame) -> str:
    """The table in Markdown."""
    text = formatted(table)
    head = ["", *(plain(" ".join(column)) for column in text.columns)]
    rows = [[f"**{row}**", *values] for row, values in zip(text.index, text.to_numpy().tolist(), strict=True)]
    return markdown_table(head, rows, numbers=True)


def markdown_table(head: Sequence[str], rows: Iterable[Sequence[str]], *, numbers: bool = False) -> str:
    """A table in Markdown; a bar in a cell does not end it. numbers: align all columns but the first on the right."""
    rule = ["---", *["---:" if numbers else "---"] * (len(head) - 1)]
    return "".join(f"| {' | '.join(cell.replace('|', BAR) for cell in line)} |\n" for line in (head, rule, *rows))


def rates(of: Sequence[tuple[str, float]]) -> str:
    """The base rates of controllers in words, with the controllers where they differ; empty without a rate.

    of: the name of each controller and its N; a name may come several times.
    """
    named = {rate: [name for name, own in dict.fromkeys(of) if own == rate] for _, rate in of if rate > 0}
    if len(named) < 2:
        return "".join(f"N = {rate:g}" for rate in named)
    return "N = " + ", ".join(f"{rate:g} ({', '.join(names)})" for rate, names in named.items())


def plain(name: str) -> str:
    """A name in one line that Markdown shows as it is, whatever signs it has."""
    return _SIGNS.sub(r"\\\g<0>", " ".join(name.split()))


def code(name: str) -> str:
    """A name in one line, as code in Markdown, whatever signs it has."""
    name = " ".join(name.split()) or " "
    fence = "`" * (1 + max(map(len, re.findall("`+", name)), default=0))
    space = " " if "`" in name else ""
    return f"{fence}{space}{name}{space}{fence}"
