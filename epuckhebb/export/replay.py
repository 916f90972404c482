"""`epuckhebb replay RUN`: from a run folder to something to watch, a page or a GIF."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from epuckhebb.analysis import movie
from epuckhebb.analysis import replay as pages
from epuckhebb.analysis.evaluate import Traces
from epuckhebb.config import EvaluateConfig
from epuckhebb.controller.network import Network
from epuckhebb.runs import caption, prepare_evaluation, run_settings
from epuckhebb.runtime import ConfigError
from epuckhebb.store import Run, read_traces, write_atomic
from epuckhebb.studies.flock import replay_page


@dataclass(frozen=True)
class Recording:
    """What a run recorded: lifetimes, first weights, the network, a title, notes."""

    traces: Traces
    weights: NDArray[np.float64]
    network: Network
    config: EvaluateConfig
    title: str
    notes: list[str]


def recording(path: Path) -> Recording:
    """The recorded lifetimes of a run folder."""
    run = Run(path)
    facts = run.provenance
    if facts["command"] != "evaluate":
        raise ConfigError(f"{path} records no lifetimes; give a run of evaluate, as of: evaluate genome={path}")
    config = run_settings(run, "evaluate")
    if config.lifetime.record_every == 0:
        raise ConfigError(f"{path} recorded nothing to replay; run it again with lifetime.record_every=8")
    metrics = run.table("metrics.csv")
    traces, weights, network = read_traces(run)
    title = caption(config, facts.get("genome", "genome"), list(zip(metrics.controller, metrics.N, strict=True)))
    return Recording(traces, weights, network, config, title, facts.get("notes", []))


def replay(run: Path, page: Path | None = None, gif: Path | None = None) -> list[Path]:
    """Write what a run, or a study of flocks, recorded as a page or a GIF; returns the files.

    page: written in the run's folder if no file is named.
    """
    if Run(run).has("lifetime.csv"):
        if page is not None:
            raise ConfigError("a run in an environment is replayed as a GIF; give --gif FILE, or neither of both")
        gif = gif or run / "replay.gif"
        prepared = prepare_evaluation(run_settings(Run(run), "evaluate"))
        film = prepared.world.film(prepared.genome)
        assert film is not None  # an environment draws itself
        write_atomic(gif, film)
        return [gif]
    page = page or (None if gif else run / "replay.html")
    if Run(run).has("flock.csv"):
        if page is None or gif:
            raise ConfigError("--gif is for runs of `epuckhebb evaluate`; a flock is replayed as a page")
        write_atomic(page, replay_page(run).encode())
        return [page]
    recorded = recording(run)
    if page:
        write_atomic(page, recording_page(recorded).encode())
    if gif:
        write_atomic(gif, movie.gif(recorded.traces, recorded.config.world, recorded.title))
    return [file for file in (page, gif) if file]


def recording_page(recorded: Recording) -> str:
    """The page of a recording."""
    title, world, gain = recorded.title, recorded.config.world, recorded.config.lifetime.gain_rad_s
    weights, notes = recorded.weights, recorded.notes
    network = replace(recorded.network, wiring=recorded.config.network_made.wiring)  # the record names it alone
    return pages.page(recorded.traces, weights, world, title, gain_rad_s=gain, network=network, notes=notes)
