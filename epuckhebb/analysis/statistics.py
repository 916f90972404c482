"""Intervals and p values. Champions are the independent unit; trials and repeats are not.

A *trial* is one champion on one side of the maze. It succeeds if most of its repeats do. The two sides of a champion
share one genome, as two eyes share one patient, and often succeed or fail together. They are one cluster of trials
here: no interval and no p value takes them for two independent animals. Repeats only decide whether a trial succeeds.

Fewer than `LEAST` champions say nothing about others: there is then no interval.
"""

import functools
import math
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller import random
from epuckhebb.controller.random import Stream

LEAST = 6  # champions
RESAMPLES = 100_000  # and draws of a Monte Carlo test: another seed moves an interval by a hundredth of its width
_LISTED = 200_000  # choices that a test of other than whole numbers lists; ten against ten are 184,756
_AT_ONCE = 2**20  # numbers that resamples hold at a time
_UNKNOWN = (math.nan, math.nan)
Statistic = Callable[..., NDArray[np.float64]]


def interval_title(what: str, counts: Sequence[int]) -> str:
    """What a title says of intervals: over what they are, and from how many cases on there are any.

    counts: the cases of each row of the table.
    """
    numbers = " or ".join(map(str, sorted(set(counts))))
    return f"95 % intervals over {what}" + ("" if min(counts) >= LEAST else f", which need {LEAST}: here {numbers}")


def bounds(name: str, interval: tuple[float, float]) -> dict[str, float]:
    """The two cells of a table for an interval: `NAMElow` and `NAMEhigh`."""
    return dict(zip((f"{name}low", f"{name}high"), interval, strict=True))


def wilson(share: float, n: float) -> tuple[float, float]:
    """Wilson's 95 % interval of a share among n independent cases; n may be an effective number, with a fraction.

    It is for the lifetimes of one champion, which differ in their noise alone; `wilson_by_champion` is for champions.
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
    """
    champions, trials, true = int((whole > 0).sum()), float(whole.sum()), float(part.sum())
    if champions < LEAST:
        return _UNKNOWN
    size = trials / champions
    share = (true + size / 2) / (trials + size)  # of the champions and the one more
    squares = float(((part - share * whole) ** 2).sum()) + ((share * size) ** 2 + ((1 - share) * size) ** 2) / 2
    between = (champions + 1) / champions * squares / (trials + size) ** 2
    independent = share * (1 - share) / (trials + size - 1)
    return wilson(true / trials, trials / max(1.0, between / independent))


def sign_flip(differences: NDArray[Any]) -> float:
    """Two-sided p value of paired differences, one a champion, if plasticity made no difference.

    A champion's difference is the number of its trials that succeed with plasticity minus the number without: for two
    sides, one of -2, -1, 0, 1, 2. If plasticity made no difference, both signs of it were equally likely. p is the
    share of all choices of signs in which the sum is at least as far from 0 as the observed sum. The choices are
    counted, not sampled: a table of how many choices give each sum grows by one champion at a time. Of whole numbers
    p is therefore exact for any number of champions. Where every difference is -1, 0 or 1, this is McNemar's exact
    test. Of other numbers, such as returns, p is exact where there are at most 200,000 choices, those of 17 champions.
    Else it is a Monte Carlo p value of `RESAMPLES` drawn choices; the observed one counts as one more.

    Source: Fisher's randomisation test, *The Design of Experiments* (1935), section 21; Good, *Permutation, Parametric
    and Bootstrap Tests of Hypotheses* (2005); of Monte Carlo, Phipson & Smyth, Stat. Appl. Genet. Mol. Biol. 9 (2010).

    Args:
        differences: one for each champion, (champions,).
    """
    signed = _exact(differences[differences != 0])
    least, sizes = _least(signed, len(signed)), np.abs(signed)
    if not _is_countable(sizes, 2 ** len(sizes)):
        return _monte_carlo(lambda rng, n: rng.choice([-1, 1], (n, len(sizes))) @ sizes, len(sizes), least)
    ways = Counter({0: 1})
    for size in sizes.tolist():
        longer: Counter[int] = Counter()
        for total, count in ways.items():
            longer[total + size] += count
            longer[total - size] += count
        ways = longer
    return _share_as_far(ways, least)


def permutation(ours: NDArray[Any], others: NDArray[Any]) -> float:
    """Two-sided p value of the difference in mean of two groups of champions that have nothing in common.

    It is for methods that evolve champions of their own: that two champions have the same seed makes them no pair. If
    the methods were equal, each division of all champions into two groups of these sizes was equally likely. p is the
    share of divisions in which the means differ by at least as much, in either direction. They are counted, or drawn,
    as in `sign_flip`. For groups of unequal size this is not the two-sided p of scipy, which is twice that of the more
    likely direction.

    Source: Pitman, Suppl. J. R. Stat. Soc. 4 (1937) 119; Good (2005), as of `sign_flip`.

    ours, others: one number for each champion, (champions,) each.
    """
    values = _exact(np.concatenate([ours, others])) * (len(ours) + len(others))
    # A sum of these is its distance from the middle.
    values -= values.sum() // len(values) if values.dtype.kind == "i" else values.mean()
    least = _least(values, len(ours))
    if not _is_countable(values, math.comb(len(values), len(ours))):

        def draw(rng: np.random.Generator, n: int) -> NDArray[np.float64]:
            return np.asarray(rng.permuted(np.tile(values, (n, 1)), axis=1)[:, : len(ours)].sum(axis=1))

        return _monte_carlo(draw, len(values), least)
    ways: dict[int, Counter[int]] = {0: Counter({0: 1})}  # size of the first group: its sum: how many divisions
    for value in values.tolist():
        for size in sorted(ways, reverse=True):
            if size < len(ours):
                larger = ways.setdefault(size + 1, Counter())
                for total, count in ways[size].items():
                    larger[total + value] += count
    return _share_as_far(ways[len(ours)], least)


def _exact(values: NDArray[Any]) -> NDArray[Any]:
    """Whole numbers as such, whose sums have no rounding errors."""
    return values.astype(np.int64) if (values == np.rint(values)).all() else values


def _is_countable(values: NDArray[Any], choices: int) -> bool:
    return np.issubdtype(values.dtype, np.integer) or choices <= _LISTED


def _least(values: NDArray[Any], ours: int) -> float:
    """How far from 0 a sum must be to be as far as that of the first ones, but for rounding."""
    return abs(float(values[:ours].sum())) - 1e-12 * float(np.abs(values).sum())


def _share_as_far(ways: Counter[Any], least: float) -> float:
    return sum(count for total, count in ways.items() if abs(total) >= least) / ways.total()


def _monte_carlo(draw: Callable[[np.random.Generator, int], NDArray[Any]], champions: int, least: float) -> float:
    """The share of drawn sums that are as far from 0 as the observed one. draw: so many sums of champions."""
    rng = random.rng(0, Stream.bootstrap)
    as_far = sum(int((np.abs(draw(rng, n)) >= least).sum()) for n in _portions(champions))
    return (as_far + 1) / (RESAMPLES + 1)


def _portions(numbers: int) -> Iterator[int]:
    """Divide all resamples into portions that fit into memory. numbers: of each resample."""
    most = max(1, _AT_ONCE // numbers)
    for drawn in range(0, RESAMPLES, most):
        yield min(most, RESAMPLES - drawn)


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
    statistic: Statistic, *groups: NDArray[np.float64], seed: int = 0, percentiles: tuple[float, float] = (2.5, 97.5)
) -> tuple[float, float]:
    """Percentile bootstrap interval of a statistic of champions; those of each group are resampled apart.

    Champions without a value (nan) are left out. Where all have the same value, no resample has another: nothing is
    then known of the width. There are `RESAMPLES` resamples.

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
    samples = [values[~np.isnan(values)] for values in groups]
    if min(map(len, samples)) < LEAST:
        return _UNKNOWN
    if all(np.ptp(values) == 0 for values in samples):
        return _UNKNOWN
    resampled = []
    for part, n in enumerate(_portions(math.prod(map(len, samples)))):
        if statistic is mean:  # a table may have a thousand of these, all with the same resamples
            (values,) = samples
            resampled.append(_counts(len(values), n, seed, part) @ values / len(values))
        else:
            rng = random.rng(seed, Stream.bootstrap, part)
            resampled.append(statistic(*(values[rng.integers(0, len(values), (n, len(values)))] for values in samples)))
    low, high = np.percentile(np.concatenate(resampled), percentiles)
    return (float(low), float(high)) if low < high else _UNKNOWN


@functools.lru_cache(maxsize=16)  # all portions of 150 champions, 120 MB
def _counts(champions: int, resamples: int, seed: int, part: int) -> NDArray[np.float64]:
    """How often each champion is in each resample, (resamples, champions)."""
    drawn = random.rng(seed, Stream.bootstrap, part).integers(0, champions, (resamples, champions))
    places = drawn + champions * np.arange(resamples)[:, None]
    return np.bincount(places.ravel(), minlength=places.size).reshape(places.shape).astype(float)


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
    """The probability that a champion of ours exceeds one of the others; a tie counts one half.

    Source: Agarwal et al., NeurIPS 34 (2021) 29304.
    """
    ours, others = ours[..., :, None], others[..., None, :]
    return np.asarray(((ours > others).mean(axis=(-2, -1)) + (ours >= others).mean(axis=(-2, -1))) / 2)


def performance_profile(values: NDArray[np.float64], thresholds: NDArray[np.float64]) -> NDArray[np.float64]:
    """The share of champions that exceed each threshold, (thresholds,).

    Source: Agarwal et al., NeurIPS 34 (2021) 29304.
    """
    return np.asarray((values > thresholds[:, None]).mean(axis=-1))
