"""What plasticities do for many champions in many changed worlds: a page with tables of rescue and harm."""

from typing import Any

import numpy as np
import pandas as pd

from epuckhebb.sim.scenario import TRAINED
from epuckhebb.study.tables import markdown_table, plain

FIGURE = "rescue_and_harm.png"
MASTERS = {"any": "one side or both", "both": "both sides"}  # the values of `masters` in `findings.retention`, in words
RETENTION = (
    "Success in the changed worlds, all together, among trials mastered in the training world. A champion that always "
    "turns to one side masters that side at home and keeps it nearly everywhere, without having learnt what a change "
    "could break; so the champions that master both sides are told apart."
)


def label(controller: str, rate: float) -> str:
    """A plasticity in a table or figure."""
    return f"{controller}, N = {rate:g}" if rate else controller


def markdown(
    over_all: pd.DataFrame,
    by_scenario: pd.DataFrame,
    retention: pd.DataFrame,
    champions: int,
    repeats: int,
    names: str,
) -> str:
    """The page.

    over_all, by_scenario, retention: of `findings.rescue_over_all`, `rescue_and_harm` and `retention`; names: of the
    champions.
    """
    parts = [
        "# Rescue and harm\n",
        f"{champions} champions of each experiment, {names}. A *trial* is one champion on one side; it succeeds if "
        f"more than half of its {repeats} noise repeats do. Counted are trials mastered in the training world without "
        "plasticity: of those that a changed world *breaks*, how many a plasticity *rescues*; of those it leaves "
        "*sound*, how many it *harms*. Intervals are 95 %, from a bootstrap over champions.\n",
    ]
    for experiment, own in over_all.groupby("experiment", sort=False):
        own_scenarios = by_scenario[by_scenario.experiment == experiment]
        changes = ", ".join(plain(name) for name in own_scenarios.scenario.unique() if name != TRAINED[str(experiment)])
        parts += [
            f"## The {experiment} experiment\n",
            f"Training world: {TRAINED[str(experiment)]}; changed: {changes}.\n",
            _over_all(own),
            "### Rescued of broken, and harmed of sound, in each world\n",
            _by_scenario(own_scenarios),
            "### Retention\n",
            f"{RETENTION}\n",
            retention_table(retention[retention.experiment == experiment]),
        ]
    parts.append(f'<img src="figures/{FIGURE}" alt="Rescue and harm of each plasticity, with intervals">\n')
    return "\n".join(parts)


def summary(over_all: pd.DataFrame) -> str:
    """The tables of `docs/results.md`, one for each experiment."""
    parts = [
        f"The {experiment} experiment:\n\n{_over_all(own)}"
        for experiment, own in over_all.groupby("experiment", sort=False)
    ]
    return "\n".join(parts)


def _over_all(own: pd.DataFrame) -> str:
    rows = [
        [plain(label(row.controller, row.N)), count(row, "rescued", "broken"), count(row, "harmed", "sound")]
        + [f"{row.home_harmed} of {row.home_mastered}"]
        for row in own.itertuples()
    ]
    return markdown_table(["plasticity", "rescued of broken", "harmed of sound", "harmed in the training world"], rows)


def count(row: Any, part: str, whole: str) -> str:
    """How many of how many, and the share with its interval; `row` is one of `findings.rescue_over_all`."""
    figures = (getattr(row, f"{part}_{name}") for name in ("share", "low", "high"))
    told = f"{getattr(row, part)} of {getattr(row, whole)}"
    return f"{told}: {share(*figures)}" if getattr(row, whole) else told


def share(value: float, low: float, high: float) -> str:
    """A share and its interval, if that is known."""
    return f"{value:.2f}" if np.isnan(low) else f"{value:.2f} [{low:.2f}, {high:.2f}]"


def retention_table(retention: pd.DataFrame, *, by_experiment: bool = False) -> str:
    """A row for each plasticity, a column for all trials mastered at home and one for champions that master both sides.

    retention: of `findings.retention`. by_experiment: whether the experiment is told in a column of its own.
    """
    rows = []
    for (experiment, controller, rate), group in retention.groupby(["experiment", "controller", "N"], sort=False):
        own = {row.masters: row for row in group.itertuples()}
        cells = [_kept(own[masters]) if masters in own else "–" for masters in MASTERS]
        rows.append([*([experiment] if by_experiment else []), plain(label(controller, rate)), *cells])
    head = [*(["experiment"] if by_experiment else []), "plasticity"]
    return markdown_table([*head, *(f"mastered at home: {told}" for told in MASTERS.values())], rows)


def _kept(row: Any) -> str:
    told = f"{row.retained} of {row.trials}"
    if not row.trials:
        return told
    champions = "" if np.isnan(row.champions) else f", {row.champions:g} champion{'s' if row.champions > 1 else ''}"
    return f"{told}: {share(row.share, row.low, row.high)}{champions}"


def _by_scenario(own: pd.DataFrame) -> str:
    scenarios = list(own.scenario.unique())
    rows = []
    for (controller, rate), group in own.groupby(["controller", "N"], sort=False):
        cells = group.set_index("scenario").loc[scenarios].itertuples()
        told = [f"{row.rescued}/{row.broken}, {row.harmed}/{row.sound}" for row in cells]
        rows.append([plain(label(controller, rate)), *told])
    return markdown_table(["plasticity", *map(plain, scenarios)], rows)
