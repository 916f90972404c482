"""What plasticities do for many champions in many changed worlds: a page with tables of rescue and harm."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd

from epuckhebb.analysis.tables import markdown_table, plain
from epuckhebb.sim.controller import GA, HEBBIAN
from epuckhebb.sim.scenario import TRAINED

FIGURE = "rescue_and_harm.png"
_RESCUED, _HARMED = ("rescued", "broken"), ("harmed", "intact")
SOLVES = {"any": "one side or both", "both": "both sides"}  # the values of `masters` in `findings.retention`, in words
RETENTION = (
    "Success in the changed worlds, all together, among trials solved in the training world. A champion that always "
    "turns to one side masters that side at home and keeps it nearly everywhere, without having learnt what a change "
    "could break; so the champions that master both sides are told apart."
)


def label(controller: str, rate: float) -> str:
    """A plasticity in a table or figure."""
    return f"{controller}, N = {rate:g}" if rate or controller == HEBBIAN else controller


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
        f"more than half of its {repeats} noise repeats do. Counted are trials solved in the training world without "
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
    groups = over_all.groupby("experiment", sort=False)
    return "\n".join(f"The {experiment} experiment:\n\n{_over_all(own)}" for experiment, own in groups)


def baselines(told: Mapping[str, tuple[int, pd.DataFrame, pd.DataFrame]], plasticity: str) -> str:
    """Controllers that were evolved in several ways: how brittle they are, and what a plasticity leaves of that.

    told: how they were evolved -> how many in each experiment, and tables of `findings.retention` and
    `findings.rescue_over_all`. plasticity: its name; it stands in both tables, and the GA alone in the first.
    """
    rows = []
    for experiment in TRAINED:
        for name, (champions, retention, over_all) in told.items():
            alone = retention[(retention.experiment == experiment) & (retention.controller == GA)].set_index("solves")
            after = over_all[(over_all.experiment == experiment) & (over_all.controller == plasticity)]
            rescued, harmed = (count(next(after.itertuples()), *what) for what in (_RESCUED, _HARMED))
            solves = f"{alone.champions['both']:g} of {champions}"
            in_training = f"{after.training_harmed.item()} of {after.training_solved.item()}"
            rows.append(
                [experiment, name, solves, *(_kept(alone.loc[key]) for key in SOLVES), rescued, harmed, in_training]
            )
    kept = (f"kept in changed worlds, solved at home: {told}" for told in SOLVES.values())
    head = ["experiment", "evolved with", "both sides solved at home", *kept]
    return markdown_table([*head, "rescued of broken", "harmed of sound", "harmed at home"], rows)


def _over_all(own: pd.DataFrame) -> str:
    rows = [
        [plain(label(row.controller, row.N)), count(row, *_RESCUED), count(row, *_HARMED)]
        + [f"{row.training_harmed} of {row.training_solved}"]
        for row in own.itertuples()
    ]
    return markdown_table(["plasticity", "rescued of broken", "harmed of sound", "harmed in the training world"], rows)


def count(row: Any, part: str, whole: str) -> str:
    """How many of how many, and the share with its interval; `row` is one of `findings.rescue_over_all`."""
    figures = (getattr(row, f"{part}_{name}") for name in ("share", "low", "high"))
    told = f"{getattr(row, part)} of {getattr(row, whole)}"
    return f"{told}: {share(*figures)}" if getattr(row, whole) else told


def difference(row: Any) -> str:
    """The difference of a row with its interval."""
    return f"{row.difference:+.2f} [{row.difference_low:+.2f}, {row.difference_high:+.2f}]"


def share(value: float, low: float, high: float) -> str:
    """A share and its interval, if they are known."""
    if np.isnan(value):
        return "–"
    return f"{value:.2f}" if np.isnan(low) else f"{value:.2f} [{low:.2f}, {high:.2f}]"


def retention_table(retention: pd.DataFrame, *, by_experiment: bool = False) -> str:
    """A row for each plasticity, a column for all trials solved at home and one for champions that master both sides.

    retention: of `findings.retention`. by_experiment: whether the experiment is told in a column of its own.
    """
    rows = []
    for (experiment, controller, rate), group in retention.groupby(["experiment", "controller", "N"], sort=False):
        own = {row.solves: row for row in group.itertuples()}
        cells = [_kept(own[solves]) if solves in own else "–" for solves in SOLVES]
        rows.append([*([experiment] if by_experiment else []), plain(label(controller, rate)), *cells])
    head = [*(["experiment"] if by_experiment else []), "plasticity"]
    return markdown_table([*head, *(f"solved at home: {told}" for told in SOLVES.values())], rows)


def _kept(row: Any) -> str:
    told = f"{row.retained} of {row.trials}"
    if not row.trials:
        return told
    champions = "" if np.isnan(row.champions) else f", {row.champions:g} champion{'s' if row.champions > 1 else ''}"
    return f"{told}: {share(row.share, row.low, row.high)}{champions}"


def _by_scenario(own: pd.DataFrame) -> str:
    """A cell for each plasticity and scenario; whichever there are more of go down the page."""
    own = own.assign(plasticity=[plain(label(row.controller, row.N)) for row in own.itertuples()])
    own = own.assign(cell=[f"{row.rescued}/{row.broken}, {row.harmed}/{row.intact}" for row in own.itertuples()])
    kinds, scenarios = own.plasticity.unique(), own.scenario.unique()
    cells = own.set_index(["plasticity", "scenario"]).cell
    if len(scenarios) > len(kinds):
        rows = [[plain(world), *(cells[kind, world] for kind in kinds)] for world in scenarios]
        return markdown_table(["scenario", *kinds], rows)
    rows = [[kind, *(cells[kind, world] for world in scenarios)] for kind in kinds]
    return markdown_table(["plasticity", *map(plain, scenarios)], rows)
