"""The tables over all jobs of a sweep: every lifetime, a summary of each condition, and what failed."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from epuckhebb.app import runs
from epuckhebb.app.sweep import Job
from epuckhebb.sim.scenario import TRAINED
from epuckhebb.study import charts, findings, rescue
from epuckhebb.study.evaluate import COLUMNS
from epuckhebb.study.statistics import wilson

_OUTCOMES = COLUMNS[COLUMNS.index("success") + 1 :]  # of which the summary has the mean
_LIFETIME = ["experiment", "scenario", "controller", "N", "genome", "side", "seed", "repeat"]  # one of all
_IN_METRICS = ("scenario", "seed")  # settings that every row of metrics.csv tells of anyway


@dataclass(frozen=True)
class Failure:
    """A job without a result, and why."""

    job: Job
    error: str


def write(folder: Path, done: list[Job], failures: list[Failure]) -> None:
    """Write `sweep.csv`, `summary.csv` and `failed.csv`; the same jobs give the same bytes."""
    failed = [_place(failure.job) | {"error": failure.error} for failure in failures]
    failed_columns = [*_columns([failure.job for failure in failures]), "error"]
    runs.write_whole(folder / "failed.csv", _csv(pd.DataFrame(failed, columns=failed_columns)))
    parts = []
    for job in done:
        rows = pd.read_csv(folder / job.run / "metrics.csv", dtype=str, keep_default_na=False)
        parts.append(pd.concat([pd.DataFrame([_place(job)] * len(rows), dtype=str), rows], axis=1))
    whole = pd.concat(parts, ignore_index=True) if parts else pd.DataFrame(columns=[*_columns([]), *COLUMNS])
    runs.write_whole(folder / "sweep.csv", _csv(whole))
    runs.write_whole(folder / "summary.csv", _csv(summary(whole, _columns(done)[2:])))
    if whole.genome.nunique() > 1 and _lives_at_home(whole) and not whole.duplicated(_LIFETIME).any():
        _write_rescue(folder, whole)


def _lives_at_home(rows: pd.DataFrame) -> bool:
    """Whether every champion of the sweep has also lived in its training world, and in a changed one."""
    told = rows.groupby(["experiment", "genome"]).scenario.agg(set)
    home = {place: TRAINED[place[0]] for place in told.index}
    return all(home[place] in scenarios and len(scenarios) > 1 for place, scenarios in told.items())


def _write_rescue(folder: Path, rows: pd.DataFrame) -> None:
    """Where several champions lived in their training world and in changed ones: what plasticity rescued and harmed."""
    lifetimes = rows[list(COLUMNS)].apply(_numbers)
    each = findings.trials(lifetimes)
    over_all, by_scenario = findings.rescue_over_all(each), findings.rescue_and_harm(each)
    retention = findings.retention(each)
    runs.write_whole(folder / "rescue_over_all.csv", _csv(over_all))
    runs.write_whole(folder / "rescue_and_harm.csv", _csv(by_scenario))
    runs.write_whole(folder / "retention.csv", _csv(retention))
    champions = int(each.groupby("experiment").genome.nunique().max())
    seeds = f"`{each.genome.iloc[0]}` to `{each.genome.iloc[-1]}`"
    page = rescue.markdown(over_all, by_scenario, retention, champions, lifetimes.repeat.nunique(), seeds)
    runs.write_whole(folder / "report.md", page.encode())
    runs.write_whole(folder / "figures" / rescue.FIGURE, charts.rescue_over_all(over_all))


def _numbers(column: pd.Series) -> pd.Series:
    """The column as numbers, if that is what it holds."""
    try:
        return pd.to_numeric(column)
    except ValueError:
        return column


def summary(rows: pd.DataFrame, settings: list[str]) -> pd.DataFrame:
    """One row for each condition, controller and side: n, share of successes with its interval (Wilson, 95 %), means.

    `time_to_goal_s` is the mean over the `n_reached` lifetimes that came to the goal at all.
    rows: of `sweep.csv`, as text. settings: its columns of settings. Seeds and noise repeats are what a condition is
    repeated with, so the interval is about the sensor noise, for the genome at hand.
    """
    by = list(dict.fromkeys([*settings, "genome", "scenario", "controller", "N", "side"]))
    rows = rows.assign(**{name: pd.to_numeric(rows[name]) for name in _OUTCOMES})
    told: list[dict[str, Any]] = []
    for condition, lifetimes in rows.groupby(by, sort=False):
        successes, n = int((lifetimes.success == "1").sum()), len(lifetimes)
        low, high = wilson(successes, n)
        outcomes = lifetimes[list(_OUTCOMES)]
        success = {"n": n, "success": successes / n, "success_low": low, "success_high": high}
        reached = {"n_reached": int(outcomes.time_to_goal_s.notna().sum())}
        told.append(dict(zip(by, condition, strict=True)) | success | reached | outcomes.mean().to_dict())
    return pd.DataFrame(told) if told else pd.DataFrame(columns=[*by, "n"])


def _place(job: Job) -> dict[str, str]:
    """The first columns: which job, which run folder, and what was set for it."""
    settings = {key: value for key, value in job.settings.items() if key not in _IN_METRICS}
    named = {f"override.{key}" if key in COLUMNS else key: value for key, value in settings.items()}
    return {"job": str(job.number), "run": job.run, **named}


def _columns(jobs: list[Job]) -> list[str]:
    return list(_place(jobs[0])) if jobs else ["job", "run"]


def _csv(frame: pd.DataFrame) -> bytes:
    return str(frame.to_csv(index=False, lineterminator="\n")).encode()
