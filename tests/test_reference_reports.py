"""The committed reports of runs/reference/ are what the program writes of the tables beside them."""

import io
import re
import runpy
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from PIL import Image

from epuckhebb.analysis import charts, ends, leaderboard, leaderboard_charts, reproduction, rescue
from epuckhebb.analysis.findings import PAPER_N
from epuckhebb.analysis.image import image
from epuckhebb.flock import tables as flock
from epuckhebb.runtime.resources import data_folder
from epuckhebb.store import Run
from epuckhebb.studies import sweep
from epuckhebb.tmaze.scenario import EXPERIMENTS
from epuckhebb.tmaze.tasks.reversal import Reversal

REFERENCE = Path(__file__).parents[1] / "runs" / "reference"
STUDIES = sorted(  # those that ran since the program says where robots end; the others are to be run again
    path
    for path in REFERENCE.rglob("report.md")
    if {"ends.csv", "rescue_by_champion.csv"} <= {file.name for file in path.parent.iterdir()}
)
BOARDS = sorted(REFERENCE.rglob("leaderboard.csv"))


def tables(folder, *names):
    return [pd.read_csv(folder / f"{name}.csv") for name in names]


@pytest.fixture
def committed(request):
    """Compare a report with the committed one, or write it with --regenerate."""

    def compare(path, text):
        if request.config.getoption("--regenerate"):
            path.write_text(text)
        assert path.read_text() == text, f"stale; run: pytest tests/{request.path.name} --regenerate"

    return compare


@pytest.mark.parametrize("folder", [path.parent for path in STUDIES], ids=lambda folder: folder.name)
def test_the_report_of_a_study_is_that_of_its_tables(folder, committed):
    path = folder / "report.md"
    champions, names, repeats = re.search(
        r"(\d+) champions of each experiment, (`.*?` to `.*?`)\..*half of its (\d+) ", path.read_text()
    ).groups()
    *own, at_end = tables(folder, "rescue_over_all", "rescue_and_harm", "ends")
    page = rescue.markdown(*own, int(champions), int(repeats), names)
    committed(path, "\n".join([page, *rescue.picture("png"), ends.markdown(at_end)]))


@pytest.mark.parametrize("folder", [path.parent for path in BOARDS], ids=lambda folder: folder.name)
def test_the_report_of_a_leaderboard_is_that_of_its_tables(folder, committed):
    path = folder / "report.md"
    text = path.read_text()
    board, worlds = tables(folder, "leaderboard", "worlds")
    board = board.fillna({"matched_control": "", "best_plain": ""})
    described = dict(re.findall(r"^\| `(\w+)` \| ([^|]*) \|$", text, re.MULTILINE))
    described = {name: meaning for name, meaning in described.items() if name in set(board.method)}
    named = [re.findall(r"`([\w+]+)`", line) for line in re.findall(r"test worlds: (.*)\.", text)]
    tests = dict(zip(board.experiment.unique(), named or [[]], strict=True))
    captions = {name: caption for caption, name in re.findall(r"!\[(.*)\]\(figures/(.*)\)", text)}
    committed(path, leaderboard.markdown(board, worlds, described, tests, text.splitlines()[2], captions))


def test_the_report_of_the_reproduction_is_that_of_its_tables(committed):
    path = REFERENCE / "report.md"
    text = path.read_text()
    names = ("claims", "success", "rescue_and_harm", "ends", "comparison")
    own = dict(zip(names, tables(REFERENCE, *names), strict=True))
    titles = yaml.safe_load((data_folder("conf") / "paper" / "tables.yaml").read_text())
    shown = {}
    for name, agreeing, cells in re.findall(r"Showcase: `(\w+)`.* agrees in (\d+) of the (\d+) cells", text):
        (experiment,) = (one for one in EXPERIMENTS if name.startswith(one))
        shown[experiment] = (name, int(agreeing), int(cells))
    champions, repeats = map(int, re.search(r"(\d+) champions of each .*; (\d+) ", text).groups())
    captions = {name: caption for caption, name in re.findall(r"!\[(.*)\]\(figures/(.*)\)", text)}
    facts = {"champions": champions, "repeats": repeats, "is_fixed": False, "provenance": text.splitlines()[2]}
    committed(path, reproduction.markdown(own, titles, shown, captions, **facts))


def test_the_report_of_the_flocks_is_that_of_their_table(committed):
    path = REFERENCE / "flock" / "report.md"
    text = path.read_text()
    made, figures = text.splitlines()[2].partition(" Mean cosine")[0], re.findall(r"\(figures/(.*)\)", text)
    committed(path, flock.page(*tables(path.parent, "flock"), made, figures))


EXAMPLES = {
    "evolve_or_adapt": ("evolve_or_adapt", "EvolveOrAdapt"),
    "foraging": ("foraging", "Methods"),
    "foraging_lifespans": ("foraging", "Lifespans"),
}


def example(name):
    """A study of an example, and its folder."""
    file, kind = EXAMPLES[name]
    study = runpy.run_path(str(REFERENCE.parents[1] / "examples" / f"{file}.py"))[kind]()
    return study, Run(REFERENCE / name)


@pytest.mark.parametrize("name", EXAMPLES)
def test_the_report_of_an_example_is_that_of_its_tables(name, committed):
    study, run = example(name)
    captions = {f"{name}.png": drawn.get_label() for name, drawn in study.figures(run).items()}
    committed(run.path / "report.md", study.page(run, captions))


def of_board(folder):
    board, champions = tables(folder, "leaderboard", "champions")
    for experiment, own in board.groupby("experiment"):
        limits = Reversal().limits() if experiment == "reversal" else {}
        mine = champions[champions.experiment == experiment]
        yield f"leaderboard_{experiment}", leaderboard_charts.success(own, mine, limits)
    yield "profiles", leaderboard_charts.profiles(board, champions)
    if (folder / "anytime.csv").is_file():
        yield "anytime", leaderboard_charts.anytime(board, *tables(folder, "anytime"))


def of_tables(folder):
    """The figures that the tables of a folder are enough for."""
    if folder == REFERENCE:
        over_all, by_world = tables(folder, "rescue_over_all", "rescue_and_harm")
        rates = over_all.experiment.map(PAPER_N), by_world.experiment.map(PAPER_N)
        own = over_all[rates[0] == over_all.N], by_world[rates[1] == by_world.N]
        return {"rescue_and_harm": charts.rescue_and_harm(*own)}
    if (folder / "leaderboard.csv").is_file():
        return dict(of_board(folder))
    return example(folder.name)[0].figures(Run(folder)) if folder.name in EXAMPLES else sweep.figures(Run(folder))


DRAWN = {path.parent.parent: None for path in sorted(REFERENCE.rglob("figures/*.png"))} | {REFERENCE: None}


@pytest.mark.parametrize("folder", [path for path in DRAWN if path.name != "flock"], ids=lambda folder: folder.name)
def test_the_figures_are_those_of_the_tables(folder, request):
    """The same pixels, but for the edges of letters of another version of matplotlib."""
    drawn = of_tables(folder)
    assert drawn
    for name, figure in drawn.items():
        path, png = folder / "figures" / f"{name}.png", image(figure)
        ours, theirs = (np.asarray(Image.open(one).convert("L"), float) for one in (io.BytesIO(png), path))
        apart = np.abs(ours - theirs).mean() if ours.shape == theirs.shape else np.inf
        if apart >= 0.1 and request.config.getoption("--regenerate"):
            path.write_bytes(png)
        else:
            assert apart < 0.1, f"{name} is stale; run: pytest tests/{request.path.name} --regenerate"
