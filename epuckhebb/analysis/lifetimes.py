"""The lifetimes of many evaluations in one table: each lifetime once, each genome with a name of its own."""

from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import pandas as pd

from epuckhebb.analysis.evaluate import COLUMNS, MEANS, REWARDED
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
    "environment": "environment",
    "environment.change": "change",
    "environment.changes": "change",
}
# Keys that do not change what is evaluated.
_NO_CONDITION = ("seed", "repeats", "threads", "environment.processes", "lifetime.record_every")
# More that a champion brings along without an effect on its evaluation.
_OF_EVOLUTION = ("genome", "figures", *(f"environment.{k}" for k in ("named", "population", "generations", "loops")))
_OF_NETWORK = ("environment.hidden", "environment.reads_reward")  # with `network.*`
_LIFETIME = ["_id", "side", "repeat", "seed"]


@dataclass(frozen=True, kw_only=True)
class Evaluated:
    """One evaluation of many."""

    settings: Mapping[str, Any]  # by key
    sha256: str  # of the genes of its genome
    ids: Mapping[str, str]  # for each controller, a digest of all that its lifetimes depend on but side, repeat, seed
    rows: pd.DataFrame  # its lifetimes, with the columns of `metrics.csv`
    labels: Mapping[str, str] = field(default_factory=dict)  # more columns, before all others
    config: Mapping[str, Any] = field(default_factory=dict)  # all settings by key, also what its champion brings along


class Gathered(NamedTuple):
    """The lifetimes of many evaluations.

    rows: one row a lifetime: `Evaluated.labels`, a column for each key without a column of its own, `COLUMNS`. The keys
    are those of `Evaluated.settings`, and those of `Evaluated.config` that alone tell conditions apart.
    settings: the columns that name the condition of a row.
    """

    rows: pd.DataFrame
    settings: list[str]


def gather(evaluations: Sequence[Evaluated]) -> Gathered:
    """Put the lifetimes of many evaluations together; a lifetime in several evaluations counts once.

    Two lifetimes are the same if genes, world, controller, side, repeat and seed are the same. The GA has the same
    lifetimes beside every plasticity: they have one row each, with `ANY` for the settings of plasticity.
    """
    all_keys = dict.fromkeys(key for run in evaluations for key in run.settings if key not in _NO_CONDITION)
    all_keys |= dict.fromkeys(_brought(evaluations))
    keys = [key for key in all_keys if not key.startswith("~")]  # what is left out has no value
    more = [key for key in keys if key not in OWN_COLUMN]
    labels = list(evaluations[0].labels) if evaluations else []
    names, frames = _names(evaluations), []
    changes = defaultdict[str, set[str]](set)
    for run in evaluations:
        if "change" in run.rows:
            changes[run.rows.change.iloc[0]].add(str(run.config.get("environment.changes")))
    for run in evaluations:
        values = {key: str(value) for key, value in run.config.items()} | dict(run.settings)
        first = {**run.labels, **{_column(key): values.get(key, "") for key in more}}
        frame = pd.concat([pd.DataFrame(first, index=run.rows.index), run.rows], axis=1)
        frame["genome"] = names[_world_name(run), run.sha256]
        if "change" in frame and len(changes[frame.change.iloc[0]]) > 1:  # functions of one name, in two files
            frame["change"] = str(run.config["environment.changes"])
        for column in (_column(key) for key in keys if is_of_plasticity(key) and key != "hebbian.N"):
            alone = frame.controller == GA
            frame[column] = [ANY if is_alone else value for is_alone, value in zip(alone, frame[column], strict=True)]
        frames.append(frame.assign(_id=frame.controller.map(run.ids)))
    if not frames:
        return Gathered(pd.DataFrame(columns=[*labels, *map(_column, more), *COLUMNS]), [])
    whole = pd.concat(frames, ignore_index=True)
    again = whole.duplicated([name for name in _LIFETIME if name in whole])  # an environment has no sides
    rows = whole[~again].drop(columns="_id").reset_index(drop=True)
    return Gathered(rows, list(dict.fromkeys(map(_column, keys))))


def _brought(evaluations: Sequence[Evaluated]) -> list[str]:
    """The keys that champions bring along from their evolutions, and that alone tell conditions apart.

    In these evaluations with the same other settings differ: in keys of the world where the environment is the same, in
    keys of a controller where its name is the same, too.
    """
    first: dict[Any, str] = {}
    brought: dict[str, None] = {}
    left_out = (*_NO_CONDITION, *_OF_EVOLUTION)
    every = dict.fromkeys(key for run in evaluations for key in run.config)
    keys = [key for key in every if not key.startswith(left_out)]
    for run in evaluations:
        typed = tuple(sorted((k, str(v)) for k, v in run.settings.items() if k not in ("genome", *_NO_CONDITION)))
        world, names = _world_name(run), run.rows.controller.unique()
        for key in keys:
            value = str(run.config.get(key, ""))
            for name in names if is_of_controller(key) else [""]:
                if first.setdefault((typed, world, name, key), value) != value:
                    brought[key] = None
    return list(brought)


def numeric(rows: pd.DataFrame) -> pd.DataFrame:
    """Lifetimes with numbers in place of the text of their measures and N."""
    names = [name for name in ("N", "success", *REWARDED[:1], *MEANS) if name in rows]
    return rows.assign(**{name: pd.to_numeric(rows[name]) for name in names})


def _world_name(run: Evaluated) -> str:
    """The experiment of an evaluation, or its environment."""
    return str(run.rows["environment" if "environment" in run.rows else "experiment"].iloc[0])


def _column(key: str) -> str:
    """The column that has the value of a key; `fitness` is a measure in metrics.csv."""
    return "fitness_function" if key == "fitness" else OWN_COLUMN.get(key, key)


def is_of_plasticity(key: str) -> bool:
    """Whether a key, or a column, is a setting of plasticity; the GA has none."""
    return key == "signal" or key.partition(".")[0] in ("hebbian", "adaptation", "compare")


def is_of_controller(key: str) -> bool:
    """Whether a key, or a column, is a setting of plasticity or of the network, and none of the world."""
    return is_of_plasticity(key) or key.startswith("network") or key in _OF_NETWORK


def _names(evaluations: Sequence[Evaluated]) -> dict[tuple[str, str], str]:
    """A name for each genome, by experiment or environment and SHA-256: its first name, and that where two share it."""
    names: dict[tuple[str, str], str] = {}
    for run in evaluations:
        names.setdefault((_world_name(run), run.sha256), run.rows.genome.iloc[0])
    shared = Counter((experiment, name) for (experiment, _), name in names.items())
    return {
        (experiment, sha256): name if shared[experiment, name] == 1 else f"{name}_{sha256[:8]}"
        for (experiment, sha256), name in names.items()
    }
