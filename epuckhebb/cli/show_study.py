"""Prints the tables of a study: a reproduction, a sweep, a leaderboard or flocks."""

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.console import Console
from rich.text import Text

from epuckhebb.analysis import rescue
from epuckhebb.cli.console import print_line, print_table
from epuckhebb.sim.controller import GA
from epuckhebb.sim.maze import SIDES
from epuckhebb.sim.scenario import EXPERIMENTS
from epuckhebb.store import Run, is_bundled, load_genome

if TYPE_CHECKING:
    import pandas as pd


def print_jobs(folder: Path, listed: list[dict[str, Any]], console: Console) -> None:
    """List the jobs of a sweep or a leaderboard that is not run: what each is for, or what would be typed."""
    rows = [(n, "done" if job["done"] else "to do", job["what"]) for n, job in enumerate(listed)]
    print_table(console, f"{len(listed)} jobs in {folder}/", ("job", "", "what"), rows, text=3)
    done = sum(job["done"] for job in listed)
    print_line(console, f"{done} done, {len(listed) - done} to do; nothing was run.")


def print_reproduction(path: Path, console: Console) -> None:
    """Print which of the paper's claims hold, and where the report is."""
    claims = Run(path).table("claims.csv")
    rows = [(row.experiment, row.claim, row.verdict, f"{row.true} of {row.n}") for row in claims.itertuples()]
    print_table(console, "The paper's claims", ("experiment", "claim", "verdict", "true in"), rows, text=3)
    print_line(console, f"Report: {path}/report.html")


def reproduction_in_short(path: Path) -> str:
    """How many claims hold."""
    claims = Run(path).table("claims.csv")
    claims = claims[~claims.verdict.str.startswith("check")]
    return f"{(claims.verdict == 'holds').sum()} of {len(claims)} claims hold"


def print_flock(path: Path, console: Console) -> None:
    """Print where the robots of each coupling headed in the usual condition, and where the page is."""
    from epuckhebb.analysis.flock import usual  # brings statistics

    for breaks, own in usual(Run(path).table("flock.csv")).groupby("breaks", sort=False):
        rows = [
            (
                row.coupling,
                f"{row.before:.3f}",
                rescue.share(row.long_after, row.long_after_low, row.long_after_high),
                f"{row.good * row.runs:.0f} of {row.runs}",
                f"{row.difference:+.2f} [{row.difference_low:+.2f}, {row.difference_high:+.2f}]"
                if row.difference_high > row.difference_low
                else "",
            )
            for row in own.itertuples()
        ]
        headings = ("couplings", "before", "long after", "above .9", "difference to frozen")
        print_table(console, f"Cosine of heading to the goal; breaks: {breaks} (95 % interval)", headings, rows, text=1)
    print_line(console, f"Report: {path}/report.html")


def flock_in_short(path: Path) -> str:
    """How well the best coupling does, beside frozen ones."""
    table = Run(path).table("flock.csv")
    own = table[table.breaks == table.breaks.iloc[-1]].set_index("coupling").long_after.groupby(level=0).first()
    return ", ".join(f"{name} {value:.2f}" for name, value in own.sort_values(ascending=False).head(3).items())


def print_leaderboard(path: Path, console: Console) -> None:
    """Print how well each method did, and where the page is."""
    from epuckhebb.analysis import leaderboard as board  # brings statistics

    methods = Run(path).table("leaderboard.csv")
    for experiment, own in methods.groupby("experiment", sort=False):
        rows = []
        for row in own.itertuples():
            success = rescue.share(float(row.success), float(row.success_low), float(row.success_high))
            matched_control = "" if math.isnan(row.difference) else f"{row.difference:+.2f}"
            matched_control += (
                "" if math.isnan(row.difference_low) else f" [{row.difference_low:+.2f}, {row.difference_high:+.2f}]"
            )
            rows.append((row.method, row.kind, f"{row.solved} of {row.champions}", success, matched_control))
        shown = [name for name in board.head(str(experiment)) if name != "knowledge"]
        method, kind, solved, share, _, _, difference, *_ = shown
        headings = (method, kind, solved, share, difference)
        print_table(console, f"{board.title(str(experiment))} (95 % interval)", headings, rows, text=2)
    print_line(console, f"Report: {path}/report.html")


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
    return f"success of {len(_summary(folder))} conditions, controllers and sides"


def print_rescue(folder: Path, console: Console) -> None:
    """Print what each plasticity rescued and harmed."""
    over_all = Run(folder).table("rescue_over_all.csv")
    rows = []
    for row in over_all.itertuples():
        plasticity = rescue.label(str(row.controller), float(row.N))
        rows.append((row.experiment, plasticity, *rescue.counts(row), rescue.in_training(row)))
    headings = ("experiment", "plasticity", rescue.RESCUED, rescue.HARMED, rescue.IN_TRAINING)
    print_table(console, "Rescue and harm (95 % interval over champions)", headings, rows, text=2)
    print_line(
        console, f"Rescue and harm: {folder}/: report.md, rescue_over_all.csv, rescue_and_harm.csv, retention.csv"
    )


def print_summary(folder: Path, console: Console) -> None:
    """Print the success of each condition and controller on both sides; over champions if there are several."""
    if Run(folder).has("over_champions.csv"):
        table = Run(folder).table("over_champions.csv")
        table = table.rename(columns={"champions": "n"})
        _print_success(table, "mean over {} champions", " over champions", console)
        print_line(console, f"Over champions: {folder}/over_champions.csv; each champion: {folder}/summary.csv")
    else:
        table = _summary(folder)
        table = table.rename(columns={f"success_noise_{end}": f"success_{end}" for end in ("low", "high")})
        _print_success(table, "{} lifetimes each", ": noise only, this champion", console)
        print_line(console, f"Means of all else: {folder}/summary.csv")
    if Run(folder).has("figures/dose_response.png"):
        print_line(console, f"Success and weight change against N: {folder}/figures/dose_response.png")


def _summary(folder: Path) -> "pd.DataFrame":
    return Run(folder).table("summary.csv")


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
