"""Declares the JSON files of a run, and checks them and tables as they are read."""

import io
import json
import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, NotRequired, TypedDict, TypeVar

import msgspec

from epuckhebb.runtime import ConfigError
from epuckhebb.store.columns import NUMBER, NUMBER_OR_EMPTY, TEXT_OR_EMPTY, Columns

if TYPE_CHECKING:
    import pandas as pd


class Code(TypedDict):
    """The version of the program and of its science, and its git commit where it ran from a checkout."""

    version: str
    science: NotRequired[str]
    commit: str | None
    dirty: bool | None


class Resumed(TypedDict):
    """A call that resumed a run."""

    started: str
    command_line: list[str]
    generations: NotRequired[int]
    code: Code


class OwnCode(TypedDict):
    """A user's own Python file: where in the run folder its copy is, and the SHA-256 of it and of what it imports."""

    copy: str
    sha256: dict[str, str]


class Provenance(TypedDict):
    """`provenance.json`: who ran what, with what, where."""

    schema: NotRequired[int]
    command: str
    command_line: list[str]
    overrides: list[str]
    seed: NotRequired[int]
    code: Code
    packages: dict[str, str]
    python: str
    platform: str
    cores: int | None
    genome: NotRequired[str]
    genome_sha256: NotRequired[str]
    lifetimes: NotRequired[dict[str, str]]
    nominal_sha256: NotRequired[str]
    notes: NotRequired[list[str]]
    own_code: NotRequired[dict[str, OwnCode]]
    resumed: NotRequired[list[Resumed]]
    rerun_of: NotRequired[str]
    sweep: NotRequired[str]


class Status(TypedDict):
    """`status.json`: how a run goes, or ended; once it has ended, the SHA-256 of each file that it wrote."""

    schema: NotRequired[int]
    state: Literal["running", "finished", "failed", "interrupted"]
    started: NotRequired[str]
    finished: NotRequired[str]
    error: NotRequired[str]
    traceback: NotRequired[str]
    sha256: NotRequired[dict[str, str]]


class ListOfJobs(TypedDict):
    """`sweep.json`: what all jobs of a study read, and the names of their run folders."""

    schema: NotRequired[int]
    name: str
    command_line: list[str]
    fail_fast: bool
    jobs: list[str]


class JobFile(TypedDict):
    """`jobs/RUN.json`: what one job of a study does."""

    overrides: list[str]
    config: dict[str, Any]


class Cost(TypedDict):
    """`cost.json` of a job of a leaderboard: CPU seconds, which differ each time."""

    cpu_s: float


Record = TypeVar("Record", Provenance, Status, ListOfJobs, JobFile, Cost)


def record(content: bytes, file: Path, kind: type[Record]) -> Record:
    """The content of a JSON file, checked; unknown keys stay. file: its path, for messages."""
    try:
        values: Record = json.loads(content)  # msgspec reads no NaN or infinity, which settings may hold
        msgspec.convert(values, kind)
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"{file} cannot be used: {error}") from error
    return values


def checked_table(content: bytes, file: Path, columns: Columns, *, rows: bool = True) -> "pd.DataFrame":
    """A table from the content of a CSV file, with these columns and maybe more. file: its path, for messages."""
    import pandas as pd

    texts = [name for name, column in columns.items() if column.kind not in (NUMBER, NUMBER_OR_EMPTY)]
    try:
        with warnings.catch_warnings(action="error"):  # pandas warns where rows are longer than the header
            table = pd.read_csv(
                io.BytesIO(content),
                index_col=False,
                keep_default_na=False,
                na_values=[""],
                dtype=dict.fromkeys(texts, str),
                low_memory=False,
            )
    except Exception as error:  # what damaged bytes may raise has no end
        raise ConfigError(f"{file} cannot be read as a table: {error}") from error
    for name in columns:
        if name not in table:
            raise ConfigError(f"{file} has no column {name}")
    if rows and table.empty:
        raise ConfigError(f"{file} has no rows")
    for name in columns if len(table) else ():
        _check_column(table[name], columns[name].kind, file)
    return table


def _check_column(values: "pd.Series[Any]", kind: str | tuple[str, ...], file: Path) -> None:
    import pandas as pd
    from pandas.api.types import is_bool_dtype, is_numeric_dtype

    wrong = pd.Series(False, values.index) if kind in (NUMBER_OR_EMPTY, TEXT_OR_EMPTY) else values.isna()
    if isinstance(kind, tuple):
        wrong |= ~values.isin(kind)
    elif kind in (NUMBER, NUMBER_OR_EMPTY) and not (is_numeric_dtype(values) and not is_bool_dtype(values)):
        wrong |= values.notna() & pd.to_numeric(values.astype(str), errors="coerce").isna()
    if wrong.any():
        line = int(wrong.to_numpy().argmax())
        got = "nothing" if pd.isna(values.iloc[line]) else repr(values.iloc[line])
        wanted = f"one of {', '.join(kind)}" if isinstance(kind, tuple) else kind
        raise ConfigError(f"{file}, row {line + 1}: {values.name} must be {wanted}, got {got[:60]}")
    if kind in (NUMBER, NUMBER_OR_EMPTY) and not is_numeric_dtype(values):
        raise ConfigError(f"{file}: {values.name} must be {kind} in each row; one is too large")
