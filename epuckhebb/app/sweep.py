"""The jobs of a named sweep: what `conf/experiment/NAME.yaml` and the command line make together.

A job is known by a digest of its resolved configuration, its genome and the version of the science; what is in the run
folder of that name is its result, whenever it was made. The folder of a sweep is named by its jobs, so that the same
command finds it again.
"""

import hashlib
import json
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

from omegaconf import DictConfig, OmegaConf

from epuckhebb.app import compose, genomes, runs
from epuckhebb.app.config import EvaluateConfig, typed
from epuckhebb.app.errors import ConfigError

_NO_EFFECT = ("threads",)  # keys on which no result depends


@dataclass(frozen=True, kw_only=True)
class Job:
    """One evaluation of a sweep.

    number: its place, from 0. overrides: as they would be typed. run: the name of its folder. cfg: resolved.
    """

    number: int
    overrides: list[str]
    run: str
    cfg: DictConfig

    @property
    def settings(self) -> dict[str, str]:
        """What was set for this job and may matter, by key."""
        pairs = (override.lstrip("+").partition("=") for override in self.overrides)
        return {key: value for key, _, value in pairs if key not in ("experiment", *_NO_EFFECT)}


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """A named sweep: its jobs, its folder, the command that asks for it, and what is meant for Hydra's launcher."""

    name: str
    jobs: list[Job]
    folder: Path
    command: list[str]
    launching: list[str]

    def todo(self) -> list[Job]:
        """The jobs of which there is no whole run yet."""
        return [job for job in self.jobs if not _is_whole(self.folder / job.run)]


def plan(name: str, arguments: list[str], config_dir: str | None = None) -> Sweep:
    """List the jobs of a sweep, each composed and checked; two that would do the same are one.

    Raises:
        ConfigError: there is no such sweep, or a key, a value or the genome cannot be used.
    """
    hydras = [argument for argument in arguments if argument.lstrip("+~").startswith(("hydra.", "hydra/"))]
    for argument in hydras:
        if argument.startswith(("hydra/sweeper", "hydra.sweeper", "hydra.sweep.subdir")):
            raise ConfigError(f"{argument}: `sweep` lists its jobs itself; for another sweeper: evaluate --multirun")
    if not any(argument.startswith("hydra/launcher=") for argument in hydras):
        hydras.insert(0, "hydra/launcher=joblib")
    named = [f"experiment={name}"]
    params = compose.composed("evaluate", [*named, *hydras], config_dir, with_hydra=True).hydra.sweeper.params
    if not params:
        raise ConfigError(f"experiment={name} has no hydra.sweeper.params: it is one job, for `epuckhebb evaluate`")
    swept = [f"{key}={values}" for key, values in params.items()]
    choices = compose.alternatives([*swept, *(argument for argument in arguments if argument not in hydras)])
    listed: dict[str, Job] = {}
    for overrides, cfg in compose.combinations("evaluate", named, choices, config_dir):
        run = identity(cfg)
        if run not in listed:
            listed[run] = Job(number=len(listed), overrides=[*named, *overrides], run=run, cfg=cfg)
    all_jobs = list(listed.values())
    return Sweep(
        name=name,
        jobs=all_jobs,
        folder=_folder(name, all_jobs, hydras),
        command=["epuckhebb", "sweep", name, *arguments],
        launching=[argument for argument in hydras if not argument.startswith("hydra.sweep.dir=")],
    )


def _folder(name: str, listed: list[Job], hydras: list[str]) -> Path:
    given = [argument.partition("=")[2] for argument in hydras if argument.startswith("hydra.sweep.dir=")]
    digest = _digest([_settings(job.cfg) for job in listed])
    return Path(given[-1].strip("'\"")) if given else Path("runs") / "sweep" / f"{name}_{digest[:8]}"


def identity(cfg: DictConfig) -> str:
    """The name of the run that a configuration leads to with the genome and the science of this moment.

    Raises:
        ConfigError: a value or the genome cannot be used.
    """
    config = typed(cfg, EvaluateConfig)
    digest = _digest([_settings(cfg), _genome_sha256(config.genome, config.scenario.experiment), _science()])
    return f"job_{digest[:12]}"


@cache
def _science() -> str:
    return runs.science_version()


def _genome_sha256(where: str, experiment: str) -> str:
    return genomes.load(where, experiment).sha256


def _settings(cfg: DictConfig) -> dict[str, Any]:
    settings = OmegaConf.to_container(cfg, resolve=True, enum_to_str=True)
    assert isinstance(settings, dict)
    return {str(key): value for key, value in settings.items() if key not in _NO_EFFECT}


def _digest(content: object) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _is_whole(run: Path) -> bool:
    try:
        return bool(json.loads((run / "status.json").read_text())["state"] == "finished")
    except (OSError, ValueError):
        return False
