"""`epuckhebb rerun RUN`: the same configuration again, into another folder, and whether its CSV are the same bytes."""

from collections.abc import Callable
from itertools import zip_longest
from pathlib import Path

from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException
from yaml import YAMLError

from epuckhebb.app import genomes, jobs, runs
from epuckhebb.app.config import EvaluateConfig, EvolveConfig, thread_count, typed
from epuckhebb.app.errors import ConfigError
from epuckhebb.app.hydra_bridge import new_stamp

_SCHEMAS = {"evaluate": EvaluateConfig, "evolve": EvolveConfig}


def rerun(path: Path, say: Callable[[str], None]) -> tuple[Path, str]:
    """Repeat a run; returns the new folder and what differs first, nothing if nothing does.

    say: is told what the user should know.

    Raises:
        ConfigError: it is not a finished run of `evaluate` or `evolve`, or its genome is not what it was.
        JobFailedError: it could not be finished this time.
    """
    told = runs.read(path)
    verb = told["verb"]
    if verb not in _SCHEMAS:
        raise ConfigError(f"{path} is a run of `epuckhebb {verb}`; rerun repeats those of {' and '.join(_SCHEMAS)}")
    if told["status"]["state"] != "finished":
        raise ConfigError(f"{path} is {told['status']['state']}; only a finished run can be compared with")
    if told["code"].get("science") != runs.science_version():
        say("The program has changed since this run.")
    new = Path("runs") / verb / f"{new_stamp()}_rerun_of_{path.resolve().name}"
    cfg = settings(path, verb)
    facts = {"command": ["epuckhebb", "rerun", str(path)], "rerun_of": str(path)}
    if verb == "evaluate":
        config = typed(cfg, EvaluateConfig)
        genome = genomes.load(config.genome, config.scenario.experiment)
        if genome.sha256 != told["genome_sha256"]:
            raise ConfigError(
                f"genome={config.genome} is not the genome of {path}: its SHA-256 is {genome.sha256[:16]}…, "
                f"it was {told['genome_sha256'][:16]}…"
            )
        jobs.evaluate_into(new, cfg, told["overrides"], facts, threads=thread_count(config.threads))
    else:
        run = jobs.evolve_folder(new, cfg, told["overrides"], facts)
        again = typed(cfg, EvolveConfig)
        jobs.evolve_into(run, again, None, threads=thread_count(again.threads), quiet=jobs.is_quiet())
    return new, difference(path, new)


def settings(path: Path, verb: str) -> DictConfig:
    """The configuration that a run wrote down.

    Raises:
        ConfigError: it cannot be read, or holds what this program does not know.
    """
    file = path / ".hydra" / "config.yaml"
    try:
        cfg = OmegaConf.merge(OmegaConf.structured(_SCHEMAS[verb]), OmegaConf.load(file))
    except (OSError, YAMLError, OmegaConfBaseException) as error:
        raise ConfigError(f"{file} cannot be used: {error}") from error
    assert isinstance(cfg, DictConfig)
    return cfg


def difference(one: Path, other: Path) -> str:
    """The first CSV file and line in which two runs differ; nothing if they do not."""
    names = sorted({str(file.relative_to(run)) for run in (one, other) for file in run.rglob("*.csv")})
    for name in names:
        for run in (one, other):
            if not (run / name).is_file():
                return f"{run} has no {name}"
        before, after = (one / name).read_bytes(), (other / name).read_bytes()
        if before == after:
            continue
        pairs = zip_longest(before.splitlines(keepends=True), after.splitlines(keepends=True), fillvalue=b"")
        number, (was, is_now) = next((n, pair) for n, pair in enumerate(pairs, 1) if pair[0] != pair[1])
        return f"{name} differs first in line {number}:\n  was {_shown(was)}\n  is  {_shown(is_now)}"
    return ""


def _shown(line: bytes) -> str:
    return line.decode(errors="replace").rstrip("\r\n") if line else "(nothing)"
