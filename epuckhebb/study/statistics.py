"""The statistics of the study. What counts is a *trial*: one champion on one side, successful if most repeats are.

Noise repeats of one champion are much alike, so they are no independent evidence; champions are. scipy does the work.
"""

from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from epuckhebb.sim import streams
from epuckhebb.sim.streams import Stream

RESAMPLES = 2000


@cache
def wilson(successes: int, n: int) -> tuple[float, float]:
    """Wilson's 95 % interval of a proportion; (nan, nan) without trials."""
    if n == 0:
        return float("nan"), float("nan")
    interval = stats.binomtest(successes, n).proportion_ci(0.95, method="wilson")
    return float(interval.low), float(interval.high)


def mcnemar(only_first: int, only_second: int) -> float:
    """Exact two-sided McNemar p value from the trials in which only one of two paired conditions succeeded."""
    discordant = only_first + only_second
    return float(stats.binomtest(only_first, discordant, 0.5).pvalue) if discordant else 1.0


def bootstrap_mean(values: NDArray[np.float64], seed: int) -> tuple[float, float]:
    """95 % percentile bootstrap interval of the mean of independent values, (n,); champions are resampled.

    BCa intervals are undefined where all values agree, which is common here; percentiles are not.
    """
    known = values[~np.isnan(values)]
    if len(known) == 0:
        return float("nan"), float("nan")
    drawn = streams.rng(seed, Stream.bootstrap).integers(0, len(known), (RESAMPLES, len(known)))
    low, high = np.percentile(known[drawn].mean(axis=1), [2.5, 97.5])
    return float(low), float(high)


def bootstrap_ratio(part: NDArray[np.int64], whole: NDArray[np.int64], seed: int) -> tuple[float, float]:
    """95 % percentile bootstrap interval of sum(part) / sum(whole); champions, (n,), are resampled."""
    if not whole.sum():
        return float("nan"), float("nan")
    drawn = streams.rng(seed, Stream.bootstrap).integers(0, len(whole), (RESAMPLES, len(whole)))
    wholes = whole[drawn].sum(axis=1)
    low, high = np.percentile(part[drawn].sum(axis=1)[wholes > 0] / wholes[wholes > 0], [2.5, 97.5])
    return float(low), float(high)
