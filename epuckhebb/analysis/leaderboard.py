"""The leaderboard: success of the champions of many methods in worlds that none of them was trained in.

A *trial* is one champion, one side and one test world; it succeeds if more than half of its repeats do. Champions are
the independent unit. Methods that are added to champions are compared with these, champion by champion; methods that
evolve champions of their own, as two groups. Reversal learning, the positive control, has no test worlds: there a trial
is one of the many of a lifetime, and succeeds if it is rewarded. A first table has a row for each champion; the
leaderboard is computed from it.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml
from numpy.typing import NDArray

from epuckhebb.analysis import findings
from epuckhebb.analysis.statistics import (
    bootstrap,
    bounds,
    difference,
    holm,
    improvement,
    interquartile_mean,
    mean,
    permutation,
    sign_flip,
    wilson_by_champion,
)
from epuckhebb.analysis.tables import Table, code, interval_text, pictures
from epuckhebb.tmaze.individual import CLASSES, GA
from epuckhebb.tmaze.scenario import TRAINED
from epuckhebb.tmaze.task import Task

REVERSAL = "reversal"  # the experiment that is not one of the paper's
PLAIN, EVOLVED, POST_HOC = "plain", "evolved", "post_hoc"  # the kinds of methods
KINDS = {PLAIN: "no plasticity", EVOLVED: "plasticity during evolution", POST_HOC: "added after evolution"}
_OF_ROW = ("experiment", "method", "kind", "knowledge_class", "knowledge", "matched_control")
_DIFFERENCE = ("difference", "difference_low", "difference_high", "p")
_IMPROVEMENT = ("improvement", "improvement_low", "improvement_high")
_BEST_PLAIN = [f"best_plain_{name}" for name in _DIFFERENCE]
_SAME_BUDGET = 0.1  # robot-steps may differ by this share
_TEXTS = yaml.safe_load(Path(__file__).with_suffix(".yaml").read_text(encoding="utf-8"))  # of the page
CAPTIONS: Mapping[str, str] = _TEXTS["captions"]


@dataclass(frozen=True, kw_only=True)
class Row:
    """A method in an experiment."""

    experiment: str
    method: str
    kind: str  # one of `KINDS`
    matched_control: str  # the method that it is compared with; empty for plain ones
    evolved_parameters: int
    knowledge: str = "senses"  # what it uses, with commas between
    knowledge_class: str = CLASSES[0]


def champion_counts(metrics: pd.DataFrame, training_world: str) -> tuple[dict[str, int | None], pd.DataFrame]:
    """The counts of a champion: a row for it, and a row for each test world.

    metrics: its lifetimes, without plasticity and, if it has any, with it.
    """
    each = findings.trials(metrics)
    plastic = [name for name in each.controller.unique() if name != GA]
    alone = each[each.controller == GA]
    tested = each[each.controller == plastic[0]] if plastic else alone
    in_training, tests = tested[tested.scenario == training_world], tested[tested.scenario != training_world]
    count: dict[str, int | None] = {
        "solves": int(in_training.succeeds.all()),
        "trials": len(tests),
        "successes": int(tests.succeeds.sum()),
        "successes_off": int(alone.succeeds[alone.scenario != training_world].sum()) if plastic else None,
        "successes_inverted": None,
    }
    worlds = tests.groupby("scenario", sort=False).succeeds.agg(trials="size", successes="sum").reset_index()
    return count, worlds


def learner_counts(metrics: pd.DataFrame, task: Task) -> tuple[dict[str, int | None], pd.DataFrame]:
    """The counts of a champion in reversal learning: a row for it, and a row for its world.

    It solves the task if its share of rewarded trials is nearer to the optimum than to chance. metrics: its lifetimes
    without plasticity and, if it has any, with it and with the reward inverted.
    """
    each = metrics.groupby("controller", sort=False).rewarded_share.agg(["sum", "size"])
    of_lifetime = len(task.initial_trials("left", 0))
    rewarded = [int(total) for total in (each["sum"] * of_lifetime).round()]
    trials = int(each["size"].iloc[0]) * of_lifetime
    alone, learning, *inverted = rewarded if len(rewarded) > 1 else rewarded * 2
    count: dict[str, int | None] = {
        "solves": int(learning / trials > sum(task.limits().values()) / 2),
        "trials": trials,
        "successes": learning,
        "successes_off": alone if len(rewarded) > 1 else None,
        "successes_inverted": inverted[0] if inverted else None,
    }
    world = {"scenario": metrics.scenario.iloc[0], "trials": trials, "successes": learning}
    return count, pd.DataFrame([world])


def table(rows: Sequence[Row], champions: pd.DataFrame) -> pd.DataFrame:
    """The leaderboard: a row for each method and experiment, by class of knowledge, then in order of success.

    In reversal learning all rules have the same knowledge, the reward.

    champions: a row for each, with its method and the counts of its trials.
    """
    entries = []
    for row in rows:
        group = _champions(champions, row.experiment, row.method)
        control = _champions(champions, row.experiment, row.matched_control)
        solves = group[group.solves == 1]
        shares = _shares(group)
        entries.append(
            {
                **{name: getattr(row, name) for name in _OF_ROW},
                "champions": len(group),
                "solved": len(solves),
                **bounds("solved_", wilson_by_champion(group.solves.to_numpy(np.int64), np.ones(len(group), np.int64))),
                "trials": int(group.trials.sum()),
                "successes": int(group.successes.sum()),
                **_success(group, "success"),
                "iqm": float(interquartile_mean(shares)),
                **bounds("iqm_", bootstrap(interquartile_mean, shares)),
                "best": shares.max(),
                **_success(solves, "retention"),
                **_difference(group, control, paired=row.kind == POST_HOC),
                **_improvement(group, control),
                "success_off": _share(group.successes_off, group.trials),
                "success_inverted": _share(group.successes_inverted, group.trials),
                "evolved_parameters": row.evolved_parameters,
                "robot_steps": int(group.robot_steps.mean()),
            }
        )
    board = _add_best_plain(pd.DataFrame(entries), champions)
    board.insert(board.columns.get_loc("p") + 1, "p_holm", np.nan)
    board["best_plain_p_holm"] = np.nan
    for _, group in board.groupby("experiment"):  # one correction for all p values of a table
        corrected = holm([*group.p, *group.best_plain_p])
        board.loc[group.index, ["p_holm", "best_plain_p_holm"]] = corrected.reshape(2, -1).T
    board["place"] = board.knowledge_class.map(CLASSES.index).where(board.experiment != REVERSAL, 0)
    order = ["experiment", "place", "success"]
    board = board.sort_values(order, ascending=[True, True, False], kind="stable", ignore_index=True)
    return board.drop(columns="place")


def _add_best_plain(board: pd.DataFrame, champions: pd.DataFrame) -> pd.DataFrame:
    """The difference of each method with plasticity to the best without it that took as many robot-steps."""
    entries: list[dict[str, Any]] = []
    for row in board.itertuples():
        plain = board[(board.experiment == row.experiment) & (board.kind == PLAIN)]
        alike = plain[(plain.robot_steps / row.robot_steps - 1).abs() <= _SAME_BUDGET]
        if row.kind == PLAIN or alike.empty:
            entries.append({"best_plain": ""})
            continue
        best = str(alike.method[alike.success.idxmax()])
        group, rivals = (_champions(champions, str(row.experiment), name) for name in (str(row.method), best))
        against = _difference(group, rivals, paired=row.kind == POST_HOC and row.matched_control == best)
        entries.append({"best_plain": best} | {f"best_plain_{name}": value for name, value in against.items()})
    return board.join(pd.DataFrame(entries, index=board.index, columns=["best_plain", *_BEST_PLAIN]))


def anytime(courses: pd.DataFrame) -> pd.DataFrame:
    """The share of champions and worlds that are solved after a number of robot-steps of the evolution, of each method.

    courses: a row for each champion and mark in its evolution, in order: robot_steps, trials, successes.
    """
    rows = []
    for key, group in courses.groupby(["experiment", "method", "mark"], sort=False):
        row: dict[str, Any] = dict(zip(("experiment", "method", "mark"), key, strict=True))
        row["robot_steps"] = int(group.robot_steps.mean())
        rows.append(row | {"champions": len(group), **_success(group, "success")})
    return pd.DataFrame(rows)


def _success(champions: pd.DataFrame, name: str) -> dict[str, float]:
    """The share of trials that succeed, and its interval over champions; champions that are all alike have none.

    In reversal learning the share of a champion is a mean of thousands of trials, not one of two or of many worlds:
    its interval is a bootstrap, as that of the difference beside it.
    """
    trials, successes = champions.trials.to_numpy(np.int64), champions.successes.to_numpy(np.int64)
    shares, interval = _shares(champions), (np.nan, np.nan)
    if (champions.experiment == REVERSAL).all():
        interval = bootstrap(mean, shares)
    elif len(set(shares)) > 1:
        interval = wilson_by_champion(successes, trials)
    share = successes.sum() / trials.sum() if len(trials) else np.nan
    return {name: share, **bounds(f"{name}_", interval)}


def _share(successes: "pd.Series[Any]", trials: "pd.Series[Any]") -> float:
    """The share of trials that succeed; nan where a champion has no such trials."""
    return np.nan if successes.isna().any() else successes.sum() / trials.sum()


def _champions(champions: pd.DataFrame, experiment: str, method: str) -> pd.DataFrame:
    return champions[(champions.experiment == experiment) & (champions.method == method)]


def _shares(champions: pd.DataFrame) -> NDArray[np.float64]:
    shares: NDArray[np.float64] = (champions.successes / champions.trials).to_numpy(float)
    return shares


def _difference(champions: pd.DataFrame, controls: pd.DataFrame, *, paired: bool) -> dict[str, float]:
    """The difference in success to the champions of another method, its interval and its p value.

    paired: whether they are the same champions, by their seed. That champions which evolved apart have the same seed
    makes them no pair: they are two groups.
    """
    if controls.empty:
        return dict.fromkeys(_DIFFERENCE, np.nan)
    ours, theirs = _shares(champions), _shares(controls)
    if paired:
        theirs = _shares(champions[["seed"]].merge(controls, on="seed", validate="one_to_one"))
        low, high = bootstrap(mean, ours - theirs)
        p = sign_flip(np.rint((ours - theirs) * champions.trials.to_numpy()).astype(np.int64))
    else:
        low, high = bootstrap(difference, ours, theirs)
        p = permutation(champions.successes.to_numpy(np.int64), controls.successes.to_numpy(np.int64))
    return dict(zip(_DIFFERENCE, (float(ours.mean() - theirs.mean()), low, high, p), strict=True))


def _improvement(champions: pd.DataFrame, controls: pd.DataFrame) -> dict[str, float]:
    """The probability that a champion exceeds one of another method, with its interval."""
    if controls.empty:
        return dict.fromkeys(_IMPROVEMENT, np.nan)
    groups = _shares(champions), _shares(controls)
    better = float(improvement(*groups)), *bootstrap(improvement, *groups)
    return dict(zip(_IMPROVEMENT, better, strict=True))


def readable(board: pd.DataFrame, worlds: pd.DataFrame) -> Table:
    """The rows of an experiment as a table to read.

    worlds: a row for each method and test world. Sweeps have columns of their own where there are several.
    """
    experiment = str(board.experiment.iloc[0])
    learning = experiment == REVERSAL
    tested, shares = worlds[worlds.experiment == experiment], pd.DataFrame(index=board.method)
    if tested.tests.nunique() > 1:
        summed = tested.groupby(["method", "tests"], sort=False)[["trials", "successes"]].sum()
        shares = (summed.successes / summed.trials).unstack("tests")[tested.tests.unique()]
    rows: list[dict[str, str]] = []
    for row in board.itertuples():
        control = f"{interval_text(row, 'difference', '+.2f')}, p = {row.p_holm:.2g}, to {code(row.matched_control)}"
        control += f"; better with {interval_text(row, 'improvement')}"
        best = f"{interval_text(row, 'best_plain_difference', '+.2f')}, p = {row.best_plain_p_holm:.2g}"
        cells = {"method": code(row.method), "kind": row.kind}
        if not learning:  # there all rules have the same knowledge, the reward
            cells["knowledge"] = row.knowledge
        cells["learn" if learning else "solves both sides in training"] = f"{row.solved} of {row.champions}"
        success = "rewarded share" if learning else "success over the test worlds"
        cells[success] = f"**{interval_text(row, 'success')}**"
        cells |= {f"in {code(name)}": f"{share:.2f}" for name, share in shares.loc[str(row.method)].items()}
        cells["interquartile mean"] = interval_text(row, "iqm")
        cells["of those that learn" if learning else "retention"] = interval_text(row, "retention")
        cells["best champion"] = f"{row.best:.2f}"
        cells["difference to the matched control"] = control if row.matched_control else "–"
        plain = f"{best}, to {code(row.best_plain)}" if row.best_plain else "–"
        cells["difference to the best without plasticity"] = plain
        cells["rule off"] = interval_text(row, "success_off")
        if learning:
            cells["reward inverted"] = interval_text(row, "success_inverted")
        cells["evolved parameters"] = f"{row.evolved_parameters}"
        cells["million robot-steps"] = f"{row.robot_steps / 1e6:.1f}"
        rows.append(cells)
    return Table(
        list(rows[0]), [list(cells.values()) for cells in rows], f"{title(experiment)} (95 % interval)", text=2
    )


def markdown(
    board: pd.DataFrame,
    worlds: pd.DataFrame,
    methods: Mapping[str, str],
    tests: Mapping[str, Sequence[str]],
    provenance: str,
    captions: Mapping[str, str],
) -> str:
    """The page of a leaderboard in Markdown.

    worlds: a row for each method and test world. methods: each with its description. tests: the test worlds of each
    experiment. provenance: lines on the origin of the data. captions: of the figures, in order.
    """
    parts = ["# Leaderboard\n", f"{provenance}\n", _TEXTS["terms"]]
    for experiment, rows in board.groupby("experiment", sort=False):
        tested, where = tests[str(experiment)], _TEXTS["terms_reversal"]
        if tested:
            names = ", ".join(map(code, tested))
            where = f"Training world: {code(TRAINED[str(experiment)])}. {len(tested)} test worlds: {names}.\n"
        parts += [f"## {title(str(experiment))}\n", where, readable(rows, worlds).markdown()]
    parts += [
        "## Figures\n",
        *pictures(captions),
        "## Methods\n",
        Table(["method", "description"], [[code(name), text] for name, text in methods.items()]).markdown(),
    ]
    return "\n".join(parts)


def title(experiment: str) -> str:
    """The heading of the table of an experiment."""
    return "Reversal learning" if experiment == REVERSAL else f"The {experiment} experiment"
