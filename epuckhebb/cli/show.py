"""Prints the results of runs and studies, and what a run or a folder of runs holds, or gives its JSON."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.text import Text

from epuckhebb.analysis import tables
from epuckhebb.analysis.paper_table import PaperTable, saturation
from epuckhebb.analysis.tables import Rows, unmarked
from epuckhebb.cli.console import print_line, print_table, print_text
from epuckhebb.runtime import ConfigError
from epuckhebb.store import Genome, Run, list_runs, load_genome, multirun_runs, resolve_run
from epuckhebb.tmaze.outcome import End

if TYPE_CHECKING:
    from epuckhebb.studies.study import Study

_LISTED = 20  # jobs of a study that is not run
_LATEST = 10  # runs that are listed when none is named


def print_evaluation(run: Run, console: Console) -> None:
    """Print the paper's table of a run, or the rewarded share of each controller, and what belongs to it."""
    metrics, below = run.rows("metrics.csv"), run.provenance.get("notes", [])
    if run.has("lifetime.csv"):
        first, repeats = metrics[0], len({row["repeat"] for row in metrics})
        world = f"{first['environment']}, {first['change'] or 'nothing changes'}"
        title = f"{world}: genome {first['genome']}, {repeats} lifetimes (seed {first['seed']})"
        from epuckhebb.analysis import environments  # pandas takes a while to load

        rows = run.table("table.csv")
        _print(environments.readable(rows, title), console)
        below = [*below, *(environments.unreached(rows) if first["change"] else ())]
    elif run.has("reversal.csv"):
        from epuckhebb.analysis import reversal  # pandas takes a while to load

        table = reversal.readable(run.table("reversal.csv"), _title(metrics))
        _print(table.only("", "rewarded share", "95 % interval"), console)
    else:
        _print(PaperTable.from_rows(metrics).readable(_title(metrics)), console)
        if saturated := saturation(metrics):
            print_line(console, saturated)
        drove_on = sum(row["success"] == 0 and (row["time_to_goal_s"] or math.nan) > 0 for row in metrics)
        if drove_on:
            of = f"{drove_on} of {len(metrics)} lifetimes"
            print_line(console, f"{of} reached the goal and drove on; success counts at the end.")
        if wrong := sum(row["end"] == End.wrong for row in metrics):
            print_line(console, f"{wrong} of {len(metrics)} lifetimes end at the wrong goal.")
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
    """Print the first jobs of a study, as --dry-run lists them. found: its folder and its jobs, as in JSON."""
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
        from epuckhebb.studies.study import Study, find_study  # studies take a while to load

        reference = run.json("sweep.json")["name"]
        study = study or (Study if ":" in reference else find_study(reference))
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


def print_many(finished: list[Path], console: Console) -> None:
    """Print the tables over all runs of a multirun, or a line for each run, and where they are."""
    if not finished:
        return
    folder = finished[0].parent
    if Run(folder).has("summary.csv"):
        from epuckhebb.studies.sweep import Sweep  # studies take a while to load

        print_study(Sweep, folder, console)
    else:
        for path in finished:
            print_line(console, f"{path.name}  {' '.join(Run(path).provenance['overrides'])}  {_short_result(path)}")
    print_line(console, f"Run folders: {folder}/{finished[0].name} to {folder}/{finished[-1].name}")


def show(what: str | None, console: Console) -> None:
    """Print all of a run or a multirun; the latest runs if nothing is named."""
    if what is None:
        runs = list_runs()
        if not runs:
            print_line(console, f"There are no runs in {Path('runs').absolute()} yet; begin with: epuckhebb evaluate")
        elif len(runs) > _LATEST:
            print_line(console, f"The latest of {len(runs)} runs:")
        for path in runs[-_LATEST:]:
            try:
                result = _short_result(path)
            except ConfigError as error:
                result = str(error)
            print_line(console, f"{path}  {result}")
        return
    path = resolve_run(what)
    if many := multirun_runs(path):
        print_many(many, console)
    else:
        _print_run(path, console)


def shown_as_json(what: str | None) -> dict[str, Any]:
    """What `show` prints, as JSON values."""
    if what is None:
        return {"runs": [str(path) for path in list_runs()]}
    path = resolve_run(what)
    many = multirun_runs(path)
    return {"run": str(path), "runs": list(map(as_json, many))} if many else as_json(path)


def as_json(path: Path) -> dict[str, Any]:
    """Provenance, status and results of a run, as JSON values."""
    run = Run(path)
    values = {"run": str(path), **run.provenance, "status": run.status}
    for name in ("metrics", "history", "leaderboard", "flock"):
        if run.has(f"{name}.csv"):
            values[name] = run.rows(f"{name}.csv")
    return values


def _short_result(path: Path) -> str:
    """The state of a run, and its result in a few words."""
    run = Run(path)
    status = run.status
    if status["state"] != "finished":
        return ": ".join(filter(None, (status["state"], status.get("error", ""))))
    if run.has("history.csv"):
        return f"best fitness {run.rows('history.csv')[-1]['best_fitness']:.3f}"
    if run.has("reversal.csv"):
        shares = (f"{row['controller']} {row['rewarded_share']:.2f}" for row in run.rows("reversal.csv"))
        return f"rewarded share: {', '.join(shares)}"
    if not run.has("metrics.csv"):
        return "finished"
    if run.has("lifetime.csv"):
        return "return: " + ", ".join(f"{row['controller']} {row['return']:.0f}" for row in run.rows("table.csv"))
    means = PaperTable.from_rows(run.rows("metrics.csv")).means
    return "success: " + ", ".join(f"{name} {side} {column['Success']:.2f}" for (name, side), column in means.items())


def _print_run(path: Path, console: Console) -> None:
    """Print the results of a run, then how it was made: its command, program and files."""
    run, status = Run(path).provenance, Run(path).status
    print_results(path, console)
    if Run(path).has("champion.npz"):
        print_champion(load_genome(str(path), ""), console)
    code = run["code"]
    commit = f", commit {code['commit'][:10]}{' with changes' if code['dirty'] else ''}" if code["commit"] else ""
    for name, value in {
        "Command": " ".join(run["command_line"]),
        "State": status["state"] + (f": {status['error']}" if status.get("error") else ""),
        "Time": f"{status['started']} – {status.get('finished', '')}" if "started" in status else "",
        "Program": f"epuckhebb {code['version']}{commit}; packages and machine: provenance.json",
        "Genome": f"{run['genome']} (SHA-256 {run['genome_sha256']})" if "genome" in run else "",
        "Files": ", ".join(sorted(f"{entry.name}/" if entry.is_dir() else entry.name for entry in path.iterdir())),
    }.items():
        if value:
            print_line(console, f"{name}: {value}")


def print_champion(genome: Genome, console: Console) -> None:
    """What a champion is made of, and what it remembers of its training world."""
    robot = "" if genome.environment else f"; robot {genome.robot}"
    print_line(console, f"Genome: {genome.plan.text()}; network {genome.network}{robot}")
    facts = ("optimizer", "start", "environment", "training", "physics", "rule", "task", "fitness_function")
    known = {fact: getattr(genome, fact) for fact in facts if getattr(genome, fact)}
    print_line(console, f"Evolved: {', '.join(f'{fact} {value}' for fact, value in known.items())}")
    if genome.nominal is not None:
        where, gain = genome.nominal.scenario, genome.nominal.gain_rad_s
        print_line(console, f"Nominal statistics: of {where} at {gain:g} rad/s, in its file")
