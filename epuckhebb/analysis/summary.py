"""Over many evaluations: a summary of each condition, dose-response, and rescue and harm.

All take the rows of `epuckhebb.analysis.lifetimes.gather`, one for each lifetime. `settings` are the columns that name
a condition.
"""

import math
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
import pandas as pd

from epuckhebb.analysis import ends, findings, rescue
from epuckhebb.analysis.evaluate import MEANS
from epuckhebb.analysis.lifetimes import is_of_plasticity, numeric
from epuckhebb.analysis.statistics import LEAST, bootstrap, bounds, mean, wilson, wilson_by_champion
from epuckhebb.analysis.tables import Table, code, interval_text, plain
from epuckhebb.tmaze.individual import GA
from epuckhebb.tmaze.maze import SIDES
from epuckhebb.tmaze.scenario import TRAINED

_TRIAL = ["experiment", "scenario", "controller", "N", "genome", "side", "seed", "repeat"]  # of rescue and harm
_SUCCESS = ("n", "success", "success_noise_low", "success_noise_high")
_REWARDED = "rewarded_share"  # the last mean, where a lifetime is many trials
_MOST = 60  # rows of a table of success beside one of rescue and harm
_MEANS = ("success", "weight_change_mean", "saturated_fraction", _REWARDED)  # over champions
_SIZES = ("weight_change_final", "weight_path")


def summary(rows: pd.DataFrame, settings: list[str]) -> pd.DataFrame:
    """One row for each condition, champion, controller and side: n, share of successes with its interval, means.

    `time_to_goal_s` is the mean over the `n_reached` lifetimes that reached the goal. The lifetimes of a condition
    differ in their random numbers. The interval (Wilson, 95 %) is therefore about the noise, for this one champion.
    """
    by = list(dict.fromkeys([*settings, "genome", "scenario", "controller", "N", "side"]))
    means = [*MEANS, *([_REWARDED] if has_trials(rows) else [])]
    rows = rows.assign(**{name: pd.to_numeric(rows[name]) for name in ("success", *means)})
    entries: list[dict[str, Any]] = []
    for condition, lifetimes in rows.groupby(by, sort=False):
        successes, n = int(lifetimes.success.sum()), len(lifetimes)
        row = dict(zip([*by, *_SUCCESS], (*condition, n, successes / n, *wilson(successes / n, n)), strict=True))
        row["n_reached"] = int(lifetimes.time_to_goal_s.notna().sum())
        entries.append(row | lifetimes[means].mean().to_dict())
    return pd.DataFrame(entries) if entries else pd.DataFrame(columns=[*by, *_SUCCESS])


def has_champions(rows: pd.DataFrame) -> bool:
    """Whether an experiment has several champions, so that intervals can be over champions."""
    return bool((rows.groupby("experiment").genome.nunique() > 1).any())


def champion_means(rows: pd.DataFrame, settings: list[str]) -> pd.DataFrame:
    """One row for each condition, controller and side: means over champions, with 95 % bootstrap intervals.

    How far the weights are from the genes at the end, and how far they moved in all, have no interval: they show
    whether a control is of the size of its rule.
    """
    by = list(dict.fromkeys([*(key for key in settings if key != "genome"), "scenario", "controller", "N", "side"]))
    return pd.DataFrame(
        dict(zip(by, condition, strict=True))
        | _means(group)
        | group.groupby("genome", sort=False)[[*_SIZES]].mean().mean().to_dict()
        for condition, group in numeric(rows).groupby(by, sort=False)
    )


def has_trials(rows: pd.DataFrame) -> bool:
    """Whether a lifetime is many trials: it has a rewarded share, and no end."""
    return _REWARDED in rows and bool(rows[_REWARDED].notna().any())


def _means(lifetimes: pd.DataFrame, *, several: bool = True) -> dict[str, float]:
    """Means over champions and their intervals; for one champion, over its lifetimes, and about the noise."""
    means: dict[str, float] = {"champions": lifetimes.genome.nunique(), "lifetimes": len(lifetimes)}
    for column in _MEANS:
        if column == _REWARDED and not has_trials(lifetimes):
            continue
        values = lifetimes.groupby("genome", sort=False)[column].mean() if several else lifetimes[column]
        each = values.to_numpy(float)
        if column != "success":
            interval = bootstrap(mean, each)
        else:
            interval = wilson_by_champion(each, np.ones(len(each))) if several else wilson(each.mean(), len(each))
        means |= {column: values.mean(), **bounds(f"{column}_", interval)}
    return means


def dose_response(rows: pd.DataFrame, settings: list[str]) -> pd.DataFrame | None:
    """Success and weight change at each base rate, a row each with a side; None unless several rates were set.

    `genome`: the champion; empty for means over several.
    """
    rows = numeric(rows)
    plastic = rows[(rows.controller != GA) & (rows.N > 0)]
    swept = plastic.groupby("controller").N.nunique()
    plastic = plastic[plastic.controller.isin(swept[swept > 1].index)]
    if "N" not in settings or not len(plastic) or has_trials(rows):  # such a task has no success at one goal
        return None
    several = has_champions(rows)
    differ = [key for key in settings if key not in ("N", "genome") and plastic[key].nunique() > 1]
    world = list(dict.fromkeys(["scenario", "changed", *(key for key in differ if not is_of_plasticity(key))]))
    by = list(dict.fromkeys([*world, *differ, "controller"]))
    entries = []
    for condition, group in plastic.groupby(by, sort=False):
        labels = dict(zip(by, condition, strict=True))
        alone = rows[(rows.controller == GA) & (rows[world] == [labels[key] for key in world]).all(axis=1)]
        title = f"{', '.join(_described(labels, differ))}: {labels['controller']}"
        cells = pd.concat([alone, group]).groupby(["controller", "N", "side"], sort=False)
        for (controller, rate, side), cell in cells:
            row = {"condition": title, "controller": controller, "N": rate, "side": side}
            row["genome"] = "" if several else cell.genome.iloc[0]
            entries.append(row | _means(cell, several=several))
    return pd.DataFrame(entries)


def _described(labels: dict[str, Any], differ: list[str]) -> Iterator[str]:
    """The parts of the name of a condition: its world, what is changed there, and other settings."""
    yield labels["scenario"]
    changed = list(filter(None, labels["changed"].split(", ")))
    yield from changed
    for key in differ:
        if key not in ("scenario", "light", "obstacles") and f"{key}={labels[key]}" not in changed:
            yield f"{key}={labels[key]}"


def rescue_and_harm(rows: pd.DataFrame) -> tuple[dict[str, pd.DataFrame], str] | None:
    """Rescue and harm: tables by their names, and a page in Markdown.

    None unless each of several champions ran once in its training world and in changed worlds.
    """
    plastic = rows.controller != GA
    if not has_champions(rows) or not plastic.any() or has_trials(rows) or rows.duplicated(_TRIAL).any():
        return None
    visited = rows.groupby(["experiment", "genome"]).scenario.agg(set)
    if not all(TRAINED[experiment] in worlds and len(worlds) > 1 for (experiment, _), worlds in visited.items()):
        return None
    lifetimes = numeric(rows)
    each = findings.trials(lifetimes)
    by_champion, by_scenario = findings.rescue_by_champion(each), findings.rescue_and_harm(each)
    over_all = findings.rescue_totals(by_champion)
    champions = int(each.groupby("experiment").genome.nunique().max())
    seeds = f"{code(each.genome.iloc[0])} to {code(each.genome.iloc[-1])}"
    repeats = int(lifetimes.groupby([key for key in _TRIAL if key not in ("seed", "repeat")]).size().max())
    page = rescue.markdown(over_all, by_scenario, champions, repeats, seeds)
    tables = {"rescue_over_all": over_all, "rescue_and_harm": by_scenario, "rescue_by_champion": by_champion}
    return tables, page


def readable(tables: Mapping[str, pd.DataFrame]) -> list[Table]:
    """The tables to read: success of each condition, over champions if there are several; ends; rescue and harm.

    tables: those of `summary`, `over_champions`, `ends` and `rescue_and_harm` by name, as far as they are there. Long
    tables of success and ends are left out where there is rescue and harm.
    """
    harm = []
    if "rescue_over_all" in tables:
        harm = [rescue.totals_table(shown) for _, shown in tables["rescue_over_all"].groupby("experiment", sort=False)]
    if "over_champions" in tables:
        shown = tables["over_champions"].rename(columns={"champions": "n"})
        success = _success_table(shown, "mean over {} champions", " over champions")
    else:
        shown = tables["summary"].rename(columns={f"success_noise_{end}": f"success_{end}" for end in ("low", "high")})
        success = _success_table(shown, "{} lifetimes each", ": noise only, this champion")
    at_end = ends.readable(tables["ends"]) if "ends" in tables else []
    return harm if harm and len(shown) > _MOST else [*success, *at_end, *harm]


def _differing(summary: pd.DataFrame) -> list[str]:
    """The columns that differ between the conditions of a table, which stand before `n`; `controller` is the last.

    Rows without plasticity do not count. Of columns that tell the same conditions apart there is one, the last of them:
    a genome is known by its name.
    """
    plastic = summary[summary.controller != GA] if (summary.controller != GA).any() else summary
    names = [name for name in summary.columns[: summary.columns.get_loc("n")] if name not in ("controller", "side")]
    differ = [name for name in names if plastic[name].nunique() > 1]
    return [*{tuple(plastic[name].factorize()[0]): name for name in differ}.values(), "controller"]


def _success_table(summary: pd.DataFrame, of: str, interval_is: str) -> list[Table]:
    """A row for each condition and controller, named by what differs between them; no table without rows.

    of: what the n counts. interval_is: what it is about.
    """
    if summary.empty:
        return []
    shown = _differing(summary)
    same = summary.n.nunique() == 1
    rewarded = has_trials(summary)
    name, form = (_REWARDED, ".3f") if rewarded else ("success", ".2f")
    rows: dict[tuple[str, ...], dict[str, str]] = {}
    for row in summary.to_dict("records"):
        labels = tuple(plain(_cell(row[name])) for name in shown)
        count = "" if same else f" of {row['n']}"
        rows.setdefault(labels, {})[row["side"]] = interval_text(pd.Series(row), name, form) + count
    facts = [of.format(summary.n.iloc[0])] if same else []
    if f"{name}_low" in summary:
        is_known = summary[f"{name}_low"].notna().any()
        facts.append(f"95 % interval{interval_is}" if is_known else f"fewer than {LEAST} have no interval")
    title = "Rewarded share, by the end that is rewarded first" if rewarded else "Success"
    headings = [*shown, *(side if rewarded else f"success, {side}" for side in SIDES)]
    cells = [[*labels, *(values.get(side, "") for side in SIDES)] for labels, values in rows.items()]
    return [Table(headings, cells, f"{title} ({'; '.join(facts)})" if facts else title, text=len(shown))]


def _cell(value: Any) -> str:
    return str(value) if not isinstance(value, float) else "" if math.isnan(value) else f"{value:g}"
