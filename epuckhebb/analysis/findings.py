"""Findings over many champions: success, rescue and harm, retention, dose-response, and the paper's claims.

`metrics` is the table of all lifetimes, with the columns of `epuckhebb.analysis.evaluate`; `genome` is the champion.
All intervals and p values take champions as the independent unit: see `epuckhebb.analysis.statistics`.
"""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from epuckhebb.analysis.statistics import bootstrap_mean, bootstrap_ratio, sign_flip, wilson, wilson_by_champion
from epuckhebb.tmaze.individual import CONTROLS, GA, HEBBIAN
from epuckhebb.tmaze.scenario import TRAINED

CHANGED = {"light": ("lowlight",), "obstacles": ("2obstacles", "4obstacles")}
PAPER_N = {"light": 0.002, "obstacles": 0.000015}
TRIAL = ["genome", "side"]
_CELL = ["experiment", "scenario", "controller", "N"]


def trials(metrics: pd.DataFrame) -> pd.DataFrame:
    """One row for each trial (champion, side) and condition; the other columns are means over the repeats.

    `succeeds`: whether more than half of the repeats succeed.
    """
    grouped = metrics.groupby([*_CELL, *TRIAL], sort=False)
    means = grouped[
        ["success", "time_to_goal_s", "path_length_m", "final_position_error_m", "weight_change_mean"]
    ].mean()
    means["succeeds"] = means.success > 0.5
    return means.reset_index()


def success(each: pd.DataFrame) -> pd.DataFrame:
    """Success of every condition over the champions: on the left, on the right, and on both sides.

    A champion is one case in each row. The intervals are therefore Wilson's. `gained`: champions that succeed here and
    fail in the same world without plasticity.
    """
    both = each.groupby([*_CELL, "genome"], sort=False, as_index=False).succeeds.all().assign(side="both")
    outcomes = pd.concat([each, both], ignore_index=True)
    trial = ["experiment", "scenario", *TRIAL]
    alone = outcomes[outcomes.controller == GA].set_index(trial).succeeds
    outcomes["gained"] = outcomes.succeeds & ~alone.loc[pd.MultiIndex.from_frame(outcomes[trial])].to_numpy()
    rows = []
    for cell, group in outcomes.groupby([*_CELL, "side"], sort=False):
        k, n = int(group.succeeds.sum()), len(group)
        low, high = wilson(k, n)
        row = dict(zip([*_CELL, "side"], cell, strict=True)) | {"successes": k, "n": n, "share": k / n}
        rows.append(row | {"low": low, "high": high, "gained": int(group.gained.sum())})
    return pd.DataFrame(rows)


def rescue_and_harm(each: pd.DataFrame) -> pd.DataFrame:
    """For each plasticity, rate and world: what happens to the trials that the GA solves in its training world.

    broken: fail in the changed world without plasticity; rescued: of these, succeed with it. intact: succeed in the
    changed world without plasticity; harmed: of these, fail with it. No trial is broken in the training world. The
    intervals of the shares are from `wilson_by_champion`. `difference` is success with plasticity minus success
    without, over all trials of the world, solved or not, with a bootstrap interval; `sign_flip_p` is its exact p value.
    """
    rows: list[dict[str, Any]] = []
    for experiment, kind, rate in _plasticities(each):
        for scenario in (TRAINED[experiment], *changed(each, experiment)):
            fates = _fates(each, experiment, scenario, kind, rate)
            counts = _counts(fates, wilson_by_champion)
            where = {"experiment": experiment, "scenario": scenario, "controller": kind, "N": rate}
            row = where | {"solved": counts["broken"] + counts["intact"]} | counts
            without, plastic = (_outcomes(each, experiment, scenario, *how) for how in ((GA, 0.0), (kind, rate)))
            difference = (plastic.astype(float) - without.astype(float)).groupby("genome", sort=False)
            by_champion = difference.mean().to_numpy()
            low, high = bootstrap_mean(by_champion, seed=0, bounds=(-1, 1))
            row |= {"difference": float(by_champion.mean()), "difference_low": low, "difference_high": high}
            rows.append(row | {"sign_flip_p": sign_flip(difference.sum().to_numpy().astype(np.int64))})
    return pd.DataFrame(rows)


def _fates(each: pd.DataFrame, experiment: str, scenario: str, kind: str, rate: float) -> pd.DataFrame:
    """Whether each trial is broken, rescued, intact, harmed: a column each, indexed by trial.

    A trial that the GA does not solve in its training world is none of these.
    """
    without = _outcomes(each, experiment, scenario, GA, 0.0)
    plastic = _outcomes(each, experiment, scenario, kind, rate)
    solved = without.index.isin(_solved(each, experiment))
    broken, intact = solved & ~without, solved & without
    return pd.DataFrame({"broken": broken, "rescued": broken & plastic, "intact": intact, "harmed": intact & ~plastic})


def _counts(fates: pd.DataFrame, interval: Callable[..., tuple[float, float]]) -> dict[str, Any]:
    by_champion = fates.groupby("genome", sort=False).sum()
    row: dict[str, Any] = by_champion.sum().to_dict()
    for part, whole in (("rescued", "broken"), ("harmed", "intact")):
        low, high = interval(by_champion[part].to_numpy(np.int64), by_champion[whole].to_numpy(np.int64))
        row |= {f"{part}_share": _ratio(row[part], row[whole]), f"{part}_low": low, f"{part}_high": high}
    return row


def changed(each: pd.DataFrame, experiment: str) -> list[str]:
    """The changed scenarios of an experiment, in the order of the table."""
    there = each[each.experiment == experiment].scenario.unique()
    return [scenario for scenario in there if scenario != TRAINED[experiment]]


def rescue_over_all(each: pd.DataFrame) -> pd.DataFrame:
    """Rescue and harm over all changed worlds of an experiment together, and harm in the training world.

    Trials of one champion in many worlds are not independent. The intervals are therefore from a bootstrap over
    champions. Columns as in `rescue_and_harm`.
    """
    rows = []
    for experiment, kind, rate in _plasticities(each):
        fates = pd.concat(_fates(each, experiment, scenario, kind, rate) for scenario in changed(each, experiment))
        counts = _counts(fates[fates.broken | fates.intact], partial(bootstrap_ratio, seed=0))
        trained = _fates(each, experiment, TRAINED[experiment], kind, rate).sum()
        row = {"experiment": experiment, "controller": kind, "N": rate, **counts}
        rows.append(row | {"training_harmed": int(trained.harmed), "training_solved": int(trained.intact)})
    return pd.DataFrame(rows)


def rescue_by_champion(each: pd.DataFrame) -> pd.DataFrame:
    """The counts of `rescue_over_all` for each champion, to compare two controllers champion by champion."""
    rows = []
    for experiment, kind, rate in _plasticities(each):
        fates = pd.concat(_fates(each, experiment, scenario, kind, rate) for scenario in changed(each, experiment))
        for genome, counts in fates.groupby("genome", sort=False).sum().iterrows():
            rows.append({"experiment": experiment, "controller": kind, "N": rate, "genome": genome, **counts})
    return pd.DataFrame(rows)


def retention(each: pd.DataFrame) -> pd.DataFrame:
    """How many of the trials solved in training succeed in the changed worlds, for the GA and for each plasticity.

    A trial here is a champion, a side and a changed world; it is solved in training if the GA solves that side in the
    training world. A champion that always turns left keeps its one side in nearly every world, though it has learned
    nothing that a change could break. There are therefore two rows for each plasticity: `solves` is "any" for all
    these trials, and "both" for those of champions that solve both sides in training.

    Columns: experiment, controller, N, solves, champions (that have such trials), trials, retained, share, low, high.
    """
    rows = []
    conditions = each[["experiment", "controller", "N"]].drop_duplicates().itertuples(index=False, name=None)
    for experiment, kind, rate in conditions:
        solved = _solved(each, experiment)
        sides = solved.to_frame(index=False).groupby("genome", sort=False).side.nunique()
        tests = [_outcomes(each, experiment, scenario, kind, rate) for scenario in changed(each, experiment)]
        trial = pd.concat(tests) if tests else pd.Series(dtype=bool, index=solved[:0])
        trial = trial[trial.index.isin(solved)]
        for solves, least in (("any", 1), ("both", 2)):
            among = trial[trial.index.get_level_values("genome").isin(sides[sides >= least].index)]
            retained, whole = _by_champion(among, among | ~among)
            low, high = bootstrap_ratio(retained, whole, seed=0)
            rows.append(
                {"experiment": experiment, "controller": kind, "N": rate, "solves": solves}
                | {"champions": len(whole), "trials": int(whole.sum()), "retained": int(retained.sum())}
                | {"share": _ratio(int(retained.sum()), int(whole.sum())), "low": low, "high": high}
            )
    return pd.DataFrame(rows)


def dose_response(each: pd.DataFrame) -> pd.DataFrame:
    """Success, time to goal and weight change for each rate: means over champions; N = 0 is the GA.

    Intervals are from a bootstrap. The mean of one champion has none, except for success, which has bounds.
    """
    rows = []
    shown = each[each.controller.isin([GA, *CONTROLS.values()])]
    for cell, group in shown.groupby(_CELL, sort=False):
        row = dict(zip(_CELL, cell, strict=True))
        for column in ("success", "time_to_goal_s", "weight_change_mean"):
            values = group.groupby("genome", sort=False)[column].mean().to_numpy(float)
            low, high = bootstrap_mean(values, seed=0, bounds=(0, 1) if column == "success" else None)
            mean = float(np.nanmean(values)) if np.isfinite(values).any() else float("nan")
            row |= {column: mean, f"{column}_low": low, f"{column}_high": high}
        rows.append(row)
    return pd.DataFrame(rows).sort_values([*_CELL[:3], "N"], kind="stable", ignore_index=True)


RULE = (
    "It *holds* where the interval of the share of trials in which it is true lies above one half, and *does not hold* "
    "where the interval lies below. It is *mixed* where the interval contains one half and lies between one quarter "
    "and three quarters, and *inconclusive* otherwise. A *check* has no interval: it passes or fails."
)
_MIXED = (0.25, 0.75)  # a wider interval is inconclusive


def claim(text: str, counted: str, part: NDArray[np.int64], whole: NDArray[np.int64]) -> dict[str, Any]:
    """A claim of the paper as a question to every trial that could show it: its counts, interval and verdict.

    counted: which trials these are, and what counts as true. part, whole: for each champion, in how many trials the
    claim is true, of how many, (champions,).
    """
    true, n = int(part.sum()), int(whole.sum())
    low, high = wilson_by_champion(part, whole)
    return (
        {"claim": text, "counted": counted, "true": true, "n": n, "champions": int((whole > 0).sum())}
        | {"share": _ratio(true, n), "low": low, "high": high}
        | {"verdict": verdict(low, high, n)}
    )


def verdict(low: float, high: float, n: int) -> str:
    """The verdict of `RULE` on a claim whose share, among n trials, has this interval; (nan, nan): no trials.

    The interval alone decides: 3 of 3 is not enough for any claim.
    """
    if np.isnan(low) or np.isnan(high):
        return "no trial to judge by"
    if low > 0.5:
        return "holds"
    if high < 0.5:
        return "does not hold"
    return "mixed" if _MIXED[0] <= low and high <= _MIXED[1] else f"inconclusive (n = {n})"


def claims(each: pd.DataFrame) -> pd.DataFrame:
    """The paper's claims, one row each. Column `champions`: how many have a trial that could show the claim."""
    present = set(each.experiment)
    return pd.DataFrame(
        {"experiment": experiment} | row
        for experiment, rows in (("light", _light_claims), ("obstacles", _obstacle_claims))
        if experiment in present
        for row in (*rows(each), _unchanged(each, experiment))
    )


def _light_claims(each: pd.DataFrame) -> Iterator[dict[str, Any]]:
    of, rate = partial(_outcomes, each, "light"), PAPER_N["light"]
    bright, dim = of("highlight", GA, 0.0), of("lowlight", GA, 0.0)
    bright_plastic, dim_plastic = of("highlight", HEBBIAN, rate), of("lowlight", HEBBIAN, rate)
    broken = bright & ~dim
    yield _count("The GA fails in low light", "trials solved in high light: fail in low light", ~dim, bright)
    yield _count(f"N = {rate:g} rescues it", "trials broken by low light: succeed", dim_plastic, broken)
    yield _count("The same N harms in high light", "trials solved in high light: fail", ~bright_plastic, bright)
    small = of("lowlight", HEBBIAN, PAPER_N["obstacles"])
    yield _either("A large change needs a large rate", broken, dim_plastic, small)


def _obstacle_claims(each: pd.DataFrame) -> Iterator[dict[str, Any]]:
    of, rate = partial(_outcomes, each, "obstacles"), PAPER_N["obstacles"]
    base = of("base", GA, 0.0)
    any_broken, any_small, any_large = [], [], []
    for scenario, count in (("2obstacles", 2), ("4obstacles", 4)):
        alone, plastic = of(scenario, GA, 0.0), of(scenario, HEBBIAN, rate)
        broken = base & ~alone
        yield _count(f"{count} obstacles defeat the GA", "trials solved in base: fail", ~alone, base)
        yield _count(f"N = {rate:g} rescues it at {count}", "trials broken by them: succeed", plastic, broken)
        any_broken.append(broken)
        any_small.append(plastic)
        any_large.append(of(scenario, HEBBIAN, PAPER_N["light"]))
    yield _either("A small change needs a small rate", *map(pd.concat, (any_broken, any_small, any_large)))
    none, two, four = (
        of(scenario, HEBBIAN, rate, "weight_change_mean") for scenario in ("base", "2obstacles", "4obstacles")
    )
    grows = (none < two) & (two < four)
    yield _count("Weight change grows with obstacles", "all trials: base < 2 < 4", grows, grows | ~grows)
    alone, plastic = of("base", GA, 0.0, "time_to_goal_s"), of("base", HEBBIAN, rate, "time_to_goal_s")
    both = alone.notna() & plastic.notna()
    yield _count("Plasticity reaches the goal sooner", "trials of base in which both arrive", plastic < alone, both)


def _unchanged(each: pd.DataFrame, experiment: str) -> dict[str, Any]:
    """The row of a check, which the job of a champion makes or fails; it has no interval, as it is no statistic."""
    n = each[each.experiment == experiment].genome.nunique()
    return {
        "claim": "The genome is unchanged after a lifetime",
        "counted": "champions: bit-identical after all lifetimes",
    } | {"true": n, "n": n, "champions": n, "share": 1.0, "low": np.nan, "high": np.nan, "verdict": "check passed"}


def showcase(each: pd.DataFrame, published: pd.DataFrame, experiment: str) -> tuple[str, int, int]:
    """The champion that agrees with the paper in most cells, the number of these cells, and of all cells.

    Only champions that solve both sides in training without plasticity are considered, or all if none does. Of equals
    the first is taken. It is chosen *for* its likeness: it shows that the pattern exists, not how often.
    """
    ours = each[(each.experiment == experiment) & each.N.isin([0.0, PAPER_N[experiment]])]
    ours = ours[ours.controller.isin([GA, HEBBIAN])]
    paper = published[published.experiment == experiment].set_index(["scenario", "controller", "side"]).success
    solved = _solved(each, experiment)
    names = list(dict.fromkeys(ours.genome))
    solves = [name for name in names if all((name, side) in solved for side in ("left", "right"))]
    agreement = {}
    for name in solves or names:
        own = ours[ours.genome == name].set_index(["scenario", "controller", "side"]).succeeds
        shared = [cell for cell in paper.index if cell in own.index and not np.isnan(paper[cell])]
        agreement[name] = sum(bool(own[cell]) == bool(paper[cell]) for cell in shared)
    best = max(agreement, key=lambda name: agreement[name])
    return best, agreement[best], int(paper.notna().sum())


def _plasticities(each: pd.DataFrame) -> Iterator[tuple[str, str, float]]:
    plastic = each[each.controller != GA]
    for key, _ in plastic.groupby(["experiment", "controller", "N"], sort=False):
        yield key


def _outcomes(
    each: pd.DataFrame, experiment: str, scenario: str, controller: str, rate: float, column: str = "succeeds"
) -> pd.Series:
    """A column of one condition, indexed by trial."""
    here = (each.experiment == experiment) & (each.scenario == scenario)
    return each[here & (each.controller == controller) & (rate == each.N)].set_index(TRIAL)[column]


def _solved(each: pd.DataFrame, experiment: str) -> pd.Index:
    alone = _outcomes(each, experiment, TRAINED[experiment], GA, 0.0)
    return alone[alone].index


def _count(text: str, counted: str, true: pd.Series, among: pd.Series) -> dict[str, Any]:
    return claim(text, counted, *_by_champion(true, among))


def _either(text: str, broken: pd.Series, own: pd.Series, other: pd.Series) -> dict[str, Any]:
    """Whether the experiment's own rate rescues, in the trials where just one of the two rates does."""
    if not len(other):
        return claim(text, "not run", np.zeros(0, np.int64), np.zeros(0, np.int64))
    counted = "broken trials that one of N = 0.000015 and 0.002 rescues and the other does not"
    return _count(text, counted, own & ~other, broken & (own ^ other))


def _by_champion(true: pd.Series, among: pd.Series) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """For each champion: in how many trials it is true, and how many trials `among` holds; both (champions,)."""
    counts = pd.DataFrame({"part": true & among, "whole": among}).groupby("genome", sort=False).sum()
    return counts.part.to_numpy(np.int64), counts.whole.to_numpy(np.int64)


def _ratio(k: int, n: int) -> float:
    return k / n if n else float("nan")
