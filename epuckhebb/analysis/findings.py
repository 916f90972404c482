"""Findings over many champions: success, ends, rescue and harm.

`metrics` is the table of all lifetimes, with the columns of `epuckhebb.analysis.evaluate`; `genome` is the champion.
All intervals and p values take champions as the independent unit.
"""

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
import pandas as pd

from epuckhebb.analysis.statistics import bootstrap, mean, sign_flip, wilson_by_champion
from epuckhebb.tmaze.individual import GA
from epuckhebb.tmaze.outcome import End
from epuckhebb.tmaze.scenario import TRAINED

CHANGED = {"light": ("lowlight",), "obstacles": ("2obstacles", "4obstacles")}
PAPER_N = {"light": 0.002, "obstacles": 0.000015}
COUNTS = ("broken", "rescued", "broken_wrong", "broken_elsewhere", "broken_arrived", "intact", "harmed")
TRIAL = ["genome", "side"]
_CELL = ["experiment", "scenario", "controller", "N"]
_MEANS = ["success", "time_to_goal_s", "path_length_m", "final_position_error_m", "weight_change_mean"]


def trials(metrics: pd.DataFrame, settings: Sequence[str] = ()) -> pd.DataFrame:
    """One row for each trial (champion, side) and condition; the other columns are means over the repeats.

    `succeeds`: whether more than half of the repeats succeed. `end`: where more than half of the repeats end, and
    `elsewhere` if no end has so many. `arrived`: whether more than half of them reached the goal at any time. settings:
    more columns that tell conditions apart.
    """
    own = metrics.assign(_wrong=metrics.end == End.wrong, _arrived=metrics.time_to_goal_s.notna())
    grouped = own.groupby([*dict.fromkeys([*settings, *_CELL, *TRIAL])], sort=False)
    means = grouped[[*_MEANS, "_wrong", "_arrived"]].mean()
    means["succeeds"], means["arrived"] = means.success > 0.5, means._arrived > 0.5
    means["end"] = np.where(means.succeeds, End.right, np.where(means._wrong > 0.5, End.wrong, End.elsewhere))
    return means.drop(columns=["_wrong", "_arrived"]).reset_index()


def success(each: pd.DataFrame) -> pd.DataFrame:
    """Success of every condition over the champions: on the left, on the right, and on both sides.

    `gained`: champions that succeed here and fail in the same world without plasticity. `wrong`: champions that end at
    the goal of the other side.
    """
    each = each.assign(wrong=each.end == End.wrong)
    sides = each.groupby([*_CELL, "genome"], sort=False, as_index=False)
    both = sides[["succeeds", "wrong"]].all().assign(side="both")
    outcomes = pd.concat([each, both], ignore_index=True)
    trial = ["experiment", "scenario", *TRIAL]
    alone = outcomes[outcomes.controller == GA].set_index(trial).succeeds
    outcomes["gained"] = outcomes.succeeds & ~alone.loc[pd.MultiIndex.from_frame(outcomes[trial])].to_numpy()
    rows = []
    for cell, group in outcomes.groupby([*_CELL, "side"], sort=False):
        k, n = int(group.succeeds.sum()), len(group)
        low, high = wilson_by_champion(group.succeeds.to_numpy(np.int64), np.ones(n, np.int64))
        row = dict(zip([*_CELL, "side"], cell, strict=True)) | {"successes": k, "n": n, "share": k / n}
        rows.append(row | {"low": low, "high": high} | group[["gained", "wrong"]].sum().to_dict())
    return pd.DataFrame(rows)


def rescue_and_harm(each: pd.DataFrame) -> pd.DataFrame:
    """For each plasticity, rate and world: what happens to the trials that the GA solves in its training world.

    broken: fail in the changed world without plasticity; rescued: of these, succeed with it. broken_wrong,
    broken_elsewhere: of the broken, end there with it, by `trials`; broken_arrived: of the broken, reach the goal with
    it at any time. intact: succeed in the changed world without plasticity; harmed: of these, fail with it. No trial is
    broken in the training world. The intervals of shares are from `wilson_by_champion`. `difference` is success with
    plasticity minus success without, over all trials of the world, solved or not, with a bootstrap interval;
    `sign_flip_p` is its exact p value.
    """
    rows: list[dict[str, Any]] = []
    for experiment, kind, rate in _plasticities(each):
        for scenario in (TRAINED[experiment], *changed(each, experiment)):
            fates = _fates(each, experiment, scenario, kind, rate)
            counts = _counts(fates.groupby("genome", sort=False).sum())
            where = {"experiment": experiment, "scenario": scenario, "controller": kind, "N": rate}
            row = where | {"solved": counts["broken"] + counts["intact"]} | counts
            without, plastic = (outcomes(each, experiment, scenario, *how) for how in ((GA, 0.0), (kind, rate)))
            difference = (plastic.astype(float) - without.astype(float)).groupby("genome", sort=False)
            by_champion = difference.mean().to_numpy()
            low, high = bootstrap(mean, by_champion)
            row |= {"difference": float(by_champion.mean()), "difference_low": low, "difference_high": high}
            rows.append(row | {"sign_flip_p": sign_flip(difference.sum().to_numpy().astype(np.int64))})
    return pd.DataFrame(rows)


def _fates(each: pd.DataFrame, experiment: str, scenario: str, kind: str, rate: float) -> pd.DataFrame:
    """Whether each trial is one of `COUNTS`: a column each, indexed by trial.

    A trial that the GA does not solve in its training world is none of these.
    """
    without = outcomes(each, experiment, scenario, GA, 0.0)
    plastic, end, arrived = (
        outcomes(each, experiment, scenario, kind, rate, column) for column in ("succeeds", "end", "arrived")
    )
    solved = without.index.isin(solved_in_training(each, experiment))
    broken, intact = solved & ~without, solved & without
    fates = (plastic, end == End.wrong, end == End.elsewhere, arrived)
    return pd.DataFrame(
        dict(zip(COUNTS, (broken, *(broken & fate for fate in fates), intact, intact & ~plastic), strict=True))
    )


def _counts(by_champion: pd.DataFrame) -> dict[str, Any]:
    """The sums over champions of what happens to their trials, and the shares rescued and harmed."""
    row: dict[str, Any] = by_champion.sum().to_dict()
    for part, whole in (("rescued", "broken"), ("harmed", "intact")):
        low, high = wilson_by_champion(by_champion[part].to_numpy(np.int64), by_champion[whole].to_numpy(np.int64))
        row |= {f"{part}_share": ratio(row[part], row[whole]), f"{part}_low": low, f"{part}_high": high}
    return row


def changed(each: pd.DataFrame, experiment: str) -> list[str]:
    """The changed scenarios of an experiment, in the order of the table."""
    there = each[each.experiment == experiment].scenario.unique()
    return [scenario for scenario in there if scenario != TRAINED[experiment]]


def rescue_by_champion(each: pd.DataFrame) -> pd.DataFrame:
    """What happens to the trials of each champion in all changed worlds of an experiment together.

    `solves`: how many sides the GA solves in the training world; `training_harmed`: on how many of these the plasticity
    fails there. The counts of broken, rescued, intact and harmed trials are those of `rescue_and_harm`. The GA has
    rows, too; it rescues none.
    """
    rows = []
    for experiment, kind, rate in each[["experiment", "controller", "N"]].drop_duplicates().itertuples(index=False):
        fates = pd.concat(_fates(each, experiment, scenario, kind, rate) for scenario in changed(each, experiment))
        trained = _fates(each, experiment, TRAINED[experiment], kind, rate).groupby("genome", sort=False).sum()
        for genome, counts in fates.groupby("genome", sort=False).sum().iterrows():
            own = trained.loc[genome]
            row = {"experiment": experiment, "controller": kind, "N": rate, "genome": genome, "solves": own.intact}
            rows.append(row | {"training_harmed": own.harmed, **counts})
    return pd.DataFrame(rows)


def rescue_totals(by_champion: pd.DataFrame) -> pd.DataFrame:
    """Rescue and harm over all changed worlds of an experiment together, and harm in the training world.

    by_champion: the table `rescue_by_champion.csv`. The counts and shares have the names that they have for one world
    (`rescue_and_harm`).
    """
    rows = []
    plastic = by_champion[by_champion.controller != GA]
    for cell, own in plastic.groupby(["experiment", "controller", "N"], sort=False):
        row = dict(zip(("experiment", "controller", "N"), cell, strict=True))
        row |= _counts(own[list(COUNTS)])
        rows.append(row | {"training_harmed": own.training_harmed.sum(), "training_solved": own.solves.sum()})
    return pd.DataFrame(rows)


def _plasticities(each: pd.DataFrame) -> Iterator[tuple[str, str, float]]:
    plastic = each[each.controller != GA]
    for key, _ in plastic.groupby(["experiment", "controller", "N"], sort=False):
        yield key


def outcomes(
    each: pd.DataFrame, experiment: str, scenario: str, controller: str, rate: float, column: str = "succeeds"
) -> pd.Series:
    """A column of one condition, indexed by trial."""
    here = (each.experiment == experiment) & (each.scenario == scenario)
    return each[here & (each.controller == controller) & (rate == each.N)].set_index(TRIAL)[column]


def solved_in_training(each: pd.DataFrame, experiment: str) -> pd.Index:
    """The trials that the GA solves in its training world."""
    alone = outcomes(each, experiment, TRAINED[experiment], GA, 0.0)
    return alone[alone].index


def ratio(k: int, n: int) -> float:
    """A share; nan of nothing."""
    return k / n if n else float("nan")
