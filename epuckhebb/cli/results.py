"""Prints the tables of results: of an evaluation or an evolution, and of studies."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.text import Text

from epuckhebb.analysis import environments, reversal, tables
from epuckhebb.analysis.evaluate import Rows
from epuckhebb.analysis.tables import unmarked
from epuckhebb.cli.console import print_line, print_table, print_text
from epuckhebb.store import Run

if TYPE_CHECKING:
    from epuckhebb.studies.study import Study

_LISTED = 20  # jobs of a study that is not run


def print_evaluation(run: Run, console: Console) -> None:
    """Print the paper's table of a run, or the rewarded share of each controller, and what belongs to it."""
    metrics, below = run.rows("metrics.csv"), run.provenance.get("notes", [])
    if run.has("lifetime.csv"):
        first, repeats = metrics[0], len({row["repeat"] for row in metrics})
        change = first["change"] or "nothing changes"
        title = (
            f"{first['environment']}, {change}: genome {first['genome']}, {repeats} lifetimes (seed {first['seed']})"
        )
        _print(environments.readable(run.table("table.csv"), title), console)
        for note in below:
            print_line(console, note)
        return
    if run.has("reversal.csv"):
        _print(reversal.readable(run.table("reversal.csv"), _title(metrics)).only(0, 1, 2), console)
    else:
        text = tables.formatted(tables.paper_table(metrics))
        rows = [(*place, *cells.values()) for place, cells in text.items()]
        print_table(console, _title(metrics), ("controller", "side", *tables.ROWS), rows, text=2)
        if saturated := tables.saturation(metrics):
            print_line(console, saturated)
        drove_on = sum(row["success"] == 0 and (row["time_to_goal_s"] or math.nan) > 0 for row in metrics)
        if drove_on:
            of = f"{drove_on} of {len(metrics)} lifetimes"
            print_line(console, f"{of} reached the goal and drove on; success counts at the end.")
    for note in below:
        print_text(console, Text(note))


def print_evolution(run: Run, console: Console) -> None:
    """Print how fitness rose."""
    history = run.rows("history.csv")
    first, last = history[0], history[-1]
    best = f"best fitness {first['best_fitness']:.3f} → {last['best_fitness']:.3f}"
    mean = f"mean {first['mean_fitness']:.3f} → {last['mean_fitness']:.3f}"
    console.print(Text(f"{len(history)} generations: {best}, {mean}."))


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


def print_jobs(found: dict[str, Any], console: Console) -> None:
    """List the first jobs of a study that is not run. found: as in its JSON."""
    folder, listed = found["folder"], found["jobs"]
    rows = [(n, "done" if job["done"] else "to do", job["what"]) for n, job in enumerate(listed[:_LISTED])]
    print_table(console, f"{len(listed)} jobs in {folder}/", ("job", "", "what"), rows, text=3)
    if len(listed) > _LISTED:
        print_line(console, f"... and {len(listed) - _LISTED} more; --json lists all.")
    done = sum(job["done"] for job in listed)
    print_line(console, f"{done} done, {len(listed) - done} to do; nothing was run.")


def print_results(path: Path, console: Console, study: "type[Study] | None" = None) -> None:
    """Print the results of a run or of a study; nothing of a study that has not written its tables yet.

    study: the class of a study that has just run; the file of a user's is not loaded to show a folder.
    """
    run = Run(path)
    if run.has("sweep.json"):
        from epuckhebb.studies.study import Study, study_named  # studies take a while to load

        reference = run.json("sweep.json")["name"]
        study = study or (Study if ":" in reference else study_named(reference))
        if run.has(study.result):
            print_study(study, path, console)
    elif run.provenance["command"] == "sweep":  # a job of a user's study, whose tables may have any columns
        pass
    elif run.has("metrics.csv"):
        print_evaluation(run, console)
    elif run.has("history.csv"):
        print_evolution(run, console)
    if run.has("report.html"):
        print_line(console, f"Report: {path}/report.html")


def _print(table: tables.Table, console: Console) -> None:
    rows = [[unmarked(cell) for cell in row] for row in table.rows]
    print_table(console, table.title, list(map(unmarked, table.headings)), rows, text=table.text)


def print_study(study: "type[Study]", path: Path, console: Console) -> None:
    """Print the tables over all runs of a study or a multirun, and name its files."""
    run = Run(path)
    for table in study.shown(run):
        _print(table, console)
    for what, files in (("Tables", sorted(path.glob("*.csv"))), ("Figures", sorted(path.glob("figures/*.png")))):
        if files:
            print_line(console, f"{what}: {files[0].parent}/: {', '.join(file.name for file in files)}")
