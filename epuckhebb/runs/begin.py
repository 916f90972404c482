"""Begins a run in its folder; one of many goes on in the folder in which it was stopped."""

from pathlib import Path
from typing import Any

import yaml

from epuckhebb.config import OWN_CODE, Checked, OwnFile, dump, own_files, settings
from epuckhebb.runtime import ConfigError, conf
from epuckhebb.store import CONFIG, PROVENANCE, Genome, Run, RunFolder


def begin(
    path: Path,
    command: str,
    config: Checked,
    overrides: list[str],
    facts: dict[str, Any],
    *,
    goes_on: bool,
    genome: Genome | None = None,
) -> RunFolder:
    """Claim a folder for a run, and write down what is about to run.

    overrides, facts: as of `RunFolder`. goes_on: whether a run with the same settings that was stopped there goes on;
    else the folder must hold none. genome: of the lifetimes of an evaluation.
    """
    own, text = own_files(config.values), dump(config)
    if not goes_on:
        return RunFolder.new(path, command, text, overrides, facts, own)
    if (path / PROVENANCE).is_file():
        check_same(path, config, genome)
    return RunFolder.resume(path, command, text, overrides, facts, own, overrides=overrides)


def check_same(path: Path, config: Checked, genome: Genome | None = None) -> None:
    """Refuse a folder whose run has other settings, other files of the user's, or another genome."""
    before, now = (dict(conf.flat(values)) for values in (settings(path / CONFIG), yaml.safe_load(dump(config))))
    for key in (*now, *before):
        if key not in conf.NO_EFFECT and before.get(key) != now.get(key):
            was = f"{path} holds a run with {key}={before.get(key, '(none)')}"
            raise ConfigError(f"{was}, this call has {now.get(key, '(none)')}; choose another folder")
    facts = Run(path).provenance
    check_user_files(path, own_files(config.values), facts)
    if genome is not None and genome.sha256 != facts.get("genome_sha256"):
        raise ConfigError(f"genome={genome.name} is not the genome of {path}: its SHA-256 is another")


def check_user_files(path: Path, own: dict[Path, OwnFile], facts: dict[str, Any]) -> None:
    """Refuse to go on where a file of the user's has changed since. facts: the provenance of the run."""
    before = facts.get("own_code", {})
    for file, now in own.items():
        if str(file) not in before or now.copy != before[str(file)]["copy"]:
            raise ConfigError(f"{file}, or a file that it imports, has changed; a copy is in {path / OWN_CODE}")
