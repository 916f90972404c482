"""Tables of rescue and harm in Markdown, and the page of a study of many champions in changed worlds."""

from typing import TYPE_CHECKING, Any

from epuckhebb.analysis.tables import Table, interval_text, plain
from epuckhebb.tmaze.individual import HEBBIAN
from epuckhebb.tmaze.scenario import TRAINED

if TYPE_CHECKING:
    import pandas as pd

RESCUED, HARMED = "rescued, of the trials that the change broke", "harmed, of those still intact"
ENDS = "ends of the broken: right, wrong, elsewhere"
COUNTED = (
    "Only trials that the GA solves in the training world count. A changed world *breaks* some of them; plasticity "
    "*rescues* some of the broken trials. The other trials stay *intact*; plasticity *harms* some of these. A broken "
    "trial that ends *wrong*, at the goal of the other side, stands beside the rescued ones: a robot that drives to "
    "either end without regard to the lamp has as many of both."
)


def trial(repeats: int) -> str:
    """A sentence for a page: what a trial is, and when it succeeds."""
    return (
        "A *trial* is one champion on one side. It succeeds if the robot ends within 5 cm of its goal in more than "
        f"half of its {repeats} repeats."
    )


def picture(kind: str) -> list[str]:
    """The line of a page with its picture; none for a PDF, which no page shows."""
    line = f'<img src="figures/rescue_and_harm.{kind}" alt="Rescue and harm of each plasticity, with intervals">\n'
    return [] if kind in ("pdf", "none") else [line]


def label(controller: str, rate: float) -> str:
    """A controller and its rate in a table or figure."""
    return f"{controller}, N = {rate:g}" if rate or controller == HEBBIAN else controller


def markdown(over_all: "pd.DataFrame", by_scenario: "pd.DataFrame", champions: int, repeats: int, names: str) -> str:
    """The page of rescue and harm. over_all, by_scenario: the two tables; names: of the champions, in a few words."""
    parts = [
        "# Rescue and harm\n",
        f"{champions} champions of each experiment, {names}. {trial(repeats)} {COUNTED} Intervals are 95 %, over "
        "champions; fewer than six have none.\n",
    ]
    for experiment, totals in over_all.groupby("experiment", sort=False):
        scenarios, training = by_scenario[by_scenario.experiment == experiment], TRAINED[str(experiment)]
        changes = ", ".join(plain(name) for name in scenarios.scenario.unique() if name != training)
        parts += [
            f"## The {experiment} experiment\n",
            f"Training world: {training}. Changed worlds: {changes}.\n",
            totals_table(totals).markdown(),
            "### Each world: rescued/wrong end/broken, harmed/intact\n",
            _scenario_table(scenarios).markdown(),
        ]
    return "\n".join(parts)


def totals_table(totals: "pd.DataFrame") -> Table:
    """Rescue and harm of each plasticity over all changed worlds. totals: the rows of one experiment."""
    rows = [
        [plain(label(row.controller, row.N)), *counts(row), f"{row.training_harmed} of {row.training_solved}"]
        for row in totals.itertuples()
    ]
    title = f"The {totals.experiment.iloc[0]} experiment (95 % interval over champions)"
    return Table(["plasticity", RESCUED, ENDS, HARMED, "harmed in the training world"], rows, title)


def counts(row: Any) -> list[str]:
    """Three cells: trials rescued, the ends of the broken ones, trials harmed. row: of a table of rescue and harm."""
    cells = []
    for part, whole in (("rescued", "broken"), ("harmed", "intact")):
        text = f"{getattr(row, part)} of {getattr(row, whole)}"
        cells.append(f"{text}: {interval_text(row, f'{part}_share')}" if getattr(row, whole) else text)
    cells.insert(1, f"{row.rescued}, {row.broken_wrong}, {row.broken_elsewhere}")
    return cells


def _scenario_table(table: "pd.DataFrame") -> Table:
    """A cell for each plasticity and scenario; the longer of the two lists goes down the page."""
    rows = list(table.itertuples())
    cells = table.assign(
        plasticity=[plain(label(row.controller, row.N)) for row in rows],
        scenario=table.scenario.map(plain),
        cell=[f"{row.rescued}/{row.broken_wrong}/{row.broken}, {row.harmed}/{row.intact}" for row in rows],
    )
    across, down = sorted(("scenario", "plasticity"), key=lambda name: cells[name].nunique())
    grid = cells.pivot(index=down, columns=across, values="cell").loc[cells[down].unique(), cells[across].unique()]
    return Table([down, *grid], [[str(name), *row] for name, row in zip(grid.index, grid.to_numpy(), strict=True)])
