"""The configuration of `epuckhebb flock`: its keys, and the flocks and couplings that come of them."""

from dataclasses import dataclass, field, replace
from itertools import product
from typing import Any, NamedTuple

from epuckhebb.config.build import check_counts
from epuckhebb.config.parts import part_class, part_from
from epuckhebb.config.values import part_settings
from epuckhebb.controller.ranges import check_range
from epuckhebb.flock.coupling import Coupling
from epuckhebb.flock.couplings.frozen import Frozen
from epuckhebb.flock.couplings.oracle import Oracle
from epuckhebb.flock.plane import Flock

ALL, FROZEN, ORACLE = "all", "frozen", "oracle"
_INFLUENCE, _FITNESS = "transfer_entropy", "live_fitness"
_ROWS = (_INFLUENCE, _FITNESS, f"{_INFLUENCE}_x_fitness")  # between frozen and oracle
_WITHOUT_CONTROL = (FROZEN, ORACLE, f"{_INFLUENCE}_x_fitness")  # they use no number of others, or two
SHUFFLED = " (shuffled)"


class Row(NamedTuple):
    """A row of the tables. name: of the coupling. other: whether it is given the numbers of other robots."""

    name: str
    coupling: Coupling
    other: bool = False


class Condition(NamedTuple):
    """Flocks that differ in what breaks alone, and how many seeds each runs with."""

    flocks: list[Flock]
    repeats: int


@dataclass(kw_only=True)
class Sweep:
    """Values of a sweep; see `conf/flock/all.yaml`."""

    loudness: list[float] = field(default_factory=list)
    knowers: list[int] = field(default_factory=list)
    range_m: list[float] = field(default_factory=list)
    repeats: int = 20


@dataclass(kw_only=True)
class FlockKeys:
    """The keys of group flock; see `epuckhebb.flock.plane.Flock` and `epuckhebb.flock.coupling.Coupling`."""

    coupling: str = ALL
    N: float = Coupling.N
    decay: float = Coupling.decay
    own: dict[str, Any] = field(default_factory=dict)
    shuffled: bool = True
    robots: int = Flock.robots
    knowers: int = Flock.knowers
    breaks: Any = Flock.breaks
    at_s: float = Flock.at_s
    duration_s: float = Flock.duration_s
    loudness: float = Flock.loudness
    noise: float = Flock.noise
    range_m: float = Flock.range_m
    spacing_m: float = Flock.spacing_m
    sweep: Sweep = field(default_factory=Sweep)


def check(keys: FlockKeys, seed: int, repeats: int, threads: int) -> tuple[list[Row], list[Condition]]:
    """The rows of the tables, and the conditions of the sweep, the usual one first."""
    check_counts({"seed": seed, "repeats": repeats, "threads": threads})
    check_range(keys.sweep, "flock.sweep", "repeats", least=1)
    names = [keys.breaks] if isinstance(keys.breaks, str) else keys.breaks
    if not isinstance(names, list) or not names or len(set(map(str, names))) < len(names):
        raise ValueError(f"flock.breaks must be none, stranger, knower, or a list of different ones, got {keys.breaks}")
    shared = {name: getattr(keys, name) for name in ("robots", "at_s", "duration_s", "noise", "spacing_m")}
    usual = {name: getattr(keys, name) for name in ("loudness", "knowers", "range_m")}
    cells = [usual]
    for loudness, knowers in product(keys.sweep.loudness or [keys.loudness], keys.sweep.knowers or [keys.knowers]):
        cells.append({**usual, "loudness": loudness, "knowers": knowers})
    cells += [{**usual, "range_m": range_m} for range_m in keys.sweep.range_m]
    different = [cell for place, cell in enumerate(cells) if cell not in cells[:place]]
    return _rows(keys), [
        Condition([Flock(breaks=name, **shared, **cell) for name in names], keys.sweep.repeats if number else repeats)
        for number, cell in enumerate(different)
    ]


def _rows(keys: FlockKeys) -> list[Row]:
    rows = [Row(FROZEN, Frozen())]
    for where in _ROWS if keys.coupling == ALL else (keys.coupling,):
        name = where.rpartition(":")[2]
        own = part_settings(part_class("coupling", where, "flock"), dict(keys.own), "flock.own", f"coupling {name}")
        coupling = part_from("coupling", {"coupling": where, "N": keys.N, "decay": keys.decay, **own}, "flock")
        if name not in (FROZEN, ORACLE):
            rows.append(Row(name, coupling))
        if keys.shuffled and name not in _WITHOUT_CONTROL:
            rows.append(Row(name + SHUFFLED, coupling, other=True))
    return [*rows, Row(ORACLE, Oracle())]


def shorter(flock: Flock) -> Flock:
    """The first moments of a flock, in which its coupling changes once."""
    return replace(flock, at_s=6.4, duration_s=19.2)
