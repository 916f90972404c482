"""`epuckhebb reproduce`, small: whole, resumable, repeatable, and every number of its report in a CSV."""

import json
import re
import shutil

import numpy as np
import pandas as pd
import pytest
from cases import call, done

from epuckhebb.analysis import reproduction
from epuckhebb.store.run import Run
from epuckhebb.studies import champions

TINY = ["ga.population=4", "ga.generations=2", "ga.elites=1", "ga.loops=1"]
ALL = ["reproduce", "obstacles", "champions=2", "repeats=1", "rates=[0.001]", "hydra/launcher=basic", *TINY]


@pytest.fixture
def _no_figures(monkeypatch):
    """Leave out what takes longest, where only the numbers matter."""
    monkeypatch.setattr(reproduction, "make_figures", lambda *_: {})


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """The folder of a small study without figures, which take longest, and what the command printed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("reproduce"))
        patch.setattr(reproduction, "make_figures", lambda *_: {})
        result = done(*ALL)
    (folder,) = (tmp_path_factory.getbasetemp() / "reproduce0" / "runs" / "reproduce").iterdir()
    return folder, result


def test_it_leaves_a_report_and_its_tables(made):
    folder, result = made
    assert "The paper's claims" in result.stdout
    assert {"report.md", "report.html", "provenance.json", "status.json"} <= {file.name for file in folder.iterdir()}
    tables = {
        "metrics",
        "trials",
        "claims",
        "success",
        "rescue_and_harm",
        "doses",
        "rescue_over_all",
        "ends",
        "ends_by_champion",
        "discrimination",
        "comparison",
    }
    assert tables <= {file.stem for file in folder.glob("*.csv")}


@pytest.fixture
def copy(made, tmp_path, monkeypatch):
    """A copy of the finished folder, in which the same command works."""
    monkeypatch.chdir(tmp_path)
    return shutil.copytree(made[0], tmp_path / "runs" / "reproduce" / made[0].name)


@pytest.mark.thorough
def test_its_figures_are_on_its_page_and_can_be_drawn_again(copy):
    done(*ALL)
    named = set(re.findall(r"\(figures/([\w.]+)\)", (copy / "report.md").read_text()))
    assert named == {file.name for file in (copy / "figures").iterdir()}
    assert len(named) == 10
    page = (copy / "report.html").read_text()
    assert "://" not in re.sub(r'src="data:[^"]+"', "", page)
    assert page.count('src="data:image/png;base64,') == 10
    done("figure", copy, "dose_response_obstacles", "-f", "svg", "-o", "again.svg")
    assert b"<svg" in (copy.parents[2] / "again.svg").read_bytes()


def stopping(monkeypatch, error, after):
    """Make the evaluation that follows so many others in this process end with an error."""
    test, seen = champions._test, []

    def stop(*arguments):
        seen.append(1)
        if len(seen) > after:
            raise error
        test(*arguments)

    monkeypatch.setattr(champions, "_test", stop)


@pytest.mark.usefixtures("_no_figures")
def test_interrupted_it_goes_on_to_the_same_bytes(copy, monkeypatch):
    before = tables(copy)
    for run in copy.glob("test_*"):
        shutil.rmtree(run)
    with monkeypatch.context() as patch:
        stopping(patch, KeyboardInterrupt, after=1)
        result = call(*ALL)
    assert result.exit_code == 130
    assert "interrupted: 3 of 4 jobs are done; the same command does the rest" in result.stderr
    assert Run(copy).status["state"] == "interrupted"
    assert "3 of 4 jobs" in " ".join(done("show", copy).stdout.split())
    assert "evaluate champions: 2 jobs, 1 done before, 1 to do." in done(*ALL).stderr
    assert tables(copy) == before
    assert list(copy.rglob("*.tmp")) == []
    told = json.loads((copy / "provenance.json").read_text())
    assert len(told["resumed"]) == 2
    assert Run(copy).status["state"] == "finished"
    assert Run(copy).status["started"] < told["resumed"][0]["started"]


def tables(folder):
    return {str(file.relative_to(folder)): file.read_bytes() for file in folder.rglob("*.csv")}


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
    assert "Table 3" in done("show", folder).stdout
    comparison = pd.read_csv(folder / "comparison.csv")
    assert comparison.relative_deviation.notna().sum() > 30
    assert "Relative deviation" in (folder / "report.md").read_text()


@pytest.mark.thorough
@pytest.mark.usefixtures("_no_figures")
def test_what_is_missing_or_damaged_is_made_again_to_the_same_bytes_and_the_rest_is_kept(copy):
    before, (kept, cut, *_), (lost, *_) = tables(copy), sorted(copy.glob("champion_*")), copy.glob("test_*")
    stamp = (kept / "champion.npz").stat().st_mtime_ns
    shutil.rmtree(lost)
    (copy / "claims.csv").unlink()
    (cut / "champion.npz").write_bytes((cut / "champion.npz").read_bytes()[:-20])
    done(*ALL, "threads=1")
    after = {name: content for name, content in tables(copy).items() if "set_aside" not in name}
    assert after == before
    assert (kept / "champion.npz").stat().st_mtime_ns == stamp
