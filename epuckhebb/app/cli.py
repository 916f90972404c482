"""The command line: Typer verbs. Everything heavy is imported inside a verb, so that help comes at once."""

import atexit
import gc
import json
import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from rich.console import Console
from typer.core import TyperCommand

from epuckhebb import __version__
from epuckhebb.app import data
from epuckhebb.app.errors import INTERRUPTED, JOB_FAILED, USAGE, ConfigError, JobFailedError, interrupted, interruptible
from epuckhebb.app.terminal import Terminal, fall_silent, show_what_can_be_shown

if TYPE_CHECKING:
    from epuckhebb.app.engine import Job

app = typer.Typer(
    name="epuckhebb",
    help="Evolve e-puck controllers in a T-maze, and see what Hebbian plasticity does for them when the world changes.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


class ConfiguredCommand(TyperCommand):
    """A verb that takes `key=value`; its help lists the configuration groups."""

    def format_epilog(self, ctx: Any, formatter: Any) -> None:
        """Write the groups and their choices below the options."""
        with formatter.section("Configuration groups (GROUP=CHOICE; any key: GROUP.KEY=VALUE, see epuckhebb keys)"):
            formatter.write_dl(
                [(name, ", ".join(choices)) for name, choices in data.groups(str(ctx.info_name)).items()]
            )
        with formatter.section("Examples"):
            for example in _EXAMPLES[str(ctx.info_name)]:
                formatter.write_text(f"epuckhebb {ctx.info_name} {example}")


_EXAMPLES = {
    "reproduce": ["--quick", "obstacles champions=40", "all genome=Best.npy signal=as_coded"],
    "leaderboard": [
        "--quick",
        "obstacles methods=modulated,abcd_shared champions=4",
        "all hydra/launcher=slurm",
        "light methods=my_rules.py:Mine",
    ],
    "evaluate": [
        "scenario=4obstacles",
        "scenario=lowlight hebbian.N=0.002 repeats=50",
        "genome=runs/evolve/RUN scenario=2obstacles",
        '"compare=[late,none]" scenario=lowlight',
        "-m hebbian.N=0,1.5e-5,0.002 scenario=base,4obstacles hydra/launcher=joblib",
    ],
    "sweep": ["light", 'n_sweep "seed=range(1,6)" genome=runs/evolve/RUN --dry-run', "obstacles hydra/launcher=slurm"],
    "evolve": [
        "seed=7",
        "resume=runs/evolve/RUN ga.generations=60",
        "scenario=highlight ga=as_coded",
        "optimizer=sep_cma_es training=varied",
        '-m "seed=range(1,21)" hydra/launcher=joblib',
    ],
}


def _complete_override(ctx: typer.Context, incomplete: str) -> list[str]:
    return data.complete_override(str(ctx.info_name), incomplete)


Overrides = Annotated[
    list[str] | None,
    typer.Argument(metavar="[KEY=VALUE]...", help="Settings to change.", autocompletion=_complete_override),
]
Run = Annotated[Path, typer.Argument(help="A run folder, or latest.", metavar="RUN", autocompletion=data.complete_run)]
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
    typer.Option("--config-dir", help="A folder with YAML of your own: FOLDER/scenario/mine.yaml for scenario=mine."),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]
Json = Annotated[
    bool, typer.Option("--json", help="Print one JSON object on standard output, all else on standard error.")
]
Open = Annotated[bool, typer.Option("--open", help="Write the page that replays the run, and open it in a browser.")]


def _experiment(*others: str) -> Any:
    """The argument of a study: an experiment, the paper's, others or all of them, and settings."""
    return typer.Argument(
        metavar=f"[{'|'.join(('light', 'obstacles', *others, 'all'))}] [KEY=VALUE]...",
        help=f"The experiment{', or several with commas between,' if others else ''} and settings to change.",
        autocompletion=_complete_override,
    )


def _say_error(message: str) -> None:
    console = Terminal(stderr=True)
    console.print("Error: ", style="bold red", end="")
    console.print(message, markup=False, soft_wrap=True)


@contextmanager
def _told() -> Iterator[None]:
    """Turn errors into one message and an exit code."""
    if os.environ.get("NUMBA_DISABLE_JIT", "0") not in ("", "0"):
        _say_error("NUMBA_DISABLE_JIT is set, and without compiled code there is no physics; unset it and start again")
        raise typer.Exit(USAGE)
    try:
        with interruptible():
            yield
    except ConfigError as error:
        _say_error(str(error))
        raise typer.Exit(USAGE) from None
    except KeyboardInterrupt as interruption:
        _say_error(interrupted(str(interruption)))
        raise typer.Exit(INTERRUPTED) from None
    except BrokenPipeError:  # nobody reads what we say, and what we do is done
        fall_silent(sys.stdout)
    except OSError as error:
        _say_error(f"{error.filename or ''}: {error.strerror or error}")
        raise typer.Exit(USAGE) from None
    except JobFailedError as error:
        _say_error(f"a job failed: {error}")
        raise typer.Exit(JOB_FAILED) from None


@app.command(cls=ConfiguredCommand)
@_told()
def evolve(
    overrides: Overrides = None,
    multirun: Multirun = False,
    cfg: Cfg = None,
    config_dir: ConfigDir = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Evolve a controller."""
    from epuckhebb.app import hydra_bridge
    from epuckhebb.app.evolve import asked, evolve_job, resume

    if any(word.startswith("resume=") for word in overrides or []):
        if multirun or cfg or config_dir:
            raise ConfigError("resume=RUN goes on with the settings of RUN: no -m, --cfg or --config-dir with it")
        _begin(quiet)
        _tell("evolve", [resume(hydra_bridge.with_latest_found(overrides or []))], quiet, as_json)
        return
    _run("evolve", evolve_job, asked, overrides or [], multirun, cfg, config_dir, quiet, as_json)


@app.command(cls=ConfiguredCommand)
@_told()
def evaluate(
    overrides: Overrides = None,
    multirun: Multirun = False,
    cfg: Cfg = None,
    config_dir: ConfigDir = None,
    quiet: Quiet = False,
    as_json: Json = False,
    open_page: Open = False,
) -> None:
    """Let a genome live in a scenario, with and without plasticity."""
    from epuckhebb.app.evaluate import asked, evaluate_job, recorded_job

    if open_page and (multirun or cfg):
        raise ConfigError(
            "--open shows the page of one run, so it does not go with --multirun or --cfg; "
            "run `epuckhebb replay RUN --open` for one of the runs of a multirun"
        )
    runs = _run(
        "evaluate",
        recorded_job if open_page else evaluate_job,
        asked,
        overrides or [],
        multirun,
        cfg,
        config_dir,
        quiet,
        as_json,
    )
    if open_page:
        from epuckhebb.app.replay import recording, write_page

        page = runs[0] / "replay.html"
        write_page(recording(runs[0]), page)
        _open(page)


@app.command()
@_told()
def replay(
    run: Annotated[
        Path,
        typer.Argument(
            help="A run folder of `epuckhebb evaluate`, or latest.", metavar="RUN", autocompletion=data.complete_run
        ),
    ],
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="Where to write the page.  [RUN/replay.html]")
    ] = None,
    gif: Annotated[Path | None, typer.Option("--gif", metavar="FILE", help="Write a GIF, for slides.")] = None,
    mp4: Annotated[
        Path | None, typer.Option("--mp4", metavar="FILE", help='Write a film; needs "epuckhebb[video]".')
    ] = None,
    open_page: Open = False,
) -> None:
    """A page to watch a run's lifetimes, or a film of them."""
    from epuckhebb.app import runs
    from epuckhebb.app.replay import recording, require_video, write_movie, write_page
    from epuckhebb.study import movie

    if mp4:
        require_video()
    run = runs.found(run, "evaluate")
    recorded = recording(run)
    written = []
    if output or open_page or not (gif or mp4):
        page = output or run / "replay.html"
        write_page(recorded, page)
        written.append(page)
    for target, make in ((gif, movie.gif), (mp4, movie.mp4)):
        if target:
            write_movie(recorded, target, make)
            written.append(target)
    for path in written:
        typer.echo(path)
    if open_page:
        _open(page)


@app.command(cls=ConfiguredCommand)
@_told()
def reproduce(
    words: Annotated[list[str] | None, _experiment()] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="3 champions, 3 repeats, 2 rates: a look in two minutes.")
    ] = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """The paper's tables and figures, and whether its claims hold."""
    from epuckhebb.app import hydra_bridge
    from epuckhebb.app import show as shown
    from epuckhebb.app.reproduce import reproduce as run

    _begin(quiet)
    experiment, overrides = "all", hydra_bridge.with_latest_found(words or [])
    if overrides and "=" not in overrides[0]:
        experiment = overrides.pop(0)
    folder = run(experiment, overrides, quick=quick)
    _out(as_json, quiet, lambda: shown.as_json(folder), lambda console: shown.tell_reproduction(folder, console))


@app.command(cls=ConfiguredCommand)
@_told()
def leaderboard(
    words: Annotated[list[str] | None, _experiment("reversal")] = None,
    quick: Annotated[
        bool,
        typer.Option("--quick", help="3 methods, 2 champions, 8 test worlds, obstacles: a look in three minutes."),
    ] = False,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="List the jobs, run nothing.")] = False,
    config_dir: ConfigDir = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Which plasticity copes with worlds it was not evolved in."""
    from epuckhebb.app import hydra_bridge
    from epuckhebb.app import show as shown
    from epuckhebb.app.leaderboard import leaderboard as run
    from epuckhebb.app.leaderboard_plan import plan

    arguments = hydra_bridge.with_latest_found(words or [])
    experiment = "obstacles" if quick else "all"
    if arguments and "=" not in arguments[0]:
        experiment = arguments.pop(0)
    planned = plan(experiment, arguments, quick=quick, config_dir=config_dir)
    _begin(quiet)
    if dry_run:
        _tell_jobs("leaderboard", planned.folder, planned.jobs, as_json, quiet, planned.told)
        return
    run(planned)
    _out(
        as_json,
        quiet,
        lambda: shown.as_json(planned.folder),
        lambda console: shown.tell_leaderboard(planned.folder, console),
    )


@app.command(cls=ConfiguredCommand)
@_told()
def sweep(
    name: Annotated[
        str,
        typer.Argument(
            metavar="NAME", help="A file of conf/experiment/, see below.", autocompletion=data.complete_sweep
        ),
    ],
    overrides: Overrides = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="List the jobs, run nothing.")] = False,
    fail_fast: Annotated[bool, typer.Option("--fail-fast", help="Start no job after one has failed.")] = False,
    config_dir: ConfigDir = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """A named sweep on all cores; again, it does what is not done."""
    from epuckhebb.app import engine, hydra_bridge, progress
    from epuckhebb.app import show as shown
    from epuckhebb.app.sweep import plan, told
    from epuckhebb.app.sweep import sweep as run

    hydra_bridge.check_config_dir(config_dir)
    planned = plan(name, hydra_bridge.with_latest_found(overrides or []), config_dir)
    _begin(quiet)
    if dry_run:
        _tell_jobs("sweep", planned.folder, planned.jobs, as_json, quiet)
        return
    todo = len(engine.todo(planned.folder, planned.jobs))
    progress.say(
        f"{len(planned.jobs)} jobs in {planned.folder}/: {len(planned.jobs) - todo} done before, {todo} to do."
    )
    outcome = run(planned, fail_fast=fail_fast)
    found = {"verb": "sweep", "folder": str(planned.folder), **outcome.as_json()}
    _out(as_json, quiet, lambda: found, lambda console: shown.tell_sweep(planned.folder, console))
    if outcome.failures:
        raise JobFailedError(told(planned, outcome))


@app.command()
@_told()
def show(
    what: Annotated[
        str | None,
        typer.Argument(
            help="A run, sweep, multirun or reproduction, latest, a champion's file, or reference_7.  [latest runs]",
            metavar="WHAT",
            autocompletion=data.complete_shown,
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Tell what a run or a champion holds, or list the latest runs."""
    from epuckhebb.app import show as shown

    _out(as_json, False, lambda: shown.shown_as_json(what), lambda console: shown.show(what, console))


@app.command()
@_told()
def keys(
    group: Annotated[
        str | None,
        typer.Argument(metavar="GROUP", help="One group, or a verb.  [all]", autocompletion=data.complete_group),
    ] = None,
) -> None:
    """Every key, its default, what it is, and choices of groups."""
    from epuckhebb.app import keys as known

    known.tell([known.group_named(group)] if group else known.all_groups(), Terminal())


@app.command()
@_told()
def export(
    what: Annotated[
        str,
        typer.Argument(
            help="A run of `epuckhebb evaluate`, or a champion: a run of `epuckhebb evolve`, a file, reference_7.",
            metavar="RUN",
            autocompletion=data.complete_shown,
        ),
    ],
    webots: Annotated[bool, typer.Option("--webots", help="As a controller for the e-puck of Webots.")] = False,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FOLDER", help="Where to write it; the controller's name.")
    ] = Path("epuckhebb_champion"),
) -> None:
    """Take a champion, and its plasticity, to another simulator."""
    from epuckhebb.app import export as exported

    if not webots:
        raise ConfigError("export writes controllers for Webots only; say so with --webots")
    written = exported.webots(what, output)
    for file in written:
        typer.echo(file)
    typer.echo(exported.next_step(written[0]))


@app.command()
@_told()
def rerun(run: Run, quiet: Quiet = False, as_json: Json = False) -> None:
    """Repeat a run, and say whether its CSV files are the same bytes."""
    from epuckhebb.app import runs
    from epuckhebb.app.rerun import rerun as repeat

    _begin(quiet)
    run = runs.found(run, "evaluate", "evolve")
    new, difference = repeat(run)
    if as_json:
        typer.echo(_json({"verb": "rerun", "run": str(run), "new": str(new), "difference": difference}))
    elif not quiet and not difference:
        typer.echo(f"same bytes: {new}")
    if difference:
        _say_error(f"{new}: {difference}")
        raise typer.Exit(JOB_FAILED)


def _version(wanted: bool) -> None:
    if wanted:
        typer.echo(__version__)
        raise typer.Exit


@app.callback()
def _main(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Options of the program itself."""


def _run(
    verb: str,
    job: Callable[..., None],
    asked: Callable[..., Any],
    arguments: list[str],
    multirun: bool,
    cfg: Shown | None,
    config_dir: str | None,
    quiet: bool,
    as_json: bool,
) -> list[Path]:
    """Hand a verb over to Hydra, then say what came out; returns the run folders."""
    from epuckhebb.app import hydra_bridge

    if multirun and cfg:
        raise ConfigError("--cfg shows the configuration of one job: leave out --multirun, and give each key one value")
    flags = ["--multirun"] if multirun else []
    flags += ["--cfg", cfg] if cfg else []
    flags += ["--config-dir", config_dir] if config_dir else []
    _begin(quiet)
    arguments = hydra_bridge.with_latest_found(arguments)
    hydra_bridge.check_words(verb, arguments)
    hydra_bridge.check_config_dir(config_dir)
    if not cfg:
        hydra_bridge.check(verb, arguments, config_dir, asked, multirun=multirun)
    runs = hydra_bridge.run(verb, job, [*arguments, *flags])
    if multirun and verb == "evaluate" and runs:
        from epuckhebb.app.sweep import write_summary_of_multirun

        write_summary_of_multirun(runs[0].parent, runs)
    if not cfg:
        _tell(verb, runs, quiet, as_json)
    return runs


def _tell(verb: str, runs: list[Path], quiet: bool, as_json: bool) -> None:
    from epuckhebb.app import show as shown

    _out(
        as_json,
        quiet,
        lambda: {"verb": verb, "runs": list(map(shown.as_json, runs))},
        lambda console: shown.tell(runs, console),
    )


def _tell_jobs(
    verb: str, folder: Path, jobs: "list[Job]", as_json: bool, quiet: bool, told: "dict[str, str] | None" = None
) -> None:
    """List the jobs of a study that is not run. told: what each run is for; of a sweep, what would be typed."""
    from epuckhebb.app import engine
    from epuckhebb.app import show as shown

    todo = {job.run for job in engine.todo(folder, jobs)}
    listed = [
        {
            "run": job.run,
            "done": job.run not in todo,
            "overrides": job.overrides,
            "told": told[job.run] if told else " ".join(job.overrides),
        }
        for job in jobs
    ]
    found = {"verb": verb, "folder": str(folder), "jobs": listed}
    _out(as_json, quiet, lambda: found, lambda console: shown.tell_jobs(folder, listed, console))


def _out(as_json: bool, quiet: bool, told: Callable[[], Any], tell: Callable[[Console], None]) -> None:
    """Say what came out: as JSON, in the terminal, or not at all."""
    if as_json:
        typer.echo(_json(told()))
    elif not quiet:
        tell(Terminal())


def _json(told: Any) -> str:
    """The text of JSON values; numbers that JSON does not have, nan and infinite ones, are null."""
    return json.dumps(json.loads(json.dumps(told), parse_constant=lambda _: None), allow_nan=False)


def _begin(quiet: bool) -> None:
    """What a verb does first, when all that it needs is imported: see `main`."""
    from epuckhebb.app import progress

    gc.freeze()
    gc.enable()
    progress.be_quiet(quiet)


def _open(page: Path) -> None:
    import webbrowser

    if not webbrowser.open(page.resolve().as_uri()):
        _say_error(f"no browser could be started; open {page} yourself")
        raise typer.Exit(JOB_FAILED)


def main() -> None:
    """The entry point of `epuckhebb`.

    What the program loads at its start never becomes garbage, so it is not searched for any: not while it loads (see
    `_begin`), and not at the end. That is half a second of the three that an evaluation would take.
    """
    show_what_can_be_shown()
    gc.disable()
    atexit.register(gc.freeze)
    app()
