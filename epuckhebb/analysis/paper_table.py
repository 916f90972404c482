"""The paper's table: a row for each metric, a column for each controller and side, means over the repeats."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from epuckhebb.analysis.tables import Rows, Table, plain
from epuckhebb.tmaze.individual import GA

METRICS: Mapping[str, str] = {
    "Success": "success",
    "Time-to-Goal (s)": "time_to_goal_s",
    "Path Length (m)": "path_length_m",
    "Average Speed (m/s)": "average_speed_m_s",
    "Final Position Error (m)": "final_position_error_m",
    "Weight Change Mean": "weight_change_mean",
}
_DECIMALS = {"Success": 2, "Time-to-Goal (s)": 2}


@dataclass(frozen=True)
class PaperTable:
    """Means over the repeats of lifetimes, nan where there is none. means: metric -> mean, by controller and side.

    Success is the share of lifetimes that end at the goal. The time to the goal is a mean over those that reach it.
    The GA has no weight change.
    """

    means: Mapping[tuple[str, str], Mapping[str, float]]

    @classmethod
    def from_rows(cls, metrics: Rows) -> "PaperTable":
        """The table of some lifetimes, a row each, as in `metrics.csv`."""
        groups: dict[tuple[str, str], Rows] = {}
        for row in metrics:
            groups.setdefault((row["controller"], row["side"]), []).append(row)
        means = {
            key: {metric: mean(row[column] for row in rows) for metric, column in METRICS.items()}
            for key, rows in groups.items()
        }
        for (controller, _), column in means.items():
            if controller == GA:
                column["Weight Change Mean"] = math.nan
        return cls(means)

    @property
    def rows(self) -> Rows:
        """The rows of `table.csv`: metric, then `<controller> <side>` for each column."""
        return [
            {"metric": metric, **{" ".join(key): column[metric] for key, column in self.means.items()}}
            for metric in METRICS
        ]

    def markdown(self) -> str:
        """The table in Markdown."""
        rows = [
            [f"**{metric}**", *(text(metric, column[metric]) for column in self.means.values())] for metric in METRICS
        ]
        return Table(["", *(plain(" ".join(key)) for key in self.means)], rows, numbers=True).markdown()

    def readable(self, title: str = "") -> Table:
        """The table for the terminal, transposed: a row for each controller and side, a column for each metric."""
        rows = [
            (*map(plain, key), *(text(metric, value) for metric, value in column.items()))
            for key, column in self.means.items()
        ]
        return Table(["controller", "side", *METRICS], rows, title, text=2)


def mean(values: Iterable[float | None]) -> float:
    """The mean of the values that are there, nan of none; its sum is rounded once, so no digit depends on a library."""
    numbers = [value for value in values if value is not None and not math.isnan(value)]
    return math.fsum(numbers) / len(numbers) if numbers else math.nan


def text(metric: str, value: float) -> str:
    """A mean with the paper's decimals; a dash for nan."""
    if math.isnan(value):
        return "–"
    if metric == "Weight Change Mean":
        return f"{value:#.4g}".rstrip(".")
    return f"{value:.{_DECIMALS.get(metric, 4)}f}"


def saturation(metrics: Rows) -> str:
    """A line on the controllers with more than half of their weights saturated at the end; empty without such."""
    names = dict.fromkeys(row["controller"] for row in metrics if row["controller"] != GA)
    shares = {name: mean(row["saturated_fraction"] for row in metrics if row["controller"] == name) for name in names}
    named = ", ".join(f"{100 * share:.0f} % ({name})" for name, share in shares.items() if share > 0.5)
    return f"More than half of the weights end at their bound: {named}." if named else ""
