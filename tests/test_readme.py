"""The findings of the README and the results of docs/results.md are those of runs/reference/."""

import datetime
import re
import shlex
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from cases import done, first_of

import epuckhebb
from epuckhebb.analysis import findings, report, rescue
from epuckhebb.sim.controller import GA, HEBBIAN

ROOT = Path(__file__).parents[1]
REFERENCE = ROOT / "runs" / "reference"
README = ROOT / "README.md"
RESULTS, FAQ, ADAPTATIONS = (ROOT / "docs" / f"{name}.md" for name in ("results", "faq", "adaptations"))


def test_the_image_runs_the_two_commands_of_the_readme():
    (commands,) = re.findall(r"^```sh\n(python.*?)\n```$", README.read_text(), re.MULTILINE | re.DOTALL)
    image = re.findall(r"^RUN (.*)$", (ROOT / "Dockerfile").read_text(), re.MULTILINE)
    assert image[-2:] == commands.splitlines()


def test_ci_runs_the_line_with_which_the_readme_runs_all_checks():
    *_, line = (ROOT / ".ci" / "run").read_text().splitlines()
    assert line == "python -m pip install nox uv && nox -j 2"
    assert f"`{line}`" in README.read_text()


def test_the_citation_and_the_page_of_releases_name_this_version():
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert cited["version"] == epuckhebb.__version__
    assert isinstance(cited["date-released"], datetime.date)
    releases = (ROOT / "docs" / "releases.md").read_text()
    assert f"$ epuckhebb --version\n{done('--version').stdout}```" in releases
    assert f"| {cited['version']} | {cited['date-released']} |" in releases


@pytest.mark.parametrize(
    ("page", "name"),
    first_of([(README, "output"), (FAQ, "reached"), (FAQ, "other"), (ADAPTATIONS, "compared")]),
)
def test_a_page_shows_what_its_command_prints(page, name, generated, here, monkeypatch):
    """All that the command above the mark prints but its run folder; of the front page, the table."""
    monkeypatch.setenv("COLUMNS", "80")
    (here / "runs").mkdir()
    (here / "runs" / "reference").symlink_to(REFERENCE)
    above = re.findall(r"^epuckhebb (.*)$", page.read_text().partition(f"<!-- {name}: ")[0], re.MULTILINE)
    printed = [line.rstrip() for line in done(*shlex.split(above[-1])).stdout.splitlines()]
    end = max(n for n, line in enumerate(printed) if " right " in line) + 1 if page == README else -1
    assert "\n".join(printed[end:]).count("Run folder: ") == 1
    generated(page, name, "\n".join(["```", *printed[:end], "```", ""]))


IN_LIGHT = {"experiment": "light", "controller": HEBBIAN, "N": findings.PAPER_N["light"]}
USUAL_FLOCK = {"loudness": 2.5, "knowers": 2, "range_m": 2.0}
UNSEEN = "unseen_kinds/rescue_over_all", "rescued", "broken"
FLOCKS = "flock/flock", "good", "runs"


def in_unseen_kinds(controller):
    """The row of a controller in the third set of changes of the light experiment."""
    return *UNSEEN, {"experiment": "light", "controller": controller}


def in_flocks(coupling):
    """The row of a coupling in flocks of which one robot that knows the way breaks."""
    return *FLOCKS, {**USUAL_FLOCK, "breaks": "knower", "coupling": coupling}


FINDINGS = [  # sentence, unit, row (table, what is counted, of what, which), and rows whose counts are in the sentence
    (
        "In dimmed light, most solved trials fail without plasticity. The paper's rule rescues few of these",
        "trials",
        ("rescue_and_harm", "rescued", "broken", IN_LIGHT | {"scenario": "lowlight"}),
    ),
    (
        "In the bright light of training, where nothing has changed, the same rule makes most solved trials fail",
        "trials",
        ("rescue_and_harm", "harmed", "intact", IN_LIGHT | {"scenario": "highlight"}),
    ),
    (
        "Twenty other changes of that experiment: a robot that is given a signal at the goal can follow walls until "
        "then ({} trials rescued) and halt there ({}). [It can also learn to stay](docs/unseen_kinds.md), by an "
        "anti-Hebbian rule",
        "trials",
        in_unseen_kinds("find_and_learn_to_stay (anti)"),
        in_unseen_kinds("find"),
        in_unseen_kinds("find_and_stay"),
    ),
    (
        "Ten robots [learn whom to listen to](docs/flock.md), and one that knows the way breaks. If they follow those "
        "who gain fitness, the flock stays on course; if they follow by transfer entropy, {} flocks do",
        "flocks",
        in_flocks("live_fitness"),
        in_flocks("transfer_entropy"),
    ),
    (
        "[When the reward changes sides](docs/reversal.md) within a lifetime, a controller needs plasticity. With a "
        "rule that one neuron modulates, half of the champions learn it; without plasticity none does",
        "champions",
        ("reversal/leaderboard", "solved", "champions", {"method": "modulated"}),
    ),
]


def counted(table, part, whole, which):
    """The one row of a table of runs/reference/, how many it counts and of how many."""
    rows = pd.read_csv(REFERENCE / f"{table}.csv")
    (row,) = rows[(rows[list(which)] == pd.Series(which)).all(axis=1)].to_dict("records")
    count = round(row[part] * row[whole]) if part == "good" else row[part]  # a share, in the table of flocks
    return row, count, row[whole]


def sentence(text, unit, place, *others):
    """A finding with its number, unit and interval."""
    row, count, of = counted(*place)
    part = place[1]
    also = (f"{found} of {all_}" for _, found, all_ in (counted(*other) for other in others))
    share = rescue.share(count / of, row[f"{part}_low"], row[f"{part}_high"])
    return f"- {text.format(*also)}: **{count} of {of} {unit}, {share}**.\n"


def test_the_findings_are_those_of_the_reference_results(generated):
    generated(README, "findings", "".join(sentence(*finding) for finding in FINDINGS))


def test_results_are_those_of_the_reference_run(generated):
    claims, success, harm = (
        pd.read_csv(REFERENCE / f"{name}.csv") for name in ("claims", "success", "rescue_and_harm")
    )
    provenance, _, trial = (REFERENCE / "report.md").read_text().splitlines()[2:5]
    parts = [
        f"{provenance} {trial}\n",
        report.claims_table(claims, counted=False),
        "Success:\n",
        report.success_table(success, (GA, HEBBIAN)),
        f"Rescue and harm. {report.RESCUE_TEXT}\n",
        report.rescue_table(harm),
    ]
    generated(RESULTS, "results", "\n".join(parts))


def test_the_verdicts_of_the_reference_run_follow_the_printed_rule():
    claims = pd.read_csv(REFERENCE / "claims.csv")
    judged = claims[claims.verdict != "check passed"]
    assert list(judged.verdict) == [findings.verdict(row.low, row.high, row.n) for row in judged.itertuples()]


@pytest.mark.parametrize("experiment", ["light", "obstacles"])
def test_the_bundled_champion_is_the_showcase_of_the_reference_run(experiment):
    report_text = (REFERENCE / "report.md").read_text()
    name = re.search(rf"Showcase: `({experiment}_seed\d+)`", report_text)[1]
    with (
        np.load(REFERENCE / f"champion_{experiment}.npz") as bundled,
        np.load(REFERENCE / "champions" / f"{name}.npz") as own,
    ):
        assert (bundled["genome"] == own["genome"]).all()
