"""Tables of rescue, harm and retention in Markdown, and the page of a study of many champions in changed worlds."""

from typing import TYPE_CHECKING, Any

import numpy as np

from epuckhebb.analysis.tables import Table, plain, with_interval
from epuckhebb.tmaze.individual import HEBBIAN
from epuckhebb.tmaze.scenario import TRAINED

if TYPE_CHECKING:
    import pandas as pd

FIGURE = "rescue_and_harm.png"
RESCUED, HARMED = "rescued, of the trials that the change broke", "harmed, of those still intact"
SOLVES = {"any": "one side or both", "both": "both sides"}  # the values of `solves` in `findings.retention`
COUNTED = (
    "Only trials that the GA solves in the training world count. A changed world *breaks* some of them; plasticity "
    "*rescues* some of the broken trials. The other trials stay *intact*; plasticity *harms* some of these."
)
RETENTION = (
    "Success in all changed worlds together, among the trials solved in the training world. A champion that always "
    "turns to one side keeps that side nearly everywhere, and has learned nothing that a change could break. The "
    "champions that solve both sides in training therefore have a column of their own."
)


def trial(repeats: int) -> str:
    """What a trial is, and when it succeeds."""
    return (
        "A *trial* is one champion on one side. It succeeds if the robot ends within 5 cm of its goal in more than "
        f"half of its {repeats} repeats."
    )


def label(controller: str, rate: float) -> str:
    """A controller and its rate in a table or figure."""
    return f"{controller}, N = {rate:g}" if rate or controller == HEBBIAN else controller


def markdown(
    over_all: "pd.DataFrame",
    by_scenario: "pd.DataFrame",
    retention: "pd.DataFrame",
    champions: int,
    repeats: int,
    names: str,
) -> str:
    """The page. over_all, by_scenario, retention: tables of `findings`; names: of the champions, in a few words."""
    parts = [
        "# Rescue and harm\n",
        f"{champions} champions of each experiment, {names}. {trial(repeats)} {COUNTED} Intervals are 95 %, over "
        "champions; fewer than six have none.\n",
    ]
    for experiment, own in over_all.groupby("experiment", sort=False):
        own_scenarios, training = by_scenario[by_scenario.experiment == experiment], TRAINED[str(experiment)]
        changes = ", ".join(plain(name) for name in own_scenarios.scenario.unique() if name != training)
        parts += [
            f"## The {experiment} experiment\n",
            f"Training world: {training}. Changed worlds: {changes}.\n",
            over_all_table(own).markdown(),
            "### Each world: rescued/broken, harmed/intact\n",
            _by_scenario(own_scenarios).markdown(),
            "### Retention\n",
            f"{RETENTION}\n",
            retention_table(retention[retention.experiment == experiment]).markdown(),
        ]
    parts.append(f'<img src="figures/{FIGURE}" alt="Rescue and harm of each plasticity, with intervals">\n')
    return "\n".join(parts)


def over_all_table(own: "pd.DataFrame") -> Table:
    """A row for each plasticity; own: the rows of an experiment in `findings.rescue_over_all`."""
    rows = [
        [plain(label(row.controller, row.N)), *counts(row), f"{row.training_harmed} of {row.training_solved}"]
        for row in own.itertuples()
    ]
    title = f"The {own.experiment.iloc[0]} experiment (95 % interval over champions)"
    return Table(["plasticity", RESCUED, HARMED, "harmed in the training world"], rows, title)


def counts(row: Any) -> list[str]:
    """The cells below `RESCUED` and `HARMED`; row: of `findings.rescue_over_all` or `rescue_and_harm`."""
    cells = []
    for part, whole in (("rescued", "broken"), ("harmed", "intact")):
        text = f"{getattr(row, part)} of {getattr(row, whole)}"
        cells.append(f"{text}: {with_interval(row, f'{part}_share')}" if getattr(row, whole) else text)
    return cells


def retention_table(retention: "pd.DataFrame", *, by_experiment: bool = False) -> Table:
    """A row for each plasticity; a column for all champions, and one for those that solve both sides in training.

    retention: of `findings.retention`. by_experiment: whether a first column names the experiment.
    """
    rows = []
    for (experiment, controller, rate), group in retention.groupby(["experiment", "controller", "N"], sort=False):
        own = {row.solves: row for row in group.itertuples()}
        cells = [retained(own[solves]) if solves in own else "–" for solves in SOLVES]
        rows.append([*([experiment] if by_experiment else []), plain(label(controller, rate)), *cells])
    head = [*(["experiment"] if by_experiment else []), "plasticity"]
    return Table([*head, *(f"champions that solve {sides} in training" for sides in SOLVES.values())], rows)


def retained(row: Any) -> str:
    """How many trials are retained, of how many, and of how many champions; row: of `findings.retention`."""
    text = f"{row.retained} of {row.trials}"
    if not row.trials:
        return text
    champions = "" if np.isnan(row.champions) else f", {row.champions:g} champion{'s' if row.champions > 1 else ''}"
    return f"{text}: {with_interval(row, 'share')}{champions}"


def _by_scenario(own: "pd.DataFrame") -> Table:
    """A cell for each plasticity and scenario; the longer of the two lists goes down the page."""
    own = own.assign(
        plasticity=[plain(label(row.controller, row.N)) for row in own.itertuples()],
        scenario=own.scenario.map(plain),
        cell=[f"{row.rescued}/{row.broken}, {row.harmed}/{row.intact}" for row in own.itertuples()],
    )
    down, across = sorted(("plasticity", "scenario"), key=lambda name: own[name].nunique(), reverse=True)
    cells = own.set_index([down, across]).cell.unstack(across)[own[across].unique()].loc[own[down].unique()]
    rows = [[str(name), *row] for name, row in zip(cells.index, cells.to_numpy(), strict=True)]
    return Table([down, *cells.columns], rows)
