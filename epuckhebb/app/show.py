"""`epuckhebb show`, and what every verb says of its results in the terminal or as JSON."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table
from rich.text import Text

from epuckhebb.app import files, formats, runs
from epuckhebb.app.config import settings
from epuckhebb.app.errors import ConfigError
from epuckhebb.app.files import Genome
from epuckhebb.app.terminal import print_table
from epuckhebb.sim.adaptation.baseline import Baseline
from epuckhebb.sim.adaptation.self_check.findings import find
from epuckhebb.sim.adaptation.self_check.memory import SelfMemory
from epuckhebb.sim.controller import GA
from epuckhebb.sim.maze import SIDES
from epuckhebb.sim.scenario import EXPERIMENTS
from epuckhebb.study import rescue, tables
from epuckhebb.study.self_checks import in_words

_LATEST = 10  # runs that are told of when none is named
_CHANGED = {"light": "lowlight", "obstacles": "4obstacles"}  # a changed world of each experiment
_MANY = 6  # files of a folder that are counted and not named


def tell(finished: list[Path], console: Console) -> None:
    """Say what the runs of one call came to: the results of one, a table over many."""
    if len(finished) == 1:
        _results(finished[0], console, in_short=True)
        _line(console, f"Run folder: {finished[0]}")
        champion = files.load_genome(str(finished[0]), "") if runs.has(finished[0], files.CHAMPION) else None
        if champion is not None and champion.task:
            settings = f"task={champion.task} hebbian={champion.rule or 'none'} repeats=100"
            _line(console, f"To let it live new lives: epuckhebb evaluate genome=latest {settings}")
        elif champion is not None:
            home = champion.baseline
            changed = _CHANGED[home.experiment] if home else _CHANGED["obstacles"]
            _line(console, "What it remembers of its training world: epuckhebb show latest")
            _line(console, f"To let it live in a changed one: epuckhebb evaluate genome=latest scenario={changed}")
    elif finished:
        if not runs.has(finished[0].parent, files.SUMMARY):
            _tell_each(finished, console)
        _tell_together(finished, console)


def _tell_each(finished: list[Path], console: Console) -> None:
    """A line for each run of a multirun."""
    told = [(path, runs.read(path)) for path in finished]
    rows = [(path.name, " ".join(run["overrides"]), _in_short(path, run["status"])) for path, run in told]
    print_table(console, "", ("run", "overrides", "result"), rows)


def _tell_together(finished: list[Path], console: Console) -> None:
    """What all runs of a multirun came to, if they were evaluations, and where they are."""
    folder = finished[0].parent
    if runs.has(folder, files.SUMMARY):
        _tell_summary(folder, console)
    _line(console, f"Run folders: {folder}/{finished[0].name} to {folder}/{finished[-1].name}")


def tell_reproduction(path: Path, console: Console) -> None:
    """Say what a reproduction found of the paper's claims, and where its report is."""
    claims = runs.table(path, "claims.csv", formats.CLAIMS)
    rows = [(row.experiment, row.claim, row.verdict, f"{row.true} of {row.n}") for row in claims.itertuples()]
    print_table(console, "The paper's claims", ("experiment", "claim", "verdict", "true in"), rows)
    _line(console, f"Report: {path}/report.html")


def tell_jobs(folder: Path, listed: list[dict[str, Any]], console: Console) -> None:
    """List the jobs of a sweep or a leaderboard that is not run; what they are for, or what would be typed."""
    rows = [(n, "done" if job["done"] else "to do", job["told"]) for n, job in enumerate(listed)]
    print_table(console, f"{len(listed)} jobs in {folder}/", ("job", "", "what"), rows)
    done = sum(job["done"] for job in listed)
    _line(console, f"{done} done, {len(listed) - done} to do; nothing was run.")


def tell_sweep(folder: Path, console: Console) -> None:
    """Say what a sweep came to: the success of each condition, or rescue and harm, and where its tables are."""
    written = "sweep.csv (every lifetime), summary.csv, failed.csv"
    if runs.has(folder, "rescue_over_all.csv"):
        over_all = runs.table(folder, "rescue_over_all.csv", formats.RESCUE)
        rows = []
        for row in over_all.itertuples():
            cells = [rescue.count(row, "rescued", "broken"), rescue.count(row, "harmed", "sound")]
            plasticity = rescue.label(str(row.controller), float(row.N))
            rows.append((row.experiment, plasticity, *cells, f"{row.home_harmed} of {row.home_mastered}"))
        headings = ("experiment", "plasticity", "rescued of broken", "harmed of sound", "at home")
        print_table(console, "Rescue and harm (95 % interval)", headings, rows)
        written = f"report.md, rescue_over_all.csv, rescue_and_harm.csv, {written}"
    else:
        _tell_summary(folder, console)
    _line(console, f"Tables: {folder}/: {written}")


def _tell_summary(folder: Path, console: Console) -> None:
    """The success of each condition and controller on both sides, told by what differs between them."""
    summary = runs.table(folder, files.SUMMARY, formats.SUMMARY, rows=False)
    conditions = list(summary.columns[: summary.columns.get_loc("n")])
    of_plasticity = summary[summary.controller != GA] if (summary.controller != GA).any() else summary
    differ = [name for name in conditions if name == "controller" or of_plasticity[name].nunique() > 1]
    alike = {tuple(of_plasticity[name].factorize()[0]): name for name in differ if name != "side"}
    told = list(alike.values())  # of columns that tell the same, the last: a genome is known by its name, too
    same = summary.n.nunique() == 1
    rows: dict[tuple[str, ...], dict[str, str]] = {}
    for row in summary.to_dict("records"):
        place = tuple(_cell(row[name]) for name in told)
        interval = f"{row['success']:.2f} ({row['success_low']:.2f}–{row['success_high']:.2f})"
        rows.setdefault(place, {})[row["side"]] = interval + ("" if same else f" of {row['n']}")
    if rows:
        each = f", {summary.n.iloc[0]} lifetimes each" if same else ""
        headings = (*told, *(f"success, {side}" for side in SIDES))
        cells = ((*place, *(found.get(side, "") for side in SIDES)) for place, found in rows.items())
        print_table(console, f"Success (95 % interval){each}", headings, cells)
    _line(console, f"Means of all else: {folder / files.SUMMARY}")
    if runs.has(folder, files.DOSE_RESPONSE):
        _line(console, f"Success and weight change against N: {folder / files.DOSE_RESPONSE}")


def _cell(value: Any) -> str:
    if isinstance(value, float):
        return "" if np.isnan(value) else f"{value:g}"
    return str(value)


def tell_leaderboard(path: Path, console: Console) -> None:
    """Say how well each method of a leaderboard did, and where its page is."""
    from epuckhebb.study import leaderboard as board  # brings statistics

    told = runs.table(path, "leaderboard.csv", formats.LEADERBOARD)
    for experiment, own in told.groupby("experiment", sort=False):
        rows = []
        for row in own.itertuples():
            success = rescue.share(float(row.success), float(row.success_low), float(row.success_high))
            twin = "" if pd.isna(row.difference) else f"{row.difference:+.2f}"
            twin += "" if pd.isna(row.difference_low) else f" [{row.difference_low:+.2f}, {row.difference_high:+.2f}]"
            mastered = f"{row.mastered} of {row.champions}"
            rows.append((row.method, row.kind, mastered, success, f"{row.best:.2f}", twin))
        method, kind, mastered, share, _, best, difference, *_ = board.head(str(experiment))
        headings = (method, kind, mastered, share, best, difference)
        print_table(console, f"{board.title(str(experiment))} (95 % interval)", headings, rows)
    _line(console, f"Report: {path}/report.html")


def show(what: str | None, console: Console) -> None:
    """Tell all of a run, or of whatever else a user names: a multirun, a champion; of nothing named, the latest runs.

    Raises:
        ConfigError: It is none of these.
    """
    if what is None:
        _latest(console)
        return
    genomes = _genomes(what)
    for genome, experiment in genomes:
        console.print(Text(f"{genome.name}, of the {experiment} experiment", style="bold"))
        _line(console, f"SHA-256 of its genes: {genome.sha256}")
        _tell_genome(genome, console)
    if not genomes:
        path = runs.found(what)
        many = runs.of_multirun(path)
        if many:
            _tell_each(many, console)
            _tell_together(many, console)
        else:
            _run(path, console)


def shown_as_json(what: str | None) -> dict[str, Any]:
    """What `show` tells, as JSON values.

    Raises:
        ConfigError: It cannot be told of.
    """
    if what is None:
        return {"runs": [str(path) for path in runs.below_runs()]}
    genomes = _genomes(what)
    if genomes:
        return {"genomes": [_genome_as_json(genome, experiment) for genome, experiment in genomes]}
    path = runs.found(what)
    many = runs.of_multirun(path)
    return {"run": str(path), "runs": list(map(as_json, many))} if many else as_json(path)


def _latest(console: Console) -> None:
    """What the latest runs came to, the last one last."""
    known = runs.below_runs()
    if not known:
        _line(console, f"There are no runs in {Path('runs').absolute()} yet; begin with: epuckhebb evaluate")
        return
    rows = []
    for path in known[-_LATEST:]:
        try:
            rows.append((str(path), _in_short(path, runs.read(path)["status"])))
        except ConfigError as error:
            rows.append((str(path), str(error)))
    print_table(console, f"The latest of {len(known)} runs" if len(known) > _LATEST else "", ("run", "result"), rows)


def _genomes(what: str) -> list[tuple[Genome, str]]:
    """The genomes of a champion's file, or of a bundled champion in either experiment; none if it is something else."""
    if files.is_bundled(what):
        return [(files.load_genome(what, experiment), experiment) for experiment in EXPERIMENTS]
    path = Path(what)
    if path.suffix not in (".npz", ".npy") or path.is_dir():
        return []
    genome = files.load_genome(what, "")
    return [(genome, genome.experiment or "unknown")]


def _genome_as_json(genome: Genome, experiment: str) -> dict[str, Any]:
    parts = {part.name: part.size for part in genome.plan.parts}
    known = {"layers": list(genome.network.layers), "parts": parts, "robot": genome.robot}
    evolved = {"optimizer": genome.optimizer, "training": genome.training}
    return {"genome": genome.name, "sha256": genome.sha256, "experiment": experiment, **known, **evolved}


def _run(path: Path, console: Console) -> None:
    """Tell all of a run: what was asked, by which program, how it ended, and its results."""
    told = runs.read(path)
    status, code = told["status"], told["code"]
    commit = f", commit {code['commit'][:10]}{' with changes' if code['dirty'] else ''}" if code["commit"] else ""
    science = f", science {code['science']}" if "science" in code else ""
    resumed = [
        again["started"] + (f" after {again['generations']}" if "generations" in again else "")
        for again in told.get("resumed", [])
    ]
    facts = Table(show_header=False, box=None, padding=(0, 2, 0, 0))
    facts.add_column(style="bold")
    facts.add_column(overflow="fold")
    for name, value in {
        "Command": " ".join(told["command"]),
        "Overrides": " ".join(told["overrides"]),
        "State": status["state"] + (f": {status['error']}" if status.get("error") else ""),
        "Time": f"{status['started']} – {status.get('finished', '')}" if "started" in status else "",
        "Resumed": ", ".join(resumed),
        "Settings": " ".join(_settings(path)),
        "Program": f"epuckhebb {code['version']}{commit}{science}, Python {told['python']}",
        "Packages": ", ".join(f"{name} {number}" for name, number in told["packages"].items() if name != "epuckhebb"),
        "Machine": f"{told['platform']}, {told['cores']} cores",
        "Own rules": ", ".join(f"{file} (SHA-256 {sha256})" for file, sha256 in told.get("rules", {}).items()),
        "Genome": f"{told['genome']} (SHA-256 {told['genome_sha256']})" if "genome" in told else "",
        "Files": ", ".join(_files(path)),
    }.items():
        if value:
            facts.add_row(name, Text(value))
    console.print(facts)
    _results(path, console)


def as_json(path: Path) -> dict[str, Any]:
    """Provenance, status and results of a run, as JSON values.

    Raises:
        ConfigError: It is not a run folder.
    """
    told = {"run": str(path), **runs.read(path)}
    for name, columns in (
        ("metrics", formats.METRICS),
        ("history", formats.HISTORY),
        ("leaderboard", formats.LEADERBOARD),
    ):
        if runs.has(path, f"{name}.csv"):
            frame = runs.table(path, f"{name}.csv", columns)
            told[name] = frame.astype(object).where(frame.notna(), None).to_dict("records")
    return told


def _line(console: Console, text: str) -> None:
    console.print(text, markup=False, highlight=False, soft_wrap=True)


def _settings(path: Path) -> Iterator[str]:
    """The resolved configuration of a run, as it could be typed; of the maze and the robot, only which they are."""

    def below(node: dict[Any, Any], prefix: str) -> Iterator[str]:
        for key, value in node.items():
            if not prefix and key in ("maze", "robot") and isinstance(value, dict):
                yield f"{key}={value.get('name')}"
            elif isinstance(value, dict):
                yield from below(value, f"{prefix}{key}.")
            else:
                yield f"{prefix}{key}={'null' if value is None else value}"

    file = path / runs.CONFIG
    if runs.has(path, runs.CONFIG):
        runs.content(path, runs.CONFIG)  # it is as it was written
        yield from below(settings(file), "")


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


def _results(path: Path, console: Console, *, in_short: bool = False) -> None:
    """What a run came to; nothing of a study that has not come to its tables yet. in_short: not what it remembers."""
    if runs.has(path, "claims.csv"):
        tell_reproduction(path, console)
    elif runs.has(path, "leaderboard.csv"):
        tell_leaderboard(path, console)
    elif runs.has(path, files.SUMMARY):
        tell_sweep(path, console)
    elif runs.has(path, "metrics.csv"):
        _tell_metrics(runs.table(path, "metrics.csv", formats.METRICS), console)
    if runs.has(path, files.REVERSAL):
        told = runs.table(path, files.REVERSAL, formats.REVERSAL)
        shares = [
            (row.controller, f"{row.rewarded_share:.3f}", "" if pd.isna(row.low) else f"{row.low:.3f}–{row.high:.3f}")
            for row in told.itertuples()
        ]
        print_table(console, "Reversal learning", ("", "rewarded share", "95 % interval"), shares)
    found = in_words(files.read_findings(path))
    if found:
        rows = [(side, text, count) for side, said in found.items() for text, count in said]
        print_table(console, "Found by the self-check", ("side", "it found", "lifetimes"), rows)
    if runs.has(path, files.CHAMPION) and not in_short:
        _tell_genome(files.load_genome(str(path), ""), console)
    if runs.has(path, "history.csv"):
        history = runs.table(path, "history.csv", formats.HISTORY)
        last = history.iloc[-1]
        console.print(
            f"{len(history)} generations: best fitness {history.best_fitness.iloc[0]:.3f} → {last.best_fitness:.3f}, "
            f"mean {history.mean_fitness.iloc[0]:.3f} → {last.mean_fitness:.3f}; {_fittest(path, last)}.",
            highlight=False,
        )


def _fittest(path: Path, last: pd.Series) -> str:
    """How well the fittest of the last generation did: how often it came to its goal, or how often it was rewarded."""
    told = settings(path / runs.CONFIG) if runs.has(path, runs.CONFIG) else {}
    task = told.get("task") or {}
    if task.get("kind") != "reversal":
        return f"the fittest reached its goal in {100 * last.best_success:.0f} % of its training lifetimes"
    bonus = task["end_bonus"] + task["progress_bonus"] + told["training"]["success_bonus"] * last.best_success
    return (
        f"rewarded share of the fittest in training: {max(0.0, last.best_fitness - bonus):.3f} or more (its fitness "
        f"without the {bonus:.3g} that a robot gets which comes to an end in every trial)"
    )


def _tell_genome(genome: Genome, console: Console) -> None:
    """What a champion is made of, what it remembers of its training world, and how well it can check itself."""
    _line(console, f"Genome: {genome.plan.told()}; network {genome.network}; robot {genome.robot}")
    if genome.optimizer:
        rule = f", with rule {genome.rule}" if genome.rule else ""
        task = f", for task {genome.task}" if genome.task else ""
        _line(console, f"Evolved by {genome.optimizer}, in training worlds {genome.training}{rule}{task}")
    if genome.baseline is not None:
        _tell_baseline(genome.baseline, genome, console)
    if genome.self_memory is not None:
        _tell_self_memory(genome.self_memory, console)


def _tell_self_memory(memory: SelfMemory, console: Console) -> None:
    """How well a robot that remembers this can check itself."""
    expected = find(memory.mean[0], memory)
    rows = [
        (f"{wheel} wheel", f"± {100 * error:.1f} % of its speed")
        for wheel, error in zip(("Left", "Right"), expected.wheel_loss_error, strict=True)
    ]
    rows.append(("Light", f"± {100 * expected.light_ratio_error:.1f} % of {memory.scenario}'s"))
    title = f"Self-check: a dance of {len(memory.spread)} steps, remembered of {memory.scenario}; standard errors"
    print_table(console, title, ("", "is told to"), rows)


def _tell_baseline(baseline: Baseline, genome: Genome, console: Console) -> None:
    """What a champion remembers of its training world."""
    rows: list[tuple[str, ...]] = []
    for name, numbers in {
        "At the goal in the end": baseline.success,
        "Slowest arrival (s)": baseline.time_to_goal_s,
        "Longest away afterwards (s)": baseline.away_s,
    }.items():
        rows.append((name, *("never" if np.isnan(number) else f"{number:g}" for number in numbers.round(2))))
    rows.append((f"Least live fitness, over {baseline.fitness.shape[1]} s", *map(_course, baseline.fitness)))
    inputs = genome.network.inputs
    for kind, first, count in (("Light", 0, genome.lights), ("Distance", genome.lights, inputs - genome.lights)):
        for place in range(count):
            means, spreads = baseline.reading_mean[:, first + place], baseline.reading_spread[:, first + place]
            told = (f"{mean:.2f} ± {spread:.2f}" for mean, spread in zip(means, spreads, strict=True))
            rows.append((f"{kind} reading {place}", *told))
    title = f"Baseline: {baseline.scenario} at {baseline.gain_rad_s:g} rad/s"
    print_table(console, title, ("", "left (lamp off)", "right (lamp on)"), rows)


def _course(fitness: NDArray[np.float64]) -> str:
    """The course of fitness as twelve bars from 0 to 1, and the means of its first and last twelfth."""
    parts = [part.mean() for part in np.array_split(fitness, min(12, len(fitness)))]
    return "".join("▁▂▃▄▅▆▇█"[min(7, int(8 * max(0.0, part)))] for part in parts) + f" {parts[0]:.2f} → {parts[-1]:.2f}"


def _tell_metrics(metrics: pd.DataFrame, console: Console) -> None:
    """The paper's table of a run."""
    text = tables.formatted(tables.paper_table(metrics))
    first = metrics.iloc[0]
    rate = tables.rates(list(zip(metrics.controller, metrics.N, strict=True)))
    repeats = metrics.repeat.nunique()
    changed = str(first.get("changed", "nan"))  # runs of version 0.1 do not have the column
    world = first.scenario if changed == "nan" else f"{first.scenario} ({changed})"
    told = (
        f"{world}: genome {first.genome}{f', {rate}' if rate else ''}, "
        f"mean of {repeats} lifetime{'s' if repeats > 1 else ''} a side (seed {first.seed})"
    )
    rows = ([row, *values] for row, values in zip(text.index, text.to_numpy().tolist(), strict=True))
    print_table(console, told, ["", *map("\n".join, text.columns)], rows, numbers=True)
    drove_on = int(((metrics.success == 0) & metrics.time_to_goal_s.notna()).sum())
    if drove_on:
        of = f"{drove_on} of {len(metrics)} lifetimes"
        _line(console, f"{of} came to the goal and drove on; success is asked at the end.")


def _in_short(path: Path, status: dict[str, Any]) -> str:
    if status["state"] != "finished":
        return ": ".join(filter(None, (status["state"], status.get("error", ""))))
    if runs.has(path, "claims.csv"):
        claims = runs.table(path, "claims.csv", formats.CLAIMS)
        return f"{(claims.verdict == 'holds').sum()} of {len(claims)} claims hold"
    if runs.has(path, "leaderboard.csv"):
        best = runs.table(path, "leaderboard.csv", formats.LEADERBOARD).groupby("experiment", sort=False).first()
        return ", ".join(f"{row.Index}: {row.method} {row.success:.2f}" for row in best.itertuples())
    if runs.has(path, files.SUMMARY):
        rows = len(runs.table(path, files.SUMMARY, formats.SUMMARY, rows=False))
        return f"success of {rows} conditions, controllers and sides"
    if runs.has(path, "metrics.csv"):
        if runs.has(path, files.REVERSAL):
            told = runs.table(path, files.REVERSAL, formats.REVERSAL)
            return ", ".join(f"{row.controller} rewarded {row.rewarded_share:.2f}" for row in told.itertuples())
        metrics = runs.table(path, "metrics.csv", formats.METRICS)
        success = metrics.groupby(["controller", "side"], sort=False).success.mean().unstack(sort=False)
        return "\n".join(
            f"{name} success {row.get('left', np.nan):.2f} left {row.get('right', np.nan):.2f} right"
            for name, row in success.iterrows()
        )
    return f"best fitness {runs.table(path, 'history.csv', formats.HISTORY).best_fitness.iloc[-1]:.3f}"
