"""The committed reports of runs/reference/ are what the program writes of the tables beside them."""

import re
from pathlib import Path

import pandas as pd
import pytest
import yaml

from epuckhebb.analysis import ends, leaderboard, reproduction, rescue
from epuckhebb.flock import tables as flock
from epuckhebb.runtime.resources import data_folder
from epuckhebb.tmaze.scenario import EXPERIMENTS

REFERENCE = Path(__file__).parents[1] / "runs" / "reference"
STUDIES = sorted(path for path in REFERENCE.rglob("report.md") if (path.parent / "rescue_by_champion.csv").is_file())
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
    committed(path, "\n".join([page, ends.markdown(at_end)]))


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
    facts = {"champions": champions, "repeats": repeats, "given": False, "provenance": text.splitlines()[2]}
    committed(path, reproduction.markdown(own, titles, shown, captions, **facts))


def test_the_report_of_the_flocks_is_that_of_their_table(committed):
    path = REFERENCE / "flock" / "report.md"
    text = path.read_text()
    made, figures = text.splitlines()[2].partition(" Mean cosine")[0], re.findall(r"\(figures/(.*)\)", text)
    committed(path, flock.page(*tables(path.parent, "flock"), made, figures))
