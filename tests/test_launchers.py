"""Our launcher configurations on the real thing: nox -s slurm and nox -s ray start what these need."""

import os
import shutil
import subprocess
import sys
import threading
import time
from pathlib import Path

import pandas as pd
import pytest
from cases import call, done, refused

from epuckhebb.store import Run

MY_RULE = Path(__file__).parents[1] / "examples" / "own_rule" / "my_rules.py"
CHAMPIONS = Path(__file__).parents[1] / "runs" / "reference" / "champions"
THREE = ["sweep", "obstacles", "lifetime.duration_s=3", "repeats=2", "hydra.sweep.dir=out"]


def sweep_on(launcher, folder, *words, scenarios=("base", "2obstacles", "4obstacles")):
    words = (*words, f"scenario={','.join(scenarios)}")
    done(*THREE, f"hydra/launcher={launcher}", *words)
    rows = pd.read_csv(folder / "out" / "sweep.csv")
    assert tuple(rows.scenario.unique()) == scenarios
    again = call(*THREE, f"hydra/launcher={launcher}", *words)
    assert f"{len(scenarios)} done before, 0 to do" in again.stderr
    return (folder / "out" / "sweep.csv").read_bytes()


def sweep_by_a_rule_of_ones_own_on(launcher, folder, *words, **more):
    shutil.copy(MY_RULE, folder)
    sweep_on(launcher, folder, f"hebbian.rule={folder}/my_rules.py:Gated", "hebbian.N=0.0001", *words, **more)
    assert set(pd.read_csv(folder / "out" / "sweep.csv").controller) == {"GA", "gated"}


@pytest.mark.slurm
@pytest.mark.filterwarnings("default")
def test_a_rule_of_ones_own_on_slurm(here):
    sweep_by_a_rule_of_ones_own_on("slurm", here, "hydra.launcher.mem_gb=1")


@pytest.mark.ray
@pytest.mark.filterwarnings("default")
def test_a_rule_of_ones_own_on_ray(here):
    sweep_by_a_rule_of_ones_own_on("ray_local", here)


@pytest.mark.thorough
@pytest.mark.parametrize("launcher", ["joblib", "submitit_local"])
def test_a_rule_of_ones_own_on_this_machine(tmp_path, monkeypatch, launcher):
    if launcher == "submitit_local":
        pytest.importorskip("submitit")
    monkeypatch.chdir(tmp_path)
    sweep_by_a_rule_of_ones_own_on(launcher, tmp_path, scenarios=("base", "4obstacles"))


@pytest.mark.thorough
def test_workers_of_an_earlier_call_do_not_work_in_its_folder(tmp_path, monkeypatch):
    for name in ("one", "other"):
        monkeypatch.chdir(tmp_path)
        (tmp_path / name).mkdir()
        monkeypatch.chdir(name)
        done("evaluate", "-m", "seed=1,2", "lifetime.duration_s=1", "hydra/launcher=joblib", "hydra.sweep.dir=out")
    assert all((tmp_path / "other" / "out" / job / "metrics.csv").exists() for job in "01")


@pytest.mark.slurm
@pytest.mark.filterwarnings("default")  # submitit warns that this cluster keeps no accounts
@pytest.mark.parametrize(("launcher", "batch"), [("submitit_slurm", 1), ("slurm", 2)])
def test_three_jobs_on_slurm(here, monkeypatch, launcher, batch):
    table = sweep_on(launcher, here, "hydra.launcher.mem_gb=1", f"--batch={batch}")
    submitted = [path.name for path in (here / "out" / ".submitit").glob("[0-9]*_*")]
    assert len(submitted) == {1: 3, 2: 2}[batch]
    assert len({name.partition("_")[0] for name in submitted}) == 1, submitted  # one array
    monkeypatch.chdir(here / "out")
    assert sweep_on("basic", here / "out") == table


@pytest.mark.slurm
def test_what_slurm_refuses_is_refused(here):
    told = refused("evolve", "-m", "seed=1,2", "hydra/launcher=slurm", "hydra.launcher.partition=none")
    assert "hydra.launcher.partition=none" in told
    assert not list(here.iterdir())


@pytest.mark.slurm
@pytest.mark.usefixtures("here")
@pytest.mark.filterwarnings("default")
def test_a_job_that_slurm_loses_costs_itself_where_there_are_no_accounts(monkeypatch):
    """One of two evolutions is cancelled: the other one ends, and the same command does the rest."""
    monkeypatch.setattr("epuckhebb.runs.slurm._LOOK_S", 1.0)
    monkeypatch.setattr("epuckhebb.runs.slurm._PATIENCE_S", 5.0)
    few = ["ga.generations=3", "ga.population=10", "ga.loops=1", "lifetime.duration_s=20", "hydra.launcher.mem_gb=1"]
    words = ["evolve", "-m", "seed=1,2", *few, "hydra/launcher=slurm", "hydra.sweep.dir=out"]

    def cancel():
        def queued():
            asked = ["squeue", "--me", "--array", "--noheader", "--format=%i"]
            return subprocess.run(asked, capture_output=True, text=True, check=True).stdout.split()

        while not any(job.endswith("_1") for job in queued()):
            time.sleep(0.1)
        subprocess.run(["scancel", next(job for job in queued() if job.endswith("_1"))], check=True)

    thread = threading.Thread(target=cancel)
    thread.start()
    ended = call(*words)
    thread.join()
    assert ended.exit_code == 1
    assert "1 of 2 jobs" in ended.stderr
    assert "seed=2" in ended.stderr
    assert Run(Path("out/0")).is_whole
    done(*words)
    done("evolve", "-m", "seed=1,2", *few[:-1], "hydra.sweep.dir=alone")
    assert Path("out/summary.csv").read_bytes() == Path("alone/summary.csv").read_bytes()


@pytest.mark.slurm
@pytest.mark.usefixtures("here")
@pytest.mark.filterwarnings("default")
def test_an_evolution_whose_time_ends_goes_on_as_often_as_it_may(monkeypatch):
    """SLURM's signal before a limit comes twice: the job begins again once, is then stopped, and can go on."""
    monkeypatch.setattr("epuckhebb.runs.slurm._LOOK_S", 1.0)
    few = ["ga.generations=600", "ga.population=10", "ga.loops=1", "lifetime.duration_s=20", "figures=none"]
    on_slurm = ["hydra/launcher=slurm", "hydra.launcher.mem_gb=1", "hydra.launcher.timeout_min=5"]
    words = ["evolve", "-m", "seed=1", *few, *on_slurm, "hydra.launcher.max_num_timeout=1", "hydra.sweep.dir=out"]
    states = []

    def state():
        return Run(Path("out/0")).recorded_status.get("state")

    def generation():
        file = Path("out/0/checkpoint.npz")
        return file.stat().st_mtime_ns if file.exists() else None

    def end_its_time():
        for _ in range(2):
            before = generation()
            while state() != "running" or generation() == before:
                if state() == "finished":
                    return  # too fast a machine for these generations
                time.sleep(0.1)
            running = ["squeue", "--me", "--states=RUNNING", "--noheader", "--format=%i"]
            job = subprocess.run(running, capture_output=True, text=True, check=True).stdout.strip()
            subprocess.run(["scancel", "--signal=USR2", job], check=True)
            while state() == "running":
                time.sleep(0.1)
            states.append(state())

    thread = threading.Thread(target=end_its_time, daemon=True)
    thread.start()
    ended = call(*words)
    thread.join()
    assert states == ["interrupted"] * 2
    assert ended.exit_code == 1
    assert "timeout_min" in ended.stderr
    done(*words)
    done("evolve", "-m", "seed=1", *few, "hydra.sweep.dir=alone")
    for name in ("history.csv", "champion.npz", "checkpoint.npz"):
        assert Path("out/0", name).read_bytes() == Path("alone/0", name).read_bytes()


@pytest.mark.ray
@pytest.mark.filterwarnings("default")  # Ray leaves sockets open
def test_three_jobs_on_ray(here):
    sweep_on("ray_local", here)


@pytest.fixture
def cluster(tmp_path_factory, monkeypatch):
    """A Ray cluster of this machine, started in another folder than that of the calls."""
    ray = Path(sys.executable).with_name("ray")
    monkeypatch.setenv("PATH", f"{ray.parent}{os.pathsep}{os.environ['PATH']}")
    monkeypatch.setenv("RAY_raylet_start_wait_time_s", "120")
    words = [ray, "start", "--head", "--block", "--num-cpus=2", "--include-dashboard=false", "--disable-usage-stats"]
    with subprocess.Popen(words, cwd=tmp_path_factory.mktemp("elsewhere"), stdout=subprocess.PIPE, text=True) as head:
        assert any("Ray runtime started" in line for line in head.stdout)
        yield
        head.terminate()


@pytest.mark.ray
@pytest.mark.usefixtures("cluster")
@pytest.mark.filterwarnings("default")
def test_a_cluster_that_was_started_elsewhere_works_in_the_folder_of_the_call(here):
    sweep_by_a_rule_of_ones_own_on("ray_cluster", here)
    shutil.copy(CHAMPIONS / "obstacles_seed001.npz", here / "mine.npz")
    words = ["-m", "genome=mine.npz", "lifetime.duration_s=3", "repeats=2", "hebbian.N=0.0002,0.0001"]
    for launcher in ("ray_cluster", "basic"):
        done("evaluate", *words, f"hydra/launcher={launcher}", f"hydra.sweep.dir={launcher}")
    assert Path("ray_cluster/summary.csv").read_bytes() == Path("basic/summary.csv").read_bytes()
