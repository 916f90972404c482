"""Intervals and p values. Champions are the independent unit; trials and repeats are not.

A *trial* is one champion on one side of the maze. It succeeds if most of its repeats do. The two sides of a champion
share one genome, as two eyes share one patient, and often succeed or fail together. They are one cluster of trials
here: no interval and no p value takes them for two independent animals. Repeats only decide whether a trial succeeds.

Fewer than `LEAST` champions say nothing about others: there is then no interval.
"""

import math
from collections import Counter
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller import random
from epuckhebb.controller.random import Stream

LEAST = 6  # champions
RESAMPLES = 2000
_UNKNOWN = (math.nan, math.nan)
Statistic = Callable[..., NDArray[np.float64]]


def wilson(share: float, n: float) -> tuple[float, float]:
    """Wilson's 95 % interval of a share among n independent cases; n may be an effective number, with a fraction.

    It is for the lifetimes of one champion, which differ in their noise alone. For champions see `wilson_by_champion`.
    Source: Wilson, J. Am. Stat. Assoc. 22 (1927) 209.

    Returns:
        Lower and upper end; (nan, nan) without cases.
    """
    if not n:
        return _UNKNOWN
    from scipy import stats  # slow to load; most commands do not need it

    z = float(stats.norm.ppf(0.975))
    middle = share + z * z / (2 * n)
    away = z * math.sqrt(share * (1 - share) / n + z * z / (4 * n * n))
    low, high = (middle - away) / (1 + z * z / n), (middle + away) / (1 + z * z / n)
    return min(max(low, 0.0), share), max(min(high, 1.0), share)


def wilson_by_champion(part: NDArray[Any], whole: NDArray[Any]) -> tuple[float, float]:
    """Wilson's 95 % interval of the share sum(part) / sum(whole), with as many cases as the trials are worth.

    Two sides that always succeed or fail together are worth one trial; two independent sides are worth two. The
    design effect measures it: the variance of the share between champions, over the variance of independent trials.
    The effective number of cases is the number of trials divided by it, and never more than the number of trials.
    With one trial from each champion this is Wilson's interval of champions.

    The design effect is unknown where all champions agree, and too small where few differ: four harmed trials of 1021
    would be surer than none. So it is taken with one champion more, of average size, half of which succeeds in all its
    trials and half in none, as Agresti and Coull add cases. Each of forty champions that agree then counts as one
    case. In simulations with 6 to 40 champions of 2 to 74 trials the interval covers the true share in 92 to 99 %;
    without the champion more in as little as 72 %, and a bootstrap over champions in 25 %, where the share is small.

    Sources: the variance of a ratio over clusters and the effective number of cases are those of Rao & Scott,
    Biometrics 48 (1992) 577, the design effect that of Kish, *Survey Sampling* (1965). That the effective
    number is never more than the number of trials follows Parker et al., Vital Health Stat. 2 (175) (2017). Wilson's
    interval with it is among the best of those compared by Dean & Pagano, J. Surv. Stat. Methodol. 3 (2015) 484. Cases
    more: Agresti & Coull, Am. Stat. 52 (1998) 119.

    Args:
        part: for each champion, how many of its trials are true, (champions,).
        whole: for each champion, how many trials it had, (champions,); champions without trials do not count.

    Returns:
        Lower and upper end; (nan, nan) if fewer than `LEAST` champions have trials.

    Raises:
        ValueError: counts that cannot be.
    """
    if part.shape != whole.shape or part.ndim != 1:
        raise ValueError(f"one number for each champion is needed, got shapes {part.shape} and {whole.shape}")
    if (part < 0).any() or (part > whole).any():
        raise ValueError("a champion's true trials must be between none and all of its trials")
    champions, trials, true = int((whole > 0).sum()), float(whole.sum()), float(part.sum())
    if champions < LEAST:
        return _UNKNOWN
    size = trials / champions
    share = (true + size / 2) / (trials + size)  # of the champions and the one more
    squares = float(((part - share * whole) ** 2).sum()) + ((share * size) ** 2 + ((1 - share) * size) ** 2) / 2
    between = (champions + 1) / champions * squares / (trials + size) ** 2
    independent = share * (1 - share) / (trials + size - 1)
    return wilson(true / trials, trials / max(1.0, between / independent))


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


def permutation(ours: NDArray[np.int64], others: NDArray[np.int64]) -> float:
    """Exact two-sided p value of the difference in mean of two groups of champions that have nothing in common.

    It is for methods that evolve champions of their own: that two champions have the same seed makes them no pair. If
    the methods were equal, each division of all champions into two groups of these sizes was equally likely. p is the
    share of divisions in which the means differ by at least as much. They are counted, as in `sign_flip`.

    Source: Pitman, Suppl. J. R. Stat. Soc. 4 (1937) 119; Good (2005), as of `sign_flip`.

    ours, others: whole numbers, one for each champion, (champions,) each.
    """
    both = np.concatenate([ours, others])
    ways: dict[int, Counter[int]] = {0: Counter({0: 1})}  # size of the first group: its sum: how many divisions
    for value in both.tolist():
        for size in sorted(ways, reverse=True):
            if size < len(ours):
                larger = ways.setdefault(size + 1, Counter())
                for total, count in ways[size].items():
                    larger[total + value] += count
    middle = int(both.sum()) * len(ours)  # of sums of the first group, times the number of all champions
    observed = abs(int(ours.sum()) * len(both) - middle)
    divisions = ways[len(ours)]
    return (
        sum(count for total, count in divisions.items() if abs(total * len(both) - middle) >= observed)
        / divisions.total()
    )


def holm(p: Sequence[float]) -> NDArray[np.float64]:
    """The p values of a table, corrected for their number; nan stays nan and does not count.

    The least is multiplied by the number of tests, the next by one less, and so on; none falls below one before it.
    Source: Holm, Scand. J. Stat. 6 (1979) 65.
    """
    values = np.asarray(p, float)
    order = np.argsort(values)[: int((~np.isnan(values)).sum())]  # nan is sorted last
    corrected = np.full(len(values), np.nan)
    corrected[order] = np.minimum(np.maximum.accumulate(values[order] * np.arange(len(order), 0, -1)), 1.0)
    return corrected


def bootstrap(
    statistic: Statistic,
    *groups: NDArray[np.float64],
    seed: int = 0,
    percentiles: tuple[float, float] = (2.5, 97.5),
) -> tuple[float, float]:
    """Percentile bootstrap interval of a statistic of champions; those of each group are resampled apart.

    Champions without a value (nan) are left out. Where all have the same value, no resample has another: nothing is
    then known of the width.

    Source: Efron & Tibshirani, *An Introduction to the Bootstrap* (1993), chapter 13. Bias-corrected (BCa) intervals
    are undefined where nearly all values agree, which is common here; percentiles are not.

    Args:
        statistic: of resamples of each group, (resamples, champions) each; gives (resamples,).
        groups: one value for each champion, (champions,) each.
        seed: of the resampling.
        percentiles: of the interval, which is one of 95 % unless others are given.

    Returns:
        Lower and upper end; (nan, nan) if a group has fewer than `LEAST` values, or if all agree.
    """
    known = [values[~np.isnan(values)] for values in groups]
    if min(map(len, known)) < LEAST:
        return _UNKNOWN
    rng = random.rng(seed, Stream.bootstrap)
    drawn = [values[rng.integers(0, len(values), (RESAMPLES, len(values)))] for values in known]
    low, high = np.percentile(statistic(*drawn), percentiles)
    return (float(low), float(high)) if low < high else _UNKNOWN


def mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The mean over champions, the last axis."""
    return np.asarray(values.mean(axis=-1))


def difference(ours: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.float64]:
    """The difference in mean of two groups of champions that have nothing in common."""
    return mean(ours) - mean(others)


def interquartile_mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The mean of the middle half of the champions: neither the best nor the worst quarter counts.

    Source: Agarwal et al., NeurIPS 34 (2021) 29304.
    """
    from scipy import stats

    return np.asarray(stats.trim_mean(values, 0.25, axis=-1))


def improvement(ours: NDArray[np.float64], others: NDArray[np.float64]) -> NDArray[np.float64]:
    """The probability that a champion of ours exceeds one of the others; a tie counts one half. Source: as above."""
    against = ours[..., :, None] - others[..., None, :]
    return np.asarray((np.sign(against) / 2 + 0.5).mean(axis=(-2, -1)))


def performance_profile(values: NDArray[np.float64], thresholds: NDArray[np.float64]) -> NDArray[np.float64]:
    """The share of champions that exceed each threshold, (thresholds,). Source: as above."""
    return np.asarray((values > thresholds[:, None]).mean(axis=-1))
