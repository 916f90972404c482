"""`epuckhebb figure RUN NAME`: draws a figure of a run again, from its files."""

import io
from collections.abc import Callable
from functools import partial
from pathlib import Path

import pandas as pd
from matplotlib.figure import Figure

from epuckhebb.analysis import charts, figures, leaderboard, summary
from epuckhebb.analysis.image import KINDS, MM, image
from epuckhebb.analysis.reversal import limits
from epuckhebb.config import (
    Config,
    EvaluateConfig,
    EvolveConfig,
    FlockConfig,
    from_values,
    settings,
    without_own_code,
)
from epuckhebb.export.replay import recording
from epuckhebb.runs import figures as of_runs
from epuckhebb.runtime import ConfigError
from epuckhebb.store import Run, load_genome, write_atomic
from epuckhebb.studies import flock, reproduce
from epuckhebb.tmaze.individual import GA
from epuckhebb.tmaze.samples import Samples
from epuckhebb.tmaze.tasks.reversal import Reversal

_LEAST_SHARE, _MOST_MM = 0.5, 1000.0  # of a figure's own width, below which its letters overlap; of any figure


def _config(run: Run, schema: type[Config]) -> Config:
    return from_values(without_own_code(settings(run.config_file)), schema, str(run.path))


def _recorded(run: Run, name: str) -> Figure:
    """A figure of what a run recorded; those about plasticity show the first controller that has it."""
    made = recording(run.path)
    world, traces = made.config.world, made.traces
    if name == "maze":
        return figures.maze(world)
    if name == "trajectories":
        return of_runs.trajectories(made.config, made.title, traces)
    plastic = next((one for one in traces.controller if one != GA), GA)
    lifetimes = {
        side: Samples(*(array[k] for array in traces.samples))
        for k, (controller, side) in enumerate(zip(traces.controller, traces.side, strict=True))
        if controller == plastic
    }
    if name == "network":
        return charts.network(made.weights, lifetimes, f"{plastic} in {made.title}", made.network, world.robot)
    return charts.weight_change({plastic: lifetimes}, "fitness", world.name, world.robot)


def _reversal(run: Run) -> Figure:
    config = _config(run, EvaluateConfig)
    shares, trials = run.table("reversal.csv"), run.table("reversal_trials.csv")
    return of_runs.reversal(config, run.provenance["genome"], shares, trials)


def _learning(run: Run) -> Figure:
    optimizer = load_genome(str(run.path), "").optimizer  # the settings may name one of the user's, which is not loaded
    return of_runs.learning(_config(run, EvolveConfig), optimizer, run.table("history.csv"))


def _dose_response(run: Run) -> Figure:
    rows = pd.read_csv(io.BytesIO(run.content("sweep.csv")), dtype=str, keep_default_na=False)
    named = list(run.table("summary.csv"))
    drawn = summary.dose_response(rows, [key for key in named[: named.index("n")] if key not in ("controller", "side")])
    if drawn is None:
        raise ConfigError(f"{run.path} has one N, or lifetimes of many trials, so there is no dose-response")
    return drawn


def _rescue_and_harm(run: Run) -> Figure:
    return charts.rescue_over_all(run.table("rescue_over_all.csv"))


def _leaderboard(run: Run) -> Figure:
    champions = run.table("champions.csv")
    tests = champions.test[champions.experiment == leaderboard.REVERSAL]
    lines = {}
    if len(tests):
        task = _config(Run(run.path / tests.iloc[0]), EvaluateConfig).world.task
        lines = {leaderboard.REVERSAL: limits(task)} if isinstance(task, Reversal) else {}
    return charts.leaderboard_of(run.table("leaderboard.csv"), champions, lines)


_DRAWN: dict[str, tuple[str, Callable[[Run], Figure]]] = {  # name -> the file that it needs, and what draws it
    **{
        name: ("traces.npz", partial(_recorded, name=name))
        for name in ("trajectories", "maze", "network", "weight_change")
    },
    "reversal": ("reversal.csv", _reversal),
    "learning": ("history.csv", _learning),
    "dose_response": ("sweep.csv", _dose_response),
    "leaderboard": ("leaderboard.csv", _leaderboard),
    "rescue_and_harm": ("rescue_over_all.csv", _rescue_and_harm),
}
_STUDIES: dict[str, Callable[[Run], dict[str, Figure]]] = {  # file of results -> what draws all figures again
    "flock.csv": lambda run: flock.figures(
        from_values(settings(run.config_file), FlockConfig, str(run.path)),
        run.table("curves.csv"),
        run.table("flock.csv"),
    ),
    "claims.csv": lambda run: reproduce.figures(run.path),
}


def _study(run: Run) -> Callable[[Run], dict[str, Figure]] | None:
    return next((draw for file, draw in _STUDIES.items() if run.has(file)), None)


def names(path: Path) -> list[str]:
    """The figures that a run has."""
    run = Run(path)
    known = [one for one, (file, _) in _DRAWN.items() if run.has(file)]
    known += sorted(file.stem for file in (path / "figures").glob("*.png")) if _study(run) else []
    if not known:
        raise ConfigError(f"{path} has no figures; give a finished run, for example one below runs/evaluate/")
    return known


def _drawn(run: Run, name: str) -> Figure:
    """A figure of a run by its name."""
    study, known = _study(run), names(run.path)
    if name not in known:
        raise ConfigError(f"{run.path} has the figures {', '.join(known)}; got {name}")
    return study(run)[f"{name}.png"] if study else _DRAWN[name][1](run)


def draw(path: Path, name: str, kind: str, width_mm: float | None, output: Path | None) -> Path:
    """Draw a figure of a run into a file; returns its path.

    kind: png, svg or pdf. width_mm: of the figure; None for its own width. output: the file; None for one in the run
    folder.
    """
    if kind not in KINDS:
        raise ConfigError(f"--format must be one of {', '.join(KINDS)}, got {kind}")
    drawn, target = _drawn(Run(path), name), output or path / "figures" / f"{name}.{kind}"
    least = _LEAST_SHARE * drawn.get_figwidth() * MM
    if width_mm is not None and not least <= width_mm <= _MOST_MM:
        raise ConfigError(f"--width of this figure must lie between {least:.0f} and {_MOST_MM:g} mm, got {width_mm:g}")
    try:
        write_atomic(target, image(drawn, kind, width_mm))
    except OSError as error:
        raise ConfigError(f"cannot write {target}: {error.strerror}") from error
    return target
