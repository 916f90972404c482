"""What the terminal says of runs: the paper's table, how an evolution went, where the files are."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import yaml
from numpy.typing import NDArray
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from epuckhebb.app import genomes, runs
from epuckhebb.sim.epuck import SENSORS
from epuckhebb.sim.memory import Memory
from epuckhebb.study import rescue, tables


def tell(finished: list[Path], console: Console) -> None:
    """Say what the runs of one call came to: the table of one, a line for each of many."""
    if len(finished) == 1:
        _results(finished[0], console)
        console.print(f"Run folder: {finished[0]}", markup=False, highlight=False, soft_wrap=True)
    elif finished:
        console.print(_overview(finished))
        console.print(f"Run folders: {finished[0].parent}/", markup=False, highlight=False, soft_wrap=True)


def tell_reproduction(path: Path, console: Console) -> None:
    """Say what a reproduction found of the paper's claims, and where its report is."""
    claims = pd.read_csv(path / "claims.csv")
    shown = Table(title="The paper's claims", title_justify="left", title_style="bold")
    for heading in ("experiment", "claim", "verdict", "true in"):
        shown.add_column(heading, overflow="fold")
    for row in claims.itertuples():
        shown.add_row(str(row.experiment), str(row.claim), str(row.verdict), f"{row.true} of {row.n}")
    console.print(shown)
    console.print(f"Report: {path}/report.html", markup=False, highlight=False, soft_wrap=True)


def tell_jobs(folder: Path, listed: list[dict[str, Any]], console: Console) -> None:
    """List the jobs of a sweep that is not run."""
    shown = Table(title=f"{len(listed)} jobs in {folder}/", title_justify="left", title_style="bold")
    for heading in ("job", "", "overrides"):
        shown.add_column(heading, overflow="fold")
    for number, job in enumerate(listed):
        shown.add_row(str(number), "done" if job["done"] else "to do", " ".join(job["overrides"]))
    console.print(shown)


def tell_sweep(folder: Path, console: Console) -> None:
    """Say what a sweep came to: the success of each condition, and where its tables are."""
    if (folder / "rescue_over_all.csv").is_file():
        _tell_rescue(folder, console)
        return
    summary = pd.read_csv(folder / "summary.csv", keep_default_na=False)
    conditions = list(summary.columns[: summary.columns.get_loc("n")])
    told = [name for name in conditions if name in ("controller", "side") or summary[name].nunique() > 1]
    shown = Table(title="Success (95 % interval)", title_justify="left", title_style="bold")
    for heading in (*told, "success", "n"):
        shown.add_column(heading, overflow="fold")
    for row in summary.to_dict("records"):
        interval = f"{row['success']:.2f} ({row['success_low']:.2f}–{row['success_high']:.2f})"
        shown.add_row(*(str(row[name]) for name in told), interval, str(row["n"]))
    if len(summary):
        console.print(shown)
    tables = "sweep.csv (every lifetime), summary.csv, failed.csv"
    console.print(f"Tables: {folder}/: {tables}", markup=False, highlight=False, soft_wrap=True)


def _tell_rescue(folder: Path, console: Console) -> None:
    """What a sweep over champions and worlds came to: rescue and harm of each plasticity."""
    table = Table(title="Rescue and harm (95 % interval)", title_justify="left", title_style="bold")
    for heading in ("experiment", "plasticity", "rescued of broken", "harmed of sound", "at home"):
        table.add_column(heading, overflow="fold")
    for row in pd.read_csv(folder / "rescue_over_all.csv", keep_default_na=False, na_values=[""]).itertuples():
        cells = [rescue.count(row, "rescued", "broken"), rescue.count(row, "harmed", "sound")]
        home = f"{row.home_harmed} of {row.home_mastered}"
        table.add_row(str(row.experiment), rescue.label(str(row.controller), float(row.N)), *cells, home)
    console.print(table)
    told = "report.md, rescue_over_all.csv, rescue_and_harm.csv, sweep.csv (every lifetime), summary.csv, failed.csv"
    console.print(f"Tables: {folder}/: {told}", markup=False, highlight=False, soft_wrap=True)


def show(path: Path, console: Console) -> None:
    """Tell all of a run: what was asked, by which program, how it ended, and its results.

    Raises:
        ConfigError: it is not a run folder.
    """
    told = runs.read(path)
    status, code = told["status"], told["code"]
    commit = f", commit {code['commit'][:10]}{' with changes' if code['dirty'] else ''}" if code["commit"] else ""
    science = f", science {code['science']}" if "science" in code else ""
    facts = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    facts.add_column(style="bold")
    facts.add_column(overflow="fold")
    for name, value in {
        "Command": " ".join(told["command"]),
        "Overrides": " ".join(told["overrides"]),
        "State": status["state"] + (f": {status['error']}" if status.get("error") else ""),
        "Time": f"{status['started']} – {status.get('finished', '')}",
        "Resumed": ", ".join(f"{again['started']} after {again['generations']}" for again in told.get("resumed", [])),
        "Settings": " ".join(_settings(path)),
        "Program": f"epuckhebb {code['version']}{commit}{science}, Python {told['python']}",
        "Packages": ", ".join(f"{name} {number}" for name, number in told["packages"].items() if name != "epuckhebb"),
        "Machine": f"{told['platform']}, {told['cores']} cores",
        "Genome": f"{told['genome']} (SHA-256 {told['genome_sha256']})" if "genome" in told else "",
        "Files": ", ".join(sorted(str(file.relative_to(path)) for file in path.rglob("*") if file.is_file())),
    }.items():
        if value:
            facts.add_row(name, escape(value))
    console.print(facts)
    _results(path, console)


def _settings(path: Path) -> Iterator[str]:
    """The resolved configuration of a run, as it could be typed."""

    def below(node: dict[str, Any], prefix: str) -> Iterator[str]:
        for key, value in node.items():
            if isinstance(value, dict):
                yield from below(value, f"{prefix}{key}.")
            else:
                yield f"{prefix}{key}={'null' if value is None else value}"

    file = path / ".hydra" / "config.yaml"
    if file.is_file():
        yield from below(yaml.safe_load(file.read_text()), "")


def as_json(path: Path) -> dict[str, Any]:
    """Provenance, status and results of a run, as JSON values.

    Raises:
        ConfigError: it is not a run folder.
    """
    told = {"run": str(path), **runs.read(path)}
    for name in ("metrics", "history"):
        if (path / f"{name}.csv").is_file():
            frame = pd.read_csv(path / f"{name}.csv", keep_default_na=False, na_values=[""])
            told[name] = frame.astype(object).where(frame.notna(), None).to_dict("records")
    return told


def _results(path: Path, console: Console) -> None:
    if (path / "metrics.csv").is_file():
        console.print(_paper_table(pd.read_csv(path / "metrics.csv", keep_default_na=False, na_values=[""])))
    if (path / "champion.npz").is_file():
        _tell_memory(genomes.load(str(path), "").memory, console)
    if (path / "history.csv").is_file():
        history = pd.read_csv(path / "history.csv")
        last = history.iloc[-1]
        console.print(
            f"{len(history)} generations: best fitness {history.best_fitness.iloc[0]:.3f} → {last.best_fitness:.3f}, "
            f"mean {history.mean_fitness.iloc[0]:.3f} → {last.mean_fitness:.3f}; the champion reached its goal in "
            f"{100 * last.best_success:.0f} % of its training lifetimes.",
            highlight=False,
        )


def _tell_memory(memory: Memory | None, console: Console) -> None:
    """What a champion remembers of its training world."""
    if memory is None:
        return
    title = f"Memory of {memory.scenario} at {memory.gain_rad_s:g} rad/s"
    shown = Table(title=title, title_justify="left", title_style="bold")
    for heading in ("", "left (lamp off)", "right (lamp on)"):
        shown.add_column(heading)
    for name, numbers in {
        "At the goal in the end": memory.success,
        "Slowest arrival (s)": memory.time_to_goal_s,
        "Longest away afterwards (s)": memory.away_s,
    }.items():
        shown.add_row(name, *("never" if np.isnan(number) else f"{number:g}" for number in numbers.round(2)))
    shown.add_row(f"Least live fitness, over {memory.fitness.shape[1]} s", *map(_course, memory.fitness))
    for kind, first in (("Light", 0), ("Proximity", SENSORS)):
        for place in range(SENSORS):
            means, spreads = memory.reading_mean[:, first + place], memory.reading_spread[:, first + place]
            told = (f"{mean:.2f} ± {spread:.2f}" for mean, spread in zip(means, spreads, strict=True))
            shown.add_row(f"{kind} reading {place}", *told)
    console.print(shown)


def _course(fitness: NDArray[np.float64]) -> str:
    """The course of fitness as twelve bars from 0 to 1, and the means of its first and last twelfth."""
    parts = [part.mean() for part in np.array_split(fitness, 12)]
    return "".join("▁▂▃▄▅▆▇█"[min(7, int(8 * max(0.0, part)))] for part in parts) + f" {parts[0]:.2f} → {parts[-1]:.2f}"


def _paper_table(metrics: pd.DataFrame) -> Table:
    text = tables.formatted(tables.paper_table(metrics))
    first = metrics.iloc[0]
    rates = metrics.N[metrics.N > 0].unique()
    rate = f", N = {', '.join(f'{N:g}' for N in rates)}" if len(rates) else ""
    repeats = metrics.repeat.nunique()
    shown = Table(
        title=f"{first.scenario}: genome {first.genome}{rate}, "
        f"mean of {repeats} lifetime{'s' if repeats > 1 else ''} a side (seed {first.seed})",
        title_justify="left",
        title_style="bold",
    )
    shown.add_column("")
    for column in text.columns:
        shown.add_column("\n".join(column), justify="right")
    for row, values in zip(text.index, text.to_numpy().tolist(), strict=True):
        shown.add_row(str(row), *values)
    return shown


def _overview(finished: list[Path]) -> Table:
    """A line for each run of a multirun."""
    shown = Table()
    for heading in ("run", "overrides", "result"):
        shown.add_column(heading, overflow="fold")
    for path in finished:
        told = runs.read(path)
        shown.add_row(path.name, " ".join(told["overrides"]), _in_short(path, told))
    return shown


def _in_short(path: Path, told: dict[str, Any]) -> str:
    if told["status"]["state"] != "finished":
        return f"{told['status']['state']}: {told['status'].get('error', '')}"
    if (path / "metrics.csv").is_file():
        success = pd.read_csv(path / "metrics.csv").groupby(["controller", "side"], sort=False).success.mean()
        controllers = success.index.get_level_values("controller").unique()
        return ", ".join(
            f"{name} success {success[name, 'left']:.2f} left {success[name, 'right']:.2f} right"
            for name in controllers
        )
    return f"best fitness {pd.read_csv(path / 'history.csv').best_fitness.iloc[-1]:.3f}"
