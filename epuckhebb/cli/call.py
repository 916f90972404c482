"""From a typed command to `epuckhebb.runs.hydra`; prints the runs or the jobs that it made."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from epuckhebb.cli.options import Output, RunOptions
from epuckhebb.runtime import ConfigError, JobFailedError

if TYPE_CHECKING:
    from epuckhebb.studies.study import Planned


def run_command(
    command: str, job: Callable[..., None], prepare: Callable[..., Any], words: list[str], options: RunOptions
) -> None:
    """Let Hydra run a command, and print the results."""
    from epuckhebb.config import check_words, configuration_of, with_environment
    from epuckhebb.runs import hydra

    multirun, config_dir = options.multirun, options.config_dir
    if multirun and options.cfg:
        raise ConfigError("--cfg shows the configuration of one job: leave out --multirun, and give each key one value")
    flags = [*(["--multirun"] if multirun else []), *(["--cfg", options.cfg] if options.cfg else [])]
    words = with_environment(words)
    check_words(configuration_of(command, words), words, several=multirun)
    if not options.cfg:
        hydra.check(command, words, config_dir, prepare, multirun=multirun)
    runs = hydra.run(command, job, [*words, *flags], config_dir)
    if multirun and command == "evaluate" and runs:
        from epuckhebb.studies.sweep import write_summary_of_multirun

        write_summary_of_multirun(runs[0].parent, runs)
    if multirun and command == "evolve" and runs:
        from epuckhebb.studies.evolutions import write_summary_of_evolutions

        write_summary_of_evolutions(runs[0].parent, runs)
    if not options.cfg:
        print_runs(command, runs, options)


def print_runs(command: str, runs: list[Path], output: Output) -> None:
    """Print the results of the runs of one call."""
    from epuckhebb.cli import show

    output.print(
        lambda: {"command": command, "runs": list(map(show.as_json, runs))},
        lambda console: show.print_finished(runs, console),
    )


def run_study(planned: "Planned", output: Output, *, dry_run: bool = False) -> None:
    """Run a study and print its results; with `dry_run` list its jobs."""
    from epuckhebb.cli import results, show
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
        output.print(lambda: jobs, lambda console: results.print_jobs(jobs, console))
        return
    outcome = conduct(planned)
    facts = {"command": planned.study.command, "folder": str(folder), **outcome.as_json()}
    kind = type(planned.study)
    output.print(lambda: show.as_json(folder) | facts, lambda console: results.print_results(folder, console, kind))
    if outcome.failures:
        raise JobFailedError(planned.failure(outcome))
