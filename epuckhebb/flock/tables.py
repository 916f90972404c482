"""Tables and page of `epuckhebb flock`: what couplings between robots are good for when one of them breaks.

Flocks, one from each seed, are the independent unit of all intervals. All couplings of a seed have the same starts and
the same noise, so differences are paired by seed.
"""

import math
from collections.abc import Sequence

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from epuckhebb.analysis.statistics import bootstrap, bounds, mean, wilson_by_champion
from epuckhebb.analysis.tables import Table, code, interval_text
from epuckhebb.flock.plane import CHANGE_S, SAMPLE_S, Flock, Record

CONDITION = ("loudness", "knowers", "range_m", "breaks", "coupling")
METRICS = (
    "before", "just_after", "long_after", "weight_to_broken", "effective_leaders", "polarisation", "spread_m",
    "least_gap_m",
)  # fmt: skip
_GOOD = 0.9  # cosine of heading to the goal
WHAT_BREAKS = {
    "stranger": "a robot that knows nothing breaks",
    "knower": "a robot that knows the way breaks",
    "none": "no robot breaks",
}


def run_metrics(flock: Flock, record: Record) -> dict[str, float]:
    """The metrics of a run.

    before, just_after, long_after: mean cosine of heading to the goal of the intact robots, in the second half of the
    time before the break, in the first tenth of the time after it, and in the second half of that; the others are of
    the last of these spans, but for the least gap, of the whole run.
    """
    breaks, end = round(flock.at_s / SAMPLE_S), len(record.path)
    late = slice((breaks + end) // 2, None)
    cosines, headings = heading_cosine(flock, record), record.path[late, :, 2]
    places = record.path[late, :, :2]
    weights = record.weights[round((flock.at_s + flock.duration_s) / 2 / CHANGE_S) :]
    attention = shares(weights)
    entropy = -(attention * np.log(np.where(attention > 0, attention, 1.0))).sum(axis=2)
    to_broken = weights[:, :, flock.broken].sum(axis=1) / (flock.robots - 1)
    return {
        "before": cosines[breaks // 2 : breaks].mean(),
        "just_after": cosines[breaks : breaks + max(1, (end - breaks) // 10)].mean(),
        "long_after": cosines[late].mean(),
        "weight_to_broken": to_broken.mean() if flock.broken >= 0 else math.nan,
        "effective_leaders": np.exp(entropy).mean(),
        "polarisation": np.hypot(np.cos(headings).mean(axis=1), np.sin(headings).mean(axis=1)).mean(),
        "spread_m": np.hypot(*(places - places.mean(axis=1, keepdims=True)).transpose(2, 0, 1)).mean(),
        "least_gap_m": record.least_gap,
    }


def shares(weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Couplings as shares of the attention of each listener, (..., listeners, speakers)."""
    attention: NDArray[np.float64] = weights / np.maximum(weights.sum(axis=-1, keepdims=True), 1e-9)
    return attention


def couplings(flock: Flock, records: Sequence[Record]) -> pd.DataFrame:
    """The mean share of the attention of each listener for each speaker, just before the break and at the end."""
    at = int(flock.at_s / CHANGE_S)
    before, end = np.mean([shares(record.weights[[at, -1]]) for record in records], axis=0)
    listeners, speakers = (places.ravel() for places in np.indices(before.shape))
    pairs = {"listener": listeners, "speaker": speakers, "before": before.ravel(), "end": end.ravel()}
    return pd.DataFrame(pairs).round(6)


def heading_cosine(flock: Flock, record: Record) -> NDArray[np.float64]:
    """The mean cosine of heading to the goal of the robots that do not break, (samples,)."""
    intact = [robot for robot in range(flock.robots) if robot != flock.broken]
    means: NDArray[np.float64] = np.cos(record.path[:, intact, 2]).mean(axis=1)
    return means


def table(runs: pd.DataFrame, seed: int) -> pd.DataFrame:
    """A row for each condition, with 95 % intervals over flocks. runs: a row for each run. seed: of the bootstrap."""
    frozen = runs[runs.coupling == "frozen"].set_index([*CONDITION[:-1], "seed"]).long_after
    rows = []
    for condition, group in runs.groupby(list(CONDITION), sort=False):
        good = (group.long_after > _GOOD).to_numpy(np.int64)
        row = dict(zip(CONDITION, condition, strict=True)) | {"runs": len(group), "good": good.mean()}
        row |= bounds("good_", wilson_by_champion(good, np.ones_like(good)))
        paired = group.set_index([*CONDITION[:-1], "seed"]).long_after
        values = {name: group[name] for name in METRICS} | {"difference": paired - frozen.loc[paired.index]}
        for name, each in values.items():
            row[name] = each.min() if name == "least_gap_m" else each.mean()
            if name != "least_gap_m":
                row |= bounds(f"{name}_", bootstrap(mean, each.to_numpy(), seed=seed))
        rows.append(row)
    return pd.DataFrame(rows)


def curves(minutes: pd.DataFrame, seed: int) -> pd.DataFrame:
    """The mean over flocks at each minute, with its interval. minutes: a row for each run and minute."""
    rows = []
    for (breaks, coupling, minute), group in minutes.groupby(["breaks", "coupling", "minute"], sort=False):
        row = {"breaks": breaks, "coupling": coupling, "minute": minute, "cosine": group.cosine.mean()}
        rows.append(row | bounds("cosine_", bootstrap(mean, group.cosine.to_numpy(), seed=seed)))
    return pd.DataFrame(rows)


def minute_cosines(flock: Flock, record: Record) -> list[float]:
    """The mean cosine of heading to the goal in each minute, of the robots that do not break."""
    cosines, size = heading_cosine(flock, record), round(60 / SAMPLE_S)
    return [float(cosines[first : first + size].mean()) for first in range(0, len(cosines), size)]


def usual(table: pd.DataFrame) -> pd.DataFrame:
    """The rows of the usual condition, which is the first."""
    first = table.iloc[0]
    is_usual = (table.loudness == first.loudness) & (table.knowers == first.knowers) & (table.range_m == first.range_m)
    return table[is_usual]


def main_tables(table: pd.DataFrame) -> list[Table]:
    """The rows of the usual condition, a table for each kind of break."""
    head = [
        "couplings", "before", "just after", "long after", "difference to frozen", "runs above .9", "weight to the "
        "broken", "effective leaders", "polarisation", "spread (m)", "least gap (mm)",
    ]  # fmt: skip
    tables = []
    for breaks, group in usual(table).groupby("breaks", sort=False):
        rows = []
        for row in group.itertuples():
            cells = [interval_text(row, name, ".3f") for name in ("before", "just_after", "long_after")]
            cells += ["–" if row.coupling == "frozen" else interval_text(row, "difference", "+.3f")]
            cells += [f"{row.good * row.runs:.0f} of {row.runs}"]
            cells += [interval_text(row, name) for name in METRICS[3:7]]
            rows.append([_name(row.coupling), *cells, f"{1000 * row.least_gap_m:.1f}"])
        tables.append(Table(head, rows, f"{WHAT_BREAKS[str(breaks)].capitalize()} (n = {group.runs.iloc[0]})"))
    return tables


def sweep_table(table: pd.DataFrame) -> Table:
    """The cosine long after the break in every condition, a row each."""
    names = list(dict.fromkeys(table.coupling))
    rows = []
    for condition, group in table.groupby(list(CONDITION[:-1]), sort=False):
        loudness, knowers, range_m, breaks = condition
        cells = {row.coupling: row for row in group.itertuples()}
        rows.append(
            [str(breaks), f"{loudness:g}", f"{knowers}", f"{range_m:g}", f"{group.runs.iloc[0]}"]
            + [interval_text(cells[name], "long_after") for name in names]
        )
    return Table(["breaks", "loudness", "knowers", "range (m)", "n", *map(_name, names)], rows)


def page(table: pd.DataFrame, made: str, figures: Sequence[str]) -> str:
    """The page of a study. made: a sentence on its settings. figures: the names of the files of its figures."""
    is_swept = len(usual(table)) < len(table)
    return "\n".join(
        [
            "# Couplings between robots: influence or competence?\n",
            f"{made} Mean cosine of heading to the goal of the intact robots, 1 for straight there. 95 % intervals "
            "over flocks. *Shuffled*: the coupling is given the transfer entropy of other pairs, or the live fitness "
            "of another robot. The oracle is given the number of the broken robot.\n",
            *(f"![{name.removesuffix('.png')}](figures/{name})\n" for name in figures),
            *(f"{part.title}:\n\n{part.markdown()}" for part in main_tables(table)),
            *([f"## Sweep: long after the break\n\n{sweep_table(table).markdown()}"] if is_swept else []),
        ]
    )


def coupling_title(coupling: str) -> str:
    """The title of a coupling in a figure or on a page: `transfer entropy × fitness`."""
    return coupling.replace("_", " ").replace(" x ", " × ")


def _name(coupling: object) -> str:
    name, _, control = str(coupling).partition(" ")
    return f"{code(name)} {control}".strip()
