"""Prints the results of one evaluation or evolution."""

from pathlib import Path

import numpy as np
import pandas as pd
from rich.console import Console
from rich.text import Text

from epuckhebb.analysis import tables
from epuckhebb.analysis.self_checks import in_words
from epuckhebb.config.stored import settings
from epuckhebb.runtime.console import print_line, print_table
from epuckhebb.store import Run, read_findings


def print_evaluation(path: Path, console: Console) -> None:
    """Print the paper's table of a run, and what belongs to it."""
    print_metrics(Run(path).table("metrics.csv"), console)
    _print_notes_and_findings(path, console)


def print_metrics(metrics: pd.DataFrame, console: Console) -> None:
    """Print the paper's table, a row for each controller and side."""
    text = tables.formatted(tables.paper_table(metrics)).T
    rows = [(*place, *cells) for place, cells in zip(text.index, text.to_numpy().tolist(), strict=True)]
    print_table(console, _title(metrics), ("controller", "side", *text.columns), rows, text=2)
    saturated = tables.saturation(metrics)
    if saturated:
        print_line(console, saturated)
    drove_on = int(((metrics.success == 0) & metrics.time_to_goal_s.notna()).sum())
    if drove_on:
        of = f"{drove_on} of {len(metrics)} lifetimes"
        print_line(console, f"{of} reached the goal and drove on; success counts at the end.")


def evaluation_in_short(path: Path) -> str:
    """The success of each controller on each side, a line each."""
    metrics = Run(path).table("metrics.csv")
    success = metrics.groupby(["controller", "side"], sort=False).success.mean().unstack(sort=False)
    return "\n".join(
        f"{name} success {row.get('left', np.nan):.2f} left {row.get('right', np.nan):.2f} right"
        for name, row in success.iterrows()
    )


def print_reversal(path: Path, console: Console) -> None:
    """Print the rewarded share of each controller, beside chance and the optimum."""
    rows = [
        (row.controller, f"{row.rewarded_share:.3f}", "" if pd.isna(row.low) else f"{row.low:.3f}–{row.high:.3f}")
        for row in Run(path).table("reversal.csv").itertuples()
    ]
    title = _title(Run(path).table("metrics.csv"))
    print_table(console, title, ("controller", "rewarded share", "95 % interval"), rows)
    _print_notes_and_findings(path, console)


def reversal_in_short(path: Path) -> str:
    """The rewarded share of each controller, in one line."""
    shares = Run(path).table("reversal.csv")
    return "rewarded share: " + ", ".join(f"{row.controller} {row.rewarded_share:.2f}" for row in shares.itertuples())


def print_evolution(path: Path, console: Console) -> None:
    """Print how fitness rose, and how well the fittest of the last generation did."""
    history = Run(path).table("history.csv")
    last = history.iloc[-1]
    best = f"best fitness {history.best_fitness.iloc[0]:.3f} → {last.best_fitness:.3f}"
    mean = f"mean {history.mean_fitness.iloc[0]:.3f} → {last.mean_fitness:.3f}"
    console.print(Text(f"{len(history)} generations: {best}, {mean}; {_fittest(path, last)}."))


def evolution_in_short(path: Path) -> str:
    """The best fitness of the last generation."""
    return f"best fitness {Run(path).table('history.csv').best_fitness.iloc[-1]:.3f}"


def _fittest(path: Path, last: pd.Series) -> str:
    """How often the fittest of the last generation reached its goal, or was rewarded."""
    config = settings(Run(path).config_file) if Run(path).has_config else {}
    task = config.get("task") or {}
    if task.get("kind") != "reversal":
        return f"the fittest reached its goal in {100 * last.best_success:.0f} % of its training lifetimes"
    bonus = task["end_bonus"] + task["progress_bonus"] + config["training"]["success_bonus"] * last.best_success
    return (
        f"rewarded share of the fittest in training: {max(0.0, last.best_fitness - bonus):.3f} or more (its "
        f"fitness without {bonus:.3g}, the bonus of a robot that reaches an end in every trial)"
    )


def _title(metrics: pd.DataFrame) -> str:
    """The world, genome, rate, repeats and seed of a run, in one line."""
    first = metrics.iloc[0]
    rate = tables.rates(list(zip(metrics.controller, metrics.N, strict=True)))
    repeats = metrics.repeat.nunique()
    world = first.scenario if pd.isna(first.changed) else f"{first.scenario} ({first.changed})"
    return (
        f"{world}: genome {first.genome}{f', {rate}' if rate else ''}, "
        f"mean of {repeats} lifetime{'s' if repeats > 1 else ''} a side (seed {first.seed})"
    )


def _print_notes_and_findings(path: Path, console: Console) -> None:
    """Print what a reader of the table must know, and what robots found in their self-checks."""
    for note in Run(path).provenance.get("notes", []):
        console.print(Text(note))
    findings = in_words(read_findings(Run(path)))
    if findings:
        rows = [(side, text, count) for side, counts in findings.items() for text, count in counts]
        print_table(console, "Found by the self-check", ("side", "it found", "lifetimes"), rows, text=2)
