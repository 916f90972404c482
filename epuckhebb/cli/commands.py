"""Declares the commands of `epuckhebb`. Each imports what is heavy when it is called, so help comes at once."""

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from epuckhebb import __version__
from epuckhebb.cli.console import print_error, print_line
from epuckhebb.cli.options import (
    Command,
    ConfigDir,
    DryRun,
    Json,
    Open,
    Output,
    Overrides,
    Quiet,
    Run,
    RunOptions,
    StudyOptions,
    resolve_genomes,
    split_experiment,
    takes_options,
)
from epuckhebb.runtime import JOB_FAILED, ConfigError, JobFailedError

if TYPE_CHECKING:
    from epuckhebb.runs.jobs import Jobs
    from epuckhebb.studies.study import Planned

app = typer.Typer(
    name="epuckhebb",
    help="Evolve e-puck controllers in a T-maze, and see what Hebbian plasticity does for them when the world changes.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def run_command(
    command: str, job: Callable[..., None], prepare: Callable[..., Any], words: list[str], options: RunOptions
) -> None:
    """Let Hydra run a command, and print the results."""
    from epuckhebb.config import check_words, dump, hydra_arguments, load_any
    from epuckhebb.runs import check_same, hydra

    multirun, config_dir = options.multirun, options.config_dir
    if multirun and options.cfg:
        raise ConfigError("--cfg shows the configuration of one job: leave out --multirun, and give each key one value")
    name, words = hydra_arguments(command, words)
    check_words(name, words, several=multirun)
    if options.cfg:
        print(dump(load_any(name, words, config_dir)), end="")
        return
    hydra.check(name, words, config_dir, prepare, multirun=multirun)
    if multirun:

        def check(path: Path, config: Any) -> None:
            check_same(path, config, getattr(prepare(config), "genome", None))

        finish_many(command, *hydra.run_many(name, job, words, config_dir, check), options)
        return
    if path := hydra.run(name, job, words, config_dir, reporter(options)):
        print_run(command, path, options)


def finish_many(command: str, folder: Path, jobs: "Jobs", output: Output) -> None:
    """Write and print the tables over all whole runs of a multirun; jobs that have none are an error."""
    from epuckhebb.cli import show
    from epuckhebb.runs.jobs import failure_text
    from epuckhebb.store import Run, multirun_runs
    from epuckhebb.studies.sweep import summarise_multirun

    summarise_multirun(folder)
    runs = [path for path in multirun_runs(folder) if Run(path).is_whole]
    failed = [{"run": str(task.path), "error": reason} for task, reason in jobs.failures]
    output.print(
        lambda: {"command": command, "runs": list(map(show.as_json, runs)), "failed": failed},
        lambda console: show.print_many(runs, console),
    )
    if failed:
        reasons = [(f"{task.path.name} ({task.name})", reason) for task, reason in jobs.failures]
        raise JobFailedError(failure_text(reasons, len(jobs.tasks)))


def reporter(output: Output) -> Callable[[Path], None]:
    """The function that prints the results of one run as soon as its tables are there."""
    from epuckhebb.cli import show

    return lambda path: output.print_text(lambda console: show.print_results(path, console))


def print_run(command: str, path: Path, output: Output) -> None:
    """Print the folder of a run, below its results; with --json, everything that the run holds."""
    from epuckhebb.cli import show

    output.print(
        lambda: {"command": command, "runs": [show.as_json(path)]},
        lambda console: print_line(console, f"Run folder: {path}"),
    )


def run_study(planned: "Planned", output: Output, *, dry_run: bool = False, batch: int = 1) -> None:
    """Run a study and print its results; with `dry_run` list its jobs. batch: how many jobs one start does."""
    from epuckhebb.cli import show
    from epuckhebb.studies.jobs import todo
    from epuckhebb.studies.study import conduct

    folder = planned.folder
    if dry_run:
        missing = {job.run for job in todo(folder, planned.jobs)}
        listed = [
            {
                "run": job.run,
                "done": job.run not in missing,
                "overrides": job.overrides,
                "what": job.purpose or " ".join(job.overrides),
            }
            for job in planned.jobs
        ]
        jobs = {"command": planned.study.command, "folder": str(folder), "jobs": listed}
        output.print(lambda: jobs, lambda console: show.print_jobs(jobs, console))
        return
    outcome = conduct(planned, batch)
    facts = {"command": planned.study.command, "folder": str(folder), **outcome.as_json()}
    kind = type(planned.study)
    output.print(lambda: show.as_json(folder) | facts, lambda console: show.print_results(folder, console, kind))
    if outcome.failures:
        raise JobFailedError(planned.failure(outcome))


@app.command(cls=Command)
@takes_options
def evolve(overrides: Overrides = None, *, options: RunOptions) -> None:
    """Evolve a controller."""
    from epuckhebb.runs import evolve_job, hydra, prepare_evolution, resume
    from epuckhebb.runtime import user_path
    from epuckhebb.store import MULTIRUN

    words = resolve_genomes(overrides, resumes=True)
    if any(word.startswith("resume=") for word in words):
        if options.multirun or options.cfg or options.config_dir:
            raise ConfigError("resume=RUN goes on with the settings of RUN: no -m, --cfg or --config-dir with it")
        changes = [word for word in words if not word.startswith("resume=")]
        (folder, *others) = (user_path(word.removeprefix("resume="), "resume") for word in words if word not in changes)
        if others or not (folder / MULTIRUN).is_file():
            print_run("evolve", resume(words, reporter(options)), options)
            return
        words, config_dir = hydra.call_of_multirun(folder, changes)
        options = replace(options, multirun=True, config_dir=config_dir)

    def prepare(config: Any) -> None:
        prepare_evolution(config).compile()

    run_command("evolve", evolve_job, prepare, words, options)


@app.command(cls=Command)
@takes_options
def evaluate(overrides: Overrides = None, *, options: RunOptions) -> None:
    """A genome's lifetimes with and without plasticity."""
    from epuckhebb.runs import evaluate_job, inherit_choices, prepare_evaluation

    words = inherit_choices(resolve_genomes(overrides), options.config_dir)
    run_command("evaluate", evaluate_job, prepare_evaluation, words, options)


@app.command(cls=Command)
def replay(
    run: Run,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="The page.  [RUN/replay.html]")
    ] = None,
    gif: Annotated[Path | None, typer.Option("--gif", metavar="FILE", help="Write a GIF, for slides.")] = None,
    open_page: Open = False,
) -> None:
    """A page, or a GIF, to watch lifetimes or a flock."""
    import webbrowser

    from epuckhebb.export.replay import replay as write_replay
    from epuckhebb.store import resolve_run

    run = resolve_run(run, "evaluate", "flock")
    page = output or (run / "replay.html" if open_page else None)
    files = write_replay(run, page, gif)
    typer.echo("\n".join(map(str, files)))
    if open_page:
        webbrowser.open(files[0].resolve().as_uri())


@app.command(cls=Command)
def figure(
    run: Run,
    name: Annotated[str, typer.Argument(metavar="[NAME]", help="Of the figure; without it, their names.")] = "",
    kind: Annotated[str, typer.Option("--format", "-f", metavar="png|svg|pdf", help="Of the file.")] = "png",
    width: Annotated[
        float | None,
        typer.Option("--width", metavar="MM", min=20, max=1000, help="88: a column of a paper, 180: a page."),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="[RUN/figures/NAME.FORMAT]")
    ] = None,
) -> None:
    """Draw a figure of a run again, in a format and a size."""
    from epuckhebb.export.figure import draw, names
    from epuckhebb.store import resolve_run

    run = resolve_run(run)
    typer.echo(draw(run, name, kind, width, output) if name else "\n".join(names(run)))


@app.command(cls=Command)
def play(
    overrides: Overrides = None,
    side: Annotated[str, typer.Option("--side", metavar="left|right", help="The side of the goal.")] = "left",
    port: Annotated[
        int, typer.Option("--port", metavar="PORT", min=0, max=65535, help="If it is taken, any that is free.")
    ] = 8470,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the page.  [yes]", show_default=False)
    ] = True,
    config_dir: ConfigDir = None,
    quiet: Quiet = False,
) -> None:
    """A live world, or a flock, in the browser, to disturb by hand."""
    import webbrowser

    from epuckhebb.live.server import Play
    from epuckhebb.runs import inherit_choices
    from epuckhebb.runtime import be_quiet, say

    be_quiet(quiet)
    words = list(overrides or ())
    if words[:1] != ["flock"]:
        words = inherit_choices(resolve_genomes(words), config_dir)
    with Play(words, side, config_dir, port) as live, suppress(KeyboardInterrupt):
        say("Ctrl-C ends it.")
        typer.echo(live.address)  # from here on, Ctrl-C is how it is ended
        if browser:
            webbrowser.open(live.address)
        live.wait()


@app.command(cls=Command)
@takes_options
def reproduce(
    words: Overrides = None,
    quick: Annotated[bool, typer.Option("--quick", help="A smoke test in two minutes: 3 champions, 2 rates.")] = False,
    *,
    options: Output,
) -> None:
    """The paper's tables and figures, and whether its claims hold."""
    from epuckhebb.studies.reproduce import plan

    experiment, overrides = split_experiment(words, "all")
    run_study(plan(experiment, overrides, quick=quick), options)


@app.command(cls=Command)
@takes_options
def leaderboard(
    words: Overrides = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="A smoke test in three minutes: 3 methods, 2 champions.")
    ] = False,
    dry_run: DryRun = False,
    *,
    options: StudyOptions,
) -> None:
    """Which plasticity copes with worlds it was not evolved in."""
    from epuckhebb.studies.leaderboard import plan

    experiment, overrides = split_experiment(words, "obstacles" if quick else "all")
    planned = plan(experiment, overrides, quick=quick, config_dir=options.config_dir)
    run_study(planned, options, dry_run=dry_run)


@app.command(cls=Command)
@takes_options
def flock(
    overrides: Overrides = None,
    quick: Annotated[bool, typer.Option("--quick", help="4 flocks of 20 minutes, no sweep: half a minute.")] = False,
    *,
    options: StudyOptions,
) -> None:
    """Couplings between robots, and what they are good for."""
    from epuckhebb.studies.flock import plan

    run_study(plan(resolve_genomes(overrides), quick=quick, config_dir=options.config_dir), options)


@app.command(cls=Command)
@takes_options
def sweep(
    name: Annotated[str, typer.Argument(metavar="NAME", hidden=True)],
    overrides: Overrides = None,
    dry_run: DryRun = False,
    batch: Annotated[
        int, typer.Option("--batch", metavar="N", min=1, help="Jobs that one start does, for short ones.  [1]")
    ] = 1,
    *,
    options: StudyOptions,
) -> None:
    """A named sweep or your own study; again, it does the rest."""
    from epuckhebb.studies.study import plan_user_study
    from epuckhebb.studies.sweep import plan

    config_dir, words = options.config_dir, resolve_genomes(overrides)
    planned = plan_user_study(name, words) if ".py:" in name else plan(name, words, config_dir)
    run_study(planned, options, dry_run=dry_run, batch=batch)


@app.command(cls=Command)
def show(
    what: Annotated[
        str | None, typer.Argument(help="A folder of a run or of runs, or latest.  [latest runs]", metavar="WHAT")
    ] = None,
    as_json: Json = False,
) -> None:
    """What a run holds, or the latest runs."""
    from epuckhebb.cli import show as shown

    Output(as_json=as_json).print(lambda: shown.shown_as_json(what), lambda console: shown.show(what, console))


@app.command(cls=Command)
def keys(
    group: Annotated[str | None, typer.Argument(metavar="GROUP", help="A group or a command.  [all commands]")] = None,
) -> None:
    """Every key, its default, what it is, and choices of groups."""
    from epuckhebb.cli.keys import keys_text

    typer.echo(keys_text(group))


@app.command(cls=Command)
def export(
    what: Annotated[
        str,
        typer.Argument(
            help="A run of evaluate, a champion (a run of evolve, a file, reference_7), or gallery.",
            metavar="RUN|gallery",
        ),
    ],
    webots: Annotated[bool, typer.Option("--webots", help="As a controller for the e-puck of Webots.")] = False,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FOLDER", help="Where to write it.  [epuckhebb_champion or gallery]"),
    ] = None,
) -> None:
    """A controller for Webots, or a gallery for any web host."""
    if what == "gallery" and not webots:
        from epuckhebb.export.gallery import gallery

        typer.echo("\n".join(map(str, gallery(output or Path(what)))))
        return
    from epuckhebb.export import webots as exported

    if not webots:
        raise ConfigError(f"type `epuckhebb export {what} --webots`, for Webots, or `epuckhebb export gallery`")
    files, next_step = exported.webots(what, output or Path("epuckhebb_champion"))
    typer.echo("\n".join([*map(str, files), next_step]))


@app.command(cls=Command)
@takes_options
def rerun(run: Run, *, options: Output) -> None:
    """Repeat a run, and check that its CSV files are bit-identical."""
    from epuckhebb.runs import repeat
    from epuckhebb.store import resolve_run

    run = resolve_run(run, "evaluate", "evolve")
    new, difference = repeat(run)
    result = {"command": "rerun", "run": str(run), "new": str(new), "difference": difference}
    if options.as_json or not difference:
        options.print(lambda: result, lambda console: print_line(console, f"bit-identical: {new}"))
    if difference:
        print_error(f"{new}: {difference}")
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
