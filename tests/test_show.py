"""`epuckhebb show` of everything that can be named, and the word `latest`."""

import json
import re
from pathlib import Path

import pandas as pd
import pytest
from cases import call, done

from epuckhebb.cli import show
from epuckhebb.cli.console import Terminal
from epuckhebb.studies.sweep import Sweep
from epuckhebb.tmaze.maze import SIDES

SHORT = ["lifetime.duration_s=0.064", "repeats=1"]
TINY = ["ga.population=4", "ga.generations=2", "ga.elites=1", "ga.loops=1", "lifetime.duration_s=0.064"]
TINY += ["scenario.paper_duration_s=10", "-q"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A folder with an evolution, two evaluations, a multirun and a sweep, in this order."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("runs"))
        for words in (
            ["evolve", *TINY],
            ["evaluate", *SHORT, "genome=latest", "-q"],
            ["evaluate", *SHORT, "seed=2", "-q"],
            ["evaluate", *SHORT, "-m", "hebbian.N=0.0001,0.002", "lifetime.record_every=0", "-q"],
            ["sweep", "light", *SHORT, "scenario.light=1,0.5", "hydra/launcher=basic", "-q"],
        ):
            done(*words)
        yield Path.cwd()


@pytest.fixture
def _there(folder, monkeypatch):
    monkeypatch.chdir(folder)
    monkeypatch.setenv("COLUMNS", "300")


def shown(*words):
    result = done("show", *words)
    return result.stdout


@pytest.mark.usefixtures("_there")
def test_without_a_name_it_tells_of_the_latest_runs():
    told = shown()
    assert "fitness" in told
    assert told.count("_multirun/") == 2
    known = json.loads(shown("--json"))["runs"]
    assert [Path(run).parts[1] for run in known] == ["evolve", *["evaluate"] * 4, "sweep"]


@pytest.mark.usefixtures("here")
def test_without_runs_it_says_how_to_begin():
    assert "epuckhebb evaluate" in shown()
    assert json.loads(shown("--json")) == {"runs": []}


@pytest.mark.usefixtures("_there")
def test_latest_is_the_one_of_the_last_call():
    for file in Path("runs/evolve").glob("*/status.json"):
        file.touch()  # as where runs are copied
    assert json.loads(shown("latest", "--json"))["command"] == "sweep"


@pytest.mark.usefixtures("_there")
def test_a_multirun_is_a_table_over_all():
    (multirun,) = Path("runs/evaluate").glob("*_multirun")
    told = shown(str(multirun))
    assert [run["run"] for run in json.loads(shown(str(multirun), "--json"))["runs"]] == [
        str(multirun / number) for number in "01"
    ]
    assert re.findall(r"^([\d.]+) +(GA|Hebbian) ", told, re.MULTILINE) == [
        ("0", "GA"),
        ("0.0001", "Hebbian"),
        ("0.002", "Hebbian"),
    ]
    figure = multirun / "figures" / "dose_response.png"
    assert f"{figure.parent}/: {figure.name}" in told
    assert figure.read_bytes().startswith(b"\x89PNG")


def test_controllers_that_have_the_same_rate_have_rows_of_their_own(tmp_path, capsys):
    rows = [
        ("reference", name, rate, side) for name, rate in (("GA", 0), ("stay", 0), ("late", 5e-4)) for side in SIDES
    ]
    summary = pd.DataFrame(rows, columns=["genome", "controller", "N", "side"])
    success = {"n": 3, "success": 1.0, "success_noise_low": 0.4, "success_noise_high": 1.0}
    summary.assign(**success).to_csv(tmp_path / "summary.csv", index=False)
    show.print_study(Sweep, tmp_path, Terminal())
    assert re.findall("GA|stay|late", capsys.readouterr().out) == ["GA", "stay", "late"]


@pytest.mark.usefixtures("_there")
def test_the_champion_of_the_latest_evolution_is_written_down_by_its_folder():
    (evolved,) = Path("runs/evolve").iterdir()
    runs = [json.loads(file.read_text()) for file in Path("runs/evaluate").glob("*_seed1/provenance.json")]
    assert [run["genome"] for run in runs] == [evolved.name]
    assert f"genome={evolved}" in runs[0]["overrides"]


def test_verbs_take_the_latest_run_that_they_can_use(folder, tmp_path, monkeypatch):
    monkeypatch.chdir(folder)
    page = tmp_path / "page.html"
    result = call("replay", "latest", "--output", str(page))
    assert "recorded nothing" in result.stderr  # the second job of the multirun
    assert "_multirun" in result.stderr
    result = done("evolve", "resume=latest", "-q")
