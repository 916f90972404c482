"""`epuckhebb reproduce`, small: whole, resumable, repeatable, and every number of its report in a CSV."""

import json
import re
import shutil
import signal
import subprocess
import sys
import time

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from epuckhebb.app import reproduce, runs
from epuckhebb.app.cli import app
from epuckhebb.app.progress import TaskProgress
from epuckhebb.sim.network import Network
from epuckhebb.study import findings, rescue

SMALL = [
    "champions=2",
    "repeats=1",
    "rates=[0.001]",
    "ga.population=4",
    "ga.generations=2",
    "ga.elites=1",
    "ga.loops=1",
]
SHOWN = []  # on the bar, by `made`


def call(*words):
    return CliRunner().invoke(app, ["reproduce", *words])


@pytest.fixture
def _no_figures(monkeypatch):
    """Leave out what takes longest, where only the numbers matter."""
    monkeypatch.setattr(reproduce, "_figures", lambda *_: {})


def contents(folder):
    return {file.name: file.read_bytes() for file in folder.rglob("*.csv")}


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("reproduce"))
        patch.setattr(TaskProgress, "put", lambda _, completed, told: SHOWN.append((completed, told)))
        result = call("all", *SMALL)
        assert result.exit_code == 0, result.output
        (folder,) = (tmp_path_factory.getbasetemp() / "reproduce0" / "runs" / "reproduce").iterdir()
        yield folder, result


def test_it_leaves_report_tables_and_figures(made):
    folder, result = made
    assert "The paper's claims" in result.stdout
    assert {"report.md", "report.html", "provenance.json", "status.json"} <= {file.name for file in folder.iterdir()}
    tables = {"metrics", "trials", "claims", "success", "rescue_and_harm", "retention", "dose_response", "comparison"}
    assert tables <= {file.stem for file in folder.glob("*.csv")}
    named = set(re.findall(r"\(figures/([\w.]+)\)", (folder / "report.md").read_text()))
    assert named == {file.name for file in (folder / "figures").iterdir()}
    assert len(named) == 15


@pytest.mark.usefixtures("made")
def test_the_bar_moves_within_the_steps():
    completed, told = zip(*SHOWN, strict=True)
    assert list(completed) == sorted(completed)
    assert [line.strip() for line in told[:4]] == [
        "1/9  evolve light_seed001",
        "1/9  evolve light_seed001  compiling …",
        "1/9  evolve light_seed001  generation 1 of 2",
        "1/9  evolve light_seed001  generation 2 of 2",
    ]
    assert "5/9  evaluate light_seed001  in lowlight, world 2 of 2" in told
    assert told[-1].strip() == "9/9  tables, figures and report"


def test_the_page_needs_nothing_else(made):
    page = (made[0] / "report.html").read_text()
    assert "://" not in re.sub(r'src="data:[^"]+"', "", page)
    assert page.count('src="data:image/png;base64,') == 15


@pytest.mark.thorough
@pytest.mark.usefixtures("_no_figures")
def test_an_interrupted_run_does_only_what_is_missing_and_ends_with_the_same_bytes(made, tmp_path, monkeypatch):
    shutil.copytree(made[0], tmp_path / "runs" / "reproduce" / made[0].name)
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "runs" / "reproduce" / made[0].name
    before = contents(folder)
    kept = folder / "champions" / "light_seed001.npz"
    stamp = kept.stat().st_mtime_ns
    (folder / "champions" / "obstacles_seed002.npz").unlink()
    (folder / "lifetimes" / "light_seed002.csv").unlink()
    (folder / "claims.csv").unlink()
    assert call("all", *SMALL, "threads=1").exit_code == 0
    assert contents(folder) == before
    assert kept.stat().st_mtime_ns == stamp


@pytest.fixture
def copy(made, tmp_path, monkeypatch):
    """A copy of the finished folder, in which the same command works."""
    monkeypatch.chdir(tmp_path)
    return shutil.copytree(made[0], tmp_path / "runs" / "reproduce" / made[0].name)


def status(folder):
    return json.loads((folder / "status.json").read_text())


def stopping(monkeypatch, error, after):
    """Make the evaluation that follows so many others in this process end with an error."""
    evaluate, seen = reproduce.evaluate, []

    def stop(*arguments, **named):
        seen.append(1)
        if len(seen) > after:
            raise error
        return evaluate(*arguments, **named)

    monkeypatch.setattr(reproduce, "evaluate", stop)


def test_it_says_when_it_ran_and_how_it_ended(made):
    told = status(made[0])
    assert told["state"] == "finished"
    assert told["started"] < told["finished"]
    assert json.loads((made[0] / "provenance.json").read_text())["command"][:3] == ["epuckhebb", "reproduce", "all"]


@pytest.mark.thorough
@pytest.mark.skipif(sys.platform == "win32", reason="no such locks")
def test_two_calls_do_not_work_in_one_folder(copy):
    before = {file: file.read_bytes() for file in copy.rglob("*") if file.is_file()}
    held = runs.hold(copy)
    result = call("all", *SMALL)
    runs.release(held)
    assert result.exit_code == 2
    assert f"another process is working on runs/reproduce/{copy.name}" in result.stderr
    assert "Traceback" not in result.output
    assert {file: file.read_bytes() for file in copy.rglob("*") if file.is_file()} == before


@pytest.mark.thorough
@pytest.mark.usefixtures("_no_figures")
def test_interrupted_anywhere_it_goes_on_to_the_same_bytes(made, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with monkeypatch.context() as patch:
        stopping(patch, KeyboardInterrupt, after=3)  # in the second champion's second world
        result = call("all", *SMALL)
    assert result.exit_code == 130
    assert "interrupted: 5 of 8 jobs are done; the same command does the rest" in result.stderr
    folder = tmp_path / "runs" / "reproduce" / made[0].name
    assert status(folder)["state"] == "interrupted"
    shown = CliRunner().invoke(app, ["show", str(folder)])
    assert shown.exit_code == 0, shown.output
    assert "5 of 8 jobs" in " ".join(shown.stdout.split())
    assert not (folder / "claims.csv").exists()
    (folder / "lifetimes" / ".light_seed002.csv.1.tmp").write_text("half a f")
    result = call("all", *SMALL)
    assert result.exit_code == 0, result.output
    assert result.stderr.startswith("6/9  evaluate light_seed002")
    assert contents(folder) == contents(made[0])
    assert list(folder.rglob("*.tmp")) == []
    told = json.loads((folder / "provenance.json").read_text())
    assert len(told["resumed"]) == 1
    assert status(folder)["state"] == "finished"
    assert status(folder)["started"] < told["resumed"][0]["started"]


def test_a_failure_is_told_of_and_written_down(copy, monkeypatch):
    (copy / "lifetimes" / "light_seed002.csv").unlink()
    stopping(monkeypatch, ArithmeticError("the robot is lost"), after=0)
    result = call("all", *SMALL)
    assert result.exit_code == 1
    assert "the robot is lost" in result.stderr
    told = status(copy)
    assert told["state"] == "failed"
    assert "ArithmeticError" in told["traceback"]


@pytest.mark.thorough
@pytest.mark.usefixtures("_no_figures")
def test_lifetimes_of_an_earlier_run_that_were_damaged_are_lived_again(copy):
    before, damaged = contents(copy), copy / "lifetimes" / "light_seed002.csv"
    damaged.write_bytes(damaged.read_bytes()[:-20])
    assert call("all", *SMALL).exit_code == 0
    assert contents(copy) == before


@pytest.mark.usefixtures("_no_figures")
def test_lifetimes_of_a_version_that_kept_no_checksums_are_named_if_they_cannot_be_read(copy):
    (copy / "status.json").write_text('{"schema": 1, "state": "finished"}')
    (copy / "lifetimes" / "light_seed002.csv").write_bytes(b"")
    result = call("all", *SMALL)
    assert result.exit_code == 2
    assert "light_seed002.csv" in result.stderr
    assert status(copy)["state"] == "failed"


@pytest.mark.thorough
@pytest.mark.usefixtures("_no_figures")
def test_show_tells_of_one_that_is_running_and_of_one_that_has_finished(copy, monkeypatch):
    tell, shown = reproduce._tell, []

    def look_and_tell(study, run):
        shown.append(CliRunner().invoke(app, ["show", str(study.folder)]))
        tell(study, run)

    monkeypatch.setattr(reproduce, "_tell", look_and_tell)
    assert call("all", *SMALL).exit_code == 0
    shown.append(CliRunner().invoke(app, ["show", str(copy)]))
    (copy / "status.json").write_text('{"schema": 1, "state": "finished"}')  # as earlier versions wrote it
    shown.append(CliRunner().invoke(app, ["show", str(copy)]))
    for result, state in zip(shown, ("running", "finished", "finished"), strict=True):
        assert result.exit_code == 0, result.output
        assert re.search(rf"State +{state}", result.stdout)
        assert "The paper's claims" in result.stdout
    told = json.loads(CliRunner().invoke(app, ["show", str(copy), "--json"]).stdout)
    assert told["verb"] == "reproduce"


@pytest.mark.slow  # test_resume.py has one for every run of the tests
def test_ctrl_c_ends_it_and_says_how_to_go_on(tmp_path):
    words = ["reproduce", "light", "ga.population=2000", "ga.generations=1000", "-q"]
    started = subprocess.Popen(
        [sys.executable, "-m", "epuckhebb", *words], cwd=tmp_path, stderr=subprocess.PIPE, text=True
    )
    with started:
        while not list(tmp_path.glob("runs/reproduce/*/provenance.json")):
            assert started.poll() is None
            time.sleep(0.05)
        time.sleep(1)  # inside a generation of 12000 lifetimes
        started.send_signal(signal.SIGINT)
        told = started.communicate(timeout=300)[1]
    assert started.returncode == 130, told
    assert "interrupted: 0 of 40 jobs are done; the same command does the rest" in told
    (folder,) = (tmp_path / "runs" / "reproduce").iterdir()
    assert status(folder)["state"] == "interrupted"


def rows_of(report, heading):
    """The cells of the Markdown table with this first header cell."""
    lines = report[report.index(f"| {heading} |") :].split("\n\n")[0].splitlines()[2:]
    return [[cell.strip(" *") for cell in line.strip("|").split(" | ")] for line in lines]


def test_every_number_of_the_report_is_in_a_csv(made):
    folder, _ = made
    report = (folder / "report.md").read_text()
    claims = pd.read_csv(folder / "claims.csv")
    for cells, row in zip(rows_of(report, "experiment | claim"), claims.itertuples(), strict=True):
        assert cells[:4] == [row.experiment, row.claim, row.verdict, f"{row.true} of {row.n}"]
    harm = pd.read_csv(folder / "rescue_and_harm.csv")
    harm["rate"] = [f"{row.controller}, N = {row.N:g}" for row in harm.itertuples()]
    for scenario, plasticity, rescued, harmed, difference, p in rows_of(report, "scenario | plasticity"):
        row = harm[(harm.scenario == scenario) & (harm.rate == plasticity)].iloc[0]
        assert rescued == rescue.count(row, "rescued", "broken")
        assert harmed == rescue.count(row, "harmed", "sound")
        assert difference.startswith(f"{row.difference:+.2f} [")
        assert p == f"{row.sign_flip_p:.2g}"
    kept = pd.read_csv(folder / "retention.csv")
    kept = kept[kept.N.isin([0, *findings.PAPER_N.values()])].groupby(["experiment", "controller", "N"], sort=False)
    rows = rows_of(report, "experiment | plasticity")
    assert len(rows) == 8  # of each experiment the GA, the paper's rule and its two controls
    for (experiment, plasticity, any_side, both), (condition, own) in zip(rows, kept, strict=True):
        assert (experiment, plasticity) == (condition[0], rescue.label(*condition[1:]))
        for row, cell in zip(own.itertuples(), (any_side, both), strict=True):
            assert cell.startswith(f"{row.retained} of {row.trials}")
    success = pd.read_csv(folder / "success.csv")
    for _, scenario, controller, left, right, both in rows_of(report, "experiment | scenario"):
        name, rate = controller.split(", N = ") if "," in controller else (controller, "0")
        own = success[(success.scenario == scenario) & (success.controller == name) & (float(rate) == success.N)]
        for side, cell in (("left", left), ("right", right), ("both", both)):
            row = own[own.side == side].iloc[0]
            assert cell == f"{row.successes} of {row.n}: {row.share:.2f} [{row.low:.2f}, {row.high:.2f}]"
    comparison = pd.read_csv(folder / "comparison.csv")
    known = {f"{value:.4f}" for value in comparison.ours.dropna()} | {
        f"{value:.2f}" for value in comparison.ours.dropna()
    }
    for block in report.split("### Table ")[1:]:
        shown = block.split("All 2 champions")[0]
        for value in re.findall(r"(\d+\.\d{2,4}) \(\d", shown):
            assert value in known, value


def test_csvs_trace_back_to_lifetimes(made):
    folder, _ = made
    metrics, trials = (pd.read_csv(folder / f"{name}.csv") for name in ("metrics", "trials"))
    row = trials.iloc[-1]
    own = metrics
    for column in ("experiment", "scenario", "controller", "N", "genome", "side"):
        own = own[own[column] == row[column]]
    assert own.path_length_m.mean() == row.path_length_m
    assert (own.success.mean() > 0.5) == row.succeeds


@pytest.mark.usefixtures("_no_figures")
def test_one_given_genome_stands_beside_the_paper(tmp_path, monkeypatch, genomes):
    monkeypatch.chdir(tmp_path)
    np.save("mine.npy", genomes[0])
    result = call("obstacles", "genome=mine.npy", "rates=[]", "repeats=1", "signal=as_coded")
    assert result.exit_code == 0, result.output
    (folder,) = (tmp_path / "runs" / "reproduce").iterdir()
    comparison = pd.read_csv(folder / "comparison.csv")
    assert comparison.relative_deviation.notna().sum() > 30
    assert "Relative deviation" in (folder / "report.md").read_text()


BAD = {
    "no champions": (["champions=0"], ["champions must be 1 or more", "0"]),
    "no such experiment": (["sound"], ["sound", "light, obstacles, all"]),
    "other layers": (["genome=layers.npz"], ["layers 16-8-2", "16-7-5-8-4-2"]),
    "negative rate": (["rates=[-1]"], ["rates", "-1"]),
    "unknown key": (["champoins=3"], ["champoins"]),
}


@pytest.mark.parametrize("mistake", BAD)
def test_a_mistake_gets_one_message_and_leaves_nothing(mistake, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    np.savez("layers.npz", genome=np.zeros(Network((16, 8, 2)).synapses), layers=[16, 8, 2])
    words, expected = BAD[mistake]
    result = call(*words)
    assert result.exit_code == 2, result.output
    for text in expected:
        assert text in result.stderr
    assert [file.name for file in tmp_path.iterdir()] == ["layers.npz"]


def test_a_champion_of_a_version_that_kept_no_checksums_is_named_if_it_cannot_be_read(copy):
    (copy / "status.json").write_text('{"schema": 1, "state": "finished"}')
    champion = copy / "champions" / "light_seed001.npz"
    cut = champion.read_bytes()[:100]
    champion.write_bytes(cut)
    result = call("all", *SMALL)
    assert result.exit_code == 2
    assert "light_seed001.npz" in result.stderr
    assert champion.read_bytes() == cut


@pytest.mark.thorough
@pytest.mark.usefixtures("_no_figures")
def test_a_champion_and_a_history_that_were_damaged_are_evolved_again(copy):
    before = contents(copy)
    champion, history = copy / "champions" / "light_seed001.npz", copy / "history" / "obstacles_seed002.csv"
    champion.write_bytes(champion.read_bytes()[:100])
    history.write_text(history.read_text().replace("0.", "1."))
    assert call("all", *SMALL).exit_code == 0
    assert contents(copy) == before
