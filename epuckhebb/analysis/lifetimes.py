"""The lifetimes of many evaluations in one table: each lifetime once, each genome with a name of its own."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from epuckhebb.analysis.evaluate import COLUMNS
from epuckhebb.tmaze.individual import GA

ANY = "any"  # the value of a setting of plasticity in the rows of the GA
OWN_COLUMN = {  # keys that metrics.csv has a column for
    "genome": "genome",
    "seed": "seed",
    "scenario": "scenario",
    "change": "scenario",
    "scenario.light": "light",
    "scenario.obstacles": "obstacles",
    "hebbian.N": "N",
    "hebbian.signal": "signal",
}
_OTHER_COLUMN = {"fitness": "fitness_function"}  # keys whose name is that of a measure in metrics.csv
_NO_CONDITION = ("seed", "repeats", "threads", "lifetime.record_every")  # keys that do not change what is evaluated
_LIFETIME = ["_id", "side", "repeat", "seed"]


@dataclass(frozen=True, kw_only=True)
class Evaluated:
    """One evaluation of many."""

    settings: Mapping[str, Any]  # by key
    where: str  # path of its genome; empty for an array
    sha256: str  # of its genes
    ids: Mapping[str, str]  # for each controller, a digest of all that its lifetimes depend on but side, repeat, seed
    rows: pd.DataFrame  # its lifetimes, with the columns of `metrics.csv`
    place: Mapping[str, str] = field(default_factory=dict)  # more columns, before all others


class Gathered(NamedTuple):
    """The lifetimes of many evaluations.

    rows: one row a lifetime: `Evaluated.place`, a column for each key without a column of its own, `COLUMNS`.
    settings: the columns that name the condition of a row. repeated: a line on evaluations that repeat others, or
    empty.
    """

    rows: pd.DataFrame
    settings: list[str]
    repeated: str


def gather(evaluations: Sequence[Evaluated]) -> Gathered:
    """Put the lifetimes of many evaluations together; a lifetime in several evaluations counts once.

    Two lifetimes are the same if genes, world, controller, side, repeat and seed are the same. The GA has the same
    lifetimes beside every plasticity: they have one row each, with `ANY` for the settings of plasticity.
    """
    keys = list(dict.fromkeys(key for one in evaluations for key in one.settings if key not in _NO_CONDITION))
    more = [key for key in keys if key not in OWN_COLUMN]
    place = list(evaluations[0].place) if evaluations else []
    names, frames = _names(evaluations), []
    for number, one in enumerate(evaluations):
        first = {**one.place, **{_column(key): one.settings.get(key, "") for key in more}}
        frame = pd.concat([pd.DataFrame(first, index=one.rows.index), one.rows], axis=1)
        frame["genome"] = names[frame.experiment.iloc[0], one.sha256]
        for column in (_column(key) for key in keys if is_of_plasticity(key) and key != "hebbian.N"):
            alone = frame.controller == GA
            frame[column] = [ANY if is_alone else value for is_alone, value in zip(alone, frame[column], strict=True)]
        frames.append(frame.assign(_id=frame.controller.map(one.ids), _number=number))
    if not frames:
        return Gathered(pd.DataFrame(columns=[*place, *map(_column, more), *COLUMNS]), [], "")
    whole = pd.concat(frames, ignore_index=True)
    again = whole.duplicated(_LIFETIME)
    rows = whole[~again].drop(columns=["_id", "_number"]).reset_index(drop=True)
    settings = list(dict.fromkeys(map(_column, keys)))
    return Gathered(rows, settings, _repeated(whole, again, evaluations))


def _column(key: str) -> str:
    """The column that has the value of a key."""
    return OWN_COLUMN.get(key) or _OTHER_COLUMN.get(key, key)


def is_of_plasticity(key: str) -> bool:
    """Whether a key, or a column, is a setting of plasticity; the GA has none."""
    return key == "signal" or key.partition(".")[0] in ("hebbian", "adaptation", "compare")


def _names(evaluations: Sequence[Evaluated]) -> dict[tuple[str, str], str]:
    """A name for each genome, by experiment and SHA-256: its first name, or a longer one if two share it."""
    found: dict[tuple[str, str], dict[str, str]] = {}  # experiment and name -> SHA-256 -> where
    known: set[tuple[str, str]] = set()
    for one in evaluations:
        first = one.rows.iloc[0]
        if (first.experiment, one.sha256) not in known:
            known.add((first.experiment, one.sha256))
            found.setdefault((first.experiment, first.genome), {})[one.sha256] = one.where
    return {
        (experiment, sha256): own
        for (experiment, name), genomes in found.items()
        for sha256, own in zip(genomes, _distinct(name, genomes), strict=True)
    }


def _distinct(name: str, genomes: Mapping[str, str]) -> list[str]:
    """Names for genomes of the same name: the shortest ends of their paths that differ, else digests."""
    if len(genomes) == 1:
        return [name]
    paths = [Path(where) for where in genomes.values()]
    parts = [(path.with_suffix("") if path.suffix in (".npz", ".npy") else path).parts for path in paths]
    for length in range(2, max(map(len, parts)) + 1):
        ends = [Path(*own[-length:]).as_posix() for own in parts]
        if len(set(ends)) == len(ends):
            return ends
    return [f"{name}_{number}_{sha256[:8]}" for number, sha256 in enumerate(genomes, start=1)]


def _repeated(whole: pd.DataFrame, again: pd.Series, evaluations: Sequence[Evaluated]) -> str:
    without = sorted(set(whole._number) - set(whole._number[~again]))
    if not without:
        return ""
    place = list(whole.loc[whole._number == without[0], _LIFETIME].iloc[0])
    same = whole[~again & (whole[_LIFETIME] == place).all(axis=1)]._number.iloc[0]
    return repeated(len(without), evaluations[without[0]].settings, evaluations[same].settings)


def repeated(count: int, later: Mapping[str, Any], before: Mapping[str, Any]) -> str:
    """A line on evaluations that repeat others; later, before: the settings of the first one and of what it repeats."""
    differ = [key for key in later if later[key] != before.get(key, "")] or list(later)
    given, first = (", ".join(f"{key}={of.get(key, '')}" for key in differ) for of in (later, before))
    which = f"{given} is given twice" if given == first else f"{given} repeats {first}"
    more = f", and {count - 1} more like it" if count > 1 else ""
    return f"{which}{more}; each lifetime counts once."
