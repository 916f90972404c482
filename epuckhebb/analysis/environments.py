"""Tables of lifetimes in environments: the return before and after a change, with intervals."""

import itertools
from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd

from epuckhebb.analysis.lifetimes import is_of_controller
from epuckhebb.analysis.statistics import LEAST, bootstrap, bounds, difference, holm, mean, permutation, sign_flip
from epuckhebb.analysis.tables import Table, cell, interval_text, short_headings
from epuckhebb.worlds.environment import Lived

_RETURNS = ("return", "return_before", "return_after")
_MEANS = (*_RETURNS, "steps", "recovery_steps", "weight_change_mean", "saturated_fraction")
_NUMBERS = ("N", "reached", *_MEANS)  # which a sweep keeps as text, as they stand in the file
_WORLD = ("environment", "change")
_BINS = 50  # of a lifetime, in `lifetime.csv`
_ENOUGH = 0.9  # share of the lifetimes that reach a change, below which a note says so
_ROUND = 100  # from which on returns are read without decimals


def lifetime_course(names: Sequence[str], lives: Sequence[Lived], horizon: int) -> list[dict[str, Any]]:
    """What happened in equal parts of a lifetime: a row for each controller and part in which a lifetime goes on.

    The reward is a mean over all lifetimes, with quartiles: one that has ended earns nothing. Other means are over
    those that go on. names: of the controller of each lifetime.
    """
    edges = np.unique(np.linspace(0, horizon, min(_BINS, horizon) + 1).astype(int))
    rows: list[dict[str, Any]] = []
    for name in dict.fromkeys(names):
        group = [lived for controller, lived in zip(names, lives, strict=True) if controller == name]
        for begin, end in itertools.pairwise(edges):
            alive = [lived for lived in group if len(lived.rewards) > begin]
            if alive:
                earned = [lived.rewards[begin:end].sum() / (end - begin) for lived in group]
                low, high = np.percentile(earned, [25, 75]).tolist()
                change = float(np.mean([lived.weight_changes[begin:end].mean() for lived in alive]))
                step = float(np.mean([lived.weight_steps[begin:end].mean() for lived in alive]))
                row = {"controller": name, "step": int(end), "alive": len(alive) / len(group)}
                row |= {"reward": float(np.mean(earned)), "reward_quartile_1": low, "reward_quartile_3": high}
                rows.append(row | {"weight_change": change, "weight_step": step})
    return rows


def table(metrics: pd.DataFrame, by: Sequence[str] = ("controller", "N")) -> pd.DataFrame:
    """A row for each condition, with means and 95 % bootstrap intervals of returns.

    With several champions each is one case, the mean of its lifetimes, and intervals are over champions; of a single
    champion they are over its lifetimes, and about the noise alone. Means after a change are over the lifetimes that
    reached it; `reached` counts them.
    """
    metrics = metrics.assign(**{name: pd.to_numeric(metrics[name]) for name in _NUMBERS})
    rows: list[dict[str, Any]] = []
    for condition, group in metrics.groupby(list(by), sort=False, dropna=False):
        champions = group.genome.nunique()
        cases = group.groupby("genome", sort=False)[list(_MEANS)].mean() if champions > 1 else group[list(_MEANS)]
        row: dict[str, Any] = dict(zip(by, condition, strict=True)) | {"champions": champions, "lifetimes": len(group)}
        for column in _MEANS:
            values = cases[column].to_numpy(float)
            row[column] = float(np.nanmean(values)) if np.isfinite(values).any() else np.nan
            if column in _RETURNS:
                row |= bounds(f"{column}_", bootstrap(mean, values))
        row["reached"] = int(group.reached.sum())
        row["recovered"] = int(group.recovery_steps.notna().sum())
        rows.append(row)
    return pd.DataFrame(rows)


def unreached(rows: pd.DataFrame) -> list[str]:
    """A note on the controllers of a table of which few lifetimes reached the change; else nothing."""
    few = rows[rows.reached < _ENOUGH * rows.lifetimes]
    counts = [f"{row['reached']} of {row['lifetimes']} lifetimes of {row['controller']}" for _, row in few.iterrows()]
    return [f"Reached the change: {', '.join(counts)}. Means after it are over these alone."] if counts else []


def tables(metrics: pd.DataFrame, settings: Sequence[str]) -> dict[str, pd.DataFrame]:
    """The tables over many evaluations, by name: returns, and effects if any. settings: keys of a condition."""
    world = [*(name for name in settings if name not in ("genome", "N", *_WORLD)), *_WORLD]
    compared, rows = effects(metrics, world), {"summary": table(metrics, [*world, "controller", "N"])}
    return rows if compared.empty else {**rows, "effects": compared}


def effects(metrics: pd.DataFrame, by: Sequence[str]) -> pd.DataFrame:
    """The effect of each rule on the return after a change: a row for each condition and each controller beside it.

    A rule is compared with its own weights frozen at the change, and with each controller that does not learn: of the
    same champions, or of others, as those that were evolved without a rule. Lifetimes that ended before the change, and
    champions of which all did, are left out. The p values of the table are corrected together, by Holm. A condition
    with fewer than six champions has no row. p: of a sign-flip test for the same champions, of a permutation test for
    others. by: keys of a condition but for `controller` and `N`; `N` is a column if a controller has several.
    """
    metrics = metrics.assign(**{name: pd.to_numeric(metrics[name]) for name in ("return_after", "N")})
    world = [name for name in by if not is_of_controller(name)]
    rule = ["N", *(name for name in by if is_of_controller(name))]
    shown = [*by, "controller", *(["N"] if has_several_rates(metrics) else [])]
    rows: list[dict[str, Any]] = []
    for _, group in metrics[metrics.change.fillna("") != ""].groupby(world, sort=False, dropna=False):
        for condition, ours in group.groupby(["controller", *rule], sort=False, dropna=False):
            name, rate = condition[:2]
            if not rate > 0 or "(" in name:
                continue
            alike = group[(group[rule] == ours[rule].iloc[0]).all(axis=1)]
            against = {f"{name} (frozen at the change)": alike}
            for control in group[(group.N == 0) & ~group.controller.str.contains("(", regex=False)].controller.unique():
                same = group[(group[rule[1:]] == ours[rule[1:]].iloc[0]).all(axis=1) & (group.N == 0)]
                against[control] = same if (same.controller == control).any() else group
            for control, among in against.items():
                row = _effect(ours, among[among.controller == control])
                if row:
                    rows.append({key: ours[key].iloc[0] for key in shown} | {"against": control} | row)
    return pd.DataFrame(rows).assign(p_holm=holm([row["p"] for row in rows])) if rows else pd.DataFrame()


def _effect(ours: pd.DataFrame, others: pd.DataFrame) -> dict[str, Any]:
    """The difference between lifetimes of two controllers, paired if they are of the same champions; none of few."""
    pair = [group.groupby("genome", sort=False).return_after.mean() for group in (ours, others)]
    shared = pair[0].index.intersection(pair[1].index, sort=False)
    is_paired = len(shared) > 0
    if is_paired:
        kept = pair[0][shared].notna() & pair[1][shared].notna()
        pair = [group[shared][kept] for group in pair]
    values = [group.dropna().to_numpy(float) for group in pair]
    if min(map(len, values)) < LEAST:
        return {}
    statistic = (mean, values[0] - values[1]) if is_paired else (difference, *values)
    p = sign_flip(values[0] - values[1]) if is_paired else permutation(*values)
    row = {"is_paired": is_paired, "champions": len(values[0]), "others": len(values[1])}
    return row | {"effect": values[0].mean() - values[1].mean(), **bounds("effect_", bootstrap(*statistic)), "p": p}


def has_several_rates(rows: pd.DataFrame) -> bool:
    """Whether a controller has several base rates, so that its name does not tell which it is."""
    return bool((rows.groupby("controller").N.nunique() > 1).any())


def differing(rows: pd.DataFrame) -> list[str]:
    """The columns that tell the conditions of a table apart, but for the controller and its N. rows: of `table`."""
    keys = list(rows)[: list(rows).index("champions")]
    return [name for name in keys if name not in ("controller", "N") and rows[name].nunique(dropna=False) > 1]


def readable(rows: pd.DataFrame, title: str = "") -> Table:
    """The summary of returns to read: a row for each condition. rows: of `table`."""
    first = [*differing(rows), "controller", *(["N"] if has_several_rates(rows) else [])]
    headings = [*short_headings(first), "return", "before", "after", "recovery (steps)", "weight change"]
    lines = []
    for _, row in rows.iterrows():
        returns = [interval_text(row, name, ".1f" if abs(row[name]) < _ROUND else ".0f") for name in _RETURNS]
        if 0 < row["reached"] < row["lifetimes"]:
            returns[-1] += f" ({row['reached']} of {row['lifetimes']})"
        recovery = f"{row['recovery_steps']:.0f} ({row['recovered']} of {row['lifetimes']})"
        line = [
            *(cell(row[name]) for name in first),
            *returns,
            recovery if row["recovered"] else "–",
            f"{row['weight_change_mean']:.3g}",
        ]
        lines.append(line)
    return Table(headings, lines, title, text=len(first), numbers=True)


def readable_effects(rows: pd.DataFrame) -> Table:
    """The differences to controls to read. rows: of `effects`."""
    conditions = list(rows)[: list(rows).index("controller")]
    rate = ["N"] if "N" in rows else []
    first = [*(name for name in conditions if rows[name].nunique(dropna=False) > 1), "controller", *rate, "against"]
    lines = [
        [
            *(cell(row[name]) for name in first),
            f"{row['champions']}, {row['others']}",
            interval_text(row, "effect", "+.1f"),
            f"{row['p_holm']:.2g}",
        ]
        for _, row in rows.iterrows()
    ]
    headings = [*short_headings(first), "champions", "difference", "Holm p"]
    title = "Return after the change: difference to controls, with 95 % intervals over champions"
    return Table(headings, lines, title, text=len(first), numbers=True)
