"""`epuckhebb rerun RUN`: repeats a run in another folder, and compares the bytes of all CSV files."""

from itertools import zip_longest
from pathlib import Path
from typing import Any

import numpy as np

from epuckhebb.config import OWN_CODE, find_schema, hand, make_config, settings, substitute_copies
from epuckhebb.runs.evaluate import evaluate_job, prepare_evaluation
from epuckhebb.runs.evolve import evolve_job, prepare_evolution
from epuckhebb.runs.hydra import Job, new_stamp
from epuckhebb.runtime import ConfigError, say, thread_count
from epuckhebb.store import SCIENCE, Run, compare_machines, load_genome, versions


def run_settings(run: Run, command: str) -> Any:
    """The settings of a run of a command, with its copies of the user's files, which are as the run wrote them."""
    for name in run.status.get("sha256", {}):
        if name == hand.NAME or name.startswith(f"{OWN_CODE}/"):
            run.content(name)
    values = substitute_copies(settings(run.config_file), run.path, run.provenance.get("own_code", {}))
    return make_config(values, find_schema(command, values), str(run.path))


def repeat(path: Path) -> tuple[Path, str]:
    """Repeat a run; returns the new folder and the first difference, "" if there is none."""
    run = Run(path)
    facts, state = run.provenance, run.status["state"]
    command = facts["command"]
    if command not in ("evaluate", "evolve"):
        raise ConfigError(f"{path} is a run of `epuckhebb {command}`; rerun repeats those of evaluate and evolve")
    if state != "finished":
        raise ConfigError(f"{path} is {state}; only a finished run can be compared with")
    if facts["code"].get("science") != SCIENCE:
        say("The program has changed since this run.")
    compare_machines(path, facts)
    for name, number in versions().items():
        before = facts.get("packages", {}).get(name)
        if before not in (None, number):
            say(f"{name} was {before} in this run, and is {number} now; digits may differ.")
    new = Path("runs") / command / f"{new_stamp()}_rerun_of_{path.resolve().name}"
    more = {"command_line": ["epuckhebb", "rerun", str(path)], "rerun_of": str(path)}
    config = run_settings(run, command)
    if command == "evaluate":
        genome = prepare_evaluation(config).genome
        if genome.sha256 != facts["genome_sha256"]:
            raise ConfigError(f"genome={config.genome} is not the genome of {path}: its SHA-256 is another")
    else:
        again, champion = prepare_evolution(config), load_genome(str(path), "")
        if again.given is not None and not np.array_equal(champion.network_genes, again.given):
            raise ConfigError(f"genome={config.genome} does not hold the weights with which {path} began")
        if champion.start != again.start_text:
            raise ConfigError(f"start={config.start} does not hold the genes at which {path} began")
    job = Job(new, config, facts["overrides"], more, thread_count(config.threads), in_multirun=False)
    (evaluate_job if command == "evaluate" else evolve_job)(job)
    return new, _difference(path, new)


def _difference(one: Path, other: Path) -> str:
    """The first CSV file and line in which two runs differ; nothing if they do not."""
    for name in sorted({str(file.relative_to(run)) for run in (one, other) for file in run.rglob("*.csv")}):
        files = (one / name, other / name)
        lines = [file.read_bytes().splitlines(keepends=True) if file.is_file() else [] for file in files]
        for number, (before, now) in enumerate(zip_longest(*lines), 1):
            if before != now:
                return f"{name} differs first in line {number}"
    return ""
