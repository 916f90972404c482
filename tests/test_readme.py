"""The findings of the README and the results of docs/results.md are those of runs/reference/."""

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
from epuckhebb.analysis.claims import claim, verdict
from epuckhebb.analysis.statistics import bootstrap, mean, sign_flip
from epuckhebb.analysis.tables import Table
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


@pytest.mark.parametrize(
    ("page", "name"),
    first_of([(README, "output"), (TUTORIAL, "reached"), (TUTORIAL, "other"), (ADAPTATIONS, "compared")]),
)
def test_a_page_shows_what_its_command_prints(page, name, generated, here, monkeypatch):
    """All that the command above the mark prints but its run folder, which is the last line."""
    monkeypatch.setenv("COLUMNS", "80")
    (here / "runs").mkdir()
    (here / "runs" / "reference").symlink_to(REFERENCE)
    above = re.findall(
        r"^(?:python.* && )?epuckhebb (.*)$", page.read_text().partition(f"<!-- {name}: ")[0], re.MULTILINE
    )
    printed = [line.rstrip() for line in done(*shlex.split(above[-1])).stdout.splitlines()]
    assert printed[-1].startswith("Run folder: ")
    generated(page, name, "\n".join(["```", *printed[:-1], "```", ""]))


LIGHT, OBSTACLES = TRAINED
FINDINGS = [  # a sentence, and the counts that stand in it, each with the method that it is compared with
    (
        "In a [changed world](docs/evolve_or_adapt.md), evolution that goes on from the champion recovers **{}** "
        "pairs of champion and world in 80 simulated hours; from scratch {}; plasticity, in a lifetime, {}, shuffled "
        "signs {}. Among the paper's own two changes it is {own[evolution]}, {own[scratch]}, {own[Hebbian]} and "
        "{own[shuffled]}. Evolution from the champion then fails in the training world in {own[forgets]}.",
        [
            ("evolve_or_adapt/ways", "recovered", "cases", {"world": "all", "way": way, "controller": name} | at)
            for way, name, at in (
                ("from the champion", "GA", {"generation": 16}),
                ("from scratch", "GA", {"generation": 16}),
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
        "With [a signal at the goal](docs/adaptations.md), in light, robots that learn to stay rescue **{}** broken "
        "trials, robots that simply stop {}, hand-written robots without a network {}: here learning adds nothing.",
        [
            ("unseen_kinds/rescue_over_all", "rescued", "broken", {"experiment": LIGHT, "controller": name})
            for name in ("find_and_learn_to_stay (anti)", "find_and_stay", "hand_written")
        ],
    ),
]


# Studies of the rule and of the control, world of the champions, changed world; the claim that the change breaks most
# trials; then for each rule its name in the tables, and the claims that it rescues and that it harms most in training.
CLAIMS = (
    (
        ("which_end", "which_end", "highlight", "lowlight"),
        "Dimmed light breaks most trials",
        ("Hebbian", "The rule (N = 0.002) rescues most of these", "In the light of training it harms most"),
    ),
    (
        ("stopping", "stopping_yoked", "base", "4obstacles"),
        "Four obstacles break most trials",
        ("Hebbian_0.000015", "The rule (N = 0.000015) rescues most of these", "Without obstacles it harms most"),
        ("Hebbian", "The rule (N = 0.00005, chosen) rescues most", "Without obstacles it harms most"),
    ),
)
CONTROL = "yoked_sign"  # as large as the rule
HEAD = ["claim", "verdict", "trials", "share", "wrong end", "random changes: share, wrong end"]


def claims_of(study, control, trained, changed, breaking, *rules):
    """A row for each claim of an experiment: that the change breaks, that the rule rescues, that it harms most trials.

    Beside each stands how many of these trials end at the wrong goal, and both for the control.
    """
    harm, ends, each, random = (
        pd.read_csv(REFERENCE / folder / f"{name}.csv", keep_default_na=False)
        for folder, name in (
            *((study, name) for name in ("rescue_and_harm", "ends", "ends_by_champion")),
            (control, "ends"),
        )
    )
    alone = each[(each.controller == "GA") & (each.scenario == changed)]
    broken, intact = (
        (alone[["fate_left", "fate_right"]] == fate).sum(axis=1).to_numpy() for fate in ("broken", "intact")
    )
    breaks = claim(breaking, "", broken, broken + intact)
    shown = [(breaking, breaks["verdict"], breaks["true"], breaks["n"], breaks["low"], breaks["high"], "–", "–")]
    for rule, text, scenario, part, whole in (
        (rule, text, *place)
        for rule, *texts in rules
        for text, place in zip(texts, ((changed, "rescued", "broken"), (trained, "harmed", "intact")), strict=True)
    ):
        row = harm[(harm.scenario == scenario) & (harm.controller == rule)].iloc[0]
        own, other = (
            rows[(rows.scenario == scenario) & (rows.controller == name) & (rows.among == whole)].iloc[0]
            for rows, name in ((ends, rule), (random, CONTROL))
        )
        low, high = float(row[f"{part}_low"]), float(row[f"{part}_high"])
        share = other.right / other.trials if part == "rescued" else 1 - other.right / other.trials
        beside = f"{share:.2f}, {other.wrong / other.trials:.2f}" if rule == "Hebbian" else "–"
        counted = (row[part], row[whole], low, high, f"{own.wrong:.0f} of {own.trials}", beside)
        shown.append((text, verdict(low, high, row[whole], own.champions), *counted))
    return [
        [text, f"**{word}**", f"{k} of {n}", f"{k / n:.2f} [{low:.2f}, {high:.2f}]", wrong, beside]
        for text, word, k, n, low, high, wrong, beside in shown
    ]


def which_end():
    """The sentence of run 1, by its plan; Holm's correction over the five runs multiplies p by five at the most."""
    ends, both = (pd.read_csv(REFERENCE / "which_end" / f"{name}.csv") for name in ("ends", "discrimination"))
    own = ends[(ends.scenario == "lowlight") & (ends.among == "all")].set_index("controller")
    rule, control, alone = own.loc["Hebbian"], own.loc["yoked_sign"], own.loc["GA"]
    (sides,) = both[(both.scenario == "lowlight") & (both.controller == "Hebbian")].itertuples()
    low, high = rule.right_less_wrong_90_low, rule.right_less_wrong_90_high
    each = pd.read_csv(REFERENCE / "which_end" / "ends_by_champion.csv").query("scenario == 'lowlight'")
    each = (each.right - each.wrong).groupby([each.controller, each.genome]).first()
    less = (each["Hebbian"] - each["GA"]).to_numpy()
    less_low, less_high = bootstrap(mean, less)
    assert alone.right_less_wrong_low > 0  # else the sentence is another one
    verdict = "not decided"
    if low > -0.3 and high < 0.3:
        verdict = "under the rule, which end is chance"
    elif 5 * rule.sign_flip_p < 0.05:
        verdict = f"the {'right' if rule.right_less_wrong > 0 else 'wrong'} end more often than the other"
    facts = f"{rule.right_less_wrong:+.2f} of two sides, 90 % [{low:+.2f}, {high:+.2f}], p = {rule.sign_flip_p:.2g}"
    return (
        f"- **In dimmed light: {verdict}.** The rule drives the robot to its goal in {rule.right:.0f} of {rule.trials} "
        f"trials, to the *wrong* goal in {rule.wrong:.0f} ({facts}). Without plasticity it is not: {alone.right:.0f} "
        f"and {alone.wrong:.0f} ({alone.right_less_wrong:+.2f} [{alone.right_less_wrong_low:+.2f}, "
        f"{alone.right_less_wrong_high:+.2f}]; the rule less this, looked at afterwards: {less.mean():+.2f} "
        f"[{less_low:+.2f}, {less_high:+.2f}]). With random changes of this size it is {control.right:.0f} and "
        f"{control.wrong:.0f}. "
        f"{sides.right_both} of {sides.champions} champions are right on both sides; by chance "
        f"{sides.right_expected:.1f} would be.\n"
    )


def stopping():
    """The sentence of run 2, by its plan: right less wrong ends of the broken trials, the rule less shuffled signs."""
    each = pd.read_csv(REFERENCE / "stopping" / "ends_by_champion.csv", keep_default_na=False)
    each = each[each.scenario == "4obstacles"].set_index(["controller", "genome"]).sort_index()
    draws = [name for name in each.index.levels[0] if name.startswith("shuffled_")]
    broken = each[["fate_left", "fate_right"]].to_numpy() == "broken"
    count = {
        end: pd.Series(((each[["end_left", "end_right"]] == end).to_numpy() & broken).sum(axis=1), each.index)
        for end in ("right", "wrong")
    }
    whole = pd.Series(broken.sum(axis=1), each.index)["Hebbian"]
    less = count["right"] - count["wrong"]
    differences = (len(draws) * less["Hebbian"] - sum(less[draw] for draw in draws))[whole > 0].to_numpy()
    low, high = bootstrap(mean, differences / len(draws))
    p, effect = sign_flip(differences), differences.mean() / len(draws)
    verdict = "not shown that the rule rescues more than random changes"
    if 5 * p < 0.05:
        verdict = f"the rule rescues {'more' if effect > 0 else 'less'} than random changes do"
    yoked = pd.read_csv(REFERENCE / "stopping_yoked" / "ends.csv").set_index(["scenario", "controller", "among"])
    of_its_size = yoked.loc["4obstacles", CONTROL, "broken"]
    rule, paper, anti = (
        [int(count[end][name].sum()) for end in count] for name in ("Hebbian", "Hebbian_0.000015", "anti")
    )
    random = [sum(count[end][draw].sum() for draw in draws) / len(draws) for end in count]
    return (
        f"- **Among four obstacles, in three dimensions: {verdict}.** Of {whole.sum()} broken trials of "
        f"{(whole > 0).sum()} champions the rule ends right in {rule[0]} and wrong in {rule[1]} at an N that was "
        f"chosen on other champions, shuffled signs at theirs in {random[0]:.1f} and {random[1]:.1f}: right less wrong "
        f"differs by {effect:+.2f} a champion [{low:+.2f}, {high:+.2f}], p = {p:.2g}. At the paper's N it is "
        f"{paper[0]} and {paper[1]}; random changes as large as the rule's, at its chosen N, end right in "
        f"{of_its_size.right:.1f} and wrong in {of_its_size.wrong:.1f}, its opposite sign in {anti[0]} and {anti[1]}.\n"
    )


def foraging():
    """The sentence of the study of foraging, by its plan."""
    means = pd.read_csv(REFERENCE / "foraging" / "methods.csv").set_index(["method", "controller"])
    rows = pd.read_csv(REFERENCE / "foraging" / "differences.csv").set_index(["ours", "other"])
    rule, frozen, plain = (
        f"{row.reward:.1f} [{row.reward_low:.1f}, {row.reward_high:.1f}]"
        for row in (means.loc["modulated", "rule"], means.loc["modulated", "frozen"], means.loc["plain", "network"])
    )
    turned, more = rows.loc["modulated", "frozen"], rows.loc["modulated", "plain"]
    cells = pd.read_csv(REFERENCE / "foraging_lifespans" / "cells.csv").query("controller == 'rule' and season == 2000")
    drawn, known = (
        f"{row.over_plain:+.3f} [{row.over_plain_low:+.3f}, {row.over_plain_high:+.3f}]"
        for row in cells.sort_values("known").itertuples()
    )
    assert turned.p_holm < 0.05 <= more.p_holm  # else the sentence is another one
    return (
        f"- When food [changes with the season](docs/foraging.md), that learning pays is **not shown**: ten champions "
        f"with a rule that a neuron modulates earn {rule}, with weights frozen after the first season {frozen} "
        f"(difference from then on {turned.difference:+.1f}, p = {turned.p_holm:.2g} after Holm), but ten without a "
        f"rule, which react to their last reward, {plain} (the rule less these {more.difference:+.1f} "
        f"[{more.low:+.1f}, {more.high:+.1f}], p = {more.p:.2g}, after Holm {more.p_holm:.2g}), and a script that "
        f"knows the season {means.loc['knows', 'network'].reward:.0f}. With one season a lifetime that is drawn, the "
        f"rule earns {drawn} a step more than networks without one (six champions, no test), with one that is known "
        f"{known}.\n"
    )


def legs():
    """The sentence of run 5, by its plan."""
    rows = pd.read_csv(REFERENCE / "legs_fresh" / "effects.csv").set_index(["change", "is_paired"])
    means = pd.read_csv(REFERENCE / "legs_fresh" / "summary.csv").query("change == 'weak_leg'").set_index("controller")
    rule, frozen, plain = (
        f"{row.return_after:.0f} [{row.return_after_low:.0f}, {row.return_after_high:.0f}]"
        for row in (
            means.loc[name] for name in ("normalised", "normalised (frozen at the change)", "without plasticity")
        )
    )
    learning, other = rows.loc["weak_leg", True], rows.loc["weak_front_leg", True]
    assert 5 * learning.p < 0.05  # so the other four primary tests cannot change the verdict
    return (
        f"- When a joint of HalfCheetah [dies](docs/any_world.md#halfcheetah-with-a-dead-joint), an evolved rule "
        f"**learns after the change**: thirty new champions return {rule}, with weights frozen at that moment {frozen} "
        f"({learning.effect:+.0f} [{learning.effect_low:+.0f}, {learning.effect_high:+.0f}], p = {learning.p:.2g}, the "
        f"primary test), thirty without a rule {plain}. The joint died in their evolution, too; for "
        f"another one it is {other.effect:+.0f} [{other.effect_low:+.0f}, {other.effect_high:+.0f}] (description). The "
        f"gain is nearly whole within 100 steps: the rule helps by going on.\n"
    )


def share(table, part, whole, which):
    """How many a row of a table of runs/reference/ counts, of how many, with the share's interval."""
    rows = pd.read_csv(REFERENCE / f"{table}.csv")
    (row,) = rows[(rows[list(which)] == pd.Series(which)).all(axis=1)].to_dict("records")
    count, of = round(row[part] * row[whole]) if part == "recovered" else row[part], row[whole]
    return f"{count} of {of} [{row[f'{part}_low']:.2f}, {row[f'{part}_high']:.2f}]"


def recoveries(way, controller, worlds=("lowlight", "base+4obstacles"), part="recovered"):
    """How many cases, of how many, are recovered, or retained, by evolution at its last generation or without it."""
    rows = pd.read_csv(REFERENCE / "evolve_or_adapt" / "recovery.csv")
    rows = rows[(rows.way == way) & (rows.controller == controller) & rows.generation.isin([0, 16])]
    rows = rows[rows.world.isin(worlds)] if worlds else rows
    return int(rows[part].sum()), len(rows)


def test_the_findings_are_those_of_the_reference_results(generated):
    table = Table(HEAD, [row for study, *texts in CLAIMS for row in claims_of(*study, *texts)]).markdown()
    ways = {"evolution": ("from the champion", "GA"), "scratch": ("from scratch", "GA")}
    ways |= {name: ("champion", name) for name in ("Hebbian", "shuffled")}
    own = {name: "{} of {}".format(*recoveries(*way)) for name, way in ways.items()}
    retained, cases = recoveries(*ways["evolution"], worlds=(), part="retained")
    own["forgets"] = f"{cases - retained} of {cases}"
    sentences = [f"- {text.format(*(share(*count) for count in counts), own=own)}\n" for text, counts in FINDINGS]
    generated(README, "findings", "".join([table, "\n", which_end(), stopping(), *sentences, foraging(), legs()]))


def test_the_page_of_methods_has_the_rule_of_verdicts(generated):
    generated(ROOT / "docs" / "methods.md", "verdicts", f"{claims.RULE}\n")


def test_results_are_those_of_the_reference_run(generated):
    table = reproduction.claims_table(pd.read_csv(REFERENCE / "claims.csv"))
    generated(RESULTS, "results", table.only(*table.headings[:6]).markdown())


@pytest.mark.parametrize("experiment", ["light", "obstacles"])
def test_the_bundled_champion_is_the_showcase_of_the_reference_run(experiment):
    report_text = (REFERENCE / "report.md").read_text()
    name = re.search(rf"Showcase: `({experiment}_seed\d+)`", report_text)[1]
    with (
        np.load(REFERENCE / f"champion_{experiment}.npz") as bundled,
        np.load(REFERENCE / "champions" / f"{name}.npz") as own,
    ):
        assert (bundled["genome"] == own["genome"]).all()
