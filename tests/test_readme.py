"""The README's results are those of runs/reference/, and its commands exist."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from epuckhebb.app.data import groups
from epuckhebb.study import findings, report, rescue

ROOT = Path(__file__).parents[1]
REFERENCE = ROOT / "runs" / "reference"
README = ROOT / "README.md"


def check_block(name, expected, regenerate):
    """The generated part of the README of this name is what it should be, or becomes it."""
    begin, end = re.compile(rf"<!-- {name}: .* -->\n"), f"<!-- end of {name} -->"
    text = README.read_text()
    start, stop = begin.search(text).end(), text.index(end)
    if regenerate:
        text = text[:start] + expected + text[stop:]
        README.write_text(text)
        stop = text.index(end)
    assert text[start:stop] == expected, "run pytest tests/test_readme.py --regenerate"


def test_results_are_those_of_the_reference_run(request):
    claims, success, harm = (
        pd.read_csv(REFERENCE / f"{name}.csv") for name in ("claims", "success", "rescue_and_harm")
    )
    provenance = (REFERENCE / "report.md").read_text().splitlines()[2]
    expected = report.summary(claims, success, harm, provenance)
    check_block("results", expected, request.config.getoption("--regenerate"))


def test_the_verdicts_of_the_reference_run_follow_the_printed_rule():
    claims = pd.read_csv(REFERENCE / "claims.csv")
    assert list(claims.verdict) == [findings.verdict(row.low, row.high) for row in claims.itertuples()]


def test_the_account_of_adaptive_plasticity_is_that_of_its_study(request):
    over_all = pd.read_csv(REFERENCE / "adaptive" / "rescue_over_all.csv")
    check_block("adaptive", rescue.summary(over_all), request.config.getoption("--regenerate"))


@pytest.mark.parametrize("experiment", ["light", "obstacles"])
def test_the_bundled_champion_is_the_showcase_of_the_reference_run(experiment):
    report_text = (REFERENCE / "report.md").read_text()
    name = re.search(rf"Showcase: `({experiment}_seed\d+)`", report_text)[1]
    with (
        np.load(REFERENCE / f"champion_{experiment}.npz") as bundled,
        np.load(REFERENCE / "champions" / f"{name}.npz") as own,
    ):
        assert (bundled["genome"] == own["genome"]).all()


def test_every_scenario_and_group_named_exists():
    text = README.read_text()
    told_elsewhere = re.findall(r"`(\w+)`", (ROOT / "docs" / "changes.md").read_text())
    rules = re.findall(r"`(\w+)`", (ROOT / "docs" / "rules.md").read_text())
    for choice in re.findall(r"scenario=(\w+)", text):
        assert choice in groups("evaluate")["scenario"] or choice == "base"
    for verb, group in (("evaluate", "hebbian"), ("evolve", "ga"), ("evaluate", "scenario")):
        for choice in groups(verb)[group]:
            assert f"`{choice}`" in text or choice in rules or choice.partition("_")[2] in told_elsewhere
