"""`epuckhebb evolve resume=RUN`: go on in the folder of an evolution that was stopped, to the same bytes.

The checkpoint alone says how far it had come; `history.csv` and `champion.npz` are written anew from it, so that it
does not matter between which two files the run was killed.
"""

from collections.abc import Callable
from pathlib import Path

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from epuckhebb.app import checkpoint, jobs, runs
from epuckhebb.app.config import EvolveConfig, thread_count, typed
from epuckhebb.app.errors import ConfigError
from epuckhebb.app.hydra_bridge import explain
from epuckhebb.app.rerun import settings

KEY = "resume="
_CHANGEABLE = ("ga.generations", "threads")  # the others would make it another evolution


def resume(arguments: list[str], say: Callable[[str], None]) -> Path:
    """Go on with the evolution that `resume=RUN` names; returns its folder.

    say: is told what the user should know.

    Raises:
        ConfigError: it is no evolution of this program, it is at work, or other settings were given.
        JobFailedError: it could not be finished.
    """
    named = [argument.removeprefix(KEY) for argument in arguments if argument.startswith(KEY)]
    changes = [argument for argument in arguments if not argument.startswith(KEY)]
    if len(named) != 1 or not named[0]:
        raise ConfigError("resume=RUN names one run folder of `epuckhebb evolve`")
    path = Path(named[0]).expanduser()
    told = runs.read(path)
    if told["verb"] != "evolve":
        raise ConfigError(f"resume={path} is a run of `epuckhebb {told['verb']}`; only evolutions can be resumed")
    cfg = _changed(path, changes)
    config = typed(cfg, EvolveConfig)
    after = checkpoint.read(path, config.ga.population)
    done = after.generation.number + 1 if after else 0
    if config.ga.generations < done:
        raise ConfigError(
            f"ga.generations must be {done} or more, the generations that {path} has, got {config.ga.generations}"
        )
    if config.ga.generations == done and told["status"]["state"] == "finished":
        say(f"{path} has all of its {done} generations; ga.generations={2 * done} would add {done}.")
        return path
    if told["code"].get("science") != runs.science_version():
        say("The program has changed since this evolution began; it may end otherwise than one that never stopped.")
    say(f"Going on after {done} of {config.ga.generations} generations.")
    resumed = {"command": ["epuckhebb", "evolve", *arguments], "generations": done}
    run = runs.RunFolder.reopened(path, cfg, resumed)
    jobs.evolve_into(run, config, after, threads=thread_count(config.threads), quiet=jobs.is_quiet())
    return path


def _changed(path: Path, changes: list[str]) -> DictConfig:
    """The configuration of the run, with what may be changed changed."""
    cfg = settings(path, "evolve")
    for change in changes:
        key, _, value = change.partition("=")
        if key not in _CHANGEABLE:
            raise ConfigError(
                f"{change} cannot be given with {KEY}: the evolution goes on with the settings in "
                f"{path}/.hydra/config.yaml; only {' and '.join(_CHANGEABLE)} may be changed"
            )
        try:
            OmegaConf.update(cfg, key, value)
        except OmegaConfBaseException as error:
            raise ConfigError(explain(error)) from error
    return cfg
