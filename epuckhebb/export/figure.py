"""`epuckhebb figure RUN NAME`: draws a figure of a run, a multirun or a study again, from its files."""

from pathlib import Path

from matplotlib.figure import Figure

from epuckhebb.analysis import charts
from epuckhebb.analysis.figures import maze, trajectories
from epuckhebb.analysis.image import KINDS, image
from epuckhebb.export import FIGURES
from epuckhebb.export.replay import recording
from epuckhebb.runs import figures, run_settings
from epuckhebb.runtime import ConfigError, refusing
from epuckhebb.store import Run, load_genome, multirun_runs, write_atomic
from epuckhebb.studies import sweep
from epuckhebb.studies.study import find_study
from epuckhebb.tmaze.individual import GA_ALONE


def _draw_run(run: Run, name: str) -> Figure:
    """A figure of one run."""
    if name == "reversal":
        shares, trials = run.table("reversal.csv"), run.table("reversal_trials.csv")
        return figures.reversal(run_settings(run, "evaluate"), run.provenance["genome"], shares, trials)
    if name == "lifetime":
        return figures.lifetime(run_settings(run, "evaluate"), run.provenance["genome"], run.table("lifetime.csv"))
    if name == "learning":
        optimizer = load_genome(str(run.path), "").optimizer  # an own one is not loaded with the settings
        return figures.learning(run_settings(run, "evolve"), optimizer, run.table("history.csv"))
    shown = recording(run.path)
    traces, world = shown.traces, shown.config.world
    if name == "trajectories":
        return trajectories(traces, world, shown.title)
    if name == "maze":
        return maze(world)
    plastic, *_ = shown.config.controllers or [GA_ALONE]
    title = f"{plastic.name} in {shown.title}"
    return charts.weights(shown.weights, traces.side_samples(plastic.name), plastic.rule.w_max, title)


def names(path: Path) -> list[str]:
    """The figures that a run has; the tables and figures of a multirun are made, of its whole runs."""
    run = Run(path)
    if multirun_runs(path):
        sweep.summarise_multirun(path)
    figures = [name for name, file in FIGURES.items() if run.has(file)]
    figures = figures or sorted(file.stem for file in (path / "figures").glob("*.png")) or list(_draw_many(run))
    if not figures:
        raise ConfigError(f"{path} has no figures; give a finished run, for example one below runs/evaluate/")
    return figures


def _draw_many(run: Run) -> dict[str, Figure]:
    """Draw the figures over the runs of a multirun or a study, by name."""
    if multirun_runs(run.path):
        return sweep.figures(run)
    return dict(find_study(run.json("sweep.json")["name"]).stored(run).figures(run)) if run.has("sweep.json") else {}


def draw(path: Path, name: str, kind: str, width_mm: float | None, output: Path | None) -> Path:
    """Draw a figure of a run into a file; returns its path.

    width_mm: None for the figure's own width. output: the file; None for one in the run folder.
    """
    if kind not in KINDS:
        raise ConfigError(f"--format must be one of {', '.join(KINDS)}, got {kind}")
    run, drawable = Run(path), names(path)
    if name not in drawable:
        raise ConfigError(f"{path} has the figures {', '.join(drawable)}; got {name}")
    drawn = _draw_run(run, name) if name in FIGURES and run.has(FIGURES[name]) else _draw_many(run)[name]
    target = output or path / "figures" / f"{name}.{kind}"
    with refusing(lambda error: f"--width: {error}"):
        content = image(drawn, kind, width_mm)
    write_atomic(target, content)
    return target
