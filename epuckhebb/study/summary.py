"""Over many evaluations: a summary of each condition, what each rate did, and what plasticity rescued and harmed.

All take the rows of many `metrics.csv` as text, with columns in front that say what was set for each evaluation.
"""

from typing import Any

import pandas as pd

from epuckhebb.sim.controller import GA
from epuckhebb.sim.scenario import TRAINED
from epuckhebb.study import findings, rescue
from epuckhebb.study.evaluate import COLUMNS
from epuckhebb.study.statistics import bootstrap_mean, wilson
from epuckhebb.study.tables import code

_OUTCOMES = COLUMNS[COLUMNS.index("success") + 1 : COLUMNS.index("changed")]  # of which the summary has the mean
_LIFETIME = ["experiment", "scenario", "controller", "N", "genome", "side", "seed", "repeat"]  # one of all
_RATE = "hebbian.N"
_OF_PLASTICITY = ("hebbian", "adaptation", "compare")  # groups whose keys the genes alone do not feel
_SUCCESS = ("n", "success", "success_low", "success_high")


def summary(rows: pd.DataFrame, settings: list[str]) -> pd.DataFrame:
    """One row for each condition, controller and side: n, share of successes with its interval (Wilson, 95 %), means.

    `time_to_goal_s` is the mean over the `n_reached` lifetimes that came to the goal at all. Seeds and noise repeats
    are what a condition is repeated with, so the interval is about the sensor noise, for the genome at hand. The genes
    alone come once, whatever plasticity was set beside them, of which their rows say nothing.

    Args:
        rows: The lifetimes.
        settings: The columns that say what was set.
    """
    by = list(dict.fromkeys([*settings, "genome", "scenario", "controller", "N", "side"]))
    rows = _genes_alone_once(rows, settings)
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


def dose_response(rows: pd.DataFrame, settings: list[str]) -> bytes | None:
    """A figure of success and weight change against the base rate; None unless there are several rates.

    Args:
        rows: The lifetimes.
        settings: The columns that say what was set.
    """
    plastic = rows[(rows.controller != GA) & (pd.to_numeric(rows.N) > 0)]
    swept = plastic.groupby("controller").N.nunique()
    plastic = plastic[plastic.controller.isin(swept[swept > 1].index)]
    if _RATE not in settings or not len(plastic):
        return None
    rows = _genes_alone_once(rows, settings)
    several = rows.genome.nunique() > 1
    differ = [key for key in settings if key not in (_RATE, "genome") and plastic[key].nunique() > 1]
    world = ["scenario", "changed", *(key for key in differ if not _is_of_plasticity(key))]
    by = list(dict.fromkeys([*world, *differ, "controller"]))
    found = []
    for condition, own in plastic.groupby(by, sort=False):
        place = dict(zip(by, condition, strict=True))
        settings_told = (f"{key}={place[key]}" for key in differ if not key.startswith("scenario"))
        told = ", ".join(
            dict.fromkeys([place["scenario"], *filter(None, place["changed"].split(", ")), *settings_told])
        )
        alone = rows[(rows.controller == GA) & (rows[world] == [place[key] for key in world]).all(axis=1)]
        for (controller, rate, side), lives in pd.concat([alone, own]).groupby(["controller", "N", "side"], sort=False):
            row = {"condition": f"{told}: {place['controller']}", "controller": controller, "N": float(rate)}
            found.append({**row, "side": side, **_doses(lives, several)})
    doses = pd.DataFrame(found)
    each = f"mean over {rows.genome.nunique()} champions" if several else f"mean of {doses.n.max()} lifetimes"
    from epuckhebb.study import charts  # matplotlib takes a while to load

    return charts.rates(doses, f"{each} on each side, with 95 % intervals")


def _doses(lives: pd.DataFrame, several: bool) -> dict[str, float]:
    """Means of lifetimes and their intervals: over champions if there are several, else over the noise."""
    told: dict[str, float] = {"n": len(lives)}
    for column, bounds in (("success", (0.0, 1.0)), ("weight_change_mean", None)):
        values = pd.to_numeric(lives[column])
        if several:
            values = values.groupby(lives.genome, sort=False).mean()
        low, high = bootstrap_mean(values.to_numpy(float), seed=0, bounds=bounds)
        if column == "success" and not several:
            low, high = wilson(int(values.sum()), len(values))
        told |= {column: values.mean(), f"{column}_low": low, f"{column}_high": high}
    return told


def _genes_alone_once(rows: pd.DataFrame, settings: list[str]) -> pd.DataFrame:
    """The rows, those of the genes alone once: whatever plasticity is set beside them, they are the same lifetimes."""
    alone = rows.controller == GA
    of_plasticity = [key for key in settings if _is_of_plasticity(key)]
    rows = rows.assign(**{key: rows[key].mask(alone, "") for key in of_plasticity})
    return rows[~alone | ~rows.duplicated([name for name in rows.columns if name not in ("job", "run")])]


def _is_of_plasticity(key: str) -> bool:
    return key.partition(".")[0] in _OF_PLASTICITY


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
    from epuckhebb.study import charts

    return found, page, charts.rescue_over_all(over_all)


def _numbers(column: pd.Series) -> pd.Series:
    """The column as numbers, if that is what it holds."""
    try:
        return pd.to_numeric(column)
    except ValueError:
        return column
