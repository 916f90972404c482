"""The formats of the JSON files and the tables of a run: what must stand in them, checked as they are read.

A disk, an editor or a crash may have changed them. What is wrong is told in one message that names the file, the key or
the column, what is there, and what should be.
"""

import io
import json
import types
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, NotRequired, TypedDict, TypeVar, get_args, get_origin, get_type_hints, is_typeddict

import pandas as pd
from pandas.api.types import is_bool_dtype, is_numeric_dtype

from epuckhebb.app.errors import ConfigError
from epuckhebb.sim.maze import SIDES
from epuckhebb.study.evaluate import COLUMNS
from epuckhebb.study.self_checks import COLUMNS as FOUND_COLUMNS


class Code(TypedDict):
    """The version of the program and of its science, and its git commit where it ran from a checkout."""

    version: str
    science: NotRequired[str]
    commit: str | None
    dirty: bool | None


class Resumed(TypedDict):
    """A call that went on with a run."""

    started: str
    command: list[str]
    generations: NotRequired[int]
    code: Code


class Provenance(TypedDict):
    """`provenance.json`: who ran what, with what, where."""

    schema: NotRequired[int]
    verb: str
    command: list[str]
    overrides: list[str]
    seed: NotRequired[int]
    code: Code
    packages: dict[str, str]
    python: str
    platform: str
    cores: int | None
    genome: NotRequired[str]
    genome_sha256: NotRequired[str]
    baseline_sha256: NotRequired[str]
    rules: NotRequired[dict[str, str]]
    resumed: NotRequired[list[Resumed]]
    rerun_of: NotRequired[str]
    sweep: NotRequired[str]


class Status(TypedDict):
    """`status.json`: how a run goes, or ended; and of each file that it wrote the SHA-256, once it has ended."""

    schema: NotRequired[int]
    state: Literal["running", "finished", "failed", "interrupted"]
    started: NotRequired[str]
    finished: NotRequired[str]
    error: NotRequired[str]
    traceback: NotRequired[str]
    sha256: NotRequired[dict[str, str]]


class ListOfJobs(TypedDict):
    """`sweep.json`: what the jobs of a sweep read, and how their folders are called."""

    schema: NotRequired[int]
    name: str
    command: list[str]
    fail_fast: bool
    jobs: list[str]


class JobAsked(TypedDict):
    """`jobs/RUN.json`: what a job of a sweep is to do."""

    overrides: list[str]
    config: dict[str, Any]


NUMBER, NUMBER_OR_EMPTY, TEXT, TEXT_OR_EMPTY = "a number", "a number or empty", "text", "text or empty"
Columns = Mapping[str, str | tuple[str, ...]]  # name -> one of these, or the texts that there may be
_LATER = ("changed",)  # columns that tables of version 0.1 do not have
METRICS: Columns = {
    **dict.fromkeys(COLUMNS, NUMBER),
    **dict.fromkeys(("genome", "experiment", "scenario", "controller"), TEXT),
    **dict.fromkeys(("signal", "changed"), TEXT_OR_EMPTY),
    "side": SIDES,
    "time_to_goal_s": NUMBER_OR_EMPTY,
}
FOUND: Columns = {
    **dict.fromkeys(FOUND_COLUMNS, NUMBER),
    **dict.fromkeys(("dead_sensors", "unexplained", "corrected"), TEXT_OR_EMPTY),
    "side": SIDES,
    "lamp": ("on", "off"),
}
HISTORY: Columns = dict.fromkeys(("generation", "best_fitness", "mean_fitness", "best_success"), NUMBER)
CLAIMS: Columns = {**dict.fromkeys(("experiment", "claim", "verdict"), TEXT), **dict.fromkeys(("true", "n"), NUMBER)}
SUMMARY: Columns = dict.fromkeys(("n", "success", "success_low", "success_high"), NUMBER)
RESCUE: Columns = {
    "experiment": TEXT,
    "controller": TEXT,
    **dict.fromkeys(("N", "broken", "rescued", "sound", "harmed", "home_harmed", "home_mastered"), NUMBER),
    **{f"{part}_{name}": NUMBER_OR_EMPTY for part in ("rescued", "harmed") for name in ("share", "low", "high")},
}

Record = TypeVar("Record", Provenance, Status, ListOfJobs, JobAsked)


def record(content: bytes, file: Path, kind: type[Record]) -> Record:
    """What a JSON file holds; keys that this program does not know are left in it.

    Args:
        content: Its content.
        file: Where it is, for the message.
        kind: What it must be.

    Raises:
        ConfigError: It is something else.
    """
    try:
        told = json.loads(content)
        _check(told, kind, "")
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"{file} cannot be used: {error}") from error
    checked: Record = told
    return checked


def _check(told: Any, kind: Any, key: str) -> None:
    """Refuse a value that is not of a kind, which may be anything that the records above are made of.

    Raises:
        ValueError: It is not; the message names its key.
    """
    if get_origin(kind) is NotRequired:
        kind = get_args(kind)[0]
    if kind is Any:
        return
    origin, inner = get_origin(kind), get_args(kind)
    if is_typeddict(kind) and isinstance(told, dict):
        for name, of_name in get_type_hints(kind).items():
            if name in told:
                _check(told[name], of_name, f"{key}.{name}" if key else name)
            elif name in kind.__required_keys__:
                raise ValueError(f"it has no {key}.{name}" if key else f"it has no {name}")
    elif origin is dict and isinstance(told, dict):
        for name, value in told.items():
            _check(value, inner[1], f"{key}.{name}")
    elif origin is list and isinstance(told, list):
        for place, value in enumerate(told):
            _check(value, inner[0], f"{key}[{place}]")
    elif origin is types.UnionType and told is None:
        pass
    elif origin is types.UnionType:
        _check(told, inner[0], key)
    elif not ((origin is Literal and isinstance(told, str) and told in inner) or type(told) is kind):
        words = {str: "text", int: "a whole number", bool: "true or false", list: "a list"}
        wanted = f"one of {', '.join(inner)}" if origin is Literal else words.get(origin or kind, "keys with values")
        raise ValueError(f"{key or 'it'} must be {wanted}, got {json.dumps(told)[:60]}")


def table(content: bytes, file: Path, columns: Columns, *, rows: bool = True) -> pd.DataFrame:
    """What a CSV file holds.

    Args:
        content: Its content.
        file: Where it is, for the message.
        columns: Those that it must have; there may be more.
        rows: Whether it must have rows.

    Raises:
        ConfigError: It is something else.
    """
    texts = [name for name, kind in columns.items() if kind not in (NUMBER, NUMBER_OR_EMPTY)]
    try:
        with warnings.catch_warnings(action="error"):  # pandas warns where rows are longer than the header
            found = pd.read_csv(
                io.BytesIO(content),
                index_col=False,
                keep_default_na=False,
                na_values=[""],
                dtype=dict.fromkeys(texts, str),
                low_memory=False,
            )
    except Exception as error:  # what damaged bytes may raise has no end
        raise ConfigError(f"{file} cannot be read as a table: {error}") from error
    missing = [name for name in columns if name not in found and name not in _LATER]
    if missing:
        raise ConfigError(f"{file} has no column {missing[0]}")
    if rows and found.empty:
        raise ConfigError(f"{file} has no rows")
    for name in columns if len(found) else ():
        if name in found:
            _check_column(found[name], columns[name], file)
    return found


def _check_column(values: pd.Series, kind: str | tuple[str, ...], file: Path) -> None:
    wrong = pd.Series(False, values.index) if kind in (NUMBER_OR_EMPTY, TEXT_OR_EMPTY) else values.isna()
    if isinstance(kind, tuple):
        wrong |= ~values.isin(kind)
    elif kind in (NUMBER, NUMBER_OR_EMPTY) and not (is_numeric_dtype(values) and not is_bool_dtype(values)):
        wrong |= values.notna() & ~values.map(_is_a_number)
    if wrong.any():
        line = int(wrong.to_numpy().argmax())
        got = "nothing" if pd.isna(values.iloc[line]) else repr(values.iloc[line])
        wanted = f"one of {', '.join(kind)}" if isinstance(kind, tuple) else kind
        raise ConfigError(f"{file}, row {line + 1}: {values.name} must be {wanted}, got {got[:60]}")
    if kind in (NUMBER, NUMBER_OR_EMPTY) and not is_numeric_dtype(values):
        raise ConfigError(f"{file}: {values.name} must be {kind} in each row; one is too large")


def _is_a_number(value: object) -> bool:
    try:
        float(str(value))
    except ValueError:
        return False
    return True
