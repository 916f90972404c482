"""Prints the results of one evaluation or evolution."""

import math
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.text import Text

from epuckhebb.analysis import tables
from epuckhebb.analysis.evaluate import Rows
from epuckhebb.analysis.self_checks import in_words
from epuckhebb.cli.console import print_line, print_table
from epuckhebb.config import settings
from epuckhebb.store import CONFIG, Run, read_findings


def print_evaluation(path: Path, console: Console, metrics: Rows | None = None) -> None:
    """Print the paper's table of a run, and what belongs to it. metrics: its lifetimes; read unless given."""
    print_metrics(metrics or Run(path).rows("metrics.csv"), console)
    _print_notes_and_findings(path, console)


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
    _print_notes_and_findings(path, console)


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


def _print_notes_and_findings(path: Path, console: Console) -> None:
    """Print what a reader of the table must know, and what robots found in their self-checks."""
    for note in Run(path).provenance.get("notes", []):
        console.print(Text(note))
    findings = in_words(read_findings(Run(path)))
    if findings:
        rows = [(side, text, count) for side, counts in findings.items() for text, count in counts]
        print_table(console, "Found by the self-check", ("side", "it found", "lifetimes"), rows, text=2)
