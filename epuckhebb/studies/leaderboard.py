"""`epuckhebb leaderboard`: a study of many methods, which evolves the champions that are missing and tests them all.

What belongs to it is listed in `epuckhebb.studies.leaderboard_plan`. A folder can be asked for other methods, more
champions or another experiment at any time, and only what is missing is done; its tables and its page are those of the
last call. The folder is named by the tests, the seeds and the science.
"""

import time
from pathlib import Path
from typing import Any

import pandas as pd
from omegaconf import DictConfig

from epuckhebb.analysis import leaderboard as board
from epuckhebb.analysis import report
from epuckhebb.analysis.limits import limits
from epuckhebb.config import plugins
from epuckhebb.config.compose import Plain
from epuckhebb.config.stored import as_config
from epuckhebb.runs import evaluate, evolve, hydra
from epuckhebb.runs.nominal import nominal_for, self_checks_for
from epuckhebb.runtime.errors import JobFailedError
from epuckhebb.runtime.progress import say
from epuckhebb.sim.scenario import TRAINED
from epuckhebb.sim.tasks.reversal import Reversal
from epuckhebb.store import columns, disk
from epuckhebb.store import run as runs
from epuckhebb.store.folder import RunFolder
from epuckhebb.store.records import Cost, JobAsked, record
from epuckhebb.studies import jobs as study_jobs
from epuckhebb.studies.leaderboard_jobs import identity, in_world, world_named
from epuckhebb.studies.leaderboard_plan import Leaderboard

_COST = "cost.json"
_FIRST_REPORTED = 100  # seeds below are those on which settings were chosen
_ENOUGH = 8  # champions of a method, of whom a difference to another may say something


def leaderboard(planned: Leaderboard) -> None:
    """Do what is missing, then write the tables, the figure and the page.

    Raises:
        JobFailedError: A job failed.
    """
    folder = planned.folder
    results = [(folder / job.run,) for job in planned.jobs]
    with study_jobs.at_work(folder, "leaderboard", planned.cfg, planned.arguments, results) as study:
        for place, content in plugins.copies(planned.own_files).items():
            study.write(place, content)
        for what, jobs in planned.stages:
            todo = len(study_jobs.todo(folder, jobs))
            say(f"{what}: {len(jobs)} jobs, {len(jobs) - todo} done before, {todo} to do.")
            outcome = study_jobs.launch(study, what, jobs, planned.launcher, leaderboard_job, fail_fast=False)
            if outcome.failures:
                (job, why), failed = outcome.failures[0], len(outcome.failures)
                raise JobFailedError(f"{failed} of {len(jobs)} jobs to {what} failed; {job.run}: {why}")
        _tell(study, planned)


def leaderboard_job(cfg: DictConfig) -> None:
    """Do one job of a leaderboard."""
    study_jobs.one_job(cfg, identity, _work)


def _work(path: Path, job: JobAsked, facts: dict[str, Any]) -> None:
    asked, folder = job["config"], path.parents[1]
    command = "evaluate" if "worlds" in asked else "evolve"
    config = dict(asked["config"])
    if asked["champion"]:
        config["genome"] = str(folder / asked["champion"])
    cfg = as_config(config, command)
    threads = hydra.threads_of_job(cfg.threads)
    if command == "evaluate":
        _live(path, cfg, asked, job["overrides"], facts, threads)
        return
    wanted = evolve.prepare(cfg)
    claimed = evolve.new_run(path, cfg, job["overrides"], facts)
    began = time.process_time()
    evolve.evolve_into(claimed, wanted, None, threads=threads, quiet=True)
    disk.write_atomic(path / _COST, _cost_since(began))


def _live(path: Path, cfg: DictConfig, asked: Plain, overrides: list[str], facts: dict[str, Any], threads: int) -> None:
    """Let a champion live in its training world and in all test worlds."""
    config, genome = evaluate.prepare(cfg)
    evaluate.compile_for(config.controllers, genome.network, config.world)
    own = plugins.own_files(cfg)
    facts = {"genome": genome.name, "genome_sha256": genome.sha256, **evaluate.own_code(own), **facts}
    with RunFolder.new(path, "leaderboard", cfg, overrides, facts) as run:
        began = time.process_time()
        nominal = nominal_for(genome, config, threads)
        lived = []
        for name in asked["worlds"]:
            there = in_world(config, world_named(name, asked["config_dir"]))
            checks = self_checks_for(genome, there, threads)
            lived.append(evaluate.run_lifetimes(there, genome, nominal, checks, threads)[0])
        run.write("metrics.csv", pd.concat(lived).to_csv(index=False))
        for place, content in plugins.copies(own).items():
            run.write(place, content)
        run.write(_COST, _cost_since(began))


def _cost_since(began: float) -> bytes:
    return disk.as_json({"cpu_s": round(time.process_time() - began, 2)})


def _tell(study: RunFolder, planned: Leaderboard) -> None:
    """Write the tables, the figure and the page over all champions."""
    from epuckhebb.analysis import charts, figures  # matplotlib takes a while to load

    champions, worlds, costs = _tables(planned)
    table = board.table([entry.row for entry in planned.entries], champions)
    for name, frame in (("champions", champions), ("worlds", worlds), ("leaderboard", table), ("cost", costs)):
        study.write(f"{name}.csv", frame.to_csv(index=False))
    parts = ["# Leaderboard\n"]
    for experiment, own in table.groupby("experiment", sort=False):
        parts.append(f"## {board.title(str(experiment))}\n\n{board.markdown_of(own)}")
    study.write("leaderboard.md", "\n".join(parts))
    lines = {entry.row.experiment: limits(entry.task) for entry in planned.entries if isinstance(entry.task, Reversal)}
    picture = charts.leaderboard_of(table, champions, lines)
    study.write(f"figures/{board.FIGURE}", picture)
    told = {entry.method.name: entry.method.told for entry in planned.entries}
    tests = {experiment: list(own) for experiment, own in planned.tests.items()}
    page = board.markdown(table, costs, told, tests, _provenance(planned))
    study.write("report.md", page)
    small = figures.small(picture)
    study.write("report.html", report.html(page, lambda _: small, "epuckhebb: leaderboard"))


def _provenance(planned: Leaderboard) -> str:
    config = planned.config
    last = config.first_seed + config.champions - 1
    chosen = f"Settings of methods were chosen on seeds below {_FIRST_REPORTED}, and none on these."
    if config.first_seed < _FIRST_REPORTED:
        chosen = f"**Settings of methods were chosen on seeds below {_FIRST_REPORTED}, so these figures flatter.**"
    lived, worlds = [], ""
    if any(planned.tests.values()):
        lived.append(f"{config.repeats} noise repeats of every champion, side and world")
        worlds = (
            f" Test worlds are those of the sweeps {', '.join(config.tests)}; no training uses one, but light levels "
            "and weak wheels of tests lie between those of varied training."
        )
    if board.REVERSAL in planned.tests:
        lived.append(f"{2 * config.reversal_repeats} new lives of every champion in reversal learning")
    few = "**A look: so few champions say nothing about a method.** " if config.champions < _ENOUGH else ""
    return (
        f"{few}Made by `epuckhebb leaderboard`: {config.champions} champions of each method and experiment, seeds "
        f"{config.first_seed} to {last}, evolved in as many robot-steps as the table tells; {' and '.join(lived)} "
        f"(seed {config.seed}). {chosen}{worlds}"
    )


def _tables(planned: Leaderboard) -> tuple[pd.DataFrame, pd.DataFrame, pd.DataFrame]:
    """A row for each champion; for each method and test world; and the cost of each method."""
    champions, worlds, costs = [], [], []
    for entry in planned.entries:
        whose = {"experiment": entry.row.experiment, "method": entry.row.method}
        spent: dict[str, list[float]] = {"evolve_cpu_s": [], "test_cpu_s": []}
        of_worlds = []
        for seed, lived in entry.lives.items():
            evolved = [jobs[seed] for jobs in (entry.before, entry.champions) if jobs]
            metrics = runs.table(planned.folder / lived.run, "metrics.csv", columns.METRICS)
            counts, away = (
                board.of_learner(metrics, entry.task)
                if isinstance(entry.task, Reversal)
                else board.of_champion(metrics, TRAINED[entry.row.experiment])
            )
            histories = [runs.table(planned.folder / job.run, "history.csv", columns.HISTORY) for job in evolved]
            steps = sum(int(history.robot_steps.sum()) for history in histories)
            runs_told = {"seed": seed, "champion": entry.champions[seed].run, "test": lived.run}
            champions.append(whose | runs_told | counts | {"robot_steps": steps})
            of_worlds.append(away)
            spent["evolve_cpu_s"].append(sum(_cpu_s(planned.folder / job.run) for job in evolved))
            spent["test_cpu_s"].append(_cpu_s(planned.folder / lived.run))
        summed = pd.concat(of_worlds).groupby("scenario", sort=False).sum().reset_index()
        worlds += [whose | {str(name): value for name, value in row.items()} for row in summed.to_dict("records")]
        costs.append(whose | {name: round(sum(each) / len(each), 1) for name, each in spent.items()})
    made = pd.DataFrame(champions).astype({"successes_off": "Int64", "successes_inverted": "Int64"})
    return made, pd.DataFrame(worlds), pd.DataFrame(costs)


def _cpu_s(run: Path) -> float:
    return float(record(runs.content(run, _COST), run / _COST, Cost)["cpu_s"])
