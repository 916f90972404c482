"""A named sweep: what it runs, what it does not run again, and its tables, killed or not."""

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cases import call, done, first_of, refused
from hydra.plugins.sweeper import Sweeper
from omegaconf import OmegaConf

from epuckhebb.config import alternatives, compose, override_value, readable
from epuckhebb.config.schema import EvaluateConfig
from epuckhebb.config.values import converted, field_types
from epuckhebb.runs import hydra, maze
from epuckhebb.runtime import ConfigError
from epuckhebb.runtime.conf import groups
from epuckhebb.runtime.resources import data_folder
from epuckhebb.store import provenance
from epuckhebb.store.genome import load_genome
from epuckhebb.store.run import Run
from epuckhebb.studies import leaderboard, study, sweep

FAST = ["lifetime.duration_s=3", "repeats=2"]
TWO = ["scenario=base,4obstacles", *FAST]
TABLES = ("sweep.csv", "summary.csv", "failed.csv")


def command(*words):
    return [sys.executable, "-c", "from epuckhebb.__main__ import main; main()", *words]


def only_sweep(folder):
    (found,) = (folder / "runs" / "sweep").iterdir()
    return found


def read_tables(folder):
    return {name: (folder / name).read_bytes() for name in TABLES}


@pytest.fixture
def failing(monkeypatch):
    """Make the evaluations of the scenario base fail, in this process."""
    evaluate = maze.evaluate

    def fail(genes, scenario, *others, **more):
        if scenario.name == "base":
            raise ArithmeticError("the robot is lost")
        return evaluate(genes, scenario, *others, **more)

    monkeypatch.setattr(maze, "evaluate", fail)


SWEEPS = [
    name for name in groups("sweep")["experiment"] if not name.startswith("legs")
]  # their champions come of plans


@pytest.mark.parametrize("name", first_of(SWEEPS))
def test_a_dry_run_lists_the_jobs_and_writes_nothing(here, name):
    many = name == "adaptive" or name.startswith("rescue")
    few = ["genome=reference_101", "scenario=base,highlight,lowlight"] if many else []
    result = done("sweep", name, *few, "seed=1,2", "--dry-run", "--json")
    told = call("sweep", name, *few, "seed=1,2", "--dry-run").stdout
    assert re.search(r"0 done, \d+ to do; nothing was run.", told)
    listed = json.loads(result.stdout)["jobs"]
    assert len({job["run"] for job in listed}) == len(listed) >= 6
    assert not any(job["done"] for job in listed)
    assert list(here.iterdir()) == []


def test_all_that_the_sweep_of_adaptations_names_is_there():
    swept = OmegaConf.load(data_folder("conf") / "experiment" / "adaptive.yaml").hydra.sweeper.params
    assert [len(worlds) for worlds in leaderboard.experiment_worlds(["adaptive"], None).values()] == [8, 8]
    (words,) = alternatives(readable([f"genome={swept.genome}"])).values()
    assert len(words) == 40
    for word in words:
        load_genome(override_value(word), "obstacles")


@pytest.mark.parametrize(
    "words",
    first_of(
        [
            ["hebbian.N=0,1e-5", "scenario=base,lowlight", "lifetime.noise=${scenario.light}"],
            ["seed=1,2", "hebbian.N=0.001", "lifetime.noise=${seed}", "scenario=base"],
            ["lifetime.duration_s=3,4", "lifetime.gain_rad_s=${lifetime.noise}", "scenario=base", "hebbian.N=0"],
            ["scenario.light=0.1,1", "repeats=2,3", "network.layers=[16,7,5,8,4,2]", "scenario=base", "hebbian.N=0,1"],
        ]
    ),
)
def test_what_is_listed_is_what_hydra_would_compose(words):
    identities = sweep.Identities()
    jobs = sweep.plan("n_sweep", words).jobs
    assert len({job.run for job in jobs}) == len(jobs) > 1
    for job in jobs:
        assert compose.load(EvaluateConfig, job.overrides).values == job.config
        assert identities.name(job.config) == sweep.Identities().name(job.config) == job.run


@pytest.mark.thorough
def test_ten_thousand_jobs_are_listed_without_composing_each(monkeypatch):
    composed, count = compose.hydra_composition, []
    monkeypatch.setattr(
        compose, "hydra_composition", lambda *args, **more: count.append(args) or composed(*args, **more)
    )
    jobs = sweep.plan("obstacles", ["scenario=base", "seed=range(1,101)", "repeats=range(1,101)"]).jobs
    assert (len(jobs), len(count)) == (10_000, 2)
    assert jobs[-1].config["seed"] == jobs[-1].config["repeats"] == 100


def test_jobs_that_would_do_the_same_are_one():
    assert len(sweep.plan("obstacles", ["scenario=base", "seed=1,1", "threads=1,2"]).jobs) == 1


def test_a_sweep_leaves_tables_and_is_not_done_twice(here):
    first = done("sweep", "obstacles", *TWO, "seed=1,2")
    assert "4 jobs" in first.stderr
    assert "0 done before, 4 to do" in first.stderr
    folder = only_sweep(here)
    rows = pd.read_csv(folder / "sweep.csv")
    assert list(rows.columns[:4]) == ["job", "run", "lifetime.duration_s", "genome"]
    assert list(rows.groupby(["scenario", "seed"], sort=False).size()) == [8] * 4
    assert list(rows.job.unique()) == [0, 1, 2, 3]
    summary = pd.read_csv(folder / "summary.csv")
    assert list(summary.n) == [4] * 8  # 2 repeats by 2 seeds for each scenario, controller and side
    assert (summary.success_noise_low <= summary.success).all()
    assert (summary.success <= summary.success_noise_high).all()
    assert (folder / "failed.csv").read_text() == "job,run,error\n"
    assert not (folder / "unfinished").exists()
    before = {file: file.stat().st_mtime_ns for file in folder.glob("job_*/*")}
    tables = read_tables(folder)
    again = call("sweep", "obstacles", *TWO, "seed=1,2", "threads=1")
    assert "4 done before, 0 to do" in again.stderr
    assert {file: file.stat().st_mtime_ns for file in folder.glob("job_*/*")} == before
    assert read_tables(folder) == tables
    told = json.loads((folder / rows.run[0] / "provenance.json").read_text())
    assert told["command_line"][:3] == ["epuckhebb", "sweep", "obstacles"]
    assert "seed=1" in told["overrides"]


@pytest.mark.thorough
def test_only_what_is_whole_is_kept(here):
    words = ["sweep", "obstacles", "scenario=base,2obstacles,4obstacles", *FAST, "hydra/launcher=basic", "-q"]
    done(*words)
    folder = only_sweep(here)
    tables = read_tables(folder)
    missing, running, cut = sorted(folder.glob("job_*"))
    shutil.rmtree(missing)
    (running / "status.json").write_text('{"schema": 1, "state": "running"}')
    (running / "metrics.csv").write_text("wrong")
    (cut / "status.json").write_text('{"sch')
    (folder / "unfinished" / "20261122-010203-0123abcd_0").mkdir(parents=True)
    (folder / "unfinished" / "20261122-010203-0123abcd_0" / "metrics.csv").write_text("half a f")
    (folder / "unfinished" / "stop").touch()
    for half in (folder / ".sweep.csv.1.tmp", folder / "jobs" / ".job_1.json.1.tmp"):
        half.write_text("half a f")
    result = call(*words[:-1])
    assert "0 done before, 3 to do" in result.stderr
    check_whole(folder, tables)


@pytest.mark.thorough
def test_another_genome_or_another_science_is_done_anew(here, monkeypatch):
    np.save("mine.npy", np.zeros(234))
    words = ["sweep", "obstacles", "scenario=base", *FAST, "genome=mine.npy", "hydra/launcher=basic"]
    assert "1 to do" in call(*words).stderr
    assert "0 to do" in call(*words).stderr
    np.save("mine.npy", np.ones(234))
    assert "0 done before, 1 to do" in call(*words).stderr
    monkeypatch.setattr(provenance, "SCIENCE", 0)
    assert "0 done before, 1 to do" in call(*words).stderr
    assert list(pd.read_csv(only_sweep(here) / "sweep.csv").genome.unique()) == ["mine"]


def test_each_job_has_its_own_reason(here, monkeypatch):
    """One fails in its run, and one before it has one."""
    evaluate, work = maze.evaluate, sweep.Sweep.work

    def fail(genes, scenario, *others, **more):
        if scenario.name == "2obstacles":
            raise ArithmeticError("the robot is lost")
        return evaluate(genes, scenario, *others, **more)

    def refuse(path, job, facts):
        if "scenario=4obstacles" in job["overrides"]:
            raise ConfigError("the table is empty")
        work(path, job, facts)

    monkeypatch.setattr(maze, "evaluate", fail)
    monkeypatch.setattr(sweep.Sweep, "work", staticmethod(refuse))
    monkeypatch.setattr(Sweeper, "validate_batch_is_legal", pytest.fail)  # it composes all jobs, each in .1 s
    words = ["sweep", "obstacles", "scenario=base,2obstacles,4obstacles", *FAST, "hydra/launcher=basic"]
    assert call(*words).exit_code == 1
    failed = pd.read_csv(only_sweep(here) / "failed.csv").error
    assert [one.rpartition(": ")[2] for one in failed] == ["the robot is lost", "the table is empty"]


def test_jobs_that_share_a_start_have_their_own_reasons_and_leave_the_same_tables(here, monkeypatch):
    """The second of three fails in a start of two; then a start begins again after its end, as SLURM's may."""
    words, starts, work, do = ["sweep", "obstacles", *FAST, "hydra/launcher=basic"], [], sweep.Sweep.work, study._do_job

    def fail(path, job, facts):
        starts.append(hydra.output_folder())
        if "scenario=2obstacles" in job["overrides"]:
            raise ArithmeticError("the robot is lost")
        work(path, job, facts)

    def do_twice(attempt, run):
        do(attempt, run)
        attempt.mkdir()
        do(attempt, run)

    three = "scenario=base,2obstacles,4obstacles"
    monkeypatch.setattr(sweep.Sweep, "work", staticmethod(fail))
    assert call(*words, three, "--batch", "2").exit_code == 1
    assert [starts.index(start) for start in starts] == [0, 0, 2]
    folder = only_sweep(here)
    assert list(pd.read_csv(folder / "failed.csv").error) == ["ArithmeticError: the robot is lost"]
    monkeypatch.setattr(sweep.Sweep, "work", work)
    monkeypatch.setattr(study, "_do_job", do_twice)
    done(*words, three, "--batch", "2")
    monkeypatch.undo()
    os.chdir(here)
    done(*words, three, "hydra.sweep.dir=alone")
    assert read_tables(folder) == read_tables(here / "alone")
    assert len(list(folder.glob("job_*"))) == 3
    assert not (folder / "unfinished").exists()


@pytest.mark.usefixtures("failing")
def test_a_failed_job_is_told_of_and_the_others_are_kept(here, monkeypatch):
    words = ["sweep", "obstacles", *TWO, "hydra/launcher=basic"]
    result = call(*words)
    assert result.exit_code == 1
    assert "the robot is lost" in result.stderr
    folder = only_sweep(here)
    failed = pd.read_csv(folder / "failed.csv")
    assert list(failed.job) == [0]
    assert "the robot is lost" in failed.error[0]
    assert set(pd.read_csv(folder / "sweep.csv").scenario) == {"4obstacles"}
    told = Run(folder).status
    assert (told["state"], "the robot is lost" in told["error"]) == ("failed", True)
    monkeypatch.undo()
    os.chdir(here)
    again = done(*words)
    assert "1 done before, 1 to do" in again.stderr
    assert set(pd.read_csv(folder / "sweep.csv").scenario) == {"base", "4obstacles"}
    assert len(pd.read_csv(folder / "failed.csv")) == 0
    assert (Run(folder).status["state"], "error" in Run(folder).status) == ("finished", False)
    shown = done("show", folder).stdout
    assert "95 % interval: noise only, this champion" in shown
    for other in ("rerun", "replay"):
        refused(other, folder)


@pytest.mark.thorough
def test_a_full_disk_spoils_no_earlier_result(here, small_files, monkeypatch):
    """A limit on the size of files stands for the disk: metrics.csv of the second seed does not fit."""
    words = ["sweep", "obstacles", "scenario=base", *FAST, "hydra/launcher=basic", "hydra.sweep.dir=out"]
    done(*words, "seed=1")
    before = {file: file.read_bytes() for file in (here / "out").glob("job_*/*") if file.is_file()}
    evaluate = maze.evaluate
    with small_files() as limit:
        monkeypatch.setattr(maze, "evaluate", lambda *words, **more: limit(100) or evaluate(*words, **more))
        result = call(*words, "seed=1,2")
    assert result.exit_code in (1, 2), result.output
    assert "File too large" in result.stderr
    assert "Traceback" not in result.output
    assert {file: file.read_bytes() for file in before} == before
    assert list((here / "out").rglob(".*.tmp")) == []
    monkeypatch.setattr(maze, "evaluate", evaluate)
    result = done(*words, "seed=1,2")
    assert "1 done before, 1 to do" in result.stderr


def killed(words, cwd, until):
    """Start a sweep and kill it and its workers when `until(seconds, jobs done)` says so."""
    started = subprocess.Popen(
        command(*words), cwd=cwd, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    began = time.monotonic()
    while not until(time.monotonic() - began, len(list(cwd.glob("runs/sweep/*/job_*")))):
        assert started.poll() is None, "it ended before it could be killed"
        time.sleep(0.02)
    os.killpg(started.pid, signal.SIGKILL)
    started.wait()


def check_whole(folder, tables):
    assert read_tables(folder) == tables
    assert len(list(folder.glob("job_*"))) == len(pd.read_csv(folder / "sweep.csv").job.unique())
    assert list(folder.rglob("*.tmp")) == []
    assert not (folder / "unfinished").exists()


@pytest.mark.thorough
def test_killed_with_its_workers_it_resumes_to_the_same_tables(here):
    words = ["sweep", "obstacles", *FAST, "seed=1,2"]
    (here / "whole").mkdir()
    os.chdir("whole")
    done(*words, "hydra/launcher=basic")
    tables = read_tables(only_sweep(here / "whole"))
    os.chdir("..")
    killed([*words, "hydra.launcher.n_jobs=2"], here, lambda _, done: done)
    result = call(*words, "hydra/launcher=basic")
    assert "6 jobs" in result.stderr
    assert "0 done before" not in result.stderr
    assert "0 to do" not in result.stderr
    check_whole(only_sweep(here), tables)


def is_gone(group):
    """Whether every process of a group has ended."""
    try:
        os.killpg(group, 0)
    except ProcessLookupError:
        return True
    return False


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("launcher", "number", "to_all"),
    [
        (["joblib"], signal.SIGINT, True),
        (["joblib", "hydra.launcher.n_jobs=4"], signal.SIGKILL, False),  # one of them has no job
        pytest.param(["joblib"], signal.SIGTERM, False, marks=pytest.mark.slow),
        pytest.param(["joblib"], signal.SIGHUP, False, marks=pytest.mark.slow),
        pytest.param(["submitit_local"], signal.SIGINT, True, marks=pytest.mark.slow),
    ],
)
def test_a_signal_ends_a_sweep_and_its_workers(here, launcher, number, to_all):
    if launcher == ["submitit_local"]:
        pytest.importorskip("submitit")
    words = ["sweep", "obstacles", "repeats=20000", "hydra.sweep.dir=out", f"hydra/launcher={launcher[0]}"]
    words += launcher[1:]
    started = subprocess.Popen(command(*words), start_new_session=True, stderr=subprocess.PIPE, text=True)
    with started:
        while not list((here / "out").glob("unfinished/*/provenance.json")):
            assert started.poll() is None
            time.sleep(0.05)
        (os.killpg if to_all else os.kill)(started.pid, number)
        told = started.communicate(timeout=60)[1]  # ends when no worker holds the pipe any more
    while not is_gone(started.pid):
        time.sleep(0.05)
    if number != signal.SIGKILL:
        assert started.returncode == 130, told
        assert "interrupted" in told
    assert "interrupted" in call("show", "out").stdout


def test_threads_do_not_multiply_with_the_width(monkeypatch):
    from hydra.core.hydra_config import HydraConfig
    from omegaconf import OmegaConf

    def threads(asked, mode, target, **launcher):
        cfg = OmegaConf.create({"mode": mode, "launcher": {"_target_": target, **launcher}})
        monkeypatch.setattr(HydraConfig, "get", lambda: cfg)
        return hydra.threads_of_job(asked)

    monkeypatch.setattr(hydra, "thread_count", lambda asked: asked or 8)
    from hydra.types import RunMode

    assert threads(0, RunMode.RUN, "x.BasicLauncher") == 8
    assert threads(0, RunMode.MULTIRUN, "x.BasicLauncher") == 8
    for asked, n_jobs, given in [(0, -1, 1), (0, 2, 1), (4, -1, 1), (4, 2, 4), (8, 2, 4), (4, 16, 1), (2, -2, 1)]:
        assert threads(asked, RunMode.MULTIRUN, "x.JoblibLauncher", n_jobs=n_jobs) == given
    assert threads(0, RunMode.MULTIRUN, "x.SlurmLauncher") == 1


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [("seed", 3, 3), ("genome", 7, "7"), ("threads", 0, 0)],
)
def test_a_value_alone_has_the_declared_type(key, value, expected):
    found = converted(key, value, field_types(EvaluateConfig)[key])
    assert (type(found), found) == (type(expected), expected)


def test_a_study_may_have_a_path():
    assert (converted("where", "a/b", Path), converted("where", None, Path | None)) == (Path("a/b"), None)


@pytest.mark.parametrize(
    ("key", "value"), [("seed", 2.5), ("seed", "3"), ("seed", True), ("seed", None), ("genome", {"a": 1})]
)
def test_a_value_alone_of_another_type_is_refused(key, value):
    with pytest.raises(ConfigError, match=key):
        converted(key, value, field_types(EvaluateConfig)[key])


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["a/x.py:One", "y.py:Two"], ["One", "Two"]),
        (["a.py:R", "b.py:R"], ["a.py:R", "b.py:R"]),
        (["[{at: 5, length: 2}]", "[{at: 9, length: 2}]"], ["[{at: 5, length: 2}]", "[{at: 9, length: 2}]"]),
        (["[{at: 5, function: a/c.py:shock}]", "[]"], ["[{at: 5, function: shock}]", "[]"]),
    ],
)
def test_a_class_of_ones_own_has_a_short_name_unless_another_has_the_same(names, expected):
    assert sweep.shortened(names) == expected
