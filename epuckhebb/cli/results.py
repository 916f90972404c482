"""Prints the tables of results: of an evaluation or an evolution, and of studies."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.text import Text

from epuckhebb.analysis import tables
from epuckhebb.analysis.evaluate import Rows
from epuckhebb.analysis.tables import unmarked
from epuckhebb.cli.console import print_line, print_table
from epuckhebb.store import Run, is_bundled, load_genome
from epuckhebb.tmaze.scenario import EXPERIMENTS

if TYPE_CHECKING:
    from epuckhebb.studies.study import Study

_LISTED = 20  # jobs of a study that is not run


def print_evaluation(path: Path, console: Console, metrics: Rows | None = None) -> None:
    """Print the paper's table of a run, and what belongs to it. metrics: its lifetimes; read unless given."""
    metrics = metrics or Run(path).rows("metrics.csv")
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
    _print_notes(path, console)


def print_trials(path: Path, console: Console) -> None:
    """Print the rewarded share of each controller, beside chance and the optimum."""
    rows = []
    for row in Run(path).rows("reversal.csv"):
        interval = "" if row["low"] is None else f"{row['low']:.3f}–{row['high']:.3f}"
        rows.append((row["controller"], f"{row['rewarded_share']:.3f}", interval))
    title = _title(Run(path).rows("metrics.csv"))
    print_table(console, title, ("controller", "rewarded share", "95 % interval"), rows)
    _print_notes(path, console)


def print_evolution(path: Path, console: Console) -> None:
    """Print how fitness rose, and how well the fittest of the last generation did, where a lifetime has one goal."""
    history = Run(path).rows("history.csv")
    first, last = history[0], history[-1]
    best = f"best fitness {first['best_fitness']:.3f} → {last['best_fitness']:.3f}"
    mean = f"mean {first['mean_fitness']:.3f} → {last['mean_fitness']:.3f}"
    share = f"; the fittest reached its goal in {100 * last['best_success']:.0f} % of its training lifetimes"
    has_trials = bool(load_genome(str(path), "").task)
    console.print(Text(f"{len(history)} generations: {best}, {mean}{'' if has_trials else share}."))


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
    """List the first jobs of a study that is not run. found: as in its JSON."""
    folder, listed = found["folder"], found["jobs"]
    rows = [(n, "done" if job["done"] else "to do", job["what"]) for n, job in enumerate(listed[:_LISTED])]
    print_table(console, f"{len(listed)} jobs in {folder}/", ("job", "", "what"), rows, text=3)
    if len(listed) > _LISTED:
        print_line(console, f"... and {len(listed) - _LISTED} more; --json lists all.")
    done = sum(job["done"] for job in listed)
    print_line(console, f"{done} done, {len(listed) - done} to do; nothing was run.")


def print_results(path: Path, console: Console, metrics: Rows | None = None) -> None:
    """Print the results of a run or of a study; nothing of a study that has not written its tables yet.

    metrics: the lifetimes of an evaluation; read unless given.
    """
    run = Run(path)
    if (study := study_in(path)) is not None:
        if run.has(study.result):
            print_study(study, path, console)
    elif run.provenance["command"] == "sweep":  # a job of a user's study, whose tables may have any columns
        pass
    elif run.has("reversal.csv"):  # it has metrics.csv, too
        print_trials(path, console)
    elif run.has("metrics.csv"):
        print_evaluation(path, console, metrics)
    elif run.has("history.csv"):
        print_evolution(path, console)
    if run.has("report.html"):
        print_line(console, f"Report: {path}/report.html")


def print_study(study: "type[Study]", path: Path, console: Console) -> None:
    """Print the tables over all runs of a study or a multirun, and name its files."""
    run = Run(path)
    for table in study.shown(run):
        rows = [[unmarked(cell) for cell in row] for row in table.rows]
        print_table(console, table.title, list(map(unmarked, table.headings)), rows, text=table.text)
    summary = run.table("summary.csv") if run.has("summary.csv") else {}
    names = set(summary.get("genome", []))
    if len(names) == 1 and is_bundled(name := str(names.pop())):
        from epuckhebb.runs import showcase  # runs take a while to load, and most of what is shown has no such note

        for note in sorted({showcase(load_genome(name, experiment)) for experiment in EXPERIMENTS} - {""}):
            console.print(Text(note))
    for what, files in (("Tables", sorted(path.glob("*.csv"))), ("Figures", sorted(path.glob("figures/*.png")))):
        if files:
            print_line(console, f"{what}: {files[0].parent}/: {', '.join(file.name for file in files)}")


def in_short(path: Path) -> str:
    """The result of a finished run or study in a few words; for each controller of an evaluation a line."""
    run = Run(path)
    if run.has("sweep.json"):
        return f"tables: {', '.join(file.name for file in sorted(path.glob('*.csv')))}"
    if run.has("reversal.csv"):
        shares = (f"{row['controller']} {row['rewarded_share']:.2f}" for row in run.rows("reversal.csv"))
        return f"rewarded share: {', '.join(shares)}"
    if run.has("history.csv"):
        return f"best fitness {run.rows('history.csv')[-1]['best_fitness']:.3f}"
    success = {place: means["Success"] for place, means in tables.paper_table(run.rows("metrics.csv")).items()}
    return "\n".join(
        f"{name} success {success.get((name, 'left'), math.nan):.2f} left "
        f"{success.get((name, 'right'), math.nan):.2f} right"
        for name in dict.fromkeys(name for name, _ in success)
    )


def study_in(path: Path) -> "type[Study] | None":
    """The class of the study of a folder, `Study` for a user's, whose file is not loaded; None in another folder."""
    if not Run(path).has("sweep.json"):
        return None
    from epuckhebb.studies.study import Study, study_named  # studies take a while to load

    reference = Run(path).json("sweep.json")["name"]
    return Study if ":" in reference else study_named(reference)
