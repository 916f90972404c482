"""`epuckhebb replay RUN`: from a run folder to something to watch, a page, a GIF or a film."""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from epuckhebb.analysis import replay
from epuckhebb.analysis.evaluate import Traces
from epuckhebb.config import EvaluateConfig, from_values, hand, settings, without_own_code
from epuckhebb.controller.network import Network
from epuckhebb.runs import caption
from epuckhebb.runtime import ConfigError, track
from epuckhebb.store import Run, read_traces, write_atomic


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


def write_page(recorded: Recording, target: Path) -> None:
    """Write the page of a recording."""
    title, world, gain = recorded.title, recorded.config.world, recorded.config.lifetime.gain_rad_s
    weights, network, notes = recorded.weights, recorded.network, recorded.notes
    page = replay.page(recorded.traces, weights, world, title, gain_rad_s=gain, network=network, notes=notes)
    write(target, page.encode())


def write_movie(recorded: Recording, target: Path, make: Callable[..., bytes]) -> None:
    """Write a recording as `make` does it, `movie.gif` or `movie.mp4`; the progress is shown on standard error."""
    show = functools.partial(track, target.name)
    write(target, make(recorded.traces, recorded.config.world, recorded.title, show))


def require_video() -> None:
    """Check that imageio-ffmpeg is installed, which makes films."""
    if find_spec("imageio_ffmpeg") is None:
        raise ConfigError('--mp4 needs imageio-ffmpeg, which is not installed: pip install "epuckhebb[video]"')


def write(target: Path, content: bytes) -> None:
    """Write a page or a film where the user wants it."""
    try:
        write_atomic(target, content)
    except OSError as error:
        raise ConfigError(f"cannot write {target}: {error.strerror}") from error
