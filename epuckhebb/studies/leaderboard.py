"""`epuckhebb leaderboard`: a study of many methods, which evolves the missing champions and tests all of them.

`epuckhebb.studies.leaderboard_plan` lists its jobs. Another call may name other methods, more champions or another
experiment; only what is missing is done, and tables and page are those of the last call. The folder is named by the
tests, the seeds and the science.
"""

import time
from pathlib import Path
from typing import Any

import pandas as pd

from epuckhebb.analysis import leaderboard as board
from epuckhebb.analysis import report
from epuckhebb.analysis.limits import limits
from epuckhebb.config import plugins
from epuckhebb.config.schema import EvaluateConfig, EvolveConfig, Plain, dump
from epuckhebb.config.stored import from_values
from epuckhebb.runs import evaluate, evolve, hydra
from epuckhebb.runtime.errors import JobFailedError
from epuckhebb.runtime.progress import say
from epuckhebb.sim.scenario import TRAINED
from epuckhebb.sim.tasks.reversal import Reversal
from epuckhebb.store import Run, RunFolder, as_json, write_atomic
from epuckhebb.studies import jobs as study_jobs
from epuckhebb.studies.leaderboard_jobs import identity, world_named
from epuckhebb.studies.leaderboard_plan import Leaderboard

_COST = "cost.json"
_FIRST_REPORTED = 100  # settings were chosen on lower seeds
_ENOUGH = 8  # champions of a method; fewer are a smoke test


def leaderboard(planned: Leaderboard) -> None:
    """Do what is missing, then write the tables, the figure and the page.

    Raises:
        JobFailedError: A job failed.
    """
    folder = planned.folder
    results = [(folder / job.run,) for job in planned.jobs]
    arguments, own = planned.arguments, planned.own_files
    with study_jobs.open_study(folder, "leaderboard", planned.config, arguments, results, own) as study:
        for what, jobs in planned.stages:
            todo = len(study_jobs.todo(folder, jobs))
            say(f"{what}: {len(jobs)} jobs, {len(jobs) - todo} done before, {todo} to do.")
            outcome = study_jobs.launch(study, what, jobs, planned.launcher, leaderboard_job, fail_fast=False)
            if outcome.failures:
                (job, why), failed = outcome.failures[0], len(outcome.failures)
                raise JobFailedError(f"{failed} of {len(jobs)} jobs to {what} failed; {job.run}: {why}")
        _report(study, planned)


def leaderboard_job(cfg: Any) -> None:
    """Do one job of a leaderboard."""
    study_jobs.one_job(cfg, identity, _work)


def _work(path: Path, job: Plain, facts: dict[str, Any]) -> None:
    wanted, folder = job["config"], path.parents[1]
    values = dict(wanted["config"])
    if wanted["champion"]:
        values["genome"] = str(folder / wanted["champion"])
    if "worlds" in wanted:
        _test(path, from_values(values, EvaluateConfig, f"job {path}"), wanted, job["overrides"], facts)
        return
    config = from_values(values, EvolveConfig, f"job {path}")
    prepared = evolve.prepare(config)
    prepared.compile()
    run = evolve.new_run(path, config, job["overrides"], facts)
    began = time.process_time()
    evolve.evolve_into(run, prepared, None, threads=hydra.threads_of_job(config.threads), quiet=True)
    write_atomic(path / _COST, _cost_since(began))


def _test(path: Path, config: EvaluateConfig, job: Plain, overrides: list[str], facts: dict[str, Any]) -> None:
    """Evaluate a champion in its training world and in all test worlds."""
    prepared, threads = evaluate.prepare(config), hydra.threads_of_job(config.threads)
    prepared.compile()
    genome = prepared.genome
    facts = {"seed": config.seed, "genome": genome.name, "genome_sha256": genome.sha256, **facts}
    own = plugins.own_files(config.values)
    with RunFolder.new(path, "leaderboard", dump(config), overrides, facts, own) as run:
        began = time.process_time()
        rows = []
        for name in job["worlds"]:
            there = prepared.in_world(world_named(name, job["config_dir"]))
            rows.append(there.run(there.remember(threads), threads)[0])
        run.write("metrics.csv", pd.concat(rows))
        run.write(_COST, _cost_since(began))


def _cost_since(began: float) -> bytes:
    return as_json({"cpu_s": round(time.process_time() - began, 2)})


def _report(study: RunFolder, planned: Leaderboard) -> None:
    """Write the tables, the figure and the page over all champions."""
    from epuckhebb.analysis import charts, figures  # matplotlib takes a while to load

    champions, worlds, costs = _tables(planned)
    table = board.table([entry.row for entry in planned.entries], champions)
    for name, frame in (("champions", champions), ("worlds", worlds), ("leaderboard", table), ("cost", costs)):
        study.write(f"{name}.csv", frame)
    parts = ["# Leaderboard\n"]
    for experiment, own in table.groupby("experiment", sort=False):
        parts.append(f"## {board.title(str(experiment))}\n\n{board.markdown_of(own)}")
    study.write("leaderboard.md", "\n".join(parts))
    lines = {entry.row.experiment: limits(entry.task) for entry in planned.entries if isinstance(entry.task, Reversal)}
    picture = charts.leaderboard_of(table, champions, lines)
    study.write(f"figures/{board.FIGURE}", picture)
    meanings = {entry.method.name: entry.method.description for entry in planned.entries}
    tests = {experiment: list(own) for experiment, own in planned.tests.items()}
    page = board.markdown(table, costs, meanings, tests, _provenance(planned))
    study.write("report.md", page)
    small = figures.small(picture)
    study.write("report.html", report.html(page, lambda _: small, "epuckhebb: leaderboard"))


def _provenance(planned: Leaderboard) -> str:
    config = planned.config
    last = config.first_seed + config.champions - 1
    chosen = f"Settings of methods were chosen on seeds below {_FIRST_REPORTED}, none on these."
    if config.first_seed < _FIRST_REPORTED:
        chosen = f"**Settings of methods were chosen on seeds below {_FIRST_REPORTED}: these figures are too high.**"
    tested, worlds = [], ""
    if any(planned.tests.values()):
        tested.append(f"{config.repeats} repeats of every champion, side and world")
        worlds = (
            f" Test worlds are those of the sweeps {', '.join(config.tests)}. No training uses one of them. Light "
            "levels and weak wheels of tests lie between those of varied training."
        )
    if board.REVERSAL in planned.tests:
        tested.append(f"{2 * config.reversal_repeats} new lifetimes of every champion in reversal learning")
    few = "**A smoke test: so few champions say nothing about a method.** " if config.champions < _ENOUGH else ""
    return (
        f"{few}Made by `epuckhebb leaderboard`: {config.champions} champions of each method and experiment, seeds "
        f"{config.first_seed} to {last}, evolved in the robot-steps of the table; {' and '.join(tested)} "
        f"(seed {config.seed}). {chosen}{worlds}"
    )


def _tables(planned: Leaderboard) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """A row for each champion; for each method and test world; and the cost of each method."""
    champions, worlds, costs = [], [], []
    for entry in planned.entries:
        whose = {"experiment": entry.row.experiment, "method": entry.row.method}
        spent: dict[str, list[float]] = {"evolve_cpu_s": [], "test_cpu_s": []}
        of_worlds = []
        for seed, test in entry.tests.items():
            evolved = [jobs[seed] for jobs in (entry.before, entry.champions) if jobs]
            metrics = Run(planned.folder / test.run).table("metrics.csv")
            counts, away = (
                board.of_learner(metrics, entry.task)
                if isinstance(entry.task, Reversal)
                else board.of_champion(metrics, TRAINED[entry.row.experiment])
            )
            histories = [Run(planned.folder / job.run).table("history.csv") for job in evolved]
            steps = sum(int(history.robot_steps.sum()) for history in histories)
            names = {"seed": seed, "champion": entry.champions[seed].run, "test": test.run}
            champions.append(whose | names | counts | {"robot_steps": steps})
            of_worlds.append(away)
            spent["evolve_cpu_s"].append(sum(_cpu_s(planned.folder / job.run) for job in evolved))
            spent["test_cpu_s"].append(_cpu_s(planned.folder / test.run))
        summed = pd.concat(of_worlds).groupby("scenario", sort=False).sum().reset_index()
        worlds += [whose | {str(name): value for name, value in row.items()} for row in summed.to_dict("records")]
        costs.append(whose | {name: round(sum(each) / len(each), 1) for name, each in spent.items()})
    made = pd.DataFrame(champions).astype({"successes_off": "Int64", "successes_inverted": "Int64"})
    return made, pd.DataFrame(worlds), pd.DataFrame(costs)


def _cpu_s(run: Path) -> float:
    return float(Run(run).json(_COST)["cpu_s"])
