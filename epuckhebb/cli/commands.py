"""Declares the commands of `epuckhebb`. Each imports what is heavy when it is called, so help comes at once."""

import atexit
import gc
import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from epuckhebb import __version__
from epuckhebb.cli import completion
from epuckhebb.cli.call import print_jobs, print_runs, print_study, run_command
from epuckhebb.cli.console import Terminal, is_of_output, print_line, replace_unencodable
from epuckhebb.cli.options import (
    Cfg,
    Command,
    Commands,
    ConfigDir,
    ConfiguredCommand,
    DryRun,
    Json,
    Multirun,
    Open,
    Overrides,
    Quiet,
    Run,
    experiment_argument,
    with_experiment,
    with_genomes_named,
)
from epuckhebb.cli.output import begin, open_in_browser, print_error, print_result, unwritable
from epuckhebb.runtime import JOB_FAILED, ConfigError, JobFailedError

if TYPE_CHECKING:
    from epuckhebb.config import EvolveConfig

app = typer.Typer(
    name="epuckhebb",
    cls=Commands,
    help="Evolve e-puck controllers in a T-maze, and see what Hebbian plasticity does for them when the world changes.",
    no_args_is_help=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


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
    from epuckhebb.runs import evolve_job, prepare_evolution, resume

    words = with_genomes_named(overrides)
    if any(word.startswith("resume=") for word in words):
        if multirun or cfg or config_dir:
            raise ConfigError("resume=RUN goes on with the settings of RUN: no -m, --cfg or --config-dir with it")
        begin(quiet)
        print_runs("evolve", [resume(words)], as_json, quiet)
        return

    def check(config: "EvolveConfig") -> None:
        prepare_evolution(config).compile()

    run_command("evolve", evolve_job, check, words, multirun, cfg, config_dir, quiet, as_json)


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
    """A genome's lifetimes with and without plasticity."""
    from epuckhebb.runs import as_evolved, evaluate_job, prepare_evaluation, recorded_job

    if open_page and (multirun or cfg):
        raise ConfigError(
            "--open shows the page of one run, so it does not go with --multirun or --cfg; "
            "run `epuckhebb replay RUN --open` for one of the runs of a multirun"
        )
    job = recorded_job if open_page else evaluate_job
    words = as_evolved(with_genomes_named(overrides), config_dir)
    runs = run_command(
        "evaluate", job, prepare_evaluation, words, multirun, cfg, config_dir, quiet, as_json, reports=True
    )
    if open_page:
        from epuckhebb.export.replay import recording, write_page

        page = runs[0] / "replay.html"
        write_page(recording(runs[0]), page)
        open_in_browser(page)


@app.command(cls=Command)
def replay(
    run: Run,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="FILE", help="The page.  [RUN/replay.html]")
    ] = None,
    gif: Annotated[Path | None, typer.Option("--gif", metavar="FILE", help="Write a GIF, for slides.")] = None,
    mp4: Annotated[
        Path | None, typer.Option("--mp4", metavar="FILE", help='Write a film; needs "epuckhebb[video]".')
    ] = None,
    open_page: Open = False,
) -> None:
    """A page, or a film, to watch lifetimes or a flock."""
    from epuckhebb.analysis import movie
    from epuckhebb.export.replay import recording, require_video, write, write_movie, write_page
    from epuckhebb.store import Run as Folder
    from epuckhebb.store import resolve_run

    if mp4:
        require_video()
    run = resolve_run(run, "evaluate", "flock")
    page, written = output or run / "replay.html", []
    if Folder(run).has("flock.csv"):
        from epuckhebb.studies.flock import replay_page

        if gif or mp4:
            raise ConfigError("--gif and --mp4 are for runs of `epuckhebb evaluate`; a flock is replayed as a page")
        write(page, replay_page(run).encode())
        written.append(page)
    else:
        recorded = recording(run)
        if output or open_page or not (gif or mp4):
            write_page(recorded, page)
            written.append(page)
        for target, make in ((gif, movie.gif), (mp4, movie.mp4)):
            if target:
                write_movie(recorded, target, make)
                written.append(target)
    for path in written:
        typer.echo(path)
    if open_page:
        open_in_browser(page)


@app.command(cls=Command)
def figure(
    run: Run,
    name: Annotated[str, typer.Argument(metavar="[NAME]", help="Of the figure; without it, their names.")] = "",
    kind: Annotated[str, typer.Option("--format", "-f", metavar="png|svg|pdf", help="Of the file.")] = "png",
    width: Annotated[
        float | None, typer.Option("--width", metavar="MM", help="88: a column of a paper, 180: a page.")
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


@app.command(cls=ConfiguredCommand)
def play(
    overrides: Overrides = None,
    side: Annotated[str, typer.Option("--side", metavar="left|right", help="The side of the goal.")] = "left",
    port: Annotated[int, typer.Option("--port", metavar="PORT", help="The next free one is taken.")] = 8470,
    browser: Annotated[
        bool, typer.Option("--browser/--no-browser", help="Open the page.  [yes]", show_default=False)
    ] = True,
    config_dir: ConfigDir = None,
    quiet: Quiet = False,
) -> None:
    """A live world in the browser, to disturb by hand."""
    from epuckhebb.config import check_config_dir
    from epuckhebb.live.server import Play, open_page
    from epuckhebb.runs import as_evolved
    from epuckhebb.runtime import say

    begin(quiet)
    check_config_dir(config_dir)
    if side not in ("left", "right"):
        raise ConfigError(f"--side must be left or right, got {side}")
    words = as_evolved(with_genomes_named(overrides), config_dir)
    with Play(words, "right" if side == "right" else "left", config_dir, port) as live, suppress(KeyboardInterrupt):
        say(live.hint or "Ctrl-C ends it.")
        typer.echo(live.address)  # from here on, Ctrl-C is how it is ended
        if browser:
            open_page(live.address)
        live.wait()


@app.command(cls=ConfiguredCommand)
def reproduce(
    words: Annotated[list[str] | None, experiment_argument()] = None,
    quick: Annotated[bool, typer.Option("--quick", help="A smoke test in two minutes: 3 champions, 2 rates.")] = False,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """The paper's tables and figures, and whether its claims hold."""
    from epuckhebb.studies.reproduce import reproduce as run

    begin(quiet)
    experiment, overrides = with_experiment(words, "all")
    print_study(run(experiment, overrides, quick=quick), as_json, quiet)


@app.command(cls=ConfiguredCommand)
def leaderboard(
    words: Annotated[list[str] | None, experiment_argument("reversal")] = None,
    quick: Annotated[
        bool,
        typer.Option("--quick", help="A smoke test in three minutes: 3 methods, 2 champions."),
    ] = False,
    dry_run: DryRun = False,
    config_dir: ConfigDir = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Which plasticity copes with worlds it was not evolved in."""
    from epuckhebb.studies.leaderboard import leaderboard as run
    from epuckhebb.studies.leaderboard_plan import plan

    begin(quiet)
    experiment, overrides = with_experiment(words, "obstacles" if quick else "all")
    planned = plan(experiment, overrides, quick=quick, config_dir=config_dir)
    if dry_run:
        print_jobs("leaderboard", planned.folder, planned.jobs, as_json, quiet, planned.purposes)
        return
    run(planned)
    print_study(planned.folder, as_json, quiet)


@app.command(cls=ConfiguredCommand)
def flock(
    overrides: Overrides = None,
    quick: Annotated[bool, typer.Option("--quick", help="4 flocks of 20 minutes, no sweep: half a minute.")] = False,
    config_dir: ConfigDir = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """Couplings between robots, and what they are good for."""
    from epuckhebb.config import check_config_dir
    from epuckhebb.studies.flock import flock as run

    begin(quiet)
    check_config_dir(config_dir)
    print_study(run(overrides or [], quick=quick, config_dir=config_dir), as_json, quiet)


@app.command(cls=ConfiguredCommand)
def sweep(
    name: Annotated[str, typer.Argument(metavar="NAME", hidden=True, autocompletion=completion.complete_sweep)],
    overrides: Overrides = None,
    dry_run: DryRun = False,
    fail_fast: Annotated[bool, typer.Option("--fail-fast", help="Start no job after one has failed.")] = False,
    config_dir: ConfigDir = None,
    quiet: Quiet = False,
    as_json: Json = False,
) -> None:
    """A named sweep on all cores; again, it does what is not done."""
    from epuckhebb.cli import results
    from epuckhebb.config import check_config_dir
    from epuckhebb.runs import as_evolved
    from epuckhebb.runtime import say
    from epuckhebb.studies import jobs
    from epuckhebb.studies.sweep import failure_of, plan
    from epuckhebb.studies.sweep import sweep as run

    begin(quiet)
    check_config_dir(config_dir)
    planned = plan(name, as_evolved(with_genomes_named(overrides), config_dir), config_dir)
    if dry_run:
        print_jobs("sweep", planned.folder, planned.jobs, as_json, quiet, cpu_s=planned.cpu_s)
        return
    todo = len(jobs.todo(planned.folder, planned.jobs))
    say(f"{len(planned.jobs)} jobs in {planned.folder}/: {len(planned.jobs) - todo} done before, {todo} to do.")
    outcome = run(planned, fail_fast=fail_fast)
    found = {"command": "sweep", "folder": str(planned.folder), **outcome.as_json()}
    print_result(as_json, quiet, lambda: found, lambda console: results.print_sweep(planned.folder, console))
    if outcome.failures:
        raise JobFailedError(failure_of(planned, outcome))


@app.command(cls=Command)
def show(
    what: Annotated[
        str | None,
        typer.Argument(
            help="A folder of runs, latest, a champion's file, or reference_7.  [latest runs]",
            metavar="WHAT",
            autocompletion=completion.complete_shown,
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """What a run or a champion holds, or the latest runs."""
    from epuckhebb.cli import show as shown

    print_result(as_json, False, lambda: shown.shown_as_json(what), lambda console: shown.show(what, console))


@app.command(cls=Command)
def keys(
    group: Annotated[
        str | None,
        typer.Argument(
            metavar="GROUP", help="A group, a command or a key.  [all]", autocompletion=completion.complete_group
        ),
    ] = None,
) -> None:
    """Every key, its default, what it is, and choices of groups."""
    from epuckhebb.cli.keys import print_groups
    from epuckhebb.config import all_groups, group_named

    print_groups([group_named(group)] if group else all_groups(), Terminal())


@app.command(cls=Command)
def export(
    what: Annotated[
        str,
        typer.Argument(
            help="A run of evaluate, or a champion: a run of evolve, a file, reference_7.",
            metavar="RUN",
            autocompletion=completion.complete_shown,
        ),
    ],
    webots: Annotated[bool, typer.Option("--webots", help="As a controller for the e-puck of Webots.")] = False,
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FOLDER", help="Where to write it; the controller's name.")
    ] = Path("epuckhebb_champion"),
) -> None:
    """Take a champion, and its plasticity, to another simulator."""
    from epuckhebb.export import webots as exported

    if not webots:
        raise ConfigError(
            f"export writes controllers for Webots: type `epuckhebb export {what} --webots`. {what} is a run of "
            "`epuckhebb evaluate`, or a champion: a run of `epuckhebb evolve`, latest, a file, or reference_7"
        )
    written = exported.webots(what, output)
    for file in written:
        typer.echo(file)
    typer.echo(exported.next_step(written[0]))


@app.command(cls=Command)
def rerun(run: Run, quiet: Quiet = False, as_json: Json = False) -> None:
    """Repeat a run, and check that its CSV files are bit-identical."""
    from epuckhebb.runs import repeat
    from epuckhebb.store import resolve_run

    begin(quiet)
    run = resolve_run(run, "evaluate", "evolve")
    new, difference = repeat(run)
    found = {"command": "rerun", "run": str(run), "new": str(new), "difference": difference}
    hidden = quiet or bool(difference)
    print_result(as_json, hidden, lambda: found, lambda console: print_line(console, f"bit-identical: {new}"))
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


def main() -> None:
    """The entry point of `epuckhebb`. What it loads is not searched for garbage: see `begin`, and not at the end."""
    replace_unencodable()
    gc.disable()
    atexit.register(gc.freeze)
    try:
        app()
    except OSError as error:  # of --help and --version
        if not is_of_output(error):
            raise
        sys.exit(unwritable(error))
