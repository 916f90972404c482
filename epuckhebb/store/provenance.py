"""Records what a result depends on: the code, the packages, the machine and the science."""

import hashlib
import json
import math
import os
import platform
import struct
import subprocess
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any

from epuckhebb import __version__
from epuckhebb.runtime import say, thread_count
from epuckhebb.store.disk import SCHEMA
from epuckhebb.store.genome import Genome

# The number of the science. Raise it when `tests/test_digest.py` says that results have other bits. Then finished jobs
# of a study run again, and `rerun` and `resume=` say that the program has changed.
SCIENCE = 2
_PACKAGE = Path(__file__).resolve().parents[1]
_NUMERIC = ("cmaes", "numba", "numpy", "pymunk")  # the packages on which digits may depend
_PLACES = (  # variables that send git to another repository, as in a hook
    *("GIT_DIR", "GIT_WORK_TREE", "GIT_INDEX_FILE", "GIT_OBJECT_DIRECTORY", "GIT_ALTERNATE_OBJECT_DIRECTORIES"),
    *("GIT_COMMON_DIR", "GIT_PREFIX", "GIT_CEILING_DIRECTORIES", "GIT_NAMESPACE"),
)
_PACKAGES = ("epuckhebb", "cmaes", "pymunk", "numpy", "numba", "pandas", "hydra-core", "typer", "matplotlib")


def digest(content: object) -> str:
    """Twelve hexadecimal digits that name any JSON values."""
    return hashlib.sha256(json.dumps(content, sort_keys=True, default=str).encode()).hexdigest()[:12]


def fingerprint(values: object, genome: Genome | None = None, user_code: object = ()) -> str:
    """Twelve hexadecimal digits for a result, from all that it depends on.

    values: the settings, as JSON values. genome: of its lifetimes. user_code: digests of the user's own files.
    """
    champion = [genome.sha256, genome.nominal_sha256] if genome else []
    return digest([SCIENCE, versions(), values, champion, user_code])


def provenance(command: str, arguments: list[str]) -> dict[str, Any]:
    """Who ran what, with what, where."""
    return {
        "schema": SCHEMA,
        "command": command,
        "command_line": ["epuckhebb", command, *arguments],
        "overrides": arguments,
        "code": dict(_code_version()),
        "packages": versions(_PACKAGES),
        "python": platform.python_version(),
        "platform": platform.platform(),
        "c_library": " ".join(platform.libc_ver()).strip(),
        "functions": functions_digest(),
        "cores": thread_count(),
    }


@cache
def functions_digest() -> str:
    """Twelve hexadecimal digits of 1,000 values each of exp, tanh, sin and cos of the C library of this machine.

    Compiled lifetimes call the same functions. Another C library, or one that chooses other code for another processor,
    may round the last digit otherwise, and an evolution then takes another course.
    """
    values = [function(k / 64.0 - 8.0) for function in (math.exp, math.tanh, math.sin, math.cos) for k in range(1000)]
    return hashlib.sha256(struct.pack(f"<{len(values)}d", *values)).hexdigest()[:12]


def compare_machines(path: Path, facts: Mapping[str, Any]) -> None:
    """Warn if a run was begun on a machine whose exp, tanh, sin or cos give other digits. facts: its provenance."""
    if facts.get("functions", functions_digest()) != functions_digest():
        where = f"{facts['platform']}, {facts['c_library']}"
        say(f"{path} was begun on {where}, whose exp, tanh, sin or cos have other last digits: results may differ.")


@cache
def _code_version() -> dict[str, Any]:
    """The version of this program and of its science, and its git commit where it runs from a checkout."""
    facts: dict[str, Any] = {"version": __version__, "science": SCIENCE, "commit": None, "dirty": None}
    if not (_PACKAGE.parent / ".git").exists():  # it is installed, perhaps below a user's project
        return facts
    command = ["git", "-C", str(_PACKAGE), "status", "--porcelain=v2", "--branch", "--", str(_PACKAGE)]
    environment = {name: value for name, value in os.environ.items() if name not in _PLACES}
    with suppress(OSError, subprocess.SubprocessError):
        state = subprocess.run(command, capture_output=True, timeout=5, check=True, text=True, env=environment).stdout
        commit, *lines = state.splitlines()
        facts["commit"] = commit.removeprefix("# branch.oid ")
        facts["dirty"] = any(not line.startswith("# ") for line in lines)
    return facts


@cache
def versions(packages: tuple[str, ...] = _NUMERIC) -> dict[str, str]:
    """The versions of packages that are installed; by default of those on which digits may depend."""
    return {name: version(name) for name in packages}
