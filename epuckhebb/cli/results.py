"""Prints the tables of results: of an evaluation or an evolution, and of studies."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.text import Text

from epuckhebb.adaptation.controller import GA
from epuckhebb.analysis import rescue, tables
from epuckhebb.analysis.evaluate import Rows
from epuckhebb.cli.console import print_line, print_table
from epuckhebb.config import settings
from epuckhebb.runtime import thread_count
from epuckhebb.store import CONFIG, Run, is_bundled, load_genome
from epuckhebb.tmaze.maze import SIDES
from epuckhebb.tmaze.scenario import EXPERIMENTS

if TYPE_CHECKING:
    import pandas as pd

_LISTED = 20  # jobs of a study that is not run


def print_evaluation(path: Path, console: Console, metrics: Rows | None = None) -> None:
    """Print the paper's table of a run, and what belongs to it. metrics: its lifetimes; read unless given."""
    print_metrics(metrics or Run(path).rows("metrics.csv"), console)
    _print_notes(path, console)


def print_metrics(metrics: Rows, console: Console) -> None:
    """Print the paper's table, a row for each controller and side."""
    text = tables.formatted(tables.paper_table(metrics))
    rows = [(*place, *cells.values()) for place, cells in text.items()]
    print_table(console, _title(metrics), ("controller", "side", *tables.ROWS), rows, text=2)
    saturated = tables.saturation(metrics)
    if saturated:
        print_line(console, saturated)
    drove_on = sum(row["success"] == 0 and (row["time_to_goal_s"] or math.nan) > 0 for row in metrics)
    if drove_on:
        of = f"{drove_on} of {len(metrics)} lifetimes"
        print_line(console, f"{of} reached the goal and drove on; success counts at the end.")


def evaluation_in_short(path: Path) -> str:
    """The success of each controller on each side, a line each."""
    success = {place: means["Success"] for place, means in tables.paper_table(Run(path).rows("metrics.csv")).items()}
    return "\n".join(
        f"{name} success {success.get((name, 'left'), math.nan):.2f} left "
        f"{success.get((name, 'right'), math.nan):.2f} right"
        for name in dict.fromkeys(name for name, _ in success)
    )


def print_reversal(path: Path, console: Console) -> None:
    """Print the rewarded share of each controller, beside chance and the optimum."""
    rows = []
    for row in Run(path).rows("reversal.csv"):
        interval = "" if row["low"] is None else f"{row['low']:.3f}–{row['high']:.3f}"
        rows.append((row["controller"], f"{row['rewarded_share']:.3f}", interval))
    title = _title(Run(path).rows("metrics.csv"))
    print_table(console, title, ("controller", "rewarded share", "95 % interval"), rows)
    _print_notes(path, console)


def reversal_in_short(path: Path) -> str:
    """The rewarded share of each controller, in one line."""
    shares = Run(path).table("reversal.csv")
    return "rewarded share: " + ", ".join(f"{row.controller} {row.rewarded_share:.2f}" for row in shares.itertuples())


def print_evolution(path: Path, console: Console) -> None:
    """Print how fitness rose, and how well the fittest of the last generation did."""
    history = Run(path).rows("history.csv")
    first, last = history[0], history[-1]
    best = f"best fitness {first['best_fitness']:.3f} → {last['best_fitness']:.3f}"
    mean = f"mean {first['mean_fitness']:.3f} → {last['mean_fitness']:.3f}"
    console.print(Text(f"{len(history)} generations: {best}, {mean}; {_fittest(path, last)}."))


def evolution_in_short(path: Path) -> str:
    """The best fitness of the last generation."""
    return f"best fitness {Run(path).rows('history.csv')[-1]['best_fitness']:.3f}"


def _fittest(path: Path, last: dict[str, Any]) -> str:
    """How often the fittest of the last generation reached its goal, or was rewarded."""
    config = settings(Run(path).config_file) if Run(path).has(CONFIG) else {}
    task = config.get("task") or {}
    if task.get("kind") != "reversal":
        return f"the fittest reached its goal in {100 * last['best_success']:.0f} % of its training lifetimes"
    bonus = task["end_bonus"] + task["progress_bonus"] + config["training"]["success_bonus"] * last["best_success"]
    return (
        f"rewarded share of the fittest in training: {max(0.0, last['best_fitness'] - bonus):.3f} or more (its "
        f"fitness without {bonus:.3g}, the bonus of a robot that reaches an end in every trial)"
    )


def _title(metrics: Rows) -> str:
    """The world, genome, rate, repeats and seed of a run, in one line."""
    first = metrics[0]
    rate = tables.rates([(row["controller"], row["N"]) for row in metrics])
    repeats = len({row["repeat"] for row in metrics})
    world = f"{first['scenario']} ({first['changed']})" if first["changed"] else first["scenario"]
    return (
        f"{world}: genome {first['genome']}{f', {rate}' if rate else ''}, "
        f"mean of {repeats} lifetime{'s' if repeats > 1 else ''} a side (seed {first['seed']})"
    )


def _print_notes(path: Path, console: Console) -> None:
    """Print what a reader of the table must know."""
    for note in Run(path).provenance.get("notes", []):
        console.print(Text(note))


def print_jobs(found: dict[str, Any], console: Console) -> None:
    """List the first jobs of a study that is not run, and say how long all take. found: as in its JSON."""
    folder, listed = found["folder"], found["jobs"]
    rows = [(n, "done" if job["done"] else "to do", job["what"]) for n, job in enumerate(listed[:_LISTED])]
    print_table(console, f"{len(listed)} jobs in {folder}/", ("job", "", "what"), rows, text=3)
    if len(listed) > _LISTED:
        print_line(console, f"... and {len(listed) - _LISTED} more; --json lists all.")
    done = sum(job["done"] for job in listed)
    print_line(console, f"{done} done, {len(listed) - done} to do; nothing was run.")
    if found.get("cpu_s"):
        cores = thread_count()
        duration = _duration(found["cpu_s"] / min(cores, len(listed) - done))
        print_line(console, f"About {duration} on the {cores} cores of this machine, if they are free.")


def _duration(seconds: float) -> str:
    """About so long, in the largest unit that it has two of; the start of the workers takes a part of a minute."""
    units = (("days", 86400), ("hours", 3600), ("minutes", 60))
    return next((f"{seconds / size:.0f} {name}" for name, size in units if seconds >= 2 * size), "2 minutes")


def print_reproduction(path: Path, console: Console) -> None:
    """Print which of the paper's claims hold."""
    claims = Run(path).table("claims.csv")
    rows = [(row.experiment, row.claim, row.verdict, f"{row.true} of {row.n}") for row in claims.itertuples()]
    print_table(console, "The paper's claims", ("experiment", "claim", "verdict", "true in"), rows, text=3)


def reproduction_in_short(path: Path) -> str:
    """How many claims hold."""
    claims = Run(path).table("claims.csv")
    claims = claims[~claims.verdict.str.startswith("check")]
    return f"{(claims.verdict == 'holds').sum()} of {len(claims)} claims hold"


def print_flock(path: Path, console: Console) -> None:
    """Print where the robots of each coupling headed in the usual condition."""
    from epuckhebb.analysis.flock import usual  # brings statistics

    for breaks, own in usual(Run(path).table("flock.csv")).groupby("breaks", sort=False):
        rows = [
            (
                row.coupling,
                f"{row.before:.3f}",
                rescue.share(row.long_after, row.long_after_low, row.long_after_high),
                f"{row.good * row.runs:.0f} of {row.runs}",
                rescue.difference(row) if row.difference_high > row.difference_low else "",
            )
            for row in own.itertuples()
        ]
        headings = ("couplings", "before", "long after", "above .9", "difference to frozen")
        print_table(console, f"Cosine of heading to the goal; breaks: {breaks} (95 % interval)", headings, rows, text=1)


def flock_in_short(path: Path) -> str:
    """How well the best coupling does, beside frozen ones."""
    table = Run(path).table("flock.csv")
    own = table[table.breaks == table.breaks.iloc[-1]].set_index("coupling").long_after.groupby(level=0).first()
    return ", ".join(f"{name} {value:.2f}" for name, value in own.sort_values(ascending=False).head(3).items())


def print_leaderboard(path: Path, console: Console) -> None:
    """Print how well each method did."""
    from epuckhebb.analysis import leaderboard as board  # brings statistics

    methods = Run(path).table("leaderboard.csv")
    for experiment, own in methods.groupby("experiment", sort=False):
        rows = []
        for row in own.itertuples():
            success = rescue.share(row.success, row.success_low, row.success_high)
            difference = "" if math.isnan(row.difference) else rescue.difference(row)
            rows.append((row.method, row.kind, f"{row.solved} of {row.champions}", success, difference))
        headings = [name for name in board.head(str(experiment)) if name != "knowledge"]
        headings = [headings[k] for k in (0, 1, 2, 3, 6)]
        print_table(console, f"{board.title(str(experiment))} (95 % interval)", headings, rows, text=2)


def leaderboard_in_short(path: Path) -> str:
    """The best method of each experiment."""
    methods = Run(path).table("leaderboard.csv").sort_values("success", ascending=False, kind="stable")
    best = methods.groupby("experiment").first()
    return ", ".join(f"{row.Index}: {row.method} {row.success:.2f}" for row in best.itertuples())


def print_sweep(folder: Path, console: Console) -> None:
    """Print the success of each condition, or rescue and harm, and where the tables are."""
    if Run(folder).has("rescue_over_all.csv"):
        print_rescue(folder, console)
    else:
        print_summary(folder, console)
    print_line(console, f"Tables: {folder}/: sweep.csv (every lifetime), summary.csv, failed.csv")


def sweep_in_short(folder: Path) -> str:
    """How many rows the summary has."""
    return f"success of {len(Run(folder).table('summary.csv'))} conditions, controllers and sides"


def print_rescue(folder: Path, console: Console) -> None:
    """Print what each plasticity rescued and harmed."""
    over_all = Run(folder).table("rescue_over_all.csv")
    rows = [
        (row.experiment, rescue.label(row.controller, row.N), *rescue.counts(row), rescue.in_training(row))
        for row in over_all.itertuples()
    ]
    headings = ("experiment", "plasticity", rescue.RESCUED, rescue.HARMED, rescue.IN_TRAINING)
    print_table(console, "Rescue and harm (95 % interval over champions)", headings, rows, text=2)
    print_line(
        console, f"Rescue and harm: {folder}/: report.md, rescue_over_all.csv, rescue_and_harm.csv, retention.csv"
    )


def print_summary(folder: Path, console: Console) -> None:
    """Print the success of each condition and controller on both sides; over champions if there are several."""
    if Run(folder).has("over_champions.csv"):
        table = Run(folder).table("over_champions.csv").rename(columns={"champions": "n"})
        _print_success(table, "mean over {} champions", " over champions", console)
        print_line(console, f"Over champions: {folder}/over_champions.csv; each champion: {folder}/summary.csv")
    else:
        ends = {f"success_noise_{end}": f"success_{end}" for end in ("low", "high")}
        table = Run(folder).table("summary.csv").rename(columns=ends)
        _print_success(table, "{} lifetimes each", ": noise only, this champion", console)
        print_line(console, f"Means of all else: {folder}/summary.csv")
    if Run(folder).has("figures/dose_response.png"):
        print_line(console, f"Success and weight change against N: {folder}/figures/dose_response.png")


def _print_success(summary: "pd.DataFrame", of: str, interval_is: str, console: Console) -> None:
    """Print a row for each condition and controller, named by what differs between them.

    summary: up to `n`, columns that tell conditions apart. of: what the n counts. interval_is: what it is about.
    """
    conditions = list(summary.columns[: summary.columns.get_loc("n")])
    of_plasticity = summary[summary.controller != GA] if (summary.controller != GA).any() else summary
    differ = [name for name in conditions if name == "controller" or of_plasticity[name].nunique() > 1]
    apart = ("controller", "side")  # two controllers may have the same of all else
    alike = {tuple(of_plasticity[name].factorize()[0]): name for name in differ if name not in apart}
    shown = [*alike.values(), "controller"]  # of columns that tell the same, the last: a genome is known by its name
    same = summary.n.nunique() == 1
    rewarded = "rewarded_share" in summary and summary.rewarded_share.notna().all()
    rows: dict[tuple[str, ...], dict[str, str]] = {}
    for row in summary.to_dict("records"):
        place = tuple(_cell(row[name]) for name in shown)
        value = f"{row['success']:.2f} ({row['success_low']:.2f}–{row['success_high']:.2f})"
        if rewarded:
            ends = [row[name] for name in ("rewarded_share_low", "rewarded_share_high") if name in row]
            value = f"{row['rewarded_share']:.3f}" + (" ({:.3f}–{:.3f})".format(*ends) if ends else "")
        rows.setdefault(place, {})[row["side"]] = value + ("" if same else f" of {row['n']}")
    if rows:
        each = [of.format(summary.n.iloc[0])] if same else []
        has_interval = not rewarded or "rewarded_share_low" in summary
        facts = "; ".join([*each, *([f"95 % interval{interval_is}"] if has_interval else [])])
        title = "Rewarded share, by the end that is rewarded first" if rewarded else "Success"
        headings = (*shown, *(side if rewarded else f"success, {side}" for side in SIDES))
        cells = ((*place, *(found.get(side, "") for side in SIDES)) for place, found in rows.items())
        print_table(console, f"{title} ({facts})" if facts else title, headings, cells, text=len(shown))
    names = set(summary.get("genome", []))
    if len(names) == 1 and is_bundled(name := str(names.pop())):
        from epuckhebb.runs import showcase  # runs take a while to load, and most of what is shown has no such note

        notes = {showcase(load_genome(name, experiment)) for experiment in EXPERIMENTS} - {""}
        for note in sorted(notes):
            console.print(Text(note))


def _cell(value: Any) -> str:
    return str(value) if not isinstance(value, float) else "" if math.isnan(value) else f"{value:g}"


KINDS = {  # file of results -> what prints all of them, and what says them in short
    "claims.csv": (print_reproduction, reproduction_in_short),
    "flock.csv": (print_flock, flock_in_short),
    "leaderboard.csv": (print_leaderboard, leaderboard_in_short),
    "summary.csv": (print_sweep, sweep_in_short),
    "reversal.csv": (print_reversal, reversal_in_short),  # it has metrics.csv, too
    "metrics.csv": (print_evaluation, evaluation_in_short),
    "history.csv": (print_evolution, evolution_in_short),
}


def print_results(path: Path, console: Console, metrics: Rows | None = None) -> None:
    """Print the results of a run; nothing of a study that has not written its tables yet.

    metrics: the lifetimes of an evaluation; read unless given.
    """
    kind = next((file for file in KINDS if Run(path).has(file)), None)
    if kind == "metrics.csv":
        print_evaluation(path, console, metrics)
    elif kind:
        KINDS[kind][0](path, console)
    if Run(path).has("report.html"):
        print_line(console, f"Report: {path}/report.html")
