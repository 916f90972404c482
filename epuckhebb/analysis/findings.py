"""Findings over many champions: success, ends, rescue and harm.

`metrics` is the table of all lifetimes, with the columns of `epuckhebb.analysis.evaluate`; `genome` is the champion.
All intervals and p values take champions as the independent unit.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from epuckhebb.analysis.statistics import bootstrap, bounds, mean, sign_flip, wilson_by_champion
from epuckhebb.tmaze.individual import GA
from epuckhebb.tmaze.outcome import End
from epuckhebb.tmaze.scenario import TRAINED

CHANGED = {"light": ("lowlight",), "obstacles": ("2obstacles", "4obstacles")}
PAPER_N = {"light": 0.002, "obstacles": 0.000015}
COUNTS = ("broken", "rescued", "broken_wrong", "broken_elsewhere", "broken_arrived", "intact", "harmed")
BROKEN, INTACT, UNSOLVED = "broken", "intact", "unsolved"
TRIAL = ["genome", "side"]
_CELL, _PLASTICITY = ["experiment", "scenario", "controller", "N"], ["experiment", "controller", "N"]
_MEANS = ["success", "time_to_goal_s", "path_length_m", "final_position_error_m", "weight_change_mean"]


def trials(metrics: pd.DataFrame, settings: Sequence[str] = ()) -> pd.DataFrame:
    """One row for each trial (champion, side) and condition; the other columns are means over the repeats.

    `succeeds`: whether more than half of the repeats succeed. `end`: where more than half of the repeats end, and
    `elsewhere` if no end has so many. `arrived`: whether more than half of them reached the goal at any time. settings:
    more columns that tell conditions apart.
    """
    marked = metrics.assign(_wrong=metrics.end == End.wrong, _arrived=metrics.time_to_goal_s.notna())
    grouped = marked.groupby([*dict.fromkeys([*settings, *_CELL, *TRIAL])], sort=False)
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
    both_sides = sides[["succeeds", "wrong"]].all().assign(side="both")
    outcomes = pd.concat([each, both_sides], ignore_index=True)
    trial = ["experiment", "scenario", *TRIAL]
    alone = outcomes[outcomes.controller == GA].set_index(trial).succeeds
    outcomes["gained"] = outcomes.succeeds & ~alone.loc[pd.MultiIndex.from_frame(outcomes[trial])].to_numpy()
    rows = []
    for cell, group in outcomes.groupby([*_CELL, "side"], sort=False):
        k, n = int(group.succeeds.sum()), len(group)
        row = dict(zip([*_CELL, "side"], cell, strict=True)) | {"successes": k, "n": n, "share": k / n}
        row |= bounds("", wilson_by_champion(group.succeeds.to_numpy(np.int64), np.ones(n, np.int64)))
        rows.append(row | group[["gained", "wrong"]].sum().to_dict())
    return pd.DataFrame(rows)


def find_fates(each: pd.DataFrame, settings: Sequence[str] = ()) -> pd.DataFrame:
    """Trials with the column `fate`: what the world does to the trial without plasticity.

    `broken`: solved in the training world, but not here; `intact`: solved in both; `unsolved`: not solved in the
    training world; empty where there are no trials of the training world. settings: columns in which a trial and that
    of its training world agree.
    """
    trial = [*dict.fromkeys([*settings, "experiment", *TRIAL])]
    alone = each[each.controller == GA]
    in_training = alone[alone.scenario == alone.experiment.map(TRAINED)].set_index(trial).succeeds
    unaided = alone.set_index([*trial, "scenario"]).succeeds
    solved = in_training.reindex(pd.MultiIndex.from_frame(each[trial]))
    stays = unaided.reindex(pd.MultiIndex.from_frame(each[[*trial, "scenario"]]))
    fates = [solved.isna(), solved.eq(False), stays.eq(True), stays.eq(False)]
    return each.assign(fate=np.select([fate.to_numpy() for fate in fates], ["", UNSOLVED, INTACT, BROKEN], ""))


def _mark_fates(each: pd.DataFrame) -> pd.DataFrame:
    """Trials with a column for each of `COUNTS`: whether the trial is one of these."""
    each = find_fates(each)
    broken, intact = each.fate == BROKEN, each.fate == INTACT
    ends = (each.succeeds, each.end == End.wrong, each.end == End.elsewhere, each.arrived)
    marks = (broken, *(broken & end for end in ends), intact, intact & ~each.succeeds)
    return each.assign(**dict(zip(COUNTS, marks, strict=True)))


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
    marked = _mark_fates(each)
    for key, group in marked[marked.controller != GA].groupby(_PLASTICITY, sort=False):
        experiment = key[0]
        for scenario in (TRAINED[experiment], *changed(each, experiment)):
            cell = group[group.scenario == scenario]
            counts = _counts(cell.groupby("genome", sort=False)[[*COUNTS]].sum())
            row = dict(zip(_CELL, (experiment, scenario, *key[1:]), strict=True))
            row |= {"solved": counts["broken"] + counts["intact"]} | counts
            gain = cell.set_index(TRIAL).succeeds.astype(float) - outcomes(each, experiment, scenario, GA, 0.0)
            of_champion = gain.groupby("genome", sort=False)
            row |= {"difference": float(of_champion.mean().mean())}
            row |= bounds("difference_", bootstrap(mean, of_champion.mean().to_numpy()))
            rows.append(row | {"sign_flip_p": sign_flip(of_champion.sum().to_numpy().astype(np.int64))})
    return pd.DataFrame(rows)


def _counts(by_champion: pd.DataFrame) -> dict[str, Any]:
    """The sums over champions of what happens to their trials, and the shares rescued and harmed."""
    row: dict[str, Any] = by_champion.sum().to_dict()
    for part, whole in (("rescued", "broken"), ("harmed", "intact")):
        row[f"{part}_share"] = ratio(row[part], row[whole])
        row |= bounds(f"{part}_", wilson_by_champion(*by_champion[[part, whole]].to_numpy(np.int64).T))
    return row


def changed(each: pd.DataFrame, experiment: str) -> list[str]:
    """The changed scenarios of an experiment, in the order of the table."""
    scenarios = each[each.experiment == experiment].scenario.unique()
    return [scenario for scenario in scenarios if scenario != TRAINED[experiment]]


def rescue_by_champion(each: pd.DataFrame) -> pd.DataFrame:
    """What happens to the trials of each champion in all changed worlds of an experiment together.

    `solves`: how many sides the GA solves in the training world; `training_harmed`: on how many of these the plasticity
    fails there. The counts of broken, rescued, intact and harmed trials are those of `rescue_and_harm`. The GA has
    rows, too; it rescues none.
    """
    rows = []
    for key, group in _mark_fates(each).groupby(_PLASTICITY, sort=False):
        is_training = group.scenario == TRAINED[key[0]]
        counts, trained = (
            group[some].groupby("genome", sort=False)[[*COUNTS]].sum() for some in (~is_training, is_training)
        )
        counts = counts.assign(**dict(zip(_PLASTICITY, key, strict=True)))
        rows.append(counts.assign(solves=trained.intact, training_harmed=trained.harmed).reset_index())
    return pd.concat(rows, ignore_index=True)[[*_PLASTICITY, "genome", "solves", "training_harmed", *COUNTS]]


def rescue_totals(by_champion: pd.DataFrame) -> pd.DataFrame:
    """Rescue and harm over all changed worlds of an experiment together, and harm in the training world.

    by_champion: the table `rescue_by_champion.csv`. The counts and shares have the names that they have for one world
    (`rescue_and_harm`).
    """
    rows = []
    plastic = by_champion[by_champion.controller != GA]
    for key, group in plastic.groupby(_PLASTICITY, sort=False):
        row = dict(zip(_PLASTICITY, key, strict=True)) | _counts(group[[*COUNTS]])
        rows.append(row | {"training_harmed": group.training_harmed.sum(), "training_solved": group.solves.sum()})
    return pd.DataFrame(rows)


def outcomes(
    each: pd.DataFrame, experiment: str, scenario: str, controller: str, rate: float, column: str = "succeeds"
) -> pd.Series:
    """A column of one condition, indexed by trial."""
    in_world = (each.experiment == experiment) & (each.scenario == scenario)
    return each[in_world & (each.controller == controller) & (rate == each.N)].set_index(TRIAL)[column]


def ratio(k: int, n: int) -> float:
    """A share; nan of nothing."""
    return k / n if n else float("nan")
