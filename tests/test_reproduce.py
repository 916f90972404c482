"""`epuckhebb reproduce`, small: whole, resumable, repeatable, and every number of its report in a CSV."""

import json
import re
import shutil

import numpy as np
import pandas as pd
import pytest
from cases import call, done, refused

from epuckhebb.analysis import findings, rescue
from epuckhebb.runtime.progress import TaskProgress
from epuckhebb.store.run import Run
from epuckhebb.studies import reproduce

TINY = ["ga.population=4", "ga.generations=2", "ga.elites=1", "ga.loops=1"]
ALL = ["reproduce", "all", "champions=2", "repeats=1", "rates=[0.001]", *TINY]
SHOWN = []  # on the bar, by `made`


@pytest.fixture
def _no_figures(monkeypatch):
    """Leave out what takes longest, where only the numbers matter."""
    monkeypatch.setattr(reproduce, "_figures", lambda *_: {})


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("reproduce"))
        patch.setattr(TaskProgress, "put", lambda _, done, text: SHOWN.append((done, text)))
        result = done(*ALL)
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
    shares, told = zip(*SHOWN, strict=True)
    assert list(shares) == sorted(shares)
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


@pytest.fixture
def copy(made, tmp_path, monkeypatch):
    """A copy of the finished folder, in which the same command works."""
    monkeypatch.chdir(tmp_path)
    return shutil.copytree(made[0], tmp_path / "runs" / "reproduce" / made[0].name)


def stopping(monkeypatch, error, after):
    """Make the evaluation that follows so many others in this process end with an error."""
    evaluate, seen = reproduce.evaluate, []

    def stop(*arguments, **named):
        seen.append(1)
        if len(seen) > after:
            raise error
        return evaluate(*arguments, **named)

    monkeypatch.setattr(reproduce, "evaluate", stop)


@pytest.mark.thorough
@pytest.mark.usefixtures("_no_figures")
def test_interrupted_anywhere_it_goes_on_to_the_same_bytes(made, here, monkeypatch):
    with monkeypatch.context() as patch:
        stopping(patch, KeyboardInterrupt, after=3)  # in the second champion's second world
        result = call(*ALL)
    assert result.exit_code == 130
    assert "interrupted: 5 of 8 jobs are done; the same command does the rest" in result.stderr
    folder = here / "runs" / "reproduce" / made[0].name
    assert Run(folder).status["state"] == "interrupted"
    shown = done("show", folder)
    assert "5 of 8 jobs" in " ".join(shown.stdout.split())
    assert not (folder / "claims.csv").exists()
    (folder / "lifetimes" / ".light_seed002.csv.1.tmp").write_text("half a f")
    result = done(*ALL)
    assert result.stderr.startswith("6/9  evaluate light_seed002")
    assert tables(folder) == tables(made[0])
    assert list(folder.rglob("*.tmp")) == []
    told = json.loads((folder / "provenance.json").read_text())
    assert len(told["resumed"]) == 1
    assert Run(folder).status["state"] == "finished"
    assert Run(folder).status["started"] < told["resumed"][0]["started"]


def test_a_failure_is_told_of_and_written_down(copy, monkeypatch):
    (copy / "lifetimes" / "light_seed002.csv").unlink()
    stopping(monkeypatch, ArithmeticError("the robot is lost"), after=0)
    result = call(*ALL)
    assert result.exit_code == 1
    assert "the robot is lost" in result.stderr
    told = Run(copy).status
    assert told["state"] == "failed"
    assert "ArithmeticError" in told["traceback"]


def tables(folder):
    return {file.name: file.read_bytes() for file in folder.rglob("*.csv")}


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
        assert harmed == rescue.count(row, "harmed", "intact")
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
def test_one_given_genome_stands_beside_the_paper(here, genomes):
    np.save("mine.npy", genomes[0])
    done("reproduce", "obstacles", "genome=mine.npy", "rates=[]", "repeats=1", "signal=as_coded")
    (folder,) = (here / "runs" / "reproduce").iterdir()
    comparison = pd.read_csv(folder / "comparison.csv")
    assert comparison.relative_deviation.notna().sum() > 30
    assert "Relative deviation" in (folder / "report.md").read_text()


def test_a_champion_without_a_checksum_is_named_if_it_cannot_be_read(copy):
    """As in a run that was killed when all was written."""
    (copy / "status.json").write_text('{"schema": 1, "state": "finished"}')
    champion = copy / "champions" / "light_seed001.npz"
    cut = champion.read_bytes()[:100]
    champion.write_bytes(cut)
    assert "light_seed001.npz" in refused(*ALL)
    assert champion.read_bytes() == cut


@pytest.mark.thorough
@pytest.mark.usefixtures("_no_figures")
def test_what_is_missing_or_damaged_is_made_again_to_the_same_bytes_and_the_rest_is_kept(copy):
    before, kept = tables(copy), copy / "champions" / "obstacles_seed001.npz"
    stamp = kept.stat().st_mtime_ns
    for lost in ("champions/obstacles_seed002.npz", "lifetimes/light_seed001.csv", "claims.csv"):
        (copy / lost).unlink()
    for cut in ("champions/light_seed001.npz", "lifetimes/light_seed002.csv"):
        (copy / cut).write_bytes((copy / cut).read_bytes()[:-20])
    history = copy / "history" / "obstacles_seed002.csv"
    history.write_text(history.read_text().replace("0.", "1."))
    done(*ALL, "threads=1")
    assert tables(copy) == before
    assert kept.stat().st_mtime_ns == stamp
