"""From a run folder to something to watch: a page, a GIF, a film."""

import functools
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from omegaconf import OmegaConf
from omegaconf.errors import OmegaConfBaseException
from rich.console import Console
from rich.progress import track

from epuckhebb.app import runs
from epuckhebb.app.config import EvaluateConfig, typed
from epuckhebb.app.errors import ConfigError
from epuckhebb.app.jobs import caption
from epuckhebb.sim.lifetime import Samples
from epuckhebb.study import movie, replay
from epuckhebb.study.evaluate import Traces


@dataclass(frozen=True, kw_only=True)
class Recording:
    """What a run recorded. genome: (234,). title: a line that says which run it is."""

    traces: Traces
    genome: NDArray[np.float64]
    config: EvaluateConfig
    title: str


def recording(run: Path) -> Recording:
    """The recorded lifetimes of a run folder.

    Raises:
        ConfigError: it is not a run folder, it recorded nothing, or a file in it cannot be read.
    """
    told = runs.read(run)
    if told["verb"] != "evaluate":
        raise ConfigError(
            f"{run} is a run of `epuckhebb {told['verb']}`, which records no lifetimes; let its champion live first: "
            f"epuckhebb evaluate genome={run}"
        )
    try:
        loaded: Any = OmegaConf.load(run / ".hydra" / "config.yaml")
        merged: Any = OmegaConf.merge(OmegaConf.structured(EvaluateConfig), loaded)
        config = typed(merged, EvaluateConfig)
    except (OSError, OmegaConfBaseException) as error:
        raise ConfigError(f"{run}/.hydra/config.yaml cannot be read: {error}") from error
    if config.lifetime.record_every == 0:
        kept = [override for override in told["overrides"] if not override.startswith("lifetime.record_every=")]
        raise ConfigError(
            f"{run} recorded nothing to replay, because it ran with lifetime.record_every=0; run it again with "
            f"recording on: {' '.join(['epuckhebb evaluate', *kept, 'lifetime.record_every=8'])}"
        )
    try:
        with (run / "traces.npz").open("rb") as file:
            arrays = dict(np.load(file, allow_pickle=False))
        arrays.setdefault("surprise", np.full_like(arrays["rate"], np.nan))  # runs from before there was surprise
        traces = Traces(
            controller=arrays["controller"].tolist(),
            side=arrays["side"].tolist(),
            samples=Samples(**{name: arrays[name] for name in Samples._fields}),
        )
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        state = told["status"]["state"]
        raise ConfigError(f"{run}/traces.npz cannot be read (the run is {state}): {error}") from error
    return Recording(
        traces=traces, genome=arrays["genome"], config=config, title=caption(config, told.get("genome", "genome"))
    )


def write_page(recorded: Recording, target: Path) -> None:
    """Write the page of a recording.

    Raises:
        ConfigError: `target` cannot be written.
    """
    text = replay.page(
        recorded.traces,
        recorded.genome,
        recorded.config.scenario,
        recorded.title,
        gain_rad_s=recorded.config.lifetime.gain_rad_s,
    )
    _write(target, text.encode())


def write_movie(recorded: Recording, target: Path, make: Callable[..., bytes]) -> None:
    """Write a recording as `make` does it, `movie.gif` or `movie.mp4`; the progress is shown on standard error.

    Raises:
        ConfigError: `target` cannot be written.
    """
    show = functools.partial(track, description=target.name, console=Console(stderr=True))
    _write(target, make(recorded.traces, recorded.config.scenario, recorded.title, show))


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
