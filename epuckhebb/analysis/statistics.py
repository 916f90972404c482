"""The statistics of the study. Champions are the independent unit; trials and noise repeats are not.

A *trial* is one champion on one side of the maze, and it counts as successful if most of its noise repeats are. The two
sides of a champion share one genome, as two eyes share one patient, and often succeed or fail together. They are
therefore one cluster of trials here: no interval and no p value takes them for two independent animals. Noise repeats
of a champion are more alike still, and only decide what a trial counts as.
"""

import math
from collections import Counter
from functools import cache

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim import random
from epuckhebb.sim.random import Stream

RESAMPLES = 2000
_UNKNOWN = (math.nan, math.nan)


@cache
def wilson(successes: int, n: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a proportion among n independent cases.

    It is right where each champion gives one trial only: one side, or "both sides" as one outcome. For trials on both
    sides see `wilson_by_champion`. Source: Wilson, J. Am. Stat. Assoc. 22 (1927) 209; computed by scipy.

    Returns:
        Lower and upper end; (nan, nan) without cases.

    Raises:
        ValueError: there are more successes than cases, or fewer than none.
    """
    if n == 0:
        return _UNKNOWN
    from scipy import stats  # takes as long to load as the program itself, which listing a sweep need not wait for

    interval = stats.binomtest(successes, n).proportion_ci(0.95, method="wilson")
    return float(interval.low), float(interval.high)


def wilson_by_champion(part: NDArray[np.int64], whole: NDArray[np.int64]) -> tuple[float, float]:
    """Wilson's 95 % interval of the share sum(part) / sum(whole), with as many cases as the trials are worth.

    Two sides that always succeed or fail together are worth one trial, and two that have nothing to do with each other
    are worth two. How much they are worth is seen from how far champions differ: the variance of the share between
    champions, divided by the variance that independent trials would have, is the design effect, and the number of
    trials divided by it is the effective number of cases. It is never more than the number of trials. Where all
    champions have the same share there is nothing to see it from; then each champion counts as one case, so that 3
    successes of 3 by two champions are no surer than 2 of 2. With one trial from each champion this is `wilson`.

    A bootstrap over champions would have no width where all champions agree, and is too narrow near 0 and 1 with few of
    them, which is where the claims of the paper have to be judged.

    Sources: the variance of a ratio over clusters and the effective number of cases are those of Rao & Scott,
    Biometrics 48 (1992) 577, the design effect that of Kish, *Survey Sampling* (1965). That the effective
    number is never more than the number of trials follows Parker et al., Vital Health Stat. 2 (175) (2017). Wilson's
    interval with it is among the best of those compared by Dean & Pagano, J. Surv. Stat. Methodol. 3 (2015) 484.

    Args:
        part: for each champion, how many of its trials came true, (champions,).
        whole: for each champion, how many trials it had, (champions,); champions without trials do not count.

    Returns:
        Lower and upper end; (nan, nan) without trials.
    """
    _check(part, whole)
    champions, trials, true = int((whole > 0).sum()), int(whole.sum()), int(part.sum())
    if not trials:
        return _UNKNOWN
    share = true / trials
    if _agree(part, whole):
        return _score_interval(share, champions)
    between = champions / (champions - 1) * float(((part - share * whole) ** 2).sum()) / trials**2
    independent = share * (1 - share) / (trials - 1)
    return _score_interval(share, trials / max(1.0, between / independent))


def sign_flip(differences: NDArray[np.int64]) -> float:
    """Exact two-sided p value of paired differences, one a champion, if plasticity made no difference.

    A champion's difference is the number of its trials that succeed with plasticity minus the number without: for two
    sides, one of -2, -1, 0, 1, 2. If plasticity made no difference, each champion's could as well have had the other
    sign. p is the share of all ways to choose the signs, all equally likely, in which the sum is at least as far from 0
    as the one observed. The ways are counted, not sampled, by adding one champion after the other to a table of how
    many ways lead to each sum, so the p value is exact for any number of champions. Where every difference is -1, 0 or
    1, this is McNemar's exact test; without any difference p is 1.

    Source: Fisher's randomisation test, *The Design of Experiments* (1935), section 21; Good, *Permutation, Parametric
    and Bootstrap Tests of Hypotheses* (2005). scipy's `permutation_test` does the same by listing all ways, which is
    too much for forty champions.

    Args:
        differences: whole numbers, one for each champion, (champions,).

    Raises:
        TypeError: the differences are no whole numbers.
    """
    if not np.issubdtype(differences.dtype, np.integer):
        raise TypeError(f"differences must be whole numbers of trials, got {differences.dtype}")
    ways = Counter({0: 1})
    for size in np.abs(differences[differences != 0]).tolist():
        longer: Counter[int] = Counter()
        for total, count in ways.items():
            longer[total + size] += count
            longer[total - size] += count
        ways = longer
    observed = abs(int(differences.sum()))
    return sum(count for total, count in ways.items() if abs(total) >= observed) / ways.total()


def bootstrap_mean(
    values: NDArray[np.float64], seed: int, bounds: tuple[float, float] | None = None
) -> tuple[float, float]:
    """95 % percentile bootstrap interval of the mean of one value a champion; champions are resampled.

    Where all champions have the same value, resampling shows nothing. If the values have bounds, the interval is then
    that of `_unseen`: as wide as it must be because only so many champions were looked at. Without bounds nothing can
    be said of champions that were not seen, so the ends are the value itself, and unknown if there is one champion
    only. Champions without a value (nan) are left out.

    Source: Efron & Tibshirani, *An Introduction to the Bootstrap* (1993), chapter 13. Bias-corrected (BCa) intervals
    are undefined where all values agree, which is common here; percentiles are not.

    Args:
        values: one for each champion, (champions,).
        seed: of the resampling.
        bounds: the least and the greatest value that a champion can have, if there are such.

    Returns:
        Lower and upper end; (nan, nan) without values, or with one value and no bounds.
    """
    known = values[~np.isnan(values)]
    if len(known) == 0 or (len(known) == 1 and bounds is None):
        return _UNKNOWN
    if bounds is not None and (known == known[0]).all():
        return _unseen(float(known[0]), len(known), *bounds)
    drawn = random.rng(seed, Stream.bootstrap).integers(0, len(known), (RESAMPLES, len(known)))
    low, high = np.percentile(known[drawn].mean(axis=1), [2.5, 97.5])
    return float(low), float(high)


def bootstrap_ratio(part: NDArray[np.int64], whole: NDArray[np.int64], seed: int) -> tuple[float, float]:
    """95 % percentile bootstrap interval of sum(part) / sum(whole); champions are resampled with all their trials.

    It is for trials in many worlds, of which a champion has up to sixteen. Where all champions have the same share,
    resampling shows nothing, and the interval is that of `_unseen` with the champions that had trials: for none of
    them, or all of them, Wilson's with champions for cases. Source: as of `bootstrap_mean`; for whole clusters, Davison
    & Hinkley, *Bootstrap Methods and their Application* (1997), section 3.8.

    part, whole: as of `wilson_by_champion`. seed: of the resampling. Returns the lower and the upper end, with the
    share between them; (nan, nan) without trials.
    """
    _check(part, whole)
    if not whole.sum():
        return _UNKNOWN
    share = float(part.sum() / whole.sum())
    if _agree(part, whole):
        return _unseen(share, int((whole > 0).sum()), 0.0, 1.0)
    drawn = random.rng(seed, Stream.bootstrap).integers(0, len(whole), (RESAMPLES, len(whole)))
    wholes = whole[drawn].sum(axis=1)
    low, high = np.percentile(part[drawn].sum(axis=1)[wholes > 0] / wholes[wholes > 0], [2.5, 97.5])
    return min(float(low), share), max(float(high), share)


def _check(part: NDArray[np.int64], whole: NDArray[np.int64]) -> None:
    if part.shape != whole.shape or part.ndim != 1:
        raise ValueError(f"one number for each champion is needed, got shapes {part.shape} and {whole.shape}")
    if (part < 0).any() or (part > whole).any():
        raise ValueError("a champion's true trials must be between none and all of its trials")


def _agree(part: NDArray[np.int64], whole: NDArray[np.int64]) -> bool:
    """Whether every champion that had trials has the same share."""
    return bool((part * whole.sum() == part.sum() * whole).all())


def _score_interval(share: float, n: float) -> tuple[float, float]:
    """Wilson's 95 % interval at this share for n cases, n > 0 being no whole number perhaps (scipy's needs one)."""
    from scipy import stats

    z = float(stats.norm.ppf(0.975))
    middle = share + z * z / (2 * n)
    away = z * math.sqrt(share * (1 - share) / n + z * z / (4 * n * n))
    low, high = (middle - away) / (1 + z * z / n), (middle + away) / (1 + z * z / n)
    return min(max(low, 0.0), share), max(min(high, 1.0), share)


def _unseen(value: float, champions: int, least: float, most: float) -> tuple[float, float]:
    """Where the mean of all champions may lie if those that were looked at all have this value.

    If none of n champions is different, a share of all champions up to Wilson's upper end for 0 of n may be different
    all the same, and these may have any value between the least and the most. For a share of 0 or 1 this is Wilson's
    interval for 0 of n or for n of n. It is the reasoning of the rule of three: Hanley & Lippman-Hand, "If nothing goes
    wrong, is everything all right?", J. Am. Med. Assoc. 249 (1983) 1743.
    """
    different = wilson(0, champions)[1]
    return value - different * (value - least), value + different * (most - value)
