"""What plasticities do for many champions in many changed worlds: a page with tables of rescue and harm."""

from typing import Any

import numpy as np
import pandas as pd

from epuckhebb.sim.scenario import TRAINED
from epuckhebb.study.tables import markdown_table

FIGURE = "rescue_and_harm.png"


def label(controller: str, rate: float) -> str:
    """A plasticity in a table or figure."""
    return f"{controller}, N = {rate:g}" if rate else controller


def markdown(over_all: pd.DataFrame, by_scenario: pd.DataFrame, champions: int, repeats: int, names: str) -> str:
    """The page. over_all, by_scenario: of `findings.rescue_over_all` and `rescue_and_harm`; names: of the champions."""
    parts = [
        "# Rescue and harm\n",
        f"{champions} champions of each experiment, {names}. A *trial* is one champion on one side; it succeeds if "
        f"more than half of its {repeats} noise repeats do. Counted are trials mastered in the training world without "
        "plasticity: of those that a changed world *breaks*, how many a plasticity *rescues*; of those it leaves "
        "*sound*, how many it *harms*. Intervals are 95 %, from a bootstrap over champions.\n",
    ]
    for experiment, own in over_all.groupby("experiment", sort=False):
        own_scenarios = by_scenario[by_scenario.experiment == experiment]
        changes = ", ".join(name for name in own_scenarios.scenario.unique() if name != TRAINED[str(experiment)])
        parts += [
            f"## The {experiment} experiment\n",
            f"Training world: {TRAINED[str(experiment)]}; changed: {changes}.\n",
            _over_all(own),
            "### Rescued of broken, and harmed of sound, in each world\n",
            _by_scenario(own_scenarios),
        ]
    parts.append(f'<img src="figures/{FIGURE}" alt="Rescue and harm of each plasticity, with intervals">\n')
    return "\n".join(parts)


def summary(over_all: pd.DataFrame) -> str:
    """The tables of the README, one for each experiment."""
    parts = [
        f"The {experiment} experiment:\n\n{_over_all(own)}"
        for experiment, own in over_all.groupby("experiment", sort=False)
    ]
    return "\n".join(parts)


def _over_all(own: pd.DataFrame) -> str:
    rows = [
        [label(row.controller, row.N), count(row, "rescued", "broken"), count(row, "harmed", "sound")]
        + [f"{row.home_harmed} of {row.home_mastered}"]
        for row in own.itertuples()
    ]
    return markdown_table(["plasticity", "rescued of broken", "harmed of sound", "harmed in the training world"], rows)


def count(row: Any, part: str, whole: str) -> str:
    """How many of how many, and the share with its interval; `row` is one of `findings.rescue_over_all`."""
    share, low, high = (getattr(row, f"{part}_{name}") for name in ("share", "low", "high"))
    told = f"{getattr(row, part)} of {getattr(row, whole)}"
    return told if np.isnan(share) else f"{told}: {share:.2f} [{low:.2f}, {high:.2f}]"


def _by_scenario(own: pd.DataFrame) -> str:
    scenarios = list(own.scenario.unique())
    rows = []
    for (controller, rate), group in own.groupby(["controller", "N"], sort=False):
        cells = group.set_index("scenario").loc[scenarios].itertuples()
        told = [f"{row.rescued}/{row.broken}, {row.harmed}/{row.sound}" for row in cells]
        rows.append([label(controller, rate), *told])
    return markdown_table(["plasticity", *scenarios], rows)
