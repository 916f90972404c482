"""A control without lifetimes of its own: what another champion's genome does in a champion's place."""

from collections.abc import Sequence

import pandas as pd


def derangement(champions: Sequence[str]) -> dict[str, str]:
    """For each champion another one, so that each stands in for one: the next in this order, the first for the last.

    Raises:
        ValueError: fewer than two, or one twice.
    """
    if len(champions) < 2 or len(set(champions)) < len(champions):
        raise ValueError(f"a derangement needs two or more different champions, got {', '.join(champions) or 'none'}")
    return dict(zip(champions, [*champions[1:], champions[0]], strict=True))


def exchange_genomes(rows: pd.DataFrame) -> pd.DataFrame:
    """The rows of a table of lifetimes or trials, each under the name of the champion whose place its genome takes.

    A lifetime depends on its genome, world, side, repeat and seed, and not on the champion that it is compared with.
    So these lifetimes have been run: the rows of a champion's genome are those of the other one in its place. The
    champions of an experiment are deranged in the order of the table. rows: with the columns `experiment` and
    `genome`.

    Raises:
        ValueError: an experiment has one champion.
    """
    found = rows.copy()
    for _, own in rows.groupby("experiment", sort=False):
        place = {other: champion for champion, other in derangement(own.genome.unique().tolist()).items()}
        found.loc[own.index, "genome"] = own.genome.map(place)
    return found
