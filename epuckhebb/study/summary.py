"""The tables over many evaluations: a summary of each condition, and what plasticity rescued and harmed.

All take the rows of many `metrics.csv` as text, with columns in front that say what was set for each evaluation.
"""

from typing import Any

import pandas as pd

from epuckhebb.sim.scenario import TRAINED
from epuckhebb.study import charts, findings, rescue
from epuckhebb.study.evaluate import COLUMNS
from epuckhebb.study.statistics import wilson
from epuckhebb.study.tables import code

_OUTCOMES = COLUMNS[COLUMNS.index("success") + 1 : COLUMNS.index("changed")]  # of which the summary has the mean
_LIFETIME = ["experiment", "scenario", "controller", "N", "genome", "side", "seed", "repeat"]  # one of all
_SUCCESS = ("n", "success", "success_low", "success_high")


def summary(rows: pd.DataFrame, settings: list[str]) -> pd.DataFrame:
    """One row for each condition, controller and side: n, share of successes with its interval (Wilson, 95 %), means.

    `time_to_goal_s` is the mean over the `n_reached` lifetimes that came to the goal at all. Seeds and noise repeats
    are what a condition is repeated with, so the interval is about the sensor noise, for the genome at hand.

    Args:
        rows: The lifetimes.
        settings: The columns that say what was set.
    """
    by = list(dict.fromkeys([*settings, "genome", "scenario", "controller", "N", "side"]))
    rows = rows.assign(**{name: pd.to_numeric(rows[name]) for name in _OUTCOMES})
    found: list[dict[str, Any]] = []
    for condition, lifetimes in rows.groupby(by, sort=False):
        successes, n = int((lifetimes.success == "1").sum()), len(lifetimes)
        low, high = wilson(successes, n)
        outcomes = lifetimes[list(_OUTCOMES)]
        success = dict(zip(_SUCCESS, (n, successes / n, low, high), strict=True))
        reached = {"n_reached": int(outcomes.time_to_goal_s.notna().sum())}
        found.append(dict(zip(by, condition, strict=True)) | success | reached | outcomes.mean().to_dict())
    return pd.DataFrame(found) if found else pd.DataFrame(columns=[*by, *_SUCCESS])


def rescue_and_harm(rows: pd.DataFrame) -> tuple[dict[str, pd.DataFrame], str, bytes] | None:
    """What plasticity rescued and harmed: tables by their names, a page in Markdown, and a figure.

    There is nothing to tell unless several champions have each lived once in their training world and in changed ones.
    """
    if rows.genome.nunique() < 2 or rows.duplicated(_LIFETIME).any():
        return None
    lived = rows.groupby(["experiment", "genome"]).scenario.agg(set)
    if not all(TRAINED[experiment] in worlds and len(worlds) > 1 for (experiment, _), worlds in lived.items()):
        return None
    lifetimes = rows[list(COLUMNS)].apply(_numbers)
    each = findings.trials(lifetimes)
    over_all, by_scenario = findings.rescue_over_all(each), findings.rescue_and_harm(each)
    retention = findings.retention(each)
    champions = int(each.groupby("experiment").genome.nunique().max())
    seeds = f"{code(each.genome.iloc[0])} to {code(each.genome.iloc[-1])}"
    page = rescue.markdown(over_all, by_scenario, retention, champions, lifetimes.repeat.nunique(), seeds)
    found = {"rescue_over_all": over_all, "rescue_and_harm": by_scenario, "retention": retention}
    return found, page, charts.rescue_over_all(over_all)


def _numbers(column: pd.Series) -> pd.Series:
    """The column as numbers, if that is what it holds."""
    try:
        return pd.to_numeric(column)
    except ValueError:
        return column
