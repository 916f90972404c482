"""Intervals and p values. Champions are the independent unit; trials and repeats are not.

A *trial* is one champion on one side of the maze. It succeeds if most of its repeats do. The two sides of a champion
share one genome, as two eyes share one patient, and often succeed or fail together. They are one cluster of trials
here: no interval and no p value takes them for two independent animals. Repeats only decide whether a trial succeeds.
"""

import math
from collections import Counter
from functools import cache

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller import random
from epuckhebb.controller.random import Stream

RESAMPLES = 2000
_UNKNOWN = (math.nan, math.nan)


@cache
def wilson(successes: int, n: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a proportion among n independent cases.

    It is for one trial of each champion: one side, or "both sides" as one outcome. For trials on both sides see
    `wilson_by_champion`. Source: Wilson, J. Am. Stat. Assoc. 22 (1927) 209; computed by scipy.

    Returns:
        Lower and upper end; (nan, nan) without cases.

    Raises:
        ValueError: there are more successes than cases, or fewer than none.
    """
    if n == 0:
        return _UNKNOWN
    from scipy import stats  # slow to load; most commands do not need it

    interval = stats.binomtest(successes, n).proportion_ci(0.95, method="wilson")
    return float(interval.low), float(interval.high)


def wilson_by_champion(part: NDArray[np.int64], whole: NDArray[np.int64]) -> tuple[float, float]:
    """Wilson's 95 % interval of the share sum(part) / sum(whole), with as many cases as the trials are worth.

    Two sides that always succeed or fail together are worth one trial; two independent sides are worth two. The
    design effect measures it: the variance of the share between champions, over the variance of independent trials.
    The effective number of cases is the number of trials divided by it, and never more than the number of trials.
    Where all champions have the same share, each champion counts as one case: 3 successes of 3 by two champions are
    no surer than 2 of 2. With one trial from each champion this is `wilson`.

    A bootstrap over champions would have no width where all champions agree, and is too narrow near 0 and 1 with few
    champions. Most claims of the paper are such cases.

    Sources: the variance of a ratio over clusters and the effective number of cases are those of Rao & Scott,
    Biometrics 48 (1992) 577, the design effect that of Kish, *Survey Sampling* (1965). That the effective
    number is never more than the number of trials follows Parker et al., Vital Health Stat. 2 (175) (2017). Wilson's
    interval with it is among the best of those compared by Dean & Pagano, J. Surv. Stat. Methodol. 3 (2015) 484.

    Args:
        part: for each champion, how many of its trials are true, (champions,).
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
    sides, one of -2, -1, 0, 1, 2. If plasticity made no difference, both signs of it were equally likely. p is the
    share of all choices of signs in which the sum is at least as far from 0 as the observed sum. The choices are
    counted, not sampled: a table of how many choices give each sum grows by one champion at a time. p is therefore
    exact for any number of champions. Where every difference is -1, 0 or 1, this is McNemar's exact test.

    Source: Fisher's randomisation test, *The Design of Experiments* (1935), section 21; Good, *Permutation, Parametric
    and Bootstrap Tests of Hypotheses* (2005). scipy's `permutation_test` lists all choices, too many for forty
    champions.

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

    Where all champions have the same value, resampling has no width. If the values have bounds, the interval is then
    that of `_unseen`. Without bounds both ends are the value, and unknown for one champion. Champions without a value
    (nan) are left out.

    Source: Efron & Tibshirani, *An Introduction to the Bootstrap* (1993), chapter 13. Bias-corrected (BCa) intervals
    are undefined where all values agree, which is common here; percentiles are not.

    Args:
        values: one for each champion, (champions,).
        seed: of the resampling.
        bounds: the least and the greatest possible value of a champion, if any.

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

    It is for champions with many trials each, in many worlds. Where all champions have the same share, the interval
    is that of `_unseen`; for a share of 0 or 1 that is Wilson's with champions as cases. Source: as of
    `bootstrap_mean`; for whole clusters, Davison & Hinkley, *Bootstrap Methods and their Application* (1997), 3.8.

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
    """Wilson's 95 % interval at this share for n > 0 cases; scipy's takes whole numbers only."""
    from scipy import stats

    z = float(stats.norm.ppf(0.975))
    middle = share + z * z / (2 * n)
    away = z * math.sqrt(share * (1 - share) / n + z * z / (4 * n * n))
    low, high = (middle - away) / (1 + z * z / n), (middle + away) / (1 + z * z / n)
    return min(max(low, 0.0), share), max(min(high, 1.0), share)


def _unseen(value: float, champions: int, least: float, most: float) -> tuple[float, float]:
    """The interval of the mean over all champions if those that were examined have the same value.

    If none of n champions differs, a share of all champions up to Wilson's upper end for 0 of n may still differ, with
    any value between the least and the most. For a share of 0 or 1 this is Wilson's interval for 0 of n or n of n. The
    rule of three argues in the same way: Hanley & Lippman-Hand, J. Am. Med. Assoc. 249 (1983) 1743.
    """
    different = wilson(0, champions)[1]
    return value - different * (value - least), value + different * (most - value)
