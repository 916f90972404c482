"""`epuckhebb replay RUN`: from a run folder to something to watch, a page, a GIF or a film."""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.progress import track

from epuckhebb.app import files, runs
from epuckhebb.app.config import EvaluateConfig, stored, typed
from epuckhebb.app.errors import ConfigError
from epuckhebb.app.evaluate import caption
from epuckhebb.app.terminal import Terminal
from epuckhebb.sim.maze import SIDES
from epuckhebb.sim.network import Network
from epuckhebb.study import movie, replay
from epuckhebb.study.evaluate import Traces
from epuckhebb.study.self_checks import told


@dataclass(frozen=True, kw_only=True)
class Recording:
    """What a run recorded: its lifetimes, the weights and the network they began with, a title, what robots found."""

    traces: Traces
    weights: NDArray[np.float64]
    network: Network
    config: EvaluateConfig
    title: str
    found: dict[str, str]


def recording(run: Path) -> Recording:
    """The recorded lifetimes of a run folder.

    Raises:
        ConfigError: It is not a run folder, it recorded nothing, or a file in it cannot be read.
    """
    facts = runs.read(run)
    if facts["verb"] == "evolve":
        raise ConfigError(
            f"{run} is a run of `epuckhebb evolve`, which records no lifetimes; let its champion live first: "
            f"epuckhebb evaluate genome={run}"
        )
    if facts["verb"] != "evaluate":
        raise ConfigError(f"{run} is of `epuckhebb {facts['verb']}`; give a run folder of `epuckhebb evaluate`")
    config = typed(stored(run, "evaluate"), EvaluateConfig)
    if config.lifetime.record_every == 0:
        alone = facts["command"][1:2] == ["evaluate"]  # else a study's, of which it is one job
        asked = facts["command"] if alone else ["epuckhebb", "evaluate", *facts["overrides"]]
        kept = [word for word in asked if not word.startswith("lifetime.record_every=")]
        raise ConfigError(
            f"{run} recorded nothing to replay, because it ran with lifetime.record_every=0; run it again with "
            f"recording on: {' '.join([*kept, 'lifetime.record_every=8'])}"
        )
    lifetimes = len(SIDES) * (1 + len(config.controllers))
    samples = -(-config.lifetime.steps // config.lifetime.record_every)
    traces, weights, network = files.read_traces(run, facts["status"]["state"], lifetimes, samples)
    title = caption(config, facts.get("genome", "genome"))
    return Recording(
        traces=traces, weights=weights, network=network, config=config, title=title, found=found_in(run, config)
    )


def found_in(run: Path, config: EvaluateConfig) -> dict[str, str]:
    """A sentence for each side on what the robots of the recorded lifetimes found in their self-check."""
    shown = [row for row in files.read_findings(run) if row["repeat"] == 0]
    who = " and ".join(f"“{one.name}”" for one in config.controllers if one.adaptation.self_check)
    return {str(row["side"]): f"Before its life, the robot with {who} found: {told(row)}." for row in shown}


def write_page(recorded: Recording, target: Path) -> None:
    """Write the page of a recording.

    Raises:
        ConfigError: `target` cannot be written.
    """
    gain = recorded.config.lifetime.gain_rad_s
    config = recorded.config
    text = replay.page(
        recorded.traces,
        recorded.weights,
        config.world,
        recorded.title,
        gain_rad_s=gain,
        network=recorded.network,
        found=recorded.found,
    )
    _write(target, text.encode())


def write_movie(recorded: Recording, target: Path, make: Callable[..., bytes]) -> None:
    """Write a recording as `make` does it, `movie.gif` or `movie.mp4`; the progress is shown on standard error.

    Raises:
        ConfigError: `target` cannot be written.
    """
    show = functools.partial(track, description=target.name, console=Terminal(stderr=True))
    _write(target, make(recorded.traces, recorded.config.world, recorded.title, show))


def require_video() -> None:
    """Check that films can be made, before anything else is.

    Raises:
        ConfigError: imageio-ffmpeg is not installed; the message says how to install it.
    """
    if not movie.can_make_mp4():
        raise ConfigError('--mp4 needs imageio-ffmpeg, which is not installed: pip install "epuckhebb[video]"')


def _write(target: Path, content: bytes) -> None:
    try:
        runs.write_whole(target, content)
    except OSError as error:
        raise ConfigError(f"cannot write {target}: {error.strerror}") from error
