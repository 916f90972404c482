"""Our launcher configurations on the real thing: nox -s slurm and nox -s ray start what these need."""

import pandas as pd
import pytest
from typer.testing import CliRunner

from epuckhebb.app.cli import app

THREE = ["sweep", "obstacles", "lifetime.duration_s=3", "repeats=2", "hydra.sweep.dir=out"]


def sweep_on(launcher, folder, *words):
    result = CliRunner().invoke(app, [*THREE, f"hydra/launcher={launcher}", *words])
    assert result.exit_code == 0, result.output
    rows = pd.read_csv(folder / "out" / "sweep.csv")
    assert list(rows.scenario.unique()) == ["base", "2obstacles", "4obstacles"]
    again = CliRunner().invoke(app, [*THREE, f"hydra/launcher={launcher}", *words])
    assert "3 done before, 0 to do" in again.stderr
    return (folder / "out" / "sweep.csv").read_bytes()


@pytest.mark.slurm
@pytest.mark.filterwarnings("default")  # submitit warns that this cluster keeps no accounts
@pytest.mark.parametrize("launcher", ["submitit_slurm", "slurm"])
def test_three_jobs_on_slurm(tmp_path, monkeypatch, launcher):
    monkeypatch.chdir(tmp_path)
    table = sweep_on(launcher, tmp_path, "hydra.launcher.mem_gb=1")
    submitted = {path.name.partition("_")[0] for path in (tmp_path / "out" / ".submitit").glob("[0-9]*")}
    assert len(submitted) == 1, submitted  # one array of three jobs
    monkeypatch.chdir(tmp_path / "out")
    assert sweep_on("basic", tmp_path / "out") == table


@pytest.mark.ray
@pytest.mark.filterwarnings("default")  # Ray leaves sockets open
def test_three_jobs_on_ray(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    sweep_on("ray_local", tmp_path)
