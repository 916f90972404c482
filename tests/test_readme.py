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
from epuckhebb.analysis import findings, reproduction, rescue
from epuckhebb.tmaze.individual import GA, HEBBIAN
from epuckhebb.tmaze.scenario import TRAINED

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


def of_paper(experiment, scenario, controller=HEBBIAN):
    """The row of a controller at the paper's rate, among champions 1 to 20 of an experiment."""
    return {"experiment": experiment, "scenario": scenario, "controller": controller, "N": findings.PAPER_N[experiment]}


USUAL_FLOCK = {"loudness": 2.5, "knowers": 2, "range_m": 2.0}


def broken(*which):
    """Trials that a change breaks, of those that are solved in training."""
    return "rescue_and_harm", "broken", "solved", of_paper(*which)


def rescued(*which):
    """Trials that plasticity rescues, of those that the change broke."""
    return "rescue_and_harm", "rescued", "broken", of_paper(*which)


def harmed(*which):
    """Trials in which plasticity fails, of those that are intact without it."""
    return "rescue_and_harm", "harmed", "intact", of_paper(*which)


def in_unseen_kinds(controller, experiment="light"):
    """Trials that a controller rescues in the third set of changes."""
    which = {"experiment": experiment, "controller": controller}
    return "unseen_kinds/rescue_over_all", "rescued", "broken", which


def in_flocks(coupling):
    """Flocks on course long after one of the two robots that know the way broke."""
    return "flock/flock", "good", "runs", {**USUAL_FLOCK, "breaks": "knower", "coupling": coupling}


def in_reversal(method):
    """Champions that solve the reversal task."""
    return "reversal/leaderboard", "solved", "champions", {"method": method}


SHUFFLED, LEARN = "shuffled signs", "find_and_learn_to_stay"
FINDINGS = [  # a sentence, and the counts that stand in it, each with the method that it is compared with
    (
        "Dimmed light breaks {} solved trials (the paper's claim is *mixed*). The paper's rule rescues **{}** of "
        "these; the same rule with shuffled signs rescues {}.",
        (broken("light", "lowlight"), rescued("light", "lowlight"), rescued("light", "lowlight", SHUFFLED)),
    ),
    (
        "In the bright light of training, where nothing has changed, the same rule makes **{}** solved trials "
        "fail; with shuffled signs {}.",
        (harmed("light", "highlight"), harmed("light", "highlight", SHUFFLED)),
    ),
    (
        "Four obstacles do not defeat the evolved controller: they break **{}** solved trials. Too few are broken "
        "to judge a rescue: the paper's rule rescues {}, shuffled signs {}.",
        (
            broken("obstacles", "4obstacles"),
            rescued("obstacles", "4obstacles"),
            rescued("obstacles", "4obstacles", SHUFFLED),
        ),
    ),
    (
        "Twenty other changes: a robot that is *given a signal at the goal* can follow walls, and then [learn to "
        "stay there](docs/unseen_kinds.md) by an anti-Hebbian rule: it rescues **{}** broken trials in light, {} "
        "with obstacles. A halt written by hand rescues {} and {}, a robot without any network {} and {}: the "
        "signal does the work.",
        tuple(
            in_unseen_kinds(method, experiment)
            for method in (f"{LEARN} (anti)", "find_and_stay", "hand_written")
            for experiment in TRAINED
        ),
    ),
    (
        "[When the reward changes sides](docs/reversal.md) within a lifetime, **{}** feed-forward champions learn "
        "it with a rule that one neuron modulates; without plasticity {}. Recurrent networks have not run.",
        (in_reversal("modulated"), in_reversal("ga")),
    ),
    (
        "Ten robots [learn whom to listen to](docs/flock.md), and one that knows the way breaks. If they follow "
        "those who gain fitness, **{}** flocks stay on course (fitness is also what scores them); with fixed "
        "couplings {}; if they follow by transfer entropy {}, but of those only 8 of 20 were on course before.",
        (in_flocks("live_fitness"), in_flocks("frozen"), in_flocks("transfer_entropy")),
    ),
]


def share(table, part, whole, which):
    """How many a row of a table of runs/reference/ counts, of how many, with the share's interval."""
    rows = pd.read_csv(REFERENCE / f"{table}.csv")
    (row,) = rows[(rows[list(which)] == pd.Series(which)).all(axis=1)].to_dict("records")
    count, of = round(row[part] * row[whole]) if part == "good" else row[part], row[whole]
    if part == "broken":  # its interval is in the table of claims
        claims = pd.read_csv(REFERENCE / "claims.csv")
        (claim,) = claims[(claims.true == count) & (claims.n == of) & claims.claim.str.contains("GA")].to_dict(
            "records"
        )
        return f"{count} of {of} ({rescue.share(claim['share'], claim['low'], claim['high'])})"
    if of < 6:  # no interval
        return f"{count} of {of}"
    return f"{count} of {of} ({rescue.share(count / of, row[f'{part}_low'], row[f'{part}_high'])})"


def sentence(text, counts):
    """A finding with its counts."""
    return f"- {text.format(*(share(*count) for count in counts))}\n"


def test_the_findings_are_those_of_the_reference_results(generated):
    generated(README, "findings", "".join(sentence(*finding) for finding in FINDINGS))


def test_results_are_those_of_the_reference_run(generated):
    claims, success, harm = (
        pd.read_csv(REFERENCE / f"{name}.csv") for name in ("claims", "success", "rescue_and_harm")
    )
    provenance, _, trial = (REFERENCE / "report.md").read_text().splitlines()[2:5]
    parts = [
        f"{provenance} {trial}\n",
        reproduction.CLAIMS,
        reproduction.claims_table(claims).only(0, 1, 2, 3, 4).markdown(),
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
