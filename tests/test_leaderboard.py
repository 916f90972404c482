"""`epuckhebb leaderboard`, small: whole, resumable, repeatable, every cell in a CSV; and what a method may be."""

import json
import re
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cases import call, described_columns, done, first_of, refused

from epuckhebb.analysis import leaderboard as board
from epuckhebb.analysis.statistics import bootstrap, difference, mean, wilson_by_champion
from epuckhebb.runs import earlier_champions
from epuckhebb.runtime.conf import groups
from epuckhebb.runtime.errors import ConfigError
from epuckhebb.studies import leaderboard, methods
from epuckhebb.studies.methods import find_methods, reversal_methods
from epuckhebb.tmaze.tasks.reversal import Reversal

ROOT = Path(__file__).parents[1]
EXAMPLES = ROOT / "examples"
TINY = "optimizer.population: 4, optimizer.starts: 3, optimizer.confirm: 2, optimizer.generations: 2"
TINY += ", lifetime.duration_s: 3, scenario.paper_duration_s: 10"
EVOLVED = f"optimizer: sep_cma_es, training: varied, {TINY}"
METHODS = {
    "tiny": f"# Tiny.\nevolve: {{{EVOLVED}}}",
    "learns": f"evolve: {{hebbian: modulated, {EVOLVED}}}\nmatched_control: tiny",
    "only_rule": f"champions_of: tiny\nevolve: {{hebbian: modulated, {EVOLVED}}}",
    "paper_over": "champions_of: tiny\nevaluate: {hebbian: paper, hebbian.N: 0.001}",
    "wired": f"evolve: {{network.wiring: elman, {EVOLVED}}}\nmatched_control: tiny",
    "oja_on_wired": "champions_of: wired\nevaluate: {hebbian: oja, hebbian.N: 0.001}",
    # what is refused
    "over_plastic": "champions_of: learns\nevaluate: {hebbian: oja}",
    "no_numbers": f"champions_of: tiny\nevolve: {{hebbian: oja, {EVOLVED}}}",
    "in_a_test": f"evolve: {{scenario: 4obstacles, {EVOLVED}}}",
    "no_twin": f"evolve: {{hebbian: modulated, {EVOLVED}}}",
    "wrong_key": f"evolve: {{{EVOLVED}}}\nevolves: {{optimizer: ga}}",
    "wrong_value": "evolve: ga",
    "nothing": "matched_control: tiny",
    "its_own_twin": f"evolve: {{hebbian: modulated, {EVOLVED}}}\nmatched_control: its_own_twin",
    "wrong_setting": "champions_of: tiny\nevaluate: {hebbian: oja, hebbian.nn: 2}",
}
FEW = """# @package _global_
# Two test worlds of one experiment, one of the other.
hydra:
  sweeper:
    params:
      scenario: base, 4obstacles, base_half, lowlight
"""
ASKED = ["leaderboard", "obstacles", "tests=[few]", "champions=2", "repeats=1", "hydra/launcher=basic"]
MADE = [*ASKED, "methods=only_rule,paper_over", "--config-dir"]


@pytest.fixture(scope="module")
def conf(tmp_path_factory):
    """A folder with small methods and few test worlds."""
    folder = tmp_path_factory.mktemp("conf")
    for name in ("method", "experiment"):
        (folder / name).mkdir()
    for name, text in METHODS.items():
        (folder / "method" / f"{name}.yaml").write_text(text)
    (folder / "experiment" / "few.yaml").write_text(FEW)
    return folder


@pytest.fixture(scope="module")
def made(conf, tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(tmp_path_factory.mktemp("leaderboard"))
        result = done(*MADE, conf)
        (folder,) = (tmp_path_factory.getbasetemp() / "leaderboard0" / "runs" / "leaderboard").iterdir()
        yield folder, result


def test_it_leaves_tables_a_figure_and_a_page(made):
    folder, result = made
    assert "paper_over" in result.stdout
    names = {file.name for file in folder.iterdir()}
    assert {"leaderboard.csv", "champions.csv", "worlds.csv", "report.md"} <= names
    for table in folder.glob("*.csv"):
        assert list(pd.read_csv(table, nrows=0)) == described_columns(table.name)
    assert (folder / "figures" / "leaderboard_obstacles.png").read_bytes().startswith(b"\x89PNG")
    page = (folder / "report.html").read_text()
    assert "://" not in re.sub(r'src="data:[^"]+"', "", page)
    assert page.count('src="data:image/png;base64,') == 3
    assert "<title>epuckhebb: Leaderboard</title>" in page


def test_the_champions_of_earlier_generations_are_those_that_the_evolution_had(made):
    folder, _ = made
    course = pd.read_csv(folder / "anytime.csv")
    assert set(course.method) == {"tiny"}  # that other methods are added to
    assert list(course.mark) == [0, 1, 2, 3]
    last = pd.read_csv(folder / "leaderboard.csv").set_index("method").loc["tiny"]
    assert course.iloc[3][["robot_steps", "success"]].tolist() == [last.robot_steps, last.success]
    assert course.robot_steps.is_monotonic_increasing


@pytest.mark.usefixtures("here")
def test_an_evolution_that_stops_early_ends_with_an_earlier_champion():
    small = ["ga.population=6", "ga.elites=2", "ga.loops=1", "lifetime.duration_s=5", "figures=none"]
    for generations in (1, 3):
        done("evolve", *small, f"ga.generations={generations}", f"hydra.run.dir={generations}")
    (early,) = earlier_champions(Path("3"), [1 / 3])
    with np.load("1/champion.npz") as champion:
        assert (early[1] == champion["genome"]).all()
    assert early[0] == pd.read_csv("1/history.csv").robot_steps.sum()


def test_a_method_brings_what_it_is_compared_with(made):
    table = pd.read_csv(made[0] / "leaderboard.csv").set_index("method")
    assert table.kind.to_dict() == {
        "tiny": "plain",
        "only_rule": "evolved",
        "paper_over": "post_hoc",
    }
    assert table.matched_control.fillna("").to_dict() == {
        "tiny": "",
        "only_rule": "tiny",
        "paper_over": "tiny",
    }
    assert table.evolved_parameters.to_dict() == {"tiny": 234, "only_rule": 10, "paper_over": 234}
    assert table.robot_steps["only_rule"] == 2 * table.robot_steps["tiny"] == 2 * table.robot_steps["paper_over"]


def test_the_rows_of_champions_are_made_of_lifetimes(made):
    folder, _ = made
    for row in pd.read_csv(folder / "champions.csv").itertuples():
        lived = pd.read_csv(folder / row.test / "metrics.csv")
        own = lived[lived.controller == lived.controller.iloc[-1]]
        in_training, away = own[own.scenario == "base"], own[own.scenario != "base"]
        assert set(away.scenario) == {"4obstacles", "base_half"}
        assert set(own.genome) == {row.champion}
        assert (row.solves, row.successes, row.trials) == (
            in_training.success.sum() == 2,
            away.success.sum(),
            len(away),
        )
        history = pd.read_csv(folder / row.champion / "history.csv").robot_steps.sum()
        assert row.robot_steps == history * (2 if row.method == "only_rule" else 1)


def test_off_is_the_twin_where_something_is_laid_over(made):
    champions = pd.read_csv(made[0] / "champions.csv").set_index(["method", "seed"])
    pd.testing.assert_series_equal(
        champions.loc["paper_over"].successes_off, champions.loc["tiny"].successes, check_names=False, check_dtype=False
    )


def test_a_rule_that_evolves_something_is_evolved():
    rule = str(EXAMPLES / "own_rule" / "evolved_rule.py") + ":Layered"
    matched_control, method = find_methods([rule])
    assert (matched_control.name, method.name, method.matched_control) == (
        "sep_cma_es_varied",
        "Layered",
        "sep_cma_es_varied",
    )
    assert list(method.evolve.items())[1:] == [("optimizer", "sep_cma_es"), ("training", "varied")]


def test_show_tells_of_it(made):
    folder, _ = made
    shown = done("show", folder)
    assert "paper_over" in shown.stdout
    assert "--config-dir" in shown.stdout
    rows = json.loads(call("show", folder, "--json").stdout)["leaderboard"]
    assert {row["method"] for row in rows} == {"tiny", "only_rule", "paper_over"}
    run = next(folder.glob("test_*"))
    done("show", run)


# Reversal learning


@pytest.fixture
def short(monkeypatch):
    """Lives of the task have two short trials, and four of them evolve."""
    lives = {"trials": 2, "first_switch": 2, "last_switch": 2, "reward_s": 0.1, "time_out_s": 1.0}
    task = {"task": "reversal"} | {f"task.{key}": value for key, value in lives.items()}
    monkeypatch.setattr(methods, "REVERSAL_TASK", task)
    evolution = {"population": 4, "generations": 2, "elites": 1, "loops": 1}
    reversal_ga = {"ga": "reversal"} | {f"ga.{key}": value for key, value in evolution.items()}
    monkeypatch.setattr(methods, "REVERSAL_GA", reversal_ga)


@pytest.mark.thorough
@pytest.mark.usefixtures("short")
def test_reversal_learning_compares_rules(here):
    words = ["leaderboard", "reversal", "methods=modulated", "champions=1", "reversal_repeats=2"]
    words += ["hydra/launcher=basic", "hydra.sweep.dir=board"]
    result = done(*words)
    assert "Reversal learning" in result.stdout
    champions = pd.read_csv(here / "board" / "champions.csv").set_index("method")
    table = pd.read_csv(here / "board" / "leaderboard.csv").set_index("method")
    assert table.kind.to_dict() == {"ga": "plain", "modulated": "evolved"}
    assert table.matched_control.fillna("").to_dict() == {"ga": "", "modulated": "ga"}
    assert set(table.trials) == {2 * 2 * 2}
    for name, own in champions.iterrows():
        lived = pd.read_csv(here / "board" / own.test / "metrics.csv")
        rewarded = lived.groupby("controller", sort=False).rewarded_share.sum() * 2
        assert own.successes == rewarded.iloc[1 if len(rewarded) > 1 else 0]
        assert np.isnan(own.successes_inverted) == (name != "modulated")
        if name == "modulated":
            assert list(rewarded.index) == ["GA", "modulated", "modulated (reward inverted)"]
            assert (own.successes_off, own.successes_inverted) == (rewarded.iloc[0], rewarded.iloc[2])
    page = (here / "board" / "report.md").read_text()
    assert "| reward inverted |" in page
    assert "4 new lifetimes in reversal learning" in page


def test_the_share_of_a_learner_by_hand():
    """The optimum is .8625, chance .5: who is nearer to the optimum learns."""
    names = ["GA", "learner", "learner (reward inverted)"]
    lives = pd.DataFrame(
        {
            "controller": np.repeat(names, 2),
            "scenario": "base",
            "rewarded_share": [0.5, 0.5, 0.6, 0.8, 0.1, 0.4],
        }
    )
    count, worlds = board.learner_counts(lives, Reversal())
    assert count == {"solves": 1, "trials": 20, "successes": 14, "successes_off": 10, "successes_inverted": 5}
    assert worlds.to_dict("records") == [{"scenario": "base", "trials": 20, "successes": 14}]
    count, _ = board.learner_counts(lives[lives.controller == "GA"], Reversal())
    assert count == {"solves": 0, "trials": 20, "successes": 10, "successes_off": None, "successes_inverted": None}


def test_methods_that_differ_in_training_or_optimizer_alone_are_one_in_reversal_learning():
    names = ["ga_varied", "abcd", "evolve_and_merge", "late", "modulated_over_ga", "online", "elman"]
    here = {method.name: method for method in reversal_methods(find_methods(names))}
    assert list(here) == ["ga", "abcd", "modulated_over_ga", "elman"]
    assert here["elman"].evolve == {"task": "reversal", "ga": "reversal", "network.wiring": "elman"}
    assert here["ga"].evolve == {"task": "reversal", "ga": "reversal"}
    assert here["abcd"].evolve == {"task": "reversal", "ga": "reversal", "hebbian": "abcd"}
    assert (here["abcd"].matched_control, here["modulated_over_ga"].champions_of) == ("ga", "ga")


# Methods


@pytest.mark.thorough
def test_every_method_of_the_program_can_be_planned_and_says_what_it_is(here):
    planned = leaderboard.plan("obstacles", ["champions=1"])
    entries = planned.study.entries
    assert sorted(entry.row.method for entry in entries) == groups("leaderboard")["method"]
    assert all(entry.description for entry in entries)
    kinds = {entry.row.method: entry.row.kind for entry in entries}
    assert (kinds["ga"], kinds["evolve_and_merge"], kinds["late"]) == ("plain", "evolved", "post_hoc")
    controls = {entry.row.method: entry.row.matched_control for entry in entries}
    assert (kinds["ctrnn"], controls["ctrnn"], controls["elman"]) == ("plain", "ga", "ga")
    assert len(planned.study.worlds["obstacles"]) == 8 + 29
    assert len({job.run for job in planned.jobs}) == len(planned.jobs)
    assert list(here.iterdir()) == []


def test_champions_are_tested_with_the_network_that_they_evolved_with(conf, here):
    words = ["tests=[few]", "champions=1", "methods=oja_on_wired"]
    planned = leaderboard.plan("obstacles", words, config_dir=str(conf))
    tests = {entry.row.method: entry.jobs["test champions"].values() for entry in planned.study.entries}
    assert list(tests) == ["tiny", "wired", "oja_on_wired"]
    networks = [[job.config["config"]["network"] for job in jobs] for jobs in tests.values()]
    assert networks == [[{"wiring": "mlp", "layers": None}], *([{"wiring": "elman", "hidden": 8}],) * 2]
    assert list(here.iterdir()) == []


def test_two_rules_of_one_name_are_refused(tmp_path):
    rule = (EXAMPLES / "own_rule" / "my_rules.py").read_text()
    (tmp_path / "other.py").write_text(f"{rule}# another\n")
    shutil.copy(EXAMPLES / "own_rule" / "my_rules.py", tmp_path / "one.py")
    with pytest.raises(ConfigError, match="another one has the name Gated"):
        find_methods([f"{tmp_path}/one.py:Gated", f"{tmp_path}/other.py:Gated"])


# Statistics


def rows_of(method, successes, solves):
    own = {
        "experiment": "obstacles",
        "method": method,
        "trials": 4,
        "successes_off": 0 if method == "own" else None,
        "successes_inverted": None,
    }
    own["robot_steps"] = 10
    return [
        own | {"seed": k, "successes": s, "solves": m} for k, (s, m) in enumerate(zip(successes, solves, strict=True))
    ]


def test_the_table_by_hand():
    control, own = ((1, 2, 4) * 2, (1, 0, 1) * 2), ((2, 2, 3) * 2, (1, 1, 0) * 2)
    champions = pd.DataFrame(rows_of("matched_control", *control) + rows_of("own", *own))
    told = {"experiment": "obstacles", "evolved_parameters": 1}
    table = board.table(
        [
            board.Row(method="matched_control", kind=board.PLAIN, matched_control="", **told),
            board.Row(method="own", kind=board.EVOLVED, matched_control="matched_control", **told),
        ],
        champions,
    ).set_index("method")
    assert table.success.to_dict() == {"matched_control": 7 / 12, "own": 7 / 12}
    assert table.retention.to_dict() == {"matched_control": 5 / 8, "own": 0.5}
    assert table.solved.to_dict() == {"matched_control": 4, "own": 4}
    assert table.best.to_dict() == {"matched_control": 1.0, "own": 0.75}
    assert table.difference["own"] == pytest.approx((1 + 0 - 1) / 12)
    assert table.difference_low["own"] <= 0 <= table.difference_high["own"]
    assert table.p["own"] == table.p_holm["own"] == table.best_plain_p_holm["own"] == 1
    assert table.best_plain.to_dict() == {"matched_control": "", "own": "matched_control"}
    assert table.improvement["own"] == pytest.approx((2 * 2 + 1) / 9)  # of nine pairs: two are ties, four are wins
    assert np.isnan(table.difference["matched_control"])
    assert np.isnan(table.success_off["matched_control"])


def test_of_learners_the_interval_is_a_bootstrap_and_of_champions_alike_there_is_none():
    """Ten champions at exactly 1,000 of 2,000 trials were once .50 [.40, .60]."""
    alike, apart = rows_of("alike", [2] * 7, [0] * 7), rows_of("apart", [0, 1, 2, 2, 3, 4, 4], [1] * 7)
    for experiment in ("obstacles", board.REVERSAL):
        champions = pd.DataFrame(alike + apart).assign(experiment=experiment)
        told = {"experiment": experiment, "evolved_parameters": 1, "matched_control": "", "kind": board.PLAIN}
        table = board.table([board.Row(method=name, **told) for name in ("alike", "apart")], champions)
        own = table.set_index("method").filter(like="success_")
        assert own.loc["alike", ["success_low", "success_high"]].isna().all()
        shares = np.array([0, 1, 2, 2, 3, 4, 4]) / 4
        counted = wilson_by_champion(np.array([0, 1, 2, 2, 3, 4, 4]), np.full(7, 4))
        expected = bootstrap(mean, shares) if experiment == board.REVERSAL else counted
        assert tuple(own.loc["apart", ["success_low", "success_high"]]) == expected


# What is refused

BAD = {
    "no such method": (["methods=abdc"], ["methods=abdc", "Did you mean abcd?", "sep_cma_es_varied", "FILE.py:NAME"]),
    "no method": (["methods="], ["methods must name one method"]),
    "a group": (["method=ga"], ["method"]),
    "no such file": (["methods=no.py:Mine"], ["no.py"]),
    "no champions": (["champions=0"], ["champions must be 1 or more, got 0"]),
    "no tests": (["tests=[]"], ["tests must name"]),
    "no such tests": (["tests=[fewer]", "methods=ga"], ["fewer"]),
    "unknown key": (["champoins=3"], ["champoins"]),
    "another sweeper": (["hydra/sweeper=x"], ["`leaderboard` lists its jobs itself"]),
    "a champion of another rule": (["methods=over_plastic"], ["champions_of=learns", "no other can be added"]),
    "a rule with nothing to evolve": (["methods=no_numbers"], ["nothing would be evolved", "rule oja"]),
    "trained in a test": (["methods=in_a_test"], ["trained in 4obstacles, a world of the tests"]),
    "no matched control": (["methods=no_twin"], ["matched_control is missing"]),
    "a wrong key": (["methods=wrong_key"], ["wrong_key.yaml: evolves is not a key of a method", "evolve"]),
    "a wrong value": (["methods=wrong_value"], ["wrong_value.yaml", "evolve"]),
    "neither evolved nor taken": (["methods=nothing"], ["it needs either evolve", "or champions_of"]),
    "its own matched control": (["methods=its_own_twin"], ["leads nowhere"]),
    "a wrong setting": (["methods=wrong_setting"], ["method wrong_setting", "hebbian.nn"]),
}


@pytest.mark.parametrize("mistake", first_of(BAD, 6))
def test_a_mistake_gets_one_message_and_leaves_nothing(mistake, conf, here):
    words, expected = BAD[mistake]
    result = refused(*ASKED, *words, "--config-dir", conf)
    for text in expected:
        assert text in result
    assert list(here.iterdir()) == []


def test_several_experiments_stand_in_one_table(conf):
    words = ["methods=ga", "champions=2", "tests=[few]"]
    planned = leaderboard.plan("obstacles,light", words, config_dir=str(conf))
    assert [entry.row.experiment for entry in planned.study.entries] == ["light", "obstacles"]
    assert planned.folder == leaderboard.plan("light", words, config_dir=str(conf)).folder


def test_a_difference_of_pairs_is_of_champions_with_the_same_seed():
    own = pd.DataFrame({"seed": range(8), "successes": [2, 18, 6, 14, 10, 4, 16, 8], "trials": 20})
    others = own.assign(successes=own.successes - [1, 1, 1, 1, 1, 1, 1, 2]).sample(frac=1, random_state=1)
    each = np.array([0.05] * 7 + [0.1])
    pairs, groups = (board._difference(own, others, paired=paired) for paired in (True, False))
    assert list(pairs.values())[:3] == pytest.approx([each.mean(), *bootstrap(mean, each)])
    assert pairs[list(pairs)[3]] == pytest.approx(2 / 2**8)
    alone = bootstrap(difference, own.successes.to_numpy() / 20, others.successes.to_numpy() / 20)
    assert list(groups.values())[:3] == pytest.approx([each.mean(), *alone])
