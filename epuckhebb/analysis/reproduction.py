"""The paper's experiment over many champions: the tables and the figures of the report."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import pandas as pd
from matplotlib.figure import Figure
from numpy.typing import NDArray

from epuckhebb.analysis import charts, figures, findings, published, report
from epuckhebb.analysis.evaluate import evaluate
from epuckhebb.controller.plasticity.control import Sign
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.tmaze.fitness import Signal
from epuckhebb.tmaze.individual import CONTROLS, HEBBIAN, Controller
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.samples import Samples
from epuckhebb.tmaze.scenario import TRAINED, Scenario


def worlds(experiment: str) -> tuple[str, ...]:
    """The scenarios of an experiment: the training world, and the changed ones."""
    return (TRAINED[experiment], *findings.CHANGED[experiment])


def controllers(experiment: str, rates: Sequence[float], signal: Signal) -> list[Controller]:
    """The paper's rule and its controls, at each of the rates and at the paper's."""
    every = sorted({*rates, findings.PAPER_N[experiment]})
    return [hebbian(rate, signal, sign) for sign in Sign for rate in every]


def hebbian(rate: float, signal: Signal, sign: Sign = Sign.hebbian) -> Controller:
    """The paper's rule at a rate, or a control of it."""
    return Controller(name=CONTROLS[sign], rule=Paper(N=rate, sign=sign, signal=signal))


def findings_of(
    metrics: pd.DataFrame, paper: Mapping[str, Any], unchanged: Mapping[str, int], **facts: Any
) -> tuple[report.Findings, dict[str, pd.DataFrame]]:
    """The findings, for the report, and every table by its name.

    metrics: the lifetimes of all champions. paper: the published tables. unchanged: for each experiment, how many
    champions had a bit-identical genome after their lifetimes. facts: `champions`, `given`, `repeats` and `provenance`
    of `report.Findings`.
    """
    each, success = findings.trials(metrics), published.published_success(paper)
    showcase = {one: findings.showcase(each, success, one) for one in unchanged}
    shown = {one: name for one, (name, *_) in showcase.items()}
    comparison = published.compare(published.published_values(paper), each, shown)
    comparison["title"] = [paper[table]["title"] for table in comparison.table]
    tables = {
        "claims": findings.claims(each, dict(unchanged)),
        "success": findings.success(each),
        "rescue_and_harm": findings.rescue_and_harm(each),
        "retention": findings.retention(each),
        "dose_response": findings.dose_response(each),
    }
    own = {"comparison": comparison.drop(columns="title")}
    if facts["given"]:
        comparison = published.with_repeats(comparison, metrics)
        own["repeats"] = comparison.drop(columns=["title", "median", "q25", "q75"])
    found = report.Findings(**tables, comparison=comparison, showcase=showcase, **facts)
    return found, {"metrics": metrics, "trials": each, **tables, **own}


def figures_of(
    found: report.Findings,
    genomes: Mapping[str, NDArray[Any]],
    signals: Mapping[str, Signal],
    world: Callable[[str], tuple[Scenario, Lifetime]],
    histories: Mapping[str, list[pd.DataFrame]],
    seed: int,
) -> dict[str, tuple[str, Figure]]:
    """The figures by the names of their files, each with a caption, in the order of the report.

    genomes, signals: for each experiment the genes (234,) of the champion that is shown, and the live fitness. world:
    gives the scenario of a name and its lifetime. histories: for each experiment the histories of its champions; empty
    for a given genome. seed: of the noise.
    """
    maze = figures.maze(world("4obstacles")[0])
    made = {
        "maze.png": ("The maze: robot at the start, lamp, goals with their 5 cm circles, four obstacles (brown).", maze)
    }
    for one, genes in genomes.items():
        name, rate = found.showcase[one][0], findings.PAPER_N[one]
        plastic = hebbian(rate, signals[one])
        recorded: dict[tuple[str, str], dict[str, Samples]] = {}
        for place in worlds(one):
            scenario, lifetime = world(place)
            _, traces = evaluate(genes, scenario, [plastic], lifetime, repeats=1, seed=seed, name=name)
            title = f"{place}, {name}, N = {rate:g}, one lifetime a side"
            made[f"trajectories_{place}.png"] = (
                f"{place}: trajectories of `{name}`, GA alone and with N = {rate:g}; one lifetime a side.",
                figures.trajectories(traces, scenario, title),
            )
            for k, (controller, side) in enumerate(zip(traces.controller, traces.side, strict=True)):
                recorded.setdefault((place, controller), {})[side] = Samples(*(array[k] for array in traces.samples))
        changed = {place: recorded[place, HEBBIAN] for place in findings.CHANGED[one]}
        for against in ("fitness", "light" if one == "light" else "proximity"):
            made[f"weight_change_{one}_{against}.png"] = (
                f"{one}: weight change between samples against {against}, `{name}`, N = {rate:g}; left blue, right "
                "orange.",
                charts.weight_change(changed, against, f"{name}, N = {rate:g}"),
            )
        last = findings.CHANGED[one][-1]
        made[f"network_{one}.png"] = (
            f"{last}: change of the weights of `{name}` by plasticity at N = {rate:g}, at the end of a lifetime.",
            charts.network(genes, recorded[last, HEBBIAN], f"{name} in {last}, N = {rate:g}"),
        )
        if histories:
            made[f"dose_response_{one}.png"] = (
                f"{one}: success, time to goal, weight change, and rescue and harm with their controls, against N "
                f"(n = {found.champions} champions).",
                charts.dose_response(found.dose_response, found.rescue_and_harm, one, found.champions),
            )
    if histories:
        made["learning_curves.png"] = (
            f"Learning curves: best and mean fitness, median and quartiles of {found.champions} evolutions.",
            charts.learning_curves(dict(histories)),
        )
    return made
