"""`epuckhebb flock`: flocks with every coupling and its controls, in every condition of a sweep, and their tables.

Each condition is a job, whose runs share the threads of one process.
"""

import copy
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import pandas as pd

from epuckhebb.analysis.tables import Table
from epuckhebb.config import MOST_THREADS, Plain, load, make_config, make_part, part_class, part_settings, register
from epuckhebb.controller.compiling.errors import PartError
from epuckhebb.controller.ranges import check as check_ranges
from epuckhebb.controller.ranges import within
from epuckhebb.flock import replay, tables
from epuckhebb.flock.coupling import Coupling
from epuckhebb.flock.couplings.frozen import Frozen
from epuckhebb.flock.couplings.oracle import Oracle
from epuckhebb.flock.plane import Flock, Record, run
from epuckhebb.runs import hydra
from epuckhebb.runtime import ConfigError, thread_count
from epuckhebb.store import Run
from epuckhebb.studies.jobs import split
from epuckhebb.studies.study import Planned, Study, prepare

if TYPE_CHECKING:
    from matplotlib.figure import Figure

QUICK = (
    "seed=1",  # those of the study are not looked at in a smoke test
    "repeats=4",
    "flock.duration_s=1200",
    "flock.at_s=600",
    "flock.sweep={loudness: [], knowers: [], range_m: [], repeats: 4}",
)
ALL, FROZEN, ORACLE = "all", "frozen", "oracle"
_INFLUENCE, _FITNESS = "transfer_entropy", "live_fitness"
_ROWS = (_INFLUENCE, _FITNESS, f"{_INFLUENCE}_x_fitness")  # between frozen and oracle
_WITHOUT_CONTROL = (FROZEN, ORACLE, f"{_INFLUENCE}_x_fitness")  # they use no number of others, or two
SHUFFLED = " (shuffled)"
_NOT_SHOWN = (SHUFFLED.strip(), ORACLE)  # in the figure of couplings, and in a replay


class Row(NamedTuple):
    """A row of the tables. name: of the coupling. is_control: whether it is given the numbers of other robots."""

    name: str
    coupling: Coupling
    is_control: bool = False


class Condition(NamedTuple):
    """Flocks that differ in what breaks alone, how many seeds each runs with, and what its robots differ in."""

    flocks: list[Flock]
    repeats: int
    settings: dict[str, Any]


@dataclass(kw_only=True)
class Sweep:
    """The sweep of a study of flocks: values of each setting, one at a time or two together, and flocks of each."""

    loudness: list[float] = field(default_factory=list)
    knowers: list[int] = field(default_factory=list)
    range_m: list[float] = field(default_factory=list)
    repeats: int = within(1, default=20)

    def __post_init__(self) -> None:
        check_ranges(self, "flock.sweep")


@dataclass(kw_only=True)
class FlockKeys(Flock):
    """The keys of group flock: of a `Flock`, of which several kinds may break, of a `Coupling`, and of the sweep."""

    coupling: str = ALL
    N: float = Coupling.N
    decay: float = Coupling.decay
    own: dict[str, Any] = field(default_factory=dict)
    shuffled: bool = True
    breaks: Any = Flock.breaks
    sweep: Sweep = field(default_factory=Sweep)

    def __post_init__(self) -> None:
        """Check nothing here: each flock of the study is checked."""


@register
@dataclass(kw_only=True)
class FlockStudy(Study):
    """The study, with all keys of `epuckhebb flock`. rows: of the tables. conditions: of the sweep, the usual first."""

    command: ClassVar[str] = "flock"
    reference: ClassVar[str] = "flock"
    seed: int = within(0, default=1100)
    repeats: int = within(1, default=20)
    threads: int = within(0, MOST_THREADS, default=0)
    flock: FlockKeys = field(default_factory=FlockKeys)

    def __post_init__(self) -> None:
        """Validate the settings."""
        check_ranges(self)
        self.rows, self.conditions = _rows(self.flock), _conditions(self.flock, self.repeats)

    @property
    def label(self) -> str:
        """The first part of the name of the study's folder."""
        return f"{self.flock.coupling.rpartition(':')[2]}_seed{self.seed}"

    def plan(self) -> Sequence[Plain]:
        """The jobs: one for each condition, which is a study of its own, so other conditions leave it as it is."""
        smoke_test = replace(self.conditions[0].flocks[0], at_s=6.4, duration_s=19.2)  # its coupling changes once
        first, again = (_run_flocks([(row, smoke_test, self.seed) for row in self.rows], 1) for _ in range(2))
        if any(a.weights.tobytes() != b.weights.tobytes() for a, b in zip(first, again, strict=True)):
            raise ConfigError(f"flock.coupling={self.flock.coupling} gives other results with the same seed")
        jobs = []
        for condition in self.conditions:
            job = copy.deepcopy(self.values)
            job["repeats"] = condition.repeats
            job["flock"] |= {**condition.settings, "sweep": {}}
            jobs.append(job)
        return jobs

    @classmethod
    def do(cls, job: Plain) -> dict[str, pd.DataFrame]:
        """Run all flocks of a condition; returns the flocks, their courses by the minute, and their couplings."""
        study = make_config(job, cls, "a job of flock")
        (condition,), threads = study.conditions, hydra.threads_of_job(study.threads)
        seeds = range(study.seed, study.seed + condition.repeats)
        rows, minutes, pairs = [], [], []
        for flock, row in product(condition.flocks, study.rows):
            labels = {"breaks": flock.breaks, "coupling": row.name}
            records = _run_flocks([(row, flock, seed) for seed in seeds], threads)
            pairs.append(tables.couplings(flock, records).assign(**labels))
            for seed, record in zip(seeds, records, strict=True):
                rows.append({**condition.settings, **labels, "seed": seed, **tables.run_metrics(flock, record)})
                for minute, cosine in enumerate(tables.minute_cosines(flock, record)):
                    minutes.append({**labels, "seed": seed, "minute": minute + 0.5, "cosine": cosine})
        return {"runs": pd.DataFrame(rows), "minutes": pd.DataFrame(minutes), "couplings": pd.concat(pairs)}

    def tables(self, runs: Sequence[Run]) -> dict[str, pd.DataFrame]:
        """All flocks, each condition with its intervals, and courses and couplings of the usual one."""
        every = pd.concat([run.table("runs.csv") for run in runs], ignore_index=True)
        made = {"runs": every, "flock": tables.table(every, self.seed)}
        made["curves"] = tables.curves(runs[0].table("minutes.csv"), self.seed)
        return made | {"couplings": runs[0].table("couplings.csv")}

    def figures(self, run: Run) -> dict[str, "Figure"]:
        """Figures by name; couplings are those of the usual condition, with the last kind of break."""
        from epuckhebb.flock import figure  # matplotlib takes a while to load

        first, pairs = self.conditions[0].flocks[-1], run.table("couplings.csv")
        pairs = pairs[(pairs.breaks == first.breaks) & ~pairs.coupling.str.endswith(_NOT_SHOWN)]
        return {
            "flock": figure.curves(run.table("curves.csv"), first.at_s, self.repeats),
            "couplings": figure.couplings(pairs, first.broken, first.knowers, self.repeats),
        }

    def first_flock(self) -> tuple[Flock, dict[str, Record]]:
        """The first flock of the usual condition, with the last kind of break, run with each coupling but controls."""
        first, rows = self.conditions[0].flocks[-1], [row for row in self.rows if not row.name.endswith(_NOT_SHOWN)]
        records = _run_flocks([(row, first, self.seed) for row in rows], thread_count(self.threads))
        return first, {row.name: record for row, record in zip(rows, records, strict=True)}

    def page(self, run: Run, captions: Mapping[str, str]) -> str:
        """The page of the study in Markdown."""
        first = self.conditions[0].flocks[-1]
        few = "**A smoke test: so few flocks say nothing about a coupling.** " if self.repeats < 8 else ""
        made = (
            f"{few}Made by `epuckhebb flock`: {self.flock.robots} robots, {self.repeats} flocks of the usual "
            f"condition, seeds {self.seed} to {self.seed + self.repeats - 1}; {first.duration_s / 60:g} minutes, and "
            f"the break after {first.at_s / 60:g}."
        )
        return tables.page(run.table("flock.csv"), made, list(captions))

    @classmethod
    def shown(cls, run: Run) -> list[Table]:
        """The cosine of the heading to the goal in each condition, as the terminal shows it."""
        columns = ("couplings", "before", "long after", "runs above .9", "difference to frozen")
        shown = [table.only(*columns) for table in tables.main_tables(run.table("flock.csv"))]
        return [replace(table, title=f"Cosine of heading to the goal. {table.title}") for table in shown]


def plan(arguments: list[str], *, quick: bool = False, config_dir: str | None = None) -> Planned:
    """Plan the study. arguments: overrides, of the study and of Hydra."""
    overrides, of_hydra = split("flock", arguments)
    study = load(FlockStudy, [*(QUICK if quick else ()), *overrides], config_dir)
    return prepare(study, of_hydra, [*(["--quick"] if quick else []), *arguments])


def replay_page(path: Path) -> str:
    """The page that replays a finished study: its first flock runs again."""
    study, done = FlockStudy.stored(Run(path)), Run(path).table("runs.csv")
    flock, records = study.first_flock()
    for name, record in records.items():
        row = done[(done.coupling == name) & (done.breaks == flock.breaks) & (done.seed == study.seed)].iloc[0]
        if tables.run_metrics(flock, record)["long_after"] != row.long_after:
            raise ConfigError(f"{path} was made by another version of the program, or of its coupling; run it again")
    return replay.page(flock, records, f"{path.name}: seed {study.seed}")


def first_page() -> str:
    """The page of the study's first flock, which runs for it."""
    study = load(FlockStudy, [], None)
    return replay.page(*study.first_flock(), f"flock: seed {study.seed}")


def _rows(keys: FlockKeys) -> list[Row]:
    """The rows of the tables: frozen couplings, those of the settings with their controls, the oracle."""
    rows = [Row(FROZEN, Frozen())]
    for where in _ROWS if keys.coupling == ALL else (keys.coupling,):
        name = where.rpartition(":")[2]
        kind = part_class("coupling", where, "flock")
        parameters = part_settings(kind, dict(keys.own), "flock.own", f"coupling {name}")
        coupling = make_part("coupling", {"coupling": where, "N": keys.N, "decay": keys.decay, **parameters}, "flock")
        if name not in (FROZEN, ORACLE):
            rows.append(Row(name, coupling))
        if keys.shuffled and name not in _WITHOUT_CONTROL:
            rows.append(Row(name + SHUFFLED, coupling, is_control=True))
    return [*rows, Row(ORACLE, Oracle())]


def _conditions(keys: FlockKeys, repeats: int) -> list[Condition]:
    """The conditions of the sweep, the usual one first."""
    names = [keys.breaks] if isinstance(keys.breaks, str) else keys.breaks
    if not isinstance(names, list) or not names or len(set(map(str, names))) < len(names):
        raise ValueError(f"flock.breaks must be none, stranger, knower, or a list of different ones, got {keys.breaks}")
    shared = {name: getattr(keys, name) for name in ("robots", "at_s", "duration_s", "noise", "spacing_m")}
    usual = {name: getattr(keys, name) for name in ("loudness", "knowers", "range_m")}
    values = product(keys.sweep.loudness or [keys.loudness], keys.sweep.knowers or [keys.knowers])
    cells = [usual, *({**usual, "loudness": loudness, "knowers": knowers} for loudness, knowers in values)]
    cells += [{**usual, "range_m": range_m} for range_m in keys.sweep.range_m]
    different = [cell for number, cell in enumerate(cells) if cell not in cells[:number]]
    return [
        Condition(
            [Flock(breaks=name, **shared, **cell) for name in names], keys.sweep.repeats if number else repeats, cell
        )
        for number, cell in enumerate(different)
    ]


def _run_flocks(tasks: Sequence[tuple[Row, Flock, int]], threads: int) -> list[Record]:
    """Run flocks in threads; returns their records in the order of the tasks."""

    def run_task(task: tuple[Row, Flock, int]) -> Record:
        row, flock, seed = task
        return run(flock, row.coupling, seed, control=row.is_control)

    try:
        with ThreadPoolExecutor(threads) as pool:
            return list(pool.map(run_task, tasks))
    except PartError as error:
        raise ConfigError(f"flock.coupling: {error}") from error
