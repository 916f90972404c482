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
from epuckhebb.analysis import claims, reproduction
from epuckhebb.tmaze.scenario import TRAINED

ROOT = Path(__file__).parents[1]
REFERENCE = ROOT / "runs" / "reference"
README = ROOT / "README.md"
RESULTS, TUTORIAL, ADAPTATIONS = (ROOT / "docs" / f"{name}.md" for name in ("results", "tutorial", "adaptations"))


def test_the_image_runs_the_line_of_the_readme():
    (line,) = re.findall(r"^```sh\n(python.*)\n```$", README.read_text(), re.MULTILINE)
    image = re.findall(r"^RUN (.*)$", (ROOT / "Dockerfile").read_text(), re.MULTILINE)
    assert image[-2:] == line.split(" && ")


def test_ci_runs_the_line_with_which_the_readme_runs_all_checks():
    *_, line = (ROOT / ".ci" / "run").read_text().splitlines()
    assert line == "python -m pip install nox uv && nox -j 2"
    assert f"`{line}`" in README.read_text()


def test_the_citation_names_this_version():
    cited = yaml.safe_load((ROOT / "CITATION.cff").read_text())
    assert cited["version"] == epuckhebb.__version__
    assert isinstance(cited["date-released"], datetime.date)


@pytest.mark.parametrize(
    ("page", "name"),
    first_of([(README, "output"), (TUTORIAL, "reached"), (TUTORIAL, "other"), (ADAPTATIONS, "compared")]),
)
def test_a_page_shows_what_its_command_prints(page, name, generated, here, monkeypatch):
    """All that the command above the mark prints but its run folder; of the front page, the table."""
    monkeypatch.setenv("COLUMNS", "80")
    (here / "runs").mkdir()
    (here / "runs" / "reference").symlink_to(REFERENCE)
    above = re.findall(
        r"^(?:python.* && )?epuckhebb (.*)$", page.read_text().partition(f"<!-- {name}: ")[0], re.MULTILINE
    )
    printed = [line.rstrip() for line in done(*shlex.split(above[-1])).stdout.splitlines()]
    end = max(n for n, line in enumerate(printed) if " right " in line) + 1 if page == README else -1
    assert "\n".join(printed[end:]).count("Run folder: ") == 1
    if page == README:
        (count,) = re.findall(r"A showcase: (\d+ of \d+) champions", " ".join(printed[end:]))
        assert f"A showcase: {count} evolved controllers do this." in README.read_text()
    generated(page, name, "\n".join(["```", *printed[:end], "```", ""]))


LIGHT, OBSTACLES = TRAINED
VERDICTS = {  # the paper's claims in plain words; those on rescue with obstacles are of 110 champions: 20 are too few
    (LIGHT, "The GA fails in low light"): "Low light breaks most trials",
    (LIGHT, "N = 0.002 rescues it"): "Plasticity (N = 0.002) rescues most",
    (LIGHT, "The same N harms in high light"): "In unchanged light it harms most trials",
    (OBSTACLES, "4 obstacles defeat the GA"): "Four obstacles break most trials",
    (OBSTACLES, "N = 1.5e-05 rescues it at 4"): "Plasticity (N = 0.000015) rescues most",
    (OBSTACLES, "Plasticity reaches the goal sooner"): "It shortens the time to the goal",
}
FINDINGS = [  # a sentence, and the counts that stand in it, each with the method that it is compared with
    (
        "In a [changed world](docs/evolve_or_adapt.md), evolution that goes on from the champion recovers **{}** cases "
        "in 80 simulated hours; plasticity, in a lifetime, {}, shuffled signs {}.",
        [
            ("evolve_or_adapt/ways", "recovered", "cases", {"world": "all", "way": way, "controller": name} | at)
            for way, name, at in (
                ("from the champion", "GA", {"generation": 16}),
                ("champion", "Hebbian", {}),
                ("champion", "shuffled", {}),
            )
        ],
    ),
    (
        "When the reward [changes sides](docs/reversal.md) within a lifetime, **{}** champions learn with a rule that "
        "a neuron modulates, {} without it, and **{}** recurrent networks learn without plasticity.",
        [("reversal/leaderboard", "solved", "champions", {"method": name}) for name in ("modulated", "ga", "ctrnn")],
    ),
    (
        "With [a signal at the goal](docs/adaptations.md), robots that learn to stay rescue **{}** broken trials, "
        "robots that simply stop {}, hand-written robots without a network {}: here learning adds nothing.",
        [
            ("unseen_kinds/rescue_over_all", "rescued", "broken", {"experiment": LIGHT, "controller": name})
            for name in ("find_and_learn_to_stay (anti)", "find_and_stay", "hand_written")
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
    yield {"experiment": OBSTACLES} | claims.claim("4 obstacles defeat the GA", "", *by_champion(broken, solved))
    yield {"experiment": OBSTACLES} | claims.claim("N = 1.5e-05 rescues it at 4", "", *rescued)


def share(table, part, whole, which):
    """How many a row of a table of runs/reference/ counts, of how many, with the share's interval."""
    rows = pd.read_csv(REFERENCE / f"{table}.csv")
    (row,) = rows[(rows[list(which)] == pd.Series(which)).all(axis=1)].to_dict("records")
    count, of = round(row[part] * row[whole]) if part == "recovered" else row[part], row[whole]
    return f"{count} of {of} [{row[f'{part}_low']:.2f}, {row[f'{part}_high']:.2f}]"


def test_the_findings_are_those_of_the_reference_results(generated):
    rows = pd.concat([pd.read_csv(REFERENCE / "claims.csv"), pd.DataFrame(of_many_champions())])
    rows = rows.drop_duplicates(["experiment", "claim"], keep="last").set_index(["experiment", "claim"])
    rows = rows.loc[list(VERDICTS)].reset_index().assign(claim=list(VERDICTS.values()))
    table = reproduction.claims_table(rows).only(1, 2, 4, 5, 3).markdown()
    sentences = [f"- {text.format(*(share(*count) for count in counts))}\n" for text, counts in FINDINGS]
    generated(README, "findings", "".join([table, "\n", *sentences]))


def test_the_page_of_methods_has_the_rule_of_verdicts(generated):
    generated(ROOT / "docs" / "methods.md", "verdicts", f"{claims.RULE}\n")


def test_results_are_those_of_the_reference_run(generated):
    table = reproduction.claims_table(pd.read_csv(REFERENCE / "claims.csv")).only(0, 1, 2, 3, 4, 5)
    generated(RESULTS, "results", table.markdown())


@pytest.mark.parametrize("experiment", ["light", "obstacles"])
def test_the_bundled_champion_is_the_showcase_of_the_reference_run(experiment):
    report_text = (REFERENCE / "report.md").read_text()
    name = re.search(rf"Showcase: `({experiment}_seed\d+)`", report_text)[1]
    with (
        np.load(REFERENCE / f"champion_{experiment}.npz") as bundled,
        np.load(REFERENCE / "champions" / f"{name}.npz") as own,
    ):
        assert (bundled["genome"] == own["genome"]).all()
