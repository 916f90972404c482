"""The paper's claims as questions to many champions: counts, effects, intervals and verdicts; and the showcase.

Each is a question to every trial that could show it. Trials are those of `epuckhebb.analysis.findings`.
"""

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from epuckhebb.analysis.findings import PAPER_N, outcomes, ratio
from epuckhebb.analysis.statistics import bootstrap, bounds, mean, wilson_by_champion
from epuckhebb.controller.plasticity.control import Sign
from epuckhebb.tmaze.individual import CONTROLS, GA, HEBBIAN
from epuckhebb.tmaze.scenario import TRAINED

_SHUFFLED = CONTROLS[Sign.shuffled]
RULE = (
    "A claim on a share *holds* where the 95 % interval of the share lies above one half, and *does not hold* where it "
    "lies below. Else it is *mixed* where the interval lies between one quarter and three quarters, and *inconclusive* "
    "where it is wider. A claim with a size is judged by its effect: the change in percent, as a mean over champions. "
    "It *holds* where the interval of the effect lies on the claimed side of zero (*smaller*: and does not reach the "
    "paper's effect). Else it *does not hold* where the interval leaves out the paper's effect, and is *inconclusive* "
    "where it does not. Trials of fewer than six champions are *too few*. A *check* passes or fails, without interval."
)
_MIXED = (0.25, 0.75)  # a wider interval is inconclusive


def claim(
    text: str, counted: str, part: NDArray[np.int64], whole: NDArray[np.int64], control: NDArray[np.int64] | None = None
) -> dict[str, Any]:
    """A claim of the paper as a question to every trial that could show it: its counts, interval and verdict.

    counted: which trials these are, and what counts as true. part, whole: for each champion, in how many trials the
    claim is true, of how many, (champions,). control: in how many it is true with shuffled signs.
    """
    true, n, champions = int(part.sum()), int(whole.sum()), int((whole > 0).sum())
    interval = wilson_by_champion(part, whole)
    row = {"claim": text, "counted": counted, "true": true, "n": n, "champions": champions}
    row |= {"share": ratio(true, n), **bounds("", interval)}
    if control is not None:
        row |= bounds("control_", wilson_by_champion(control, whole))
        row |= {"control_true": int(control.sum()), "control_share": ratio(int(control.sum()), n)}
    return row | {"verdict": verdict(*interval, n, champions)}


def verdict(low: float, high: float, n: int, champions: int, paper: float | None = None) -> str:
    """The verdict of `RULE` on a share that has this interval among n trials of some champions, or on an effect.

    The interval alone decides: 3 of 3 is not enough for any claim. paper: the effect in the paper, whose sign is the
    claim; None for a share.
    """
    if np.isnan(low):
        return f"too few (n = {n}, {champions} champion{'s' * (champions != 1)})" if n else "no trial to judge by"
    if paper is None:
        if low > 0.5:
            return "holds"
        if high < 0.5:
            return "does not hold"
        return "mixed" if _MIXED[0] <= low and high <= _MIXED[1] else f"inconclusive (n = {n})"
    low, high = sorted(np.sign(paper) * end for end in (low, high))
    if low > 0:
        return "holds, smaller" if high < abs(paper) else "holds"
    return f"inconclusive (n = {n})" if high >= abs(paper) else "does not hold"


def effect(before: pd.Series, after: pd.Series, paper: float, control: pd.Series) -> dict[str, Any]:
    """The effect of a claim with a size: the change from before to after in percent, and the verdict of `RULE`.

    before, after: values of trials, of which each champion gives one mean; control: those after with shuffled signs.
    paper: the effect in the paper's tables; its sign is the claim.

    Returns:
        effect, effect_low, effect_high, control_effect, control_effect_low, control_effect_high, paper_effect [%],
        effect_absolute, in the unit of the values; verdict.
    """
    row: dict[str, Any] = {"paper_effect": paper, "effect_absolute": _champion_mean(after - before)[0]}
    for prefix, values in (("", after), ("control_", control)):
        keys = (f"{prefix}effect", f"{prefix}effect_low", f"{prefix}effect_high")
        row |= dict(zip(keys, _champion_mean(100 * (values / before - 1)), strict=True))
    ratios = (after / before).dropna()
    champions = ratios.index.get_level_values("genome").nunique()
    return row | {"verdict": verdict(row["effect_low"], row["effect_high"], len(ratios), champions, paper)}


def _champion_mean(values: pd.Series) -> tuple[float, float, float]:
    """The mean over champions, each with the mean of its trials, and the interval."""
    by_champion = values.groupby("genome", sort=False).mean().to_numpy(float)
    means = by_champion[~np.isnan(by_champion)]
    return (float(means.mean()) if len(means) else float("nan"), *bootstrap(mean, means))


def claims(each: pd.DataFrame, published: pd.DataFrame) -> pd.DataFrame:
    """The paper's claims, one row each; those on plasticity with shuffled signs beside them.

    Column `champions`: how many have a trial that could show the claim. published: the paper's numbers, a row each.
    """
    present = set(each.experiment)
    return pd.DataFrame(
        {"experiment": experiment} | row
        for experiment, rows in (("light", _light_claims), ("obstacles", _obstacle_claims))
        if experiment in present
        for row in (*rows(each, published), _unchanged(each, experiment))
    ).reindex(columns=["experiment", *_CLAIM])


_CLAIM = ["claim", "counted", "true", "n", "champions", "share", "low", "high"]
_CLAIM += ["control_true", "control_share", "control_low", "control_high"]
_CLAIM += ["effect", "effect_low", "effect_high", "effect_absolute", "paper_effect"]
_CLAIM += ["control_effect", "control_effect_low", "control_effect_high", "verdict"]


def _light_claims(each: pd.DataFrame, _: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """The paper's claims on changed light, one row each."""
    of, rate = partial(outcomes, each, "light"), PAPER_N["light"]
    bright, dim = of("highlight", GA, 0.0), of("lowlight", GA, 0.0)
    (bright_plastic, bright_control), (dim_plastic, dim_control) = (
        [of(scenario, kind, rate) for kind in (HEBBIAN, _SHUFFLED)] for scenario in ("highlight", "lowlight")
    )
    broken = bright & ~dim
    yield _count("The GA fails in low light", "trials solved in high light: fail in low light", ~dim, bright)
    yield _count(f"N = {rate:g} rescues it", "trials broken by low light: succeed", dim_plastic, broken, dim_control)
    harms, harm_counted = "The same N harms in high light", "trials solved in high light: fail"
    yield _count(harms, harm_counted, ~bright_plastic, bright, ~bright_control)
    small = of("lowlight", HEBBIAN, PAPER_N["obstacles"])
    yield _either("A large change needs a large rate", broken, dim_plastic, small)


def _obstacle_claims(each: pd.DataFrame, published: pd.DataFrame) -> Iterator[dict[str, Any]]:
    """The paper's claims on obstacles, one row each."""
    of, rate = partial(outcomes, each, "obstacles"), PAPER_N["obstacles"]
    base = of("base", GA, 0.0)
    any_broken, any_small, any_large = [], [], []
    for scenario, count in (("2obstacles", 2), ("4obstacles", 4)):
        alone, plastic, control = of(scenario, GA, 0.0), of(scenario, HEBBIAN, rate), of(scenario, _SHUFFLED, rate)
        broken = base & ~alone
        yield _count(f"{count} obstacles defeat the GA", "trials solved in base: fail", ~alone, base)
        counted = "trials broken by them: succeed"
        yield _count(f"N = {rate:g} rescues it at {count}", counted, plastic, broken, control)
        any_broken.append(broken)
        any_small.append(plastic)
        any_large.append(of(scenario, HEBBIAN, PAPER_N["light"]))
    yield _either("A small change needs a small rate", *map(pd.concat, (any_broken, any_small, any_large)))

    def cell(controller: str, scenario: str, metric: str) -> pd.Series:
        is_cell = (published.controller == controller) & (published.scenario == scenario) & (published.metric == metric)
        return published[is_cell & (published.experiment == "obstacles")].set_index("side").published

    change = "weight_change_mean"
    none, two, four = (of(scenario, HEBBIAN, rate, change) for scenario in ("base", "2obstacles", "4obstacles"))
    grows = (none < two) & (two < four)
    paper = cell(HEBBIAN, "4obstacles", change) / cell(HEBBIAN, "base", change) - 1
    control = none * of("4obstacles", _SHUFFLED, rate, change) / of("base", _SHUFFLED, rate, change)
    counted = "all trials: base < 2 < 4; effect: base to 4"
    row = _count("Weight change grows with obstacles", counted, grows, grows | ~grows)
    yield row | effect(none, four, 100 * float(paper.mean()), control)
    time = "time_to_goal_s"
    alone, plastic = of("base", GA, 0.0, time), of("base", HEBBIAN, rate, time)
    paper = cell(HEBBIAN, "base", time) / cell(GA, "base", time) - 1
    row = _count(
        "Plasticity reaches the goal sooner",
        "trials of base in which both arrive",
        plastic < alone,
        alone.notna() & plastic.notna(),
    )
    yield row | effect(alone, plastic, 100 * float(paper.mean()), of("base", _SHUFFLED, rate, time))


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
    cell = ["scenario", "controller", "side"]
    paper = published[published.experiment == experiment].set_index(cell).success.dropna().astype(bool)
    solved = outcomes(each, experiment, TRAINED[experiment], GA, 0.0)
    names = list(dict.fromkeys(ours.genome))
    solves = [name for name in names if all(solved.get((name, side), False) for side in ("left", "right"))]
    agreement = {
        str(name): int((rows.set_index(cell).succeeds.reindex(paper.index) == paper).sum())
        for name, rows in ours.groupby("genome", sort=False)
        if name in (solves or names)
    }
    best = max(agreement, key=lambda name: agreement[name])
    return best, agreement[best], len(paper)


def _count(
    text: str, counted: str, true: pd.Series, among: pd.Series, control: pd.Series | None = None
) -> dict[str, Any]:
    """A claim that is true in some trials `among` those that could show it. control: the same with shuffled signs."""
    controls = None if control is None or control.empty else _champion_counts(control, among)[0]
    return claim(text, counted, *_champion_counts(true, among), controls)


def _either(text: str, broken: pd.Series, own_rate: pd.Series, other_rate: pd.Series) -> dict[str, Any]:
    """Whether the experiment's own rate rescues, in the trials where just one of the two rates does."""
    if not len(other_rate):
        return claim(text, "not run", np.zeros(0, np.int64), np.zeros(0, np.int64))
    counted = "broken trials that one of N = 0.000015 and 0.002 rescues and the other does not"
    return _count(text, counted, own_rate & ~other_rate, broken & (own_rate ^ other_rate))


def _champion_counts(true: pd.Series, among: pd.Series) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """For each champion: in how many trials it is true, and how many trials `among` holds; both (champions,)."""
    counts = pd.DataFrame({"part": true & among, "whole": among}).groupby("genome", sort=False).sum()
    return counts.part.to_numpy(np.int64), counts.whole.to_numpy(np.int64)
