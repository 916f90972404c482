"""`epuckhebb rerun RUN`: the same configuration again, into another folder, and whether its CSV are the same bytes."""

from itertools import zip_longest
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from omegaconf import DictConfig

from epuckhebb.app import evaluate, evolve, files, runs
from epuckhebb.app.config import literal, stored, thread_count
from epuckhebb.app.errors import ConfigError
from epuckhebb.app.hydra_bridge import new_stamp
from epuckhebb.app.parts import rule_file, sha256_of
from epuckhebb.app.progress import say


def rerun(path: Path) -> tuple[Path, str]:
    """Repeat a run; returns the new folder and what differs first, nothing if nothing does.

    Raises:
        ConfigError: It is not a finished run of `evaluate` or `evolve`, or its genome is not what it was.
        JobFailedError: It could not be finished this time.
    """
    told = runs.read(path)
    verb = told["verb"]
    if verb not in ("evaluate", "evolve"):
        raise ConfigError(f"{path} is a run of `epuckhebb {verb}`; rerun repeats those of evaluate and evolve")
    if told["status"]["state"] != "finished":
        raise ConfigError(f"{path} is {told['status']['state']}; only a finished run can be compared with")
    if told["code"].get("science") != runs.science_version():
        say("The program has changed since this run.")
    for name, number in runs.versions(runs.NUMERIC).items():
        before = told.get("packages", {}).get(name)
        if before not in (None, number):
            say(f"{name} was {before} in this run, and is {number} now; digits may differ.")
    new = Path("runs") / verb / f"{new_stamp()}_rerun_of_{path.resolve().name}"
    cfg = stored(path, verb)
    _check_rules(cfg, path, told.get("rules", {}))
    facts = {"command": ["epuckhebb", "rerun", str(path)], "rerun_of": str(path)}
    if verb == "evaluate":
        config, genome = evaluate.asked(cfg)
        if genome.sha256 != told["genome_sha256"]:
            raise ConfigError(
                f"genome={config.genome} is not the genome of {path}: its SHA-256 is {genome.sha256[:16]}…, "
                f"it was {told['genome_sha256'][:16]}…"
            )
        for name in ("baseline_sha256", "self_memory_sha256"):
            if getattr(genome, name) != told.get(name, getattr(genome, name)):
                raise ConfigError(f"genome={config.genome} remembers its training world otherwise than in {path}")
        evaluate.evaluate_into(new, cfg, told["overrides"], facts, threads=thread_count(config.threads))
    else:
        again = evolve.asked(cfg)
        given = evolve.given_weights(again)
        if given is not None and not _begins_with(path, given):
            raise ConfigError(f"genome={again.genome} is not whose weights {path} began with")
        run = evolve.new_run(new, cfg, told["overrides"], facts)
        evolve.evolve_into(run, again, None, threads=thread_count(again.threads))
    return new, _difference(path, new)


def _begins_with(path: Path, weights: NDArray[np.float64]) -> bool:
    """Whether these are the weights of the champion of a run."""
    return np.array_equal(files.load_genome(str(path), "").weights, weights)


def _check_rules(cfg: DictConfig, path: Path, rules: dict[str, str]) -> None:
    """Take the user's own rules from the copies in the run folder, which are what the run lived by.

    Raises:
        ConfigError: A copy is missing or another file than it was.
    """
    for settings in [cfg.hebbian, *(cfg.get("compare") or {}).values()]:
        file = rule_file(settings) if isinstance(settings, DictConfig) else None
        if file is None:
            continue
        copy = path / "rules" / file.name
        if not copy.is_file() or sha256_of(copy) != rules.get(str(file)):
            raise ConfigError(f"{copy} is not the rule of this run: it is missing, or was changed since")
        settings.rule = literal(f"{copy.absolute()}:{str(settings.rule).rpartition(':')[2]}")


def _difference(one: Path, other: Path) -> str:
    """The first CSV file and line in which two runs differ; nothing if they do not."""
    names = sorted({str(file.relative_to(run)) for run in (one, other) for file in run.rglob("*.csv")})
    for name in names:
        for run in (one, other):
            if not (run / name).is_file():
                return f"{run} has no {name}"
        before, after = (one / name).read_bytes(), (other / name).read_bytes()
        if after.split(b"\n", 1)[0] == before.split(b"\n", 1)[0] + b",changed":
            after = _without_last_column(after)  # runs of version 0.1 did not have it
        if before == after:
            continue
        pairs = zip_longest(before.splitlines(keepends=True), after.splitlines(keepends=True), fillvalue=b"")
        number, (was, is_now) = next((n, pair) for n, pair in enumerate(pairs, 1) if pair[0] != pair[1])
        return f"{name} differs first in line {number}:\n  was {_shown(was)}\n  is  {_shown(is_now)}"
    return ""


def _without_last_column(table: bytes) -> bytes:
    return b"".join(line.rpartition(b",")[0] + b"\n" for line in table.splitlines())


def _shown(line: bytes) -> str:
    return line.decode(errors="replace").rstrip("\r\n") if line else "(nothing)"
