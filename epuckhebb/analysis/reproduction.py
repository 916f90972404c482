"""The paper's experiment over many champions: its tables, its figures and its page.

Every number of the page is from a table that is also a CSV file.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from epuckhebb.analysis import claims, ends, findings, published, rescue, summary
from epuckhebb.analysis.claims import RULE
from epuckhebb.analysis.evaluate import evaluate
from epuckhebb.analysis.findings import PAPER_N
from epuckhebb.analysis.statistics import holm
from epuckhebb.analysis.tables import NEW_LINE, Table, code, interval_text, pictures, unmarked
from epuckhebb.controller.plasticity.control import Sign
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.tmaze.fitness import Signal
from epuckhebb.tmaze.individual import CONTROLS, GA, HEBBIAN, Controller
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.samples import Samples
from epuckhebb.tmaze.scenario import TRAINED, Scenario

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_SHOWCASE = (
    "Among the champions that solve both sides in training (among all, if none does), it agrees with the paper in most "
    "cells. Of equals it has the lowest seed. It shows that the pattern exists, not how often."
)
CLAIMS = f"Each claim is a question to every trial that could show it. {RULE}\n"
RESCUE_TEXT = (
    f"{rescue.COUNTED} The difference is success with plasticity minus success without, over all trials. Its p is from "
    "an exact sign-flip test by champion; those of a table are corrected together (Holm). The controls change the "
    "weights in other directions."
)


def markdown(
    tables: Mapping[str, pd.DataFrame],
    paper: Mapping[str, Any],
    showcase: Mapping[str, tuple[str, int, int]],
    captions: Mapping[str, str],
    *,
    champions: int,
    repeats: int,
    is_fixed: bool,
    provenance: str,
) -> str:
    """The page of a reproduction in Markdown.

    tables: by name. paper: the published tables. showcase: for each experiment a champion, in how many cells it agrees
    with the paper, and of how many. captions: of the figures, in order. champions: of each experiment. repeats: of
    every condition. is_fixed: whether one genome takes the place of champions. provenance: a line on the origin of the
    data.
    """
    parts = [
        "# The paper's experiment, reproduced\n",
        f"{provenance}\n",
        f"{rescue.trial(repeats)} Intervals are 95 %. Intervals and p values take champions as the independent "
        "unit, not trials.\n",
    ]
    if not is_fixed:
        parts += ["## The paper's claims\n", CLAIMS, claims_table(tables["claims"]).markdown()]
    parts += ["## Tables 1 to 3: ours (the paper's)\n"]
    for name, group in tables["comparison"].groupby("table", sort=False):
        shown, agreeing, cells = showcase[group.experiment.iloc[0]]
        ours = published.table(group, of_all=False).markdown()
        parts.append(f"### {paper[str(name)]['title']}\n")
        if is_fixed:
            parts += [
                f"Genome {code(shown)}. Relative deviations from the published values are in `comparison.csv`.\n",
                ours,
            ]
            continue
        parts += [
            f"Showcase: {code(shown)}, mean of its repeats. {_SHOWCASE} Success agrees in {agreeing} of the {cells} "
            f"cells of this experiment; {champions} champions were compared. Of the other numbers of this table, "
            f"{published.close(group)} lie within 5 % of the paper's.\n",
            ours,
            f"\nAll {champions} champions, median [quartiles]:\n",
            published.table(group, of_all=True).markdown(),
        ]
    if not is_fixed:
        parts += [
            "## Over all champions\n",
            "### Success\n",
            success_table(tables["success"]).markdown(),
            "### Rescue and harm\n",
            f"{RESCUE_TEXT}\n",
            rescue_table(tables["rescue_and_harm"]).markdown(),
            ends.markdown(_paper_rates(tables["ends"])),
        ]
    return "\n".join([*parts, "## Figures\n", *pictures(captions)])


def terminal_tables(comparison: pd.DataFrame, paper: Mapping[str, Any]) -> list[Table]:
    """Tables 1 to 3 with a row for each column of the paper's: the terminal has no room for these."""
    shown = []
    for name, group in comparison.groupby("table", sort=False):
        table = published.table(group, of_all=False)
        columns = zip(table.headings, *table.rows, strict=True)
        (_, *metrics), *rows = ([unmarked(cell.replace(NEW_LINE, " ")) for cell in column] for column in columns)
        shown.append(Table(["", *metrics], rows, f"{paper[str(name)]['title']}: ours (the paper's)"))
    return shown


def worlds(experiment: str) -> tuple[str, ...]:
    """The scenarios of an experiment: the training world, and the changed ones."""
    return (TRAINED[experiment], *findings.CHANGED[experiment])


def controllers(experiment: str, rates: Sequence[float], signal: Signal) -> list[Controller]:
    """The paper's rule and its controls, at each of the rates and at the paper's."""
    every = sorted({*rates, PAPER_N[experiment]})
    return [hebbian(rate, signal, sign) for sign in Sign for rate in every]


def hebbian(rate: float, signal: Signal, sign: Sign = Sign.hebbian) -> Controller:
    """The paper's rule at a rate, or a control of it."""
    return Controller(name=CONTROLS[sign], rule=Paper(N=rate, sign=sign, signal=signal))


def make_tables(metrics: pd.DataFrame, paper: Mapping[str, Any]) -> dict[str, pd.DataFrame]:
    """Every table by its name. metrics: the lifetimes of all champions. paper: the published tables."""
    each = findings.trials(metrics)
    by_champion = findings.rescue_by_champion(each)
    doses = summary.dose_response(metrics.assign(changed=""), ["N"])
    shown = {experiment: name for experiment, (name, *_) in showcases(each, paper).items()}
    return {
        "metrics": metrics,
        "trials": each,
        "claims": claims.claims(each, published.published_values(paper)),
        "success": findings.success(each),
        "rescue_and_harm": findings.rescue_and_harm(each),
        "rescue_over_all": findings.rescue_totals(by_champion),
        **ends.tables(metrics),
        "comparison": published.compare(published.published_values(paper), each, shown),
    } | ({} if doses is None else {"doses": doses})


def showcases(each: pd.DataFrame, paper: Mapping[str, Any]) -> dict[str, tuple[str, int, int]]:
    """For each experiment the champion most like the paper's, in how many cells it agrees, and of how many.

    each: the trials. paper: the published tables.
    """
    success = published.published_success(paper)
    return {experiment: claims.showcase(each, success, experiment) for experiment in each.experiment.unique()}


def make_figures(
    tables: Mapping[str, pd.DataFrame],
    shown: Mapping[str, tuple[str, NDArray[Any]]],
    signals: Mapping[str, Signal],
    world: Callable[[str], tuple[Scenario, Lifetime]],
    histories: Mapping[str, list[pd.DataFrame]],
    seed: int,
) -> dict[str, "Figure"]:
    """The figures by name, each with its caption as label, in the order of the page.

    tables: by name. shown, signals: for each experiment the champion that is shown, its name and
    genes (234,), and the live fitness. world: gives the scenario of a name and its lifetime. histories: for each
    experiment the histories of its champions; empty for a given genome. seed: of the noise.
    """
    from epuckhebb.analysis import charts, end_charts, figures  # matplotlib takes a while to load

    made: dict[str, Figure] = {}

    def add(name: str, figure: "Figure", caption: str) -> None:
        figure.set_label(caption)
        made[name] = figure

    maze = figures.maze(world("4obstacles")[0])
    add("maze", maze, "The maze: robot at the start, lamp, goals with their 5 cm circles, four obstacles (brown).")
    for experiment, (name, genes) in shown.items():
        plastic, recorded = hebbian(PAPER_N[experiment], signals[experiment]), dict[str, dict[str, Samples]]()
        at_rate = f"{name}, N = {PAPER_N[experiment]:g}"
        for world_name in worlds(experiment):
            scenario, lifetime = world(world_name)
            _, traces = evaluate(genes, scenario, [plastic], lifetime, repeats=1, seed=seed, name=name)
            drawn = figures.trajectories(traces, scenario, f"{world_name}, {at_rate}, one lifetime a side")
            add(f"trajectories_{world_name}", drawn, f"{world_name}: trajectories of {at_rate}, one lifetime a side.")
            recorded[world_name] = traces.side_samples(HEBBIAN)
        changed = {world_name: recorded[world_name] for world_name in findings.CHANGED[experiment]}
        against, last = "light" if experiment == "light" else "proximity", findings.CHANGED[experiment][-1]
        drawn = charts.weight_change(changed, against, at_rate)
        caption = f"{experiment}: weight change between samples against {against}, {at_rate}."
        add(f"weight_change_{experiment}", drawn, caption)
        drawn = charts.weights(genes, recorded[last], plastic.rule.w_max, f"{last}, {at_rate}")
        add(f"weights_{experiment}", drawn, f"{last}: each weight of {at_rate} before and at the end of a lifetime.")
        if histories and "doses" in tables:
            doses = tables["doses"]
            chosen = doses[doses.condition.isin([f"{world_name}: {HEBBIAN}" for world_name in worlds(experiment)])]
            n = len(histories[experiment])
            caption = f"{experiment}: success, weight change and saturated weights against N (n = {n})."
            add(f"dose_response_{experiment}", charts.dose_response(chosen), caption)
    if histories:
        caption = "Rescued and harmed trials of each changed world at the paper's rates, with 95 % intervals."
        rows = (_paper_rates(tables[name]) for name in ("rescue_over_all", "rescue_and_harm"))
        add("rescue_and_harm", charts.rescue_and_harm(*rows), caption)
        caption = (
            "Where trials end at the paper's rates: shares of right end, wrong end and elsewhere, n in each title."
        )
        add("ends", end_charts.ends(_paper_rates(tables["ends"])), caption)
        caption = "Learning curves: best fitness, median and quartiles of the evolutions."
        add("learning_curves", charts.learning_curves(dict(sorted(histories.items(), reverse=True))), caption)
    return made


def claims_table(table: pd.DataFrame) -> Table:
    """The claims with their verdicts, the control beside each, and which trials count."""
    rows = [
        [row.experiment, row.claim, f"**{row.verdict}**", f"{row.true} of {row.n}", *_claim_numbers(row), row.counted]
        for row in table.itertuples()
    ]
    head = ["experiment", "claim", "verdict", "trials", "share, or change (the paper's)", "with shuffled signs"]
    return Table([*head, "which trials: what counts"], rows, "The paper's claims")


def _claim_numbers(row: Any) -> list[str]:
    """The number by which a claim is judged, a share or an effect, and that of its control."""
    if np.isnan(row.paper_effect):
        return [interval_text(row, "share"), interval_text(row, "control_share")]
    names = ("effect", "paper_effect", "control_effect")
    ours, paper, control = (interval_text(row, name, "+.1f", " %") for name in names)
    return [f"{ours} ({paper})", control]


def _paper_rates(table: pd.DataFrame) -> pd.DataFrame:
    """The rows of a table without plasticity, or at the paper's rates."""
    return table[(table.N == 0) | (table.experiment.map(PAPER_N) == table.N)]


def success_table(success: pd.DataFrame) -> Table:
    """Success at the paper's rates, a row for each scenario and controller."""
    shown = _paper_rates(success[success.controller.isin([GA, *CONTROLS.values()])])
    rows, key = [], ["experiment", "scenario", "controller"]
    for (experiment, scenario, controller), group in shown.groupby(key, sort=False):
        sides = group.set_index("side")
        cells = [
            f"{sides.successes[side]} of {sides.n[side]}: {interval_text(sides.loc[side], 'share')}; "
            f"wrong end {sides.wrong[side]}"
            for side in ("left", "right", "both")
        ]
        rows.append([experiment, scenario, rescue.label(controller, group.N.iloc[0]), *cells])
    return Table([*key, "left", "right", "both sides"], rows)


def rescue_table(harm: pd.DataFrame) -> Table:
    """Rescue and harm at the paper's rates, controls included; the p values of the table are corrected together."""
    shown = _paper_rates(harm)
    rows = [
        [
            row.scenario,
            rescue.label(row.controller, row.N),
            *rescue.counts(row),
            interval_text(row, "difference", "+.2f"),
        ]
        + ["–" if np.isnan(p) else f"{p:.2g}"]
        for row, p in zip(shown.itertuples(), holm(shown.sign_flip_p.tolist()), strict=True)
    ]
    return Table(["scenario", "plasticity", rescue.RESCUED, rescue.ENDS, rescue.HARMED, "difference", "p (Holm)"], rows)
