"""Declares the arguments and options that commands share, and what their help shows."""

import re
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer
from typer.core import TyperCommand, TyperGroup

from epuckhebb.cli import completion
from epuckhebb.cli.output import report_errors
from epuckhebb.runtime import LATEST, REFERENCE, conf

_FROM_TO = re.compile(rf"{REFERENCE}_(\d+),\.\.\.,{REFERENCE}_(\d+)")


class _AsTyped:
    """In place of what Typer makes of a value by pydantic, which takes a tenth of a warm start to load.

    A text stays as it was typed; where there is another value to convert, Typer does it. Versions before 0.29 do not
    look for this.
    """

    def coerce(self, value: Any, param: Any, ctx: Any) -> Any:
        """See Typer."""
        several = param.nargs == -1
        if value is None:
            return () if several else None
        if param.type_descriptor.annotation in (str, list[str]):
            return list(value) if several else value
        param._runtime_param = None
        return param.get_runtime_param().coerce(value, param=param, ctx=ctx)


def _leave_as_typed(params: list[Any]) -> None:
    for param in params:
        param._runtime_param = _AsTyped()


class Commands(TyperGroup):
    """All commands."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """See Typer."""
        _leave_as_typed(self.get_params(ctx))
        return super().parse_args(ctx, args)


class Command(TyperCommand):
    """A command whose help begins with examples, and whose errors become one message and an exit code."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """See Typer."""
        _leave_as_typed(self.get_params(ctx))
        return super().parse_args(ctx, args)

    def invoke(self, ctx: Any) -> Any:
        """Do what the command does."""
        with report_errors():
            return super().invoke(ctx)

    def format_help_text(self, ctx: Any, formatter: Any) -> None:
        """Write what the command does, then examples."""
        super().format_help_text(ctx, formatter)
        command = str(ctx.info_name)
        with formatter.section("Examples"):
            for example in _EXAMPLES[command]:
                formatter.write(f"  epuckhebb {command} {example}".rstrip() + "\n")


class ConfiguredCommand(Command):
    """A command that takes `key=value`; its help names the configuration groups, and the sweeps."""

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        """Write the names below the options."""
        groups = conf.groups(str(ctx.info_name))
        sweeps = groups.pop("experiment", [])
        if ctx.info_name == "sweep":
            with formatter.section("Names, beside those of your own"):
                formatter.write_text(", ".join(sweeps))
        with formatter.section("Groups (GROUP=CHOICE, GROUP.KEY=VALUE; epuckhebb keys GROUP lists both)"):
            formatter.write_text(", ".join(groups))


_EXAMPLES = {
    "evolve": [
        "seed=7",
        "scenario=highlight optimizer=sep_cma_es training=varied",
        "resume=runs/evolve/RUN ga.generations=60",
        '-m "seed=range(1,21)" hydra/launcher=joblib',
    ],
    "evaluate": [
        "scenario=lowlight hebbian.N=0.002 repeats=50",
        "genome=runs/evolve/RUN scenario=2obstacles",
        'scenario=highlight "change=[slip_left,ir_low]"',
        'scenario=lowlight "compare=[late,none]"',
        "-m hebbian.N=0,1.5e-5,0.002 scenario=base,4obstacles",
    ],
    "replay": ["latest --open", "runs/evaluate/RUN --gif film.gif"],
    "figure": ["latest trajectories --format pdf --width 180", "runs/sweep/RUN rescue_and_harm --format svg"],
    "play": ["scenario=4obstacles", "hebbian=oja scenario=lowlight", "adaptation=novelty --side right"],
    "reproduce": ["--quick", "obstacles champions=40", "all genome=Best.npy signal=as_coded"],
    "leaderboard": [
        "--quick",
        "obstacles methods=modulated,abcd_shared champions=4",
        "light methods=my_rules.py:Mine",
        "all hydra/launcher=slurm",
    ],
    "flock": ["--quick", "flock=live_fitness flock.breaks=knower", "flock.coupling=my_couplings.py:Mine repeats=5"],
    "sweep": ["light", 'n_sweep "seed=range(1,6)" genome=runs/evolve/RUN --dry-run', "obstacles hydra/launcher=slurm"],
    "show": ["", "latest", "reference_7"],
    "keys": ["scenario", "evolve"],
    "export": ["runs/evaluate/RUN --webots", "reference_7 --webots --output controllers/genes_only"],
    "rerun": ["latest"],
}


def _complete_override(ctx: typer.Context, incomplete: str) -> list[str]:
    return completion.complete_override(str(ctx.info_name), incomplete)


Overrides = Annotated[
    list[str] | None,
    typer.Argument(metavar="[KEY=VALUE]...", hidden=True, autocompletion=_complete_override),
]
Run = Annotated[
    Path, typer.Argument(metavar="RUN", help="Its folder, or latest.", autocompletion=completion.complete_run)
]
Multirun = Annotated[bool, typer.Option("--multirun", "-m", help="Run every combination of comma-separated values.")]


class Shown(StrEnum):
    """The part of a configuration that `--cfg` shows."""

    job = "job"
    hydra = "hydra"
    all = "all"


Cfg = Annotated[
    Shown | None, typer.Option("--cfg", "-c", metavar="job|hydra|all", help="Show the configuration, run nothing.")
]
ConfigDir = Annotated[
    str | None,
    typer.Option("--config-dir", metavar="FOLDER", help="A folder with YAML files of your own."),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object; all else on standard error.")]
DryRun = Annotated[bool, typer.Option("--dry-run", help="List the jobs, run nothing.")]
Open = Annotated[bool, typer.Option("--open", help="Write the replay, and open it in a browser.")]


def experiment_argument(*others: str) -> Any:
    """The argument of a study: an experiment, the paper's, others or all of them, and settings."""
    return typer.Argument(
        metavar=f"[{'|'.join(('light', 'obstacles', *others, 'all'))}] [KEY=VALUE]...",
        hidden=True,
        autocompletion=_complete_override,
    )


def with_experiment(words: list[str] | None, usual: str) -> tuple[str, list[str]]:
    """The experiment that stands before the overrides, or the usual one; and the overrides, champions named."""
    overrides = with_genomes_named(words)
    if overrides and "=" not in overrides[0]:
        return overrides[0], overrides[1:]
    return usual, overrides


def with_genomes_named(overrides: list[str] | None) -> list[str]:
    """Overrides in which the folder of the latest evolution stands in place of `genome=latest` and `resume=latest`.

    A run then notes which evolution it used, whatever evolves later. `genome=reference_1,...,reference_20` gets the
    names between.
    """
    return list(map(_with_genome_named, overrides or []))


def _with_genome_named(override: str) -> str:
    from epuckhebb.config import quoted
    from epuckhebb.store import resolve_run

    key, _, value = override.partition("=")
    if key == "genome" and (ends := _FROM_TO.search(value)):
        names = (f"{REFERENCE}_{seed}" for seed in range(int(ends[1]), int(ends[2]) + 1))
        return f"genome={value[: ends.start()]}{','.join(names)}{value[ends.end() :]}"
    if key not in ("genome", "resume") or LATEST not in value.split(","):
        return override
    folder = str(resolve_run(LATEST, "evolve"))
    named = folder if key == "resume" else quoted(folder)
    return f"{key}={','.join(named if word == LATEST else word for word in value.split(','))}"
