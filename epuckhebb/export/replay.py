"""`epuckhebb replay RUN`: from a run folder to something to watch, a page, a GIF or a film."""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from epuckhebb.analysis import movie
from epuckhebb.analysis import replay as pages
from epuckhebb.analysis.evaluate import Traces
from epuckhebb.config import EvaluateConfig, from_values, hand, settings, without_own_code
from epuckhebb.controller.network import Network
from epuckhebb.runs import caption
from epuckhebb.runtime import ConfigError, track
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
    if facts["command"] == "evolve":
        raise ConfigError(
            f"{path} is a run of `epuckhebb evolve`, which records no lifetimes; evaluate its champion first: "
            f"epuckhebb evaluate genome={path}"
        )
    if facts["command"] != "evaluate":
        raise ConfigError(f"{path} is of `epuckhebb {facts['command']}`; give a run folder of `epuckhebb evaluate`")
    config = from_values(
        hand.take_copy(without_own_code(settings(run.config_file)), run.path), EvaluateConfig, str(run.path)
    )
    if config.lifetime.record_every == 0:
        alone = facts["command_line"][1:2] == ["evaluate"]  # else a study's, of which it is one job
        typed = facts["command_line"] if alone else ["epuckhebb", "evaluate", *facts["overrides"]]
        words = [word for word in typed if not word.startswith("lifetime.record_every=")]
        raise ConfigError(
            f"{path} recorded nothing to replay, because it ran with lifetime.record_every=0; run it again with "
            f"recording on: {' '.join([*words, 'lifetime.record_every=8'])}"
        )
    metrics = run.table("metrics.csv")
    traces, weights, network = read_traces(run)
    title = caption(config, facts.get("genome", "genome"), list(zip(metrics.controller, metrics.N, strict=True)))
    return Recording(traces, weights, network, config, title, facts.get("notes", []))


def replay(run: Path, page: Path | None = None, gif: Path | None = None, mp4: Path | None = None) -> list[Path]:
    """Write what a run, or a study of flocks, recorded as a page, a GIF or a film; returns the files.

    page: written in the run's folder if no file is named. The progress of a GIF or a film is shown on standard error.
    """
    if mp4 and find_spec("imageio_ffmpeg") is None:
        raise ConfigError('--mp4 needs imageio-ffmpeg, which is not installed: pip install "epuckhebb[video]"')
    page = page or (None if gif or mp4 else run / "replay.html")
    content: dict[Path, Callable[[], bytes]] = {}
    if Run(run).has("flock.csv"):
        if page is None or gif or mp4:
            raise ConfigError("--gif and --mp4 are for runs of `epuckhebb evaluate`; a flock is replayed as a page")
        content[page] = lambda: replay_page(run).encode()
    else:
        recorded = recording(run)
        shown = recorded.traces, recorded.config.world, recorded.title
        if page:
            content[page] = lambda: page_of(recorded).encode()
        for film, make in ((gif, movie.gif), (mp4, movie.mp4)):
            if film:
                content[film] = functools.partial(make, *shown, functools.partial(track, film.name))
    for file, make_content in content.items():
        try:
            write_atomic(file, make_content())
        except OSError as error:
            raise ConfigError(f"cannot write {file}: {error.strerror}") from error
    return list(content)


def page_of(recorded: Recording) -> str:
    """The page of a recording."""
    title, world, gain = recorded.title, recorded.config.world, recorded.config.lifetime.gain_rad_s
    weights, network, notes = recorded.weights, recorded.network, recorded.notes
    return pages.page(recorded.traces, weights, world, title, gain_rad_s=gain, network=network, notes=notes)
