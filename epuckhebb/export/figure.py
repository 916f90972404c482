"""`epuckhebb figure RUN NAME`: draws a figure of a run, a multirun or a study again, from its files."""

from collections.abc import Callable, Mapping
from pathlib import Path

from matplotlib.figure import Figure

from epuckhebb.analysis import charts
from epuckhebb.analysis.figures import maze, trajectories
from epuckhebb.analysis.image import KINDS, MM, image
from epuckhebb.config import EvaluateConfig, EvolveConfig, from_values, settings, without_own_code
from epuckhebb.export.replay import recording
from epuckhebb.runs import figures
from epuckhebb.runtime import ConfigError
from epuckhebb.store import Run, load_genome, of_multirun, write_atomic
from epuckhebb.studies import sweep
from epuckhebb.studies.study import study_named
from epuckhebb.tmaze.individual import GA

_LEAST_SHARE, _MOST_MM = 0.5, 1000.0  # of a figure's own width, below which its letters overlap; of any figure


def _trajectories(run: Run) -> Figure:
    made = recording(run.path)
    return trajectories(made.traces, made.config.world, made.title)


def _network(run: Run) -> Figure:
    made = recording(run.path)
    plastic = next((one for one in made.traces.controller if one != GA), GA)
    lifetimes, title = made.traces.lifetimes_of(plastic), f"{plastic} in {made.title}"
    return charts.network(made.weights, lifetimes, title, made.network, made.config.world.robot)


def _weight_change(run: Run) -> Figure:
    made = recording(run.path)
    world, plastic = made.config.world, next((one for one in made.traces.controller if one != GA), GA)
    return charts.weight_change({plastic: made.traces.lifetimes_of(plastic)}, "fitness", world.name, world.robot)


def _reversal(run: Run) -> Figure:
    config = from_values(without_own_code(settings(run.config_file)), EvaluateConfig, str(run.path))
    shares, trials = run.table("reversal.csv"), run.table("reversal_trials.csv")
    return figures.reversal(config, run.provenance["genome"], shares, trials)


def _learning(run: Run) -> Figure:
    config = from_values(without_own_code(settings(run.config_file)), EvolveConfig, str(run.path))
    optimizer = load_genome(str(run.path), "").optimizer  # the settings may name one of the user's, which is not loaded
    return figures.learning(config, optimizer, run.table("history.csv"))


_OF_RUN: dict[str, tuple[str, Callable[[Run], Figure]]] = {  # name -> the file that it needs, and what draws it
    "trajectories": ("traces.npz", _trajectories),
    "maze": ("traces.npz", lambda run: maze(recording(run.path).config.world)),
    "network": ("traces.npz", _network),
    "weight_change": ("traces.npz", _weight_change),
    "reversal": ("reversal.csv", _reversal),
    "learning": ("history.csv", _learning),
}


def _of_many(run: Run) -> Mapping[str, Figure]:
    """The figures of a study, or of a multirun."""
    if of_multirun(run.path):
        return sweep.figures(run)
    return study_named(run.json("sweep.json")["name"]).stored(run).figures(run)


def names(path: Path) -> list[str]:
    """The figures that a run has."""
    run = Run(path)
    known = [name for name, (file, _) in _OF_RUN.items() if run.has(file)]
    known = known or sorted(file.stem for file in (path / "figures").glob("*.png"))
    if not known:
        raise ConfigError(f"{path} has no figures; give a finished run, for example one below runs/evaluate/")
    return known


def draw(path: Path, name: str, kind: str, width_mm: float | None, output: Path | None) -> Path:
    """Draw a figure of a run into a file; returns its path.

    kind: png, svg or pdf. width_mm: of the figure; None for its own width. output: the file; None for one in the run
    folder.
    """
    if kind not in KINDS:
        raise ConfigError(f"--format must be one of {', '.join(KINDS)}, got {kind}")
    run, known = Run(path), names(path)
    if name not in known:
        raise ConfigError(f"{path} has the figures {', '.join(known)}; got {name}")
    is_of_run = name in _OF_RUN and run.has(_OF_RUN[name][0])
    drawn = _OF_RUN[name][1](run) if is_of_run else _of_many(run)[name]
    target = output or path / "figures" / f"{name}.{kind}"
    least = _LEAST_SHARE * drawn.get_figwidth() * MM
    if width_mm is not None and not least <= width_mm <= _MOST_MM:
        raise ConfigError(f"--width of this figure must lie between {least:.0f} and {_MOST_MM:g} mm, got {width_mm:g}")
    try:
        write_atomic(target, image(drawn, kind, width_mm))
    except OSError as error:
        raise ConfigError(f"cannot write {target}: {error.strerror}") from error
    return target
