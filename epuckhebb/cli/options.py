"""Declares the arguments and options that commands share, and what their help shows."""

import functools
import inspect
import sys
from collections.abc import Callable
from contextlib import nullcontext, redirect_stdout
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Literal, TextIO

import typer
from rich.console import Console
from typer.core import TyperCommand

from epuckhebb.cli.console import Terminal, json_text, report_errors
from epuckhebb.runtime import LATEST, ConfigError, be_quiet, refusing, say, working


class Command(TyperCommand):
    """A command whose help begins with examples, and whose errors become one message and an exit code."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the words of a call; an option that is none may be meant as a key."""
        try:
            return super().parse_args(ctx, args)
        except Exception as error:
            if name := getattr(error, "option_name", ""):  # of an error whose class Typer does not give
                vars(error)["message"] += f". Keys have no dashes: {name.lstrip('-')}=VALUE"
            raise

    def invoke(self, ctx: Any) -> Any:
        """Do what the command does."""
        with report_errors(), working(f"{ctx.info_name}: loading libraries and settings."):
            with refusing(lambda _: "the working folder was removed; change to one that is there", FileNotFoundError):
                Path.cwd()
            return super().invoke(ctx)

    def format_help_text(self, ctx: Any, formatter: Any) -> None:
        """Write what the command does, then examples."""
        super().format_help_text(ctx, formatter)
        command = str(ctx.info_name)
        with formatter.section("Examples"):
            for example in _EXAMPLES[command]:
                formatter.write(f"  epuckhebb {command} {example}".rstrip() + "\n")


_EXAMPLES = {
    "evolve": ["seed=7", "resume=runs/evolve/RUN ga.generations=60", '-m "seed=range(1,21)" hydra/launcher=joblib'],
    "evaluate": [
        "scenario=lowlight hebbian.N=0.002 repeats=50",
        'genome=runs/evolve/RUN "change=[slip_left,ir_low]"',
        '"compare=[late,none]" scenario=lowlight',
        "-m hebbian.N=0,1.5e-5,0.002 scenario=base,4obstacles",
    ],
    "replay": ["latest --open", "runs/evaluate/RUN --gif film.gif"],
    "figure": ["latest trajectories --format pdf --width 180"],
    "play": ["scenario=4obstacles", "flock", "adaptation=novelty --side right"],
    "reproduce": ["--quick", "obstacles champions=40"],
    "leaderboard": ["--quick", "obstacles methods=modulated,abcd_shared", "all hydra/launcher=slurm"],
    "flock": ["--quick", "flock=live_fitness flock.breaks=knower"],
    "sweep": ["light", "n_sweep genome=runs/evolve/RUN --dry-run", "my_studies.py:Mine repeats=5"],
    "show": ["", "latest"],
    "keys": ["scenario", "evolve"],
    "export": ["gallery", "runs/evaluate/RUN --webots", "reference_7 --webots --output controllers/genes_only"],
    "rerun": ["latest"],
}


Overrides = Annotated[list[str] | None, typer.Argument(metavar="[KEY=VALUE]...", hidden=True)]
Run = Annotated[Path, typer.Argument(metavar="RUN", help="Its folder, or latest.")]
Multirun = Annotated[bool, typer.Option("--multirun", "-m", help="Run every combination of comma-separated values.")]
Cfg = Annotated[
    Literal["job"] | None,
    typer.Option("--cfg", "-c", metavar="job", help="Show the configuration that would run, run nothing."),
]
ConfigDir = Annotated[
    str | None, typer.Option("--config-dir", metavar="FOLDER", help="A folder with YAML files of your own.")
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]
Json = Annotated[bool, typer.Option("--json", help="Print one JSON object; all else on standard error.")]
DryRun = Annotated[bool, typer.Option("--dry-run", help="List the jobs, run nothing.")]
Open = Annotated[bool, typer.Option("--open", help="Write the replay, and open it in a browser.")]


@dataclass(frozen=True, kw_only=True)
class Output:
    """How a command prints its result, and where: on what is standard output when the command begins."""

    quiet: Quiet = False
    as_json: Json = False
    stream: TextIO = field(default_factory=lambda: sys.stdout, init=False)

    def print(self, values: Callable[[], Any], print_text: Callable[[Console], None]) -> None:
        """Print a result: as JSON, as text, or not at all."""
        if self.as_json:
            with redirect_stdout(self.stream):
                typer.echo(json_text(values()))
        else:
            self.print_text(print_text)

    def print_text(self, print_text: Callable[[Console], None]) -> None:
        """Print a part of a result as text, unless JSON or nothing is wanted."""
        if not (self.as_json or self.quiet):
            with redirect_stdout(self.stream):
                print_text(Terminal())


@dataclass(frozen=True, kw_only=True)
class StudyOptions(Output):
    """How a study is run, and how its result is printed."""

    config_dir: ConfigDir = None


@dataclass(frozen=True, kw_only=True)
class RunOptions(StudyOptions):
    """How the jobs of one call are run, and how their results are printed."""

    multirun: Multirun = False
    cfg: Cfg = None


def takes_options(command: Callable[..., None]) -> Callable[..., None]:
    """Let the fields of a command's parameter `options`, one of the classes above, be options of the command line."""
    signature = inspect.signature(command)
    kind = signature.parameters["options"].annotation
    shared = list(inspect.signature(kind).parameters.values())
    parameters = [*(own for own in signature.parameters.values() if own.name != "options"), *shared]

    @functools.wraps(command)
    def called(**values: Any) -> None:
        """Call the command with its options as one value."""
        options = kind(**{one.name: values.pop(one.name) for one in shared})
        be_quiet(options.quiet)
        with nullcontext() if getattr(options, "cfg", None) else redirect_stdout(sys.stderr):  # what own parts print
            command(**values, options=options)

    vars(called)["__signature__"] = signature.replace(parameters=parameters)
    called.__annotations__ = {one.name: one.annotation for one in parameters}
    return called


RESUMED = (
    "`epuckhebb evolve resume=RUN` resumes an evolution, or many; the same command resumes a sweep or a study, and a "
    "multirun of `evaluate` with hydra.sweep.dir=FOLDER; `epuckhebb rerun RUN` repeats a run"
)


def split_experiment(words: list[str] | None, default: str) -> tuple[str, list[str]]:
    """The experiment that stands before the overrides, or the default; and the overrides, champions named."""
    overrides = resolve_genomes(words)
    if overrides and "=" not in overrides[0]:
        return overrides[0], overrides[1:]
    return default, overrides


def resolve_genomes(overrides: list[str] | None, *, resumes: bool = False) -> list[str]:
    """Overrides in which the folder of the latest evolution stands in place of `genome=latest` and `resume=latest`.

    A run then notes which evolution it used, whatever evolves later. resumes: whether the command has a key `resume`.
    """
    from epuckhebb.config import quoted, readable
    from epuckhebb.store import CHECKPOINT, Run, resolve_run

    words = readable(overrides or [])
    for place, word in enumerate(words):
        key, _, value = word.partition("=")
        if key == "resume" and not resumes:
            raise ConfigError(f"{word}: {RESUMED}")
        if key in ("genome", "start", "resume") and LATEST in (choices := value.split(",")):
            folder = str(resolve_run(LATEST, "evolve"))
            path = folder if key == "resume" else quoted(folder)
            words[place] = f"{key}={','.join(path if choice == LATEST else choice for choice in choices)}"
        if key in ("genome", "start"):
            for run in (Run(Path(choice)) for choice in words[place].partition("=")[2].split(",")):
                if run.has(CHECKPOINT) and (reason := run.unfinished):
                    say(f"{key}: {reason}")
    return words
