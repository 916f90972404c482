"""Hands a command to Hydra, and prints the runs or the jobs of a call."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from epuckhebb.cli.options import Shown
from epuckhebb.cli.output import begin, print_result
from epuckhebb.runtime.errors import ConfigError

if TYPE_CHECKING:
    from epuckhebb.studies.jobs import Job


def run_command(
    command: str,
    job: Callable[..., None],
    prepare: Callable[..., Any],
    arguments: list[str],
    multirun: bool,
    cfg: Shown | None,
    config_dir: str | None,
    quiet: bool,
    as_json: bool,
) -> list[Path]:
    """Let Hydra run a command, then print the results; returns the run folders."""
    from epuckhebb.config import overrides
    from epuckhebb.config.words import check_words
    from epuckhebb.runs import hydra

    if multirun and cfg:
        raise ConfigError("--cfg shows the configuration of one job: leave out --multirun, and give each key one value")
    flags = ["--multirun"] if multirun else []
    flags += ["--cfg", cfg] if cfg else []
    begin(quiet)
    overrides.check_config_dir(config_dir)
    check_words(command, arguments, config_dir)
    if not cfg:
        hydra.check(command, arguments, config_dir, prepare, multirun=multirun)
    runs = hydra.run(command, job, [*arguments, *flags], config_dir)
    if multirun and command == "evaluate" and runs:
        from epuckhebb.studies.sweep import write_summary_of_multirun

        write_summary_of_multirun(runs[0].parent, runs)
    if not cfg:
        print_runs(command, runs, as_json, quiet)
    return runs


def print_runs(command: str, runs: list[Path], as_json: bool, quiet: bool) -> None:
    """Print the results of the runs of one call."""
    from epuckhebb.cli import show

    print_result(
        as_json,
        quiet,
        lambda: {"command": command, "runs": list(map(show.as_json, runs))},
        lambda console: show.print_finished(runs, console),
    )


def print_study(folder: Path, as_json: bool, quiet: bool) -> None:
    """Print the results of a study."""
    from epuckhebb.cli import show

    print_result(as_json, quiet, lambda: show.as_json(folder), lambda console: show.print_results(folder, console))


def print_jobs(
    command: str, folder: Path, jobs: "list[Job]", as_json: bool, quiet: bool, purposes: "dict[str, str] | None" = None
) -> None:
    """List the jobs of a study that is not run. purposes: of each run; its overrides unless given."""
    from epuckhebb.cli import show_study
    from epuckhebb.studies import jobs as study_jobs

    todo = {job.run for job in study_jobs.todo(folder, jobs)}
    listed = [
        {
            "run": job.run,
            "done": job.run not in todo,
            "overrides": job.overrides,
            "what": purposes[job.run] if purposes else " ".join(job.overrides),
        }
        for job in jobs
    ]
    found = {"command": command, "folder": str(folder), "jobs": listed}
    print_result(as_json, quiet, lambda: found, lambda console: show_study.print_jobs(folder, listed, console))
