"""`epuckhebb rerun RUN`: the same configuration again, into another folder, and whether its CSV are the same bytes."""

from collections.abc import Mapping
from itertools import zip_longest
from pathlib import Path

import numpy as np
from omegaconf import DictConfig

from epuckhebb.config import plugins
from epuckhebb.config.overrides import literal
from epuckhebb.runs import evaluate, evolve
from epuckhebb.runs.hydra import new_stamp, stored
from epuckhebb.runtime.errors import ConfigError
from epuckhebb.runtime.progress import say
from epuckhebb.runtime.resources import thread_count
from epuckhebb.store import provenance
from epuckhebb.store.genome import load_genome
from epuckhebb.store.records import OwnCode
from epuckhebb.store.run import content, read, status_of


def rerun(path: Path) -> tuple[Path, str]:
    """Repeat a run; returns the new folder and what differs first, nothing if nothing does."""
    told = read(path)
    command = told["command"]
    if command not in ("evaluate", "evolve"):
        raise ConfigError(f"{path} is a run of `epuckhebb {command}`; rerun repeats those of evaluate and evolve")
    if told["status"]["state"] != "finished":
        raise ConfigError(f"{path} is {told['status']['state']}; only a finished run can be compared with")
    if told["code"].get("science") != provenance.science_version():
        say("The program has changed since this run.")
    for name, number in provenance.versions(provenance.NUMERIC).items():
        before = told.get("packages", {}).get(name)
        if before not in (None, number):
            say(f"{name} was {before} in this run, and is {number} now; digits may differ.")
    new = Path("runs") / command / f"{new_stamp()}_rerun_of_{path.resolve().name}"
    cfg = stored(path, command)
    _take_copies(cfg, path, told.get("own_code", {}))
    facts = {"command_line": ["epuckhebb", "rerun", str(path)], "rerun_of": str(path)}
    if command == "evaluate":
        config, genome = evaluate.prepare(cfg)
        if genome.sha256 != told["genome_sha256"]:
            raise ConfigError(
                f"genome={config.genome} is not the genome of {path}: its SHA-256 is {genome.sha256[:16]}…, "
                f"it was {told['genome_sha256'][:16]}…"
            )
        for name in ("nominal_sha256", "self_memory_sha256"):
            if told.get(name) not in (None, getattr(genome, name)):
                raise ConfigError(f"genome={config.genome} remembers its training world otherwise than in {path}")
        evaluate.evaluate_into(new, cfg, told["overrides"], facts, threads=thread_count(config.threads))
    else:
        again = evolve.prepare(cfg)
        given = evolve.given_weights(again)
        if given is not None and not np.array_equal(load_genome(str(path), "").weights, given):
            raise ConfigError(f"genome={again.genome} is not whose weights {path} began with")
        run = evolve.new_run(new, cfg, told["overrides"], facts)
        evolve.evolve_into(run, again, None, threads=thread_count(again.threads))
    return new, _difference(path, new)


def _take_copies(cfg: DictConfig, path: Path, own_code: Mapping[str, OwnCode]) -> None:
    """Take the user's own files from their copies in the run folder."""
    for settings, key, file, name in plugins.references(cfg):
        if str(file) not in own_code:
            raise ConfigError(f"{path} has no copy of {file}, which {key} names")
        copy = own_code[str(file)]["copy"]
        folder = copy.rpartition("/")[0]
        for written in status_of(path).get("sha256", {}):
            if written.startswith(f"{folder}/"):
                content(path, written)  # it is as it was written
        settings[key] = literal(f"{(path / copy).absolute()}:{name}")


def _difference(one: Path, other: Path) -> str:
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
        shown = [line.decode(errors="replace").rstrip("\r\n") or "(nothing)" for line in (was, is_now)]
        return f"{name} differs first in line {number}:\n  was {shown[0]}\n  is  {shown[1]}"
    return ""
