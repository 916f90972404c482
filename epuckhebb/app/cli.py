"""The command line: Typer verbs. Everything heavy is imported inside a verb, so that help comes at once."""

import atexit
import gc
import json
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from typer.core import TyperCommand

from epuckhebb import __version__
from epuckhebb.app.errors import ConfigError, JobFailedError

JOB_FAILED, USAGE = 1, 2

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
        from epuckhebb.app.data import groups

        with formatter.section("Configuration groups (GROUP=CHOICE; any key of a group: GROUP.KEY=VALUE)"):
            formatter.write_dl([(name, ", ".join(choices)) for name, choices in groups(str(ctx.info_name)).items()])
        with formatter.section("Examples"):
            for example in _EXAMPLES[str(ctx.info_name)]:
                formatter.write_text(f"epuckhebb {ctx.info_name} {example}")


_EXAMPLES = {
    "reproduce": ["--quick", "obstacles champions=40", "all genome=Best.npy signal=as_coded"],
    "evaluate": [
        "scenario=4obstacles",
        "scenario=lowlight hebbian.N=0.002 repeats=50",
        "genome=runs/evolve/RUN scenario=2obstacles",
        "hebbian=adaptive scenario=lowlight",
        "-m hebbian.N=0,1.5e-5,0.002 scenario=base,4obstacles hydra/launcher=joblib",
    ],
    "sweep": ["light", "n_sweep seed='range(1,6)' genome=runs/evolve/RUN --dry-run", "obstacles hydra/launcher=slurm"],
    "evolve": [
        "seed=7",
        "resume=runs/evolve/RUN ga.generations=60",
        "scenario=highlight ga=as_coded",
        "-m seed='range(1,21)' hydra/launcher=joblib",
    ],
}


def _complete_override(ctx: typer.Context, incomplete: str) -> list[str]:
    from epuckhebb.app import completion

    return completion.overrides(str(ctx.info_name), incomplete)


def _complete_sweep(incomplete: str) -> list[str]:
    from epuckhebb.app import completion

    return completion.sweeps(incomplete)


def _complete_run(incomplete: str) -> list[str]:
    from epuckhebb.app import completion

    return completion.runs(incomplete)


Overrides = Annotated[
    list[str] | None,
    typer.Argument(metavar="[KEY=VALUE]...", help="Settings to change.", autocompletion=_complete_override),
]
Run = Annotated[Path, typer.Argument(help="A run folder.", metavar="RUN", autocompletion=_complete_run)]
Multirun = Annotated[bool, typer.Option("--multirun", "-m", help="Run every combination of comma-separated values.")]


class Shown(StrEnum):
    """The part of a configuration that `--cfg` shows."""

    job = "job"
    hydra = "hydra"
    all = "all"


Cfg = Annotated[
    Shown | None, typer.Option("--cfg", "-c", metavar="job|hydra|all", help="Show the configuration, run nothing.")
]
ConfigDir = Annotated[str | None, typer.Option("--config-dir", help="A folder with more configuration files.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print nothing but errors.")]
Json = Annotated[
    bool, typer.Option("--json", help="Print one JSON object on standard output, all else on standard error.")
]
Open = Annotated[bool, typer.Option("--open", help="Write the page that replays the run, and open it in a browser.")]


@app.command(cls=ConfiguredCommand)
def evolve(
    overrides: Overrides = None,
    multirun: Multirun = False,
    cfg: Cfg = None,
    config_dir: ConfigDir = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Evolve a controller."""
    with _told():
        from epuckhebb.app.jobs import evolve_job

        if any(word.startswith("resume=") for word in overrides or []):
            if multirun or cfg or config_dir:
                raise ConfigError("resume=RUN goes on with the settings of RUN: no -m, --cfg or --config-dir with it")
            _resume(overrides or [], quiet, as_json)
            return
        _run("evolve", evolve_job, overrides or [], multirun, cfg, config_dir, quiet, as_json)


@app.command(cls=ConfiguredCommand)
def evaluate(
    overrides: Overrides = None,
    multirun: Multirun = False,
    cfg: Cfg = None,
    config_dir: ConfigDir = None,
    quiet: Quiet = False,
    as_json: Json = False,
    open_page: Open = False,
) -> None:
    """A genome's lifetimes in a scenario, GA alone and with plasticity."""
    with _told():
        from epuckhebb.app import jobs

        if open_page and (multirun or cfg):
            raise ConfigError(
                "--open shows the page of one run, so it does not go with --multirun or --cfg; "
                "run `epuckhebb replay RUN --open` for one of the runs of a multirun"
            )
        _run("evaluate", jobs.evaluate_job, overrides or [], multirun, cfg, config_dir, quiet, as_json)
        if open_page:
            from epuckhebb.app import watch

            page = jobs.finished[0] / "replay.html"
            watch.write_page(watch.recording(jobs.finished[0]), page)
            _open(page)


@app.command()
def replay(
    run: Annotated[
        Path, typer.Argument(help="A run folder of `epuckhebb evaluate`.", metavar="RUN", autocompletion=_complete_run)
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
    with _told():
        from epuckhebb.app import watch
        from epuckhebb.study import movie

        if mp4:
            watch.require_video()
        recorded = watch.recording(run)
        written = []
        if output or open_page or not (gif or mp4):
            page = output or run / "replay.html"
            watch.write_page(recorded, page)
            written.append(page)
        for target, make in ((gif, movie.gif), (mp4, movie.mp4)):
            if target:
                watch.write_movie(recorded, target, make)
                written.append(target)
        for path in written:
            typer.echo(path)
        if open_page:
            _open(page)


@app.command(cls=ConfiguredCommand)
def reproduce(
    words: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[light|obstacles|all] [KEY=VALUE]...",
            help="The experiment, and settings to change.",
            autocompletion=_complete_override,
        ),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="3 champions, 3 repeats, 2 rates: a look in two minutes.")
    ] = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """The paper's tables and figures, ours beside theirs, and how often its claims hold."""
    with _told():
        from epuckhebb.app import progress, report
        from epuckhebb.app.reproduce import reproduce as run

        _all_is_loaded()
        experiment, overrides = "all", list(words or [])
        if overrides and "=" not in overrides[0]:
            experiment = overrides.pop(0)
        with progress.StepProgress(quiet=quiet) as steps:
            folder = run(experiment, overrides, quick=quick, step=steps.begin)
        if as_json:
            typer.echo(json.dumps(report.as_json(folder)))
        elif not quiet:
            report.tell_reproduction(folder, Console())


@app.command(cls=ConfiguredCommand)
def sweep(
    name: Annotated[
        str,
        typer.Argument(metavar="NAME", help="A file of conf/experiment/, see below.", autocompletion=_complete_sweep),
    ],
    overrides: Overrides = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", help="List the jobs, run nothing.")] = False,
    fail_fast: Annotated[bool, typer.Option("--fail-fast", help="Start no job after one has failed.")] = False,
    config_dir: ConfigDir = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """A named sweep on all cores; the same command again does only what is not done."""
    with _told():
        from epuckhebb.app import jobs, report, sweep_launch
        from epuckhebb.app.sweep import plan

        jobs.begin(quiet=quiet)
        planned = plan(name, overrides or [], config_dir)
        todo = {job.run for job in planned.todo()}
        if dry_run:
            listed = [{"run": job.run, "done": job.run not in todo, "overrides": job.overrides} for job in planned.jobs]
            if as_json:
                typer.echo(json.dumps({"verb": "sweep", "folder": str(planned.folder), "jobs": listed}))
            elif not quiet:
                report.tell_jobs(planned.folder, listed, Console())
            return
        if not quiet:
            done = len(planned.jobs) - len(todo)
            _say(f"{len(planned.jobs)} jobs in {planned.folder}/: {done} done before, {len(todo)} to do.")
        outcome = sweep_launch.launch(planned, fail_fast=fail_fast, quiet=quiet)
        if as_json:
            typer.echo(json.dumps({"verb": "sweep", "folder": str(planned.folder), **outcome.as_json()}))
        elif not quiet:
            report.tell_sweep(planned.folder, Console())
        if outcome.failures:
            raise JobFailedError(outcome.told(planned.folder))


@app.command()
def show(
    run: Run,
    as_json: Json = False,
) -> None:
    """Tell what a run holds."""
    with _told():
        from epuckhebb.app import report

        if as_json:
            typer.echo(json.dumps(report.as_json(run)))
        else:
            report.show(run, Console())


@app.command()
def rerun(
    run: Run,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Repeat a run, and say whether its CSV files are the same bytes."""
    with _told():
        from epuckhebb.app import jobs
        from epuckhebb.app.rerun import rerun as repeat

        jobs.begin(quiet=quiet)
        new, difference = repeat(run, lambda note: None if quiet else _say(note))
        if as_json:
            typer.echo(json.dumps({"verb": "rerun", "run": str(run), "new": str(new), "difference": difference}))
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
    arguments: list[str],
    multirun: bool,
    cfg: Shown | None,
    config_dir: str | None,
    quiet: bool,
    as_json: bool,
) -> None:
    """Hand a verb over to Hydra, then say what came out."""
    from epuckhebb.app import compose, hydra_bridge, jobs, report

    if multirun and cfg:
        raise ConfigError("--cfg shows the configuration of one job: leave out --multirun, and give each key one value")
    flags = ["--multirun"] if multirun else []
    flags += ["--cfg", cfg] if cfg else []
    flags += ["--config-dir", config_dir] if config_dir else []
    _all_is_loaded()
    jobs.begin(quiet=quiet)
    if multirun:
        compose.check_sweep(verb, arguments, config_dir)
    elif not cfg:
        compose.check_single(verb, arguments, config_dir)
    stamp = hydra_bridge.run(verb, job, [*arguments, *flags])
    runs = hydra_bridge.runs_of(verb, stamp, arguments) if multirun else jobs.finished
    if as_json and not cfg:
        typer.echo(json.dumps({"verb": verb, "runs": [report.as_json(path) for path in runs]}))
    elif not quiet and not cfg:
        report.tell(runs, Console())


def _resume(arguments: list[str], quiet: bool, as_json: bool) -> None:
    """Go on with an evolution, then say what came out."""
    from epuckhebb.app import jobs, report
    from epuckhebb.app.resume import resume

    jobs.begin(quiet=quiet)
    path = resume(arguments, lambda note: None if quiet else _say(note))
    if as_json:
        typer.echo(json.dumps({"verb": "evolve", "runs": [report.as_json(path)]}))
    elif not quiet:
        report.tell([path], Console())


@contextmanager
def _told() -> Iterator[None]:
    """Turn errors into one message and an exit code."""
    from epuckhebb.app import interrupt

    try:
        with interrupt.soon():
            yield
    except ConfigError as error:
        _say_error(str(error))
        raise typer.Exit(USAGE) from None
    except KeyboardInterrupt as interruption:
        _say_error(f"interrupted{f': {interruption}' if str(interruption) else ''}")
        raise typer.Exit(interrupt.EXIT_CODE) from None
    except OSError as error:
        _say_error(f"{error.filename or ''}: {error.strerror or error}")
        raise typer.Exit(USAGE) from None
    except JobFailedError as error:
        _say_error(f"a job failed: {error}")
        raise typer.Exit(JOB_FAILED) from None


def _open(page: Path) -> None:
    import webbrowser

    if not webbrowser.open(page.resolve().as_uri()):
        _say_error(f"no browser could be started; open {page} yourself")
        raise typer.Exit(JOB_FAILED)


def _say(note: str) -> None:
    Console(stderr=True, highlight=False, soft_wrap=True).print(note, markup=False)


def _say_error(message: str) -> None:
    console = Console(stderr=True, highlight=False, soft_wrap=True)
    console.print("Error: ", style="bold red", end="")
    console.print(message, markup=False)


def main() -> None:
    """The entry point of `epuckhebb`.

    What the program loads at its start never becomes garbage, so it is not searched for any: not while it loads (see
    `_all_is_loaded`), and not at the end. That is half a second of the three that an evaluation would take.
    """
    gc.disable()
    atexit.register(gc.freeze)
    app()


def _all_is_loaded() -> None:
    gc.freeze()
    gc.enable()
