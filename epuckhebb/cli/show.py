"""Prints what a run or a folder of runs holds, in the terminal or as JSON."""

import re
import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table
from rich.text import Text

from epuckhebb.analysis.evaluate import Rows
from epuckhebb.cli import show_run, show_study
from epuckhebb.cli.console import print_line
from epuckhebb.cli.show_genome import genome_as_json, genomes_named, print_champion
from epuckhebb.config import settings
from epuckhebb.runtime import ConfigError, conf
from epuckhebb.store import CONFIG, Run, below_runs, load_genome, of_multirun, resolve_run

_LATEST = 10  # runs that are listed when none is named
_NEEDED = re.compile(r"(hebbian|network|physics|robot)[.=]")  # settings without which a champion is not what it was
_CHANGED = {"light": "lowlight", "obstacles": "4obstacles"}  # a changed world of each experiment
_MANY = 6  # files of a folder that are counted and not named


KINDS = {  # file of results -> what prints all of them, and what says them in short
    "claims.csv": (show_study.print_reproduction, show_study.reproduction_in_short),
    "flock.csv": (show_study.print_flock, show_study.flock_in_short),
    "leaderboard.csv": (show_study.print_leaderboard, show_study.leaderboard_in_short),
    "summary.csv": (show_study.print_sweep, show_study.sweep_in_short),
    "reversal.csv": (show_run.print_reversal, show_run.reversal_in_short),  # it has metrics.csv, too
    "metrics.csv": (show_run.print_evaluation, show_run.evaluation_in_short),
    "history.csv": (show_run.print_evolution, show_run.evolution_in_short),
}


def print_results(path: Path, console: Console, metrics: Rows | None = None) -> None:
    """Print the results of a run; nothing of a study that has not written its tables yet.

    metrics: the lifetimes of an evaluation; read unless given.
    """
    kind = next((file for file in KINDS if Run(path).has(file)), None)
    if kind == "metrics.csv":
        show_run.print_evaluation(path, console, metrics)
    elif kind:
        KINDS[kind][0](path, console)


def print_finished(finished: list[Path], console: Console, *, reported: bool = False) -> None:
    """Print the results of the runs of one call: all of one run unless reported before, a table over many."""
    if len(finished) == 1:
        if not reported:
            print_results(finished[0], console)
        print_line(console, f"Run folder: {finished[0]}")
        if Run(finished[0]).has("champion.npz"):
            _print_next_steps(finished[0], console)
    elif finished:
        _print_multirun(finished, console, each=not Run(finished[0].parent).has("summary.csv"))


def _print_next_steps(run: Path, console: Console) -> None:
    """Print what to type to see the champion of a new evolution, and to evaluate it."""
    champion = load_genome(str(run), "")
    if champion.task:
        settings = f"task={champion.task} hebbian={champion.rule or 'none'} repeats=100"
        print_line(console, f"To evaluate it in new lifetimes: epuckhebb evaluate genome=latest {settings}")
    else:
        changed = _CHANGED[champion.nominal.experiment if champion.nominal else "obstacles"]
        print_line(console, "What it remembers of its training world: epuckhebb show latest")
        needed = [word for word in Run(run).provenance["overrides"] if _NEEDED.match(word)]
        words = " ".join(["genome=latest", f"scenario={changed}", *map(shlex.quote, needed)])
        print_line(console, f"To evaluate it in a changed world: epuckhebb evaluate {words}")


def _print_multirun(finished: list[Path], console: Console, *, each: bool) -> None:
    """Print each run of a multirun if so wished, then the tables over all runs, and where they are."""
    for path in finished if each else ():
        _print_in_short(console, f"{path.name}  {' '.join(Run(path).provenance['overrides'])}", _in_short(path))
    folder = finished[0].parent
    if Run(folder).has("summary.csv"):
        show_study.print_summary(folder, console)
    if Run(folder).has("rescue_over_all.csv"):
        show_study.print_rescue(folder, console)
    print_line(console, f"Run folders: {folder}/{finished[0].name} to {folder}/{finished[-1].name}")


def show(what: str | None, console: Console) -> None:
    """Print all of a run, a multirun or a champion; the latest runs if nothing is named."""
    if what is None:
        _print_latest(console)
        return
    genomes = genomes_named(what)
    for genome, experiment in genomes:
        console.print(Text(f"{genome.name}, of the {experiment} experiment", style="bold"))
        print_line(console, f"SHA-256 of its genes: {genome.sha256}")
        print_champion(genome, console)
    if not genomes:
        path = resolve_run(what)
        many = of_multirun(path)
        if many:
            _print_multirun(many, console, each=True)
        else:
            _print_run(path, console)


def shown_as_json(what: str | None) -> dict[str, Any]:
    """What `show` prints, as JSON values."""
    if what is None:
        return {"runs": [str(path) for path in below_runs()]}
    genomes = genomes_named(what)
    if genomes:
        return {"genomes": [genome_as_json(genome, experiment) for genome, experiment in genomes]}
    path = resolve_run(what)
    many = of_multirun(path)
    return {"run": str(path), "runs": list(map(as_json, many))} if many else as_json(path)


def as_json(path: Path) -> dict[str, Any]:
    """Provenance, status and results of a run, as JSON values."""
    run = Run(path)
    values = {"run": str(path), **run.provenance, "status": run.status}
    for name in ("metrics", "history", "leaderboard", "flock"):
        if run.has(f"{name}.csv"):
            values[name] = run.rows(f"{name}.csv")
    return values


def _print_latest(console: Console) -> None:
    """Print the results of the latest runs in short, the last one last."""
    known = below_runs()
    if not known:
        print_line(console, f"There are no runs in {Path('runs').absolute()} yet; begin with: epuckhebb evaluate")
    elif len(known) > _LATEST:
        print_line(console, f"The latest of {len(known)} runs:")
    for path in known[-_LATEST:]:
        try:
            result = _in_short(path)
        except ConfigError as error:
            result = str(error)
        _print_in_short(console, str(path), result)


def _print_in_short(console: Console, run: str, result: str) -> None:
    """Print a run in a line of its own, which can be copied whole, and its result below it."""
    console.print(Text(run, style="bold"), soft_wrap=True)
    for line in result.splitlines():
        print_line(console, f"  {line}")


def _in_short(path: Path) -> str:
    status = Run(path).status
    if status["state"] != "finished":
        return ": ".join(filter(None, (status["state"], status.get("error", ""))))
    return next(in_short for file, (_, in_short) in KINDS.items() if Run(path).has(file))(path)


def _print_run(path: Path, console: Console) -> None:
    """Print all of a run: its command, settings, program and state, then its results."""
    run, status = Run(path).provenance, Run(path).status
    code = run["code"]
    commit = f", commit {code['commit'][:10]}{' with changes' if code['dirty'] else ''}" if code["commit"] else ""
    science = f", science {code['science']}" if "science" in code else ""
    resumed = [
        again["started"] + (f" after {again['generations']}" if "generations" in again else "")
        for again in run.get("resumed", [])
    ]
    own_code = [pair for own in run.get("own_code", {}).values() for pair in own["sha256"].items()]
    facts = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    facts.add_column(style="bold")
    facts.add_column(overflow="fold")
    for name, value in {
        "Command": " ".join(run["command_line"]),
        "Overrides": " ".join(run["overrides"]),
        "State": status["state"] + (f": {status['error']}" if status.get("error") else ""),
        "Time": f"{status['started']} – {status.get('finished', '')}" if "started" in status else "",
        "Resumed": ", ".join(resumed),
        "Settings": " ".join(_settings(path)),
        "Program": f"epuckhebb {code['version']}{commit}{science}, Python {run['python']}",
        "Packages": ", ".join(f"{name} {number}" for name, number in run["packages"].items() if name != "epuckhebb"),
        "Machine": f"{run['platform']}, {run['cores']} cores",
        "Own code": ", ".join(f"{file} (SHA-256 {sha256})" for file, sha256 in own_code),
        "Genome": f"{run['genome']} (SHA-256 {run['genome_sha256']})" if "genome" in run else "",
        "Files": ", ".join(_files(path)),
    }.items():
        if value:
            facts.add_row(name, Text(value))
    console.print(facts)
    if Run(path).has("champion.npz"):
        print_champion(load_genome(str(path), ""), console)
    print_results(path, console)


def _settings(path: Path) -> Iterator[str]:
    """The resolved configuration of a run, as it could be typed; of the maze and the robot, only their names."""
    if not Run(path).has(CONFIG):
        return
    config = settings(Run(path).config_file)
    for key in ("maze", "robot"):
        if isinstance(config.get(key), dict):
            config[key] = config[key].get("name")
    for key, value in conf.flat(config):
        yield f"{key}={value}"


def _files(path: Path) -> Iterator[str]:
    """The files of a folder; of the runs and the many files that are parts of a study only how many there are."""
    inside = 0
    for entry in sorted(path.iterdir()):
        names = sorted(str(file.relative_to(path)) for file in entry.rglob("*") if file.is_file())
        if entry.is_file():
            yield entry.name
        elif (entry / "status.json").is_file():
            inside += 1
        elif len(names) < _MANY:
            yield from names
        else:
            yield f"{entry.name}/ ({len(names)} files)"
    if inside:
        yield f"{inside} runs"
