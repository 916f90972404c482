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
from epuckhebb.analysis import reproduction, rescue
from epuckhebb.analysis.claims import claim
from epuckhebb.tmaze.individual import GA, HEBBIAN
from epuckhebb.tmaze.scenario import TRAINED

ROOT = Path(__file__).parents[1]
REFERENCE = ROOT / "runs" / "reference"
README = ROOT / "README.md"
USUAL_FLOCK = {"loudness": 2.5, "knowers": 2, "range_m": 2.0}
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


LIGHT, OBSTACLES = TRAINED
VERDICTS = [  # of the paper's claims; those on rescue with obstacles are of 110 champions, as 20 have too few trials
    (LIGHT, "The GA fails in low light"),
    (LIGHT, "N = 0.002 rescues it"),
    (LIGHT, "The same N harms in high light"),
    (OBSTACLES, "4 obstacles defeat the GA"),
    (OBSTACLES, "N = 1.5e-05 rescues it at 4"),
    (OBSTACLES, "Weight change grows with obstacles"),
    (OBSTACLES, "Plasticity reaches the goal sooner"),
]
FINDINGS = [  # a sentence, and the counts that stand in it, each with the method that it is compared with
    (
        "[When the reward changes sides](docs/reversal.md) within a lifetime, a controller needs memory, of "
        "plasticity or of recurrence: **{}** feed-forward champions learn it with a rule that one neuron modulates, "
        "and {} without; {} recurrent ones learn it without plasticity.",
        [("reversal/leaderboard", "solved", "champions", {"method": name}) for name in ("modulated", "ga", "ctrnn")],
    ),
    (
        "A robot that is *given a signal at the goal* can follow walls and [learn to stay "
        "there](docs/unseen_kinds.md): it rescues **{}** broken trials in twenty kinds of change of the light "
        "experiment. A halt written by hand rescues {}, a robot without any network {}: the signal does the work.",
        [
            ("unseen_kinds/rescue_over_all", "rescued", "broken", {"experiment": LIGHT, "controller": name})
            for name in ("find_and_learn_to_stay (anti)", "find_and_stay", "hand_written")
        ],
    ),
    (
        "Ten robots [learn whom to listen to](docs/flock.md), and one that knows the way breaks. If they follow those "
        "who gain fitness, **{}** flocks stay on course (fitness is also what scores them); with fixed couplings {}.",
        [
            ("flock/flock", "good", "runs", {**USUAL_FLOCK, "breaks": "knower", "coupling": name})
            for name in ("live_fitness", "frozen")
        ],
    ),
]


def of_many_champions():
    """The claims on four obstacles, of 110 champions: from how many of ten repeats succeed on each side."""
    trials = pd.read_csv(REFERENCE / "many_obstacles" / "successes.csv").set_index(["genome", "side"])
    solves, here = (trials[trials.scenario == name].iloc[:, 1:] > 5 for name in ("base", "4obstacles"))
    solved = solves.GA
    broken = solved & ~here.GA

    def by_champion(*outcomes):
        return [outcome.groupby("genome", sort=False).sum().to_numpy() for outcome in outcomes]

    rescued = by_champion(broken & here.Hebbian, broken, broken & here.shuffled)
    yield {"experiment": OBSTACLES} | claim("4 obstacles defeat the GA", "", *by_champion(broken, solved))
    yield {"experiment": OBSTACLES} | claim("N = 1.5e-05 rescues it at 4", "", *rescued)


def share(table, part, whole, which):
    """How many a row of a table of runs/reference/ counts, of how many, with the share's interval."""
    rows = pd.read_csv(REFERENCE / f"{table}.csv")
    (row,) = rows[(rows[list(which)] == pd.Series(which)).all(axis=1)].to_dict("records")
    count, of = round(row[part] * row[whole]) if part == "good" else row[part], row[whole]
    return f"{count} of {of} ({rescue.share(count / of, row[f'{part}_low'], row[f'{part}_high'])})"


def test_the_findings_are_those_of_the_reference_results(generated):
    claims = pd.concat([pd.read_csv(REFERENCE / "claims.csv"), pd.DataFrame(of_many_champions())])
    claims = claims.drop_duplicates(["experiment", "claim"], keep="last").set_index(["experiment", "claim"])
    table = reproduction.claims_table(claims.loc[VERDICTS].reset_index()).only(0, 1, 2, 3, 4, 5).markdown()
    sentences = [f"- {text.format(*(share(*count) for count in counts))}\n" for text, counts in FINDINGS]
    generated(README, "findings", "".join([table, "\n", *sentences]))


def test_results_are_those_of_the_reference_run(generated):
    claims, success, harm = (
        pd.read_csv(REFERENCE / f"{name}.csv") for name in ("claims", "success", "rescue_and_harm")
    )
    provenance, _, trial = (REFERENCE / "report.md").read_text().splitlines()[2:5]
    parts = [
        f"{provenance} {trial}\n",
        reproduction.CLAIMS,
        reproduction.claims_table(claims).only(0, 1, 2, 3, 4, 5).markdown(),
        "Success:\n",
        reproduction.success_table(success, (GA, HEBBIAN)).markdown(),
        f"Rescue and harm. {reproduction.RESCUE_TEXT}\n",
        reproduction.rescue_table(harm).markdown(),
    ]
    generated(RESULTS, "results", "\n".join(parts))


@pytest.mark.parametrize("experiment", ["light", "obstacles"])
def test_the_bundled_champion_is_the_showcase_of_the_reference_run(experiment):
    report_text = (REFERENCE / "report.md").read_text()
    name = re.search(rf"Showcase: `({experiment}_seed\d+)`", report_text)[1]
    with (
        np.load(REFERENCE / f"champion_{experiment}.npz") as bundled,
        np.load(REFERENCE / "champions" / f"{name}.npz") as own,
    ):
        assert (bundled["genome"] == own["genome"]).all()
