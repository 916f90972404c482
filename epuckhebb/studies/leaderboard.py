"""`epuckhebb leaderboard`: a study of many methods, which evolves the missing champions and tests all of them.

`epuckhebb.studies.leaderboard_plan` lists its jobs. Another call may name other methods, more champions or another
experiment; only what is missing is done, and tables and page are those of the last call. The folder is named by the
tests, the seeds and the science.
"""

import pandas as pd

from epuckhebb.analysis import leaderboard as board
from epuckhebb.analysis.reversal import limits
from epuckhebb.store import Run, RunFolder
from epuckhebb.studies.champions import COST, champion_job
from epuckhebb.studies.jobs import launch_in_turn, open_study, write_report
from epuckhebb.studies.leaderboard_plan import Leaderboard
from epuckhebb.tmaze.scenario import TRAINED
from epuckhebb.tmaze.tasks.reversal import Reversal

_FIRST_REPORTED = 100  # settings were chosen on lower seeds
_ENOUGH = 8  # champions of a method; fewer are a smoke test


def leaderboard(planned: Leaderboard) -> None:
    """Do what is missing, then write the tables, the figure and the page.

    Raises:
        JobFailedError: A job failed.
    """
    arguments, own = planned.arguments, planned.own_files
    with open_study(planned.folder, "leaderboard", planned.config, arguments, planned.jobs, own) as study:
        launch_in_turn(study, planned.stages, planned.launcher, champion_job)
        _report(study, planned)


def _report(study: RunFolder, planned: Leaderboard) -> None:
    """Write the tables, the figure and the page over all champions."""
    from epuckhebb.analysis import charts  # matplotlib takes a while to load

    champions, worlds, costs = _tables(planned)
    table = board.table([entry.row for entry in planned.entries], champions)
    for name, frame in (("champions", champions), ("worlds", worlds), ("leaderboard", table), ("cost", costs)):
        study.write(f"{name}.csv", frame)
    parts = ["# Leaderboard\n"]
    for experiment, own in table.groupby("experiment", sort=False):
        parts.append(f"## {board.title(str(experiment))}\n\n{board.markdown_of(own, worlds)}")
    study.write("leaderboard.md", "\n".join(parts))
    lines = {entry.row.experiment: limits(entry.task) for entry in planned.entries if isinstance(entry.task, Reversal)}
    figures = {board.FIGURE: charts.leaderboard_of(table, champions, lines)}
    meanings = {entry.method.name: entry.method.description for entry in planned.entries}
    tests = {experiment: list(own) for experiment, own in planned.tests.items()}
    page = board.markdown(table, worlds, costs, meanings, tests, _provenance(planned))
    write_report(study, page, figures, "epuckhebb: leaderboard")


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
            spent["evolve_cpu_s"].append(sum(_cpu_s(Run(planned.folder / job.run)) for job in evolved))
            spent["test_cpu_s"].append(_cpu_s(Run(planned.folder / test.run)))
        summed = pd.concat(of_worlds).groupby("scenario", sort=False).sum().reset_index()
        summed.insert(0, "tests", summed.scenario.map(planned.sweep_of).fillna(""))
        worlds += [whose | {str(name): value for name, value in row.items()} for row in summed.to_dict("records")]
        costs.append(whose | {name: round(sum(each) / len(each), 1) for name, each in spent.items()})
    made = pd.DataFrame(champions).astype({"successes_off": "Int64", "successes_inverted": "Int64"})
    return made, pd.DataFrame(worlds), pd.DataFrame(costs)


def _cpu_s(run: Run) -> float:
    return float(run.json(COST)["cpu_s"])
