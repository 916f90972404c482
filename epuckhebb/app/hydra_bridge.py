"""From a Typer command to `hydra.main`, through Hydra's public interface.

Typer owns the options, Hydra owns `key=value`. The command builds the argument list that Hydra would have found on a
command line of its own, so that real launchers, sweepers and `.hydra/` work; and it turns what Hydra raises into one
message and an exit code.
"""

import difflib
import os
import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import datetime
from importlib.metadata import version
from pathlib import Path
from secrets import token_hex
from typing import Any

import hydra
from hydra.core.global_hydra import GlobalHydra
from hydra.errors import HydraException
from omegaconf import DictConfig
from omegaconf.errors import OmegaConfBaseException

from epuckhebb.app.data import data_folder
from epuckhebb.app.errors import ConfigError, JobFailedError

STAMP = "EPUCKHEBB_STAMP"  # environment variable that conf/ names run folders with
IS_HYDRA_1_4 = int(version("hydra-core").split(".")[1]) >= 4
_EXTRAS = {"submitit": "slurm", "ray": "ray"}


def run(verb: str, job: Callable[[DictConfig], Any], arguments: list[str]) -> str:
    """Run `job` on the configuration that `arguments` (overrides and Hydra's own options) describe.

    Returns the stamp that the folders of this call bear.

    Raises:
        ConfigError: the arguments do not make a configuration; or the job said so.
        JobFailedError: a job failed, or the launcher of several.
    """
    options: dict[str, Any] = {"execution_whitelist": ("epuckhebb.*",)} if IS_HYDRA_1_4 else version_base()
    entry = hydra.main(config_path=str(data_folder("conf")), config_name=verb, **options)(job)
    stamp = new_stamp()
    if "--multirun" in arguments and not any(argument.startswith("hydra.sweep.dir=") for argument in arguments):
        # In words, not as an environment variable: workers that a launcher keeps from an earlier call have the old one.
        arguments = [f"hydra.sweep.dir={_multirun_folder(verb, stamp)}", *arguments]
    with _as_command_line(verb, arguments, stamp):
        GlobalHydra.instance().clear()
        try:
            entry()
        except (HydraException, OmegaConfBaseException) as error:
            raise ConfigError(explain(error)) from error
        except (ConfigError, JobFailedError):
            raise
        except Exception as error:
            if "--multirun" in arguments:  # jobs wrap what goes wrong in them, so this is the launcher's
                raise JobFailedError(f"the launcher stopped: {type(error).__name__}: {error}") from error
            raise
    return stamp


def version_base() -> dict[str, Any]:
    """The argument `version_base` where Hydra wants it; from 1.4 on it is warned about."""
    return {} if IS_HYDRA_1_4 else {"version_base": "1.3"}


def new_stamp() -> str:
    """When, and a random part that keeps apart what begins in the same second."""
    return f"{datetime.now():%Y%m%d-%H%M%S}-{token_hex(4)}"


@contextmanager
def _as_command_line(verb: str, arguments: list[str], stamp: str) -> Iterator[None]:
    """What Hydra reads: the argument list, and a wish to have errors raised instead of printed."""
    argv, environment = sys.argv, {name: os.environ.get(name) for name in (STAMP, "HYDRA_FULL_ERROR")}
    sys.argv = [f"epuckhebb {verb}", *arguments]
    os.environ.update({STAMP: stamp, "HYDRA_FULL_ERROR": "1"})
    try:
        yield
    finally:
        sys.argv = argv
        for name, value in environment.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value


def explain(error: BaseException) -> str:
    """Hydra's message, made fit for a reader: causes included, advice that does not apply left out, near keys named."""
    lines: list[str] = []
    current: BaseException | None = error
    while current is not None:
        for line in str(current).splitlines():
            kept = line.strip()
            if kept and kept not in lines and not kept.startswith(("object_type=", "reference_type=", "full_key:")):
                lines.append(kept)
        current = current.__cause__
    full_key = re.search(r"full_key: (\S+)", str(error))
    if full_key and not any(full_key[1] in line for line in lines):
        lines.insert(0, f"{full_key[1]}:")
    lines = [line for line in lines if not line.startswith("Config search path") and "provider=" not in line]
    text = re.sub(r"Did you mean: '(.+?)'\?", r"Did you mean: \1?", "\n".join(lines))
    missing = re.search(r"Could not (?:find|load) 'hydra/launcher/(submitit|ray)(?:_\w+)?'", text)
    if missing:
        text += f'\nThis launcher is a plug-in: pip install "epuckhebb[{_EXTRAS[missing[1]]}]"'
    if "LexerNoViableAlt" in type(error).__name__ or "mismatched input" in text or "missing EQUAL" in text:
        text += "\nSettings are written KEY=VALUE, for example scenario=4obstacles or hebbian.N=0.002"
    wrong = re.search(r"Could not override '([^']+)'", text)
    if wrong and "Did you mean" not in text:
        near = difflib.get_close_matches(wrong[1], known_keys(), n=3)
        if near:
            text += f"\nDid you mean: {', '.join(near)}?"
    return text


def known_keys() -> list[str]:
    """All keys and groups of the configuration, as they are written in an override."""
    from omegaconf import OmegaConf

    from epuckhebb.app.config import EvaluateConfig, EvolveConfig

    def below(node: Any, prefix: str) -> Iterator[str]:
        for key, value in node.items():
            yield prefix + key
            if isinstance(value, dict):
                yield from below(value, f"{prefix}{key}.")

    found: set[str] = set()
    for schema in (EvaluateConfig, EvolveConfig):
        found.update(below(OmegaConf.to_container(OmegaConf.structured(schema)), ""))
    return sorted(found)


def _multirun_folder(verb: str, stamp: str) -> Path:
    return Path("runs") / verb / f"{stamp}_multirun"


def runs_of(verb: str, stamp: str, arguments: list[str]) -> list[Path]:
    """The run folders of a multirun, in the order of its jobs."""
    folder = _multirun_folder(verb, stamp)
    for argument in arguments:
        if argument.startswith("hydra.sweep.dir="):
            folder = Path(argument.split("=", 1)[1])
    runs = [status.parent for status in folder.glob("*/status.json")]
    return sorted(runs, key=lambda run: (not run.name.isdigit(), int(run.name) if run.name.isdigit() else 0, run.name))
