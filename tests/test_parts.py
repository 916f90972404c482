"""Parts that a user brings or changes: a rule from a file, what differs in a world, other robots and networks."""

import itertools
import json
import shutil
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cases import first_of
from typer.testing import CliRunner

import epuckhebb
from epuckhebb.app import files, runs
from epuckhebb.app.cli import app
from epuckhebb.app.config import EvaluateConfig, EvolveConfig, typed
from epuckhebb.app.data import groups
from epuckhebb.app.hydra_bridge import composed
from epuckhebb.app.parts import rule_class, sha256_of
from epuckhebb.sim import block

BRIEF = ["lifetime.duration_s=2", "lifetime.record_every=0", "repeats=1"]
SHORT = ["lifetime.duration_s=2", "repeats=1"]
SMALL_GA = ["ga.population=4", "ga.generations=1", "ga.loops=1", "ga.elites=1", "lifetime.duration_s=2"]
EXAMPLES = Path(__file__).parents[1] / "examples"
MY_RULES = '''\
"""Oja's rule, with a setting of its own."""

from dataclasses import dataclass

from epuckhebb import Rule


@dataclass(frozen=True, kw_only=True)
class oja(Rule):
    decay: float = 1.0

    @staticmethod
    def synapse(correlation, post, weight, by):
        return correlation - by.decay * post * post * weight
'''
ANOTHER = MY_RULES.replace("decay: float = 1.0", "decay: float = 3.0")
OJA = ["hebbian.rule=my_rules.py:oja", "hebbian.N=0.0001"]


def call(*words):
    return CliRunner().invoke(app, list(words))


def done(*words):
    result = call(*words)
    assert result.exit_code == 0, (words, result.output)
    return result


def metrics(run):
    return pd.read_csv(Path(run) / "metrics.csv", keep_default_na=False, na_values=[""])


def told(run):
    return json.loads((Path(run) / "provenance.json").read_text())


@pytest.fixture
def here(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("my_rules.py").write_text(MY_RULES)
    return tmp_path


@pytest.fixture(scope="module")
def lived(tmp_path_factory):
    """A folder with a rule of one's own, and runs by it: `evaluated`, and `evolved` from scratch; not to be changed."""
    folder = tmp_path_factory.mktemp("own")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        Path("my_rules.py").write_text(MY_RULES)
        done("evaluate", *OJA, "hebbian.decay=2", "scenario=4obstacles", *SHORT, "hydra.run.dir=evaluated")
        done("evolve", *OJA, *SMALL_GA, "hydra.run.dir=evolved")
    return folder


@pytest.fixture
def copy(lived, tmp_path, monkeypatch):
    """A copy of that folder, in which anything may be done."""
    monkeypatch.chdir(shutil.copytree(lived, tmp_path / "own"))
    return Path.cwd()


# A rule of one's own


def test_the_rule_is_short():
    assert len(MY_RULES.splitlines()) <= 20


def test_a_rule_of_ones_own_lives_and_is_kept(lived):
    run = lived / "evaluated"
    rows = metrics(run)
    assert list(rows.controller.unique()) == ["GA", "oja"]
    plastic = rows[rows.controller == "oja"]
    assert set(plastic.N) == {0.0001}
    assert (plastic.weight_change_mean > 0).all()
    assert (run / "rules" / "my_rules.py").read_text() == MY_RULES
    assert list(told(run)["rules"].values()) == [sha256_of(lived / "my_rules.py")]
    config = (run / ".hydra" / "config.yaml").read_text()
    assert "decay: 2" in config
    assert "trace_decay" not in config  # is the paper's rule's


def test_what_is_left_as_it_is_in_the_class_is_written_down_too(tmp_path):
    (tmp_path / "mine.py").write_text(MY_RULES)
    asked = f"hebbian.rule={tmp_path / 'mine.py'}:oja"
    assert composed("evaluate", [asked]).hebbian.decay == 1.0
    assert composed("evaluate", [asked, "hebbian.decay=2"]).hebbian.decay == 2


@pytest.mark.thorough
@pytest.mark.usefixtures("here")
def test_its_setting_matters_and_the_same_rule_gives_the_same_numbers():
    """Ours with decay 1 is the program's Oja."""
    for name, words in {"one": [], "two": ["hebbian.decay=2"], "again": ["hebbian.decay=1.0"]}.items():
        done("evaluate", *OJA, *words, *BRIEF, f"hydra.run.dir={name}")
    done("evaluate", "hebbian=oja", "hebbian.N=0.0001", *BRIEF, "hydra.run.dir=ours")
    one, two, again, ours = (metrics(name) for name in ("one", "two", "again", "ours"))
    pd.testing.assert_frame_equal(one, again)
    pd.testing.assert_frame_equal(one, ours)
    assert not one.equals(two)


def test_it_is_replayed_and_shown(copy):
    assert "oja" in done("show", "evaluated").stdout
    done("replay", "evaluated")
    assert "oja" in (copy / "evaluated" / "replay.html").read_text()


@pytest.mark.parametrize(("run", "after"), first_of([("evaluated", "changed"), ("evolved", "removed")]))
def test_a_rerun_takes_the_copy(copy, run, after):
    if after == "changed":
        (copy / "my_rules.py").write_text(ANOTHER)
    else:
        (copy / "my_rules.py").unlink()
    assert "same bytes" in done("rerun", run).stdout
    (again,) = (copy / "runs").glob("*/*")
    assert (again / "rules" / "my_rules.py").read_text() == MY_RULES
    assert list(told(again)["rules"].values()) == list(told(run)["rules"].values())
    assert "same bytes" in done("rerun", str(again)).stdout


@pytest.mark.parametrize("copied", [ANOTHER, None])
def test_a_copy_that_was_changed_or_lost_is_refused(copy, copied):
    if copied:
        (copy / "evaluated" / "rules" / "my_rules.py").write_text(copied)
    else:
        (copy / "evaluated" / "rules" / "my_rules.py").unlink()
    result = call("rerun", "evaluated")
    assert result.exit_code == 2
    assert "my_rules.py is not the rule of this run" in result.stderr
    assert not (copy / "runs").exists()


@pytest.mark.thorough
def test_an_evolution_by_it_goes_on_and_its_champion_lives(copy):
    assert list(told("evolved")["rules"].values()) == [sha256_of(copy / "my_rules.py")]
    assert (copy / "evolved" / "rules" / "my_rules.py").read_text() == MY_RULES
    done("evolve", "resume=evolved", "ga.generations=2", "-q")
    assert len(pd.read_csv("evolved/history.csv")) == 2
    done("evaluate", "genome=evolved", *OJA, *BRIEF, "hydra.run.dir=out")


def a_folder_of_conf():
    """A rule and a sweep as files of one's own."""
    for group, name, text in [
        ("hebbian", "mine", "rule: my_rules.py:oja\nN: 0.0003\ndecay: 2\n"),
        ("experiment", "rates", "# @package _global_\ndefaults: [{override /hebbian: mine}]\n"
         "hydra: {sweeper: {params: {hebbian.N: '0.0001,0.0002'}}}\n"),
        ("scenario", "dusk", "defaults: [base, _self_]\nlight: 0.05\n"),
    ]:  # fmt: skip
        Path("conf", group).mkdir(parents=True, exist_ok=True)
        Path("conf", group, f"{name}.yaml").write_text(text)
    return ["--config-dir", "conf"]


@pytest.mark.usefixtures("here")
def test_in_a_file_of_ones_own():
    done("evaluate", "hebbian=mine", *BRIEF, "hydra.run.dir=out", *a_folder_of_conf())
    rows = metrics("out")
    assert list(rows.controller.unique()) == ["GA", "mine"]
    assert set(rows[rows.controller == "mine"].N) == {0.0003}


@pytest.mark.usefixtures("here")
def test_below_compare():
    own = [
        "compare.own={rule: my_rules.py:oja, N: 0.0001}",
        "compare.more={rule: my_rules.py:oja, N: 0.0001, decay: 2}",
    ]
    done("evaluate", "hebbian=none", *own, *BRIEF, "hydra.run.dir=out")
    rows = metrics("out")
    assert list(rows.controller.unique()) == ["GA", "own", "more"]
    assert Path("out/rules/my_rules.py").read_text() == MY_RULES
    done("evaluate", *OJA, *BRIEF, "hydra.run.dir=alone")
    measured = ["weight_change_mean", "path_length_m", "fitness"]
    alone = metrics("alone")
    np.testing.assert_array_equal(rows[rows.controller == "own"][measured], alone[alone.controller == "oja"][measured])


@pytest.mark.thorough
@pytest.mark.usefixtures("here")
def test_in_a_sweep_and_changed_it_makes_new_jobs():
    words = ["sweep", "rates", *BRIEF, "hydra/launcher=basic", "hydra.sweep.dir=out", *a_folder_of_conf()]
    assert "0 done before, 2 to do" in done(*words).stderr
    assert "2 done before, 0 to do" in done(*words).stderr
    assert set(pd.read_csv("out/sweep.csv").controller) == {"GA", "mine"}
    Path("my_rules.py").write_text(MY_RULES + "\n# only a remark\n")
    assert "0 done before, 2 to do" in done(*words).stderr
    assert len(list(Path("out").glob("job_*"))) == 4


@pytest.mark.thorough
@pytest.mark.parametrize("launcher", ["basic", "joblib"])
def test_in_a_multirun(here, launcher):
    rule = f"hebbian.rule={here}/my_rules.py:oja"  # workers that are kept from an earlier call stay in its folder
    words = ["-m", "hebbian.N=0.0001,0.0002", rule, f"hydra/launcher={launcher}"]
    done("evaluate", *words, *BRIEF, f"hydra.sweep.dir={here}/out")
    rows = pd.concat([metrics(here / "out" / str(job)) for job in (0, 1)])
    assert list(rows[rows.controller == "oja"].N.unique()) == [0.0001, 0.0002]


@pytest.mark.thorough
@pytest.mark.usefixtures("here")
def test_an_object_from_python():
    rule = rule_class("my_rules.py:oja", "hebbian")
    rows = epuckhebb.evaluate(epuckhebb.load(), "scenario=base", *BRIEF, hebbian=rule(N=0.0001, decay=2.0)).metrics
    assert list(rows.controller.unique()) == ["GA", "oja"]
    named = epuckhebb.evaluate(epuckhebb.load(), "scenario=base", *BRIEF, *OJA, "hebbian.decay=2").metrics
    pd.testing.assert_frame_equal(rows, named)
    late = epuckhebb.evaluate(epuckhebb.load(), "adaptation=late", *BRIEF, hebbian=rule(N=0.0001)).metrics
    assert list(late.controller.unique()) == ["GA", "late"]
    assert (late.weight_change_mean == 0).all()  # two seconds are not late


@pytest.mark.thorough
@pytest.mark.usefixtures("here")
def test_what_a_rule_evolves_goes_with_the_champion():
    """In a file and in Python; a champion that lacks it is refused."""
    own = [f"hebbian.rule={EXAMPLES}/own_rule/evolved_rule.py:Layered", "hebbian.N=0.0001"]
    done("evolve", *own, *SMALL_GA, "hydra.run.dir=evolved")
    genome = files.load_genome("evolved", "obstacles")
    assert genome.plan.told() == "234 weights, 5 grow, 5 leak"
    assert "234 weights, 5 grow, 5 leak" in done("show", "evolved").stdout
    done("evaluate", "genome=evolved", *own, *BRIEF, "hydra.run.dir=out")
    rows = epuckhebb.evaluate(genome.genes, *own, *BRIEF).metrics
    written = metrics("out")
    measured = ["controller", "weight_change_mean", "path_length_m", "fitness"]
    pd.testing.assert_frame_equal(rows[measured], written[measured])
    assert (rows.weight_change_mean[rows.controller == "layered"] > 0).all()
    champion, _ = epuckhebb.evolve(*own, *SMALL_GA)
    np.testing.assert_array_equal(champion, genome.genes)
    refused = call("evaluate", *own, *BRIEF)
    assert refused.exit_code == 2
    assert "takes grow, leak from the genome" in refused.stderr


# Mistakes


HEAD = MY_RULES.partition("    @static")[0]
WRONG_RULES = {
    "syntax.py": "x = 1\ndef f(:\n",
    "raising.py": "x = 1\nraise RuntimeError('boom')\n",
    "unknown.py": HEAD + "    @staticmethod\n    def synapse(prae, post):\n        return prae\n",
    "uncompiled.py": HEAD + "    @staticmethod\n    def synapse(pre, post):\n        return open(pre) + post\n",
    "array.py": f"import numpy as np\n{HEAD}    @staticmethod\n    def synapse(pre):\n        return sum(np.ones(2))\n",
    "nothing.py": "x = 1\n",
    "text.txt": "x = 1\n",
}
BAD = {
    "no such rule file": (["hebbian.rule=nowhere.py:oja"], ["hebbian.rule=", "there is no file", "nowhere.py"]),
    "a rule file with an error of syntax": (["hebbian.rule=syntax.py:oja"], ["syntax.py, line 2", "SyntaxError"]),
    "a rule file that raises": (["hebbian.rule=raising.py:oja"], ["raising.py, line 2", "RuntimeError: boom"]),
    "a rule file that is no Python": (["hebbian.rule=text.txt:oja"], ["text.txt", ".py"]),
    "a rule file without the name": (["hebbian.rule=my_rules.py:hebb"], ["no rule hebb", "it has oja"]),
    "a rule file without any rule": (["hebbian.rule=nothing.py:oja"], ["no rule oja", "none at all"]),
    "a rule file without a name": (["hebbian.rule=my_rules.py"], ["FILE.py:NAME", "differential"]),
    "a rule that asks for something else": (["hebbian.rule=unknown.py:oja"], ["asks for prae", "pre, post, weight"]),
    "a rule that does not compile": (["hebbian.rule=uncompiled.py:oja"], ["oja", "uncompiled.py", "open"]),
    "a rule that makes an array": (["hebbian.rule=array.py:oja"], ["oja", "array.py", "it makes an array", "kept"]),
    "not a setting of one's rule": ([*OJA, "hebbian.decya=1"], ["hebbian.decya", "did you mean decay?"]),
    "not a number for one's rule": ([*OJA, "hebbian.decay=fast"], ["hebbian.decay must be a number", "fast"]),
    "a rule of one's own below compare": (["compare.a={rule: nowhere.py:b}"], ["compare.a.rule=", "nowhere.py"]),
    "a setting of another rule": (["hebbian=oja", "hebbian.trace_decay=1"], ["hebbian.trace_decay", "rule oja"]),
    "layers that do not fit the robot": (["network.layers=[15,4,2]"], ["begin with 16", "epuck", "[15, 4, 2]"]),
    "layers with three wheels": (["network.layers=[16,4,3]"], ["network.layers", "the last of them 2"]),
    "layers that do not fit the genome": (["network.layers=[16,4,2]"], ["[16, 7, 5, 8, 4, 2]", "[16, 4, 2]"]),
    "a champion for another robot": (["robot=epuck_lidar"], ["for robot epuck", "epuck_lidar has 32 readings"]),
    "a champion of a LiDAR robot": (["genome=lidar.npz"], ["for robot epuck_lidar", "robot=epuck_lidar"]),
    "an unreachable goal": (["scenario.goals={left: [3, 3]}"], ["the goal of the left", "cannot be reached"]),
    "half a goal": (["scenario.goals={left: [0.3]}"], ["scenario.goals.left must be two numbers", "[0.3]"]),
    "a start in a wall": (["maze.start={x: 0.09, y: -0.2, heading_deg: 90}"], ["maze.start", "in a wall"]),
    "a change after the end of life": (["scenario.changes=[{at_s: 5, light: 1}]"], ["changes[0].at_s", "less than"]),
    "a change of an unknown key": (["scenario.changes=[{at_s: 1, lihgt: 1}]"], ["scenario.changes[0]", "lihgt"]),
    "a change to what cannot be": (["scenario.changes=[{at_s: 1, light: -1}]"], ["changes[0]", "scenario.light", "-1"]),
    "a change that is none": (["scenario.changes=[1]"], ["scenario.changes[0]", "at_s"]),
    "the name of the control": (["hebbian.name=GA"], ["the name GA is taken"]),
    "the paper's name, compared": (["+compare.Hebbian={N: 1}"], ["compare.Hebbian", "taken"]),
    "the adaptation's name, compared": (["adaptation=late", "compare.late={N: 1}"], ["the name late is taken"]),
    "a rate for no rule": (["hebbian=none", "hebbian.N=0.01"], ["hebbian.N does nothing", "hebbian=none"]),
    "an unknown group, added": (["+hebian.N=0.9"], ["hebian", "did you mean hebbian?"]),
    "an unknown key, added": (["+repeat=50"], ["repeat ", "did you mean repeats?"]),
    "an unknown setting, added": (["+hebbian.trace_decya=1"], ["hebbian.trace_decya", "did you mean trace_decay?"]),
    "a key without its group": (["light=0.4"], ["light", "scenario.light"]),
    "no name of a rule": (["hebbian=null"], ["hebbian=null", "must be one of", "paper"]),
    "no name of a scenario": (["scenario=5"], ["scenario=5", "must be one of", "4obstacles"]),
    "no name of a lifetime": (["lifetime=null"], ["lifetime=null", "evaluate"]),
    "no name of a rule in a multirun": (["-m", "hebbian=paper,null"], ["hebbian=null", "must be one of"]),
    "no names below compare": (["compare=[1]"], ["compare"]),
    "no settings below compare": (["compare.a=5"], ["compare.a must be settings of a rule", "5"]),
    "an unknown adaptation below compare": (
        ["compare.a={adaptation: latte}"],
        ["compare.a.adaptation", "late, late_steady", "latte"],
    ),
    "an unknown setting of one": (["compare.a={adaptation: {treshold: 1}}"], ["compare.a.adaptation.treshold"]),
    "a setting without a signal, below compare": (
        ["compare.a={adaptation: {threshold: 1}}"],
        ["compare.a", "threshold does nothing"],
    ),
    "a threshold without a signal": (["adaptation.threshold=2"], ["adaptation.threshold does nothing", "lateness"]),
    "exploration without a signal": (["adaptation.motor_noise=2"], ["adaptation.motor_noise does nothing"]),
    "rests without a signal": (["adaptation.active_s=1", "adaptation.rest_s=1"], ["adaptation.active_s does nothing"]),
    "rests without activity": (["adaptation=late_steady", "adaptation.rest_s=1"], ["adaptation.active_s above 0"]),
    "what the program fills in": (["changed=mine"], ["changed is filled in by the program"]),
}  # fmt: skip


@pytest.mark.parametrize("mistake", BAD)
def test_a_mistake_gets_one_message_and_leaves_nothing(here, mistake):
    words, expected = BAD[mistake]
    for name, text in WRONG_RULES.items():
        (here / name).write_text(text)
    if "genome=lidar.npz" in words:
        np.savez("lidar.npz", genome=np.zeros(280), layers=[32, 8, 2], robot="epuck_lidar", lights=8)
    before = {file for file in here.rglob("*") if "__pycache__" not in file.parts}
    result = call("evaluate", *words, *BRIEF)
    assert result.exit_code == 2, result.output
    for text in expected:
        assert text in result.stderr
    assert result.stderr.startswith("Error: ")
    assert "\nError: " not in result.stderr
    assert len(result.stderr.splitlines()) <= 10
    assert "Traceback" not in result.output
    assert result.stdout == ""
    assert {file for file in here.rglob("*") if "__pycache__" not in file.parts} == before


def test_weights_that_are_nan_fail_loudly(here, monkeypatch):
    """As a rule would make them; it takes a kernel of its own to do that, so they are born so."""
    monkeypatch.setattr(block, "weights_at_birth", lambda genes: np.full_like(genes, np.nan))
    result = call("evaluate", *OJA, *BRIEF, "hydra.run.dir=out")
    assert result.exit_code == 1, result.output
    for text in ("left trial", "scenario base", "controller GA", "nan", "step"):
        assert text in result.stderr
    status = runs.status_of(here / "out")
    assert status["state"] == "failed"
    assert "controller GA" in status["error"]
    assert not (here / "out" / "metrics.csv").exists()


# What is compared, and what is called how


@pytest.mark.parametrize(("scenario", "rate"), [("base", 0.000015), ("lowlight", 0.002)])
def test_what_is_compared_runs_at_the_papers_rate_of_its_scenario(scenario, rate):
    words = [f"scenario={scenario}", "compare.x={sign: shuffled}", "compare.y={adaptation: late}"]
    paper, x, y = typed(composed("evaluate", words), EvaluateConfig).controllers
    assert (paper.name, x.name, y.name) == ("Hebbian", "x", "y")
    assert paper.rule.N == x.rule.N == y.rule.N == rate
    assert (x.rule.sign.name, y.rule.sign.name) == ("shuffled", "hebbian")
    assert (y.adaptation.change_signal, y.adaptation.active_s, y.adaptation.motor_noise) == ("lateness", 10, 2)
    assert not x.adaptation.needs_baseline


@pytest.mark.parametrize(
    ("words", "name", "rule", "rate"),
    [
        ([], "Hebbian", "Paper", 0.000015),
        (["hebbian.sign=anti"], "anti-Hebbian", "Paper", 0.000015),
        (["hebbian=mild"], "mild", "Paper", 0.0002),
        (["hebbian=bcm"], "bcm", "BCM", 0.000015),
        (["hebbian=bcm", "hebbian.sign=shuffled"], "bcm (shuffled)", "BCM", 0.000015),
        (["adaptation=late"], "late", "Paper", 0.0005),
        (["adaptation=novelty"], "novelty", "Paper", 0.0002),
        (["adaptation=late", "hebbian=oja"], "late", "Oja", 0.000015),
        (["adaptation=late", "hebbian=none"], "late", "NoRule", 0),
        (["adaptation=late", "hebbian.N=0.1"], "late", "Paper", 0.1),
        (["hebbian.name=mine"], "mine", "Paper", 0.000015),
        (["adaptation.change_signal=novelty", "adaptation.name=mine"], "mine", "Paper", 0.000015),
    ],
)
def test_a_controller_is_called_as_in_tables(words, name, rule, rate):
    (controller,) = typed(composed("evaluate", words), EvaluateConfig).controllers
    assert (controller.name, type(controller.rule).__name__.lower(), controller.rule.N) == (name, rule.lower(), rate)


@pytest.mark.thorough
def test_an_adaptation_lives_beside_what_is_compared(here):
    done("evaluate", "adaptation=shortfall", "compare.y={adaptation: late}", *BRIEF, "hydra.run.dir=out")
    assert list(metrics(here / "out").controller.unique()) == ["GA", "shortfall", "y"]


# What changed


@pytest.mark.parametrize(
    ("words", "changed"),
    [
        ([], ""),
        (["scenario.light=0.1"], ""),
        (["scenario.goals={left: null}"], ""),
        (["scenario.goals={left: [-0.36, 0.155]}"], ""),
        (["scenario=4obstacles", "scenario.obstacles=4"], ""),
        (["scenario.left_wheel=0.8"], "left_wheel=0.8"),
        (["scenario.light=1.0", "scenario.lamp.beam_rad=1.2"], "light=1, lamp.beam_rad=1.2"),
        (["scenario.changes=[{at_s: 1, light: 1.0}]"], "light=1 at 1 s"),
        (["maze=t_maze_wide"], "maze=t_maze_wide"),
        (["maze=double_t", "robot=epuck_lidar"], "maze=double_t, robot=epuck_lidar"),
        (["scenario=lowlight", "hebbian=oja", "seed=3"], ""),
    ],
)
def test_what_differs_from_the_named_scenario_is_told(words, changed):
    cfg = composed("evaluate", words)
    assert cfg.changed == changed
    assert cfg.scenario.name == (words[0].partition("=")[2] if words and words[0].startswith("scenario=") else "base")


def test_what_changed_is_told_wherever_the_scenario_is(here):
    done("evaluate", "scenario.left_wheel=0.8", *SHORT)
    (run,) = (here / "runs" / "evaluate").iterdir()
    assert run.name.endswith("_base+left_wheel-0.8+lifetime.duration_s-2_seed1")
    assert set(metrics(run).changed) == {"left_wheel=0.8, lifetime.duration_s=2"}
    assert set(metrics(run).scenario) == {"base"}
    done("replay", str(run))
    told = "base (left_wheel=0.8, lifetime.duration_s=2)"
    assert told in (run / "replay.html").read_text()
    assert told in done("show", str(run)).stdout.replace("\n", " ")
    assert "same bytes" in done("rerun", str(run)).stdout


@pytest.mark.thorough
@pytest.mark.usefixtures("here")
def test_a_sweep_in_another_maze_with_another_rule():
    """Nothing of the usual maze and rule is left in a job."""
    words = ["sweep", "obstacles", "scenario=base", "maze=double_t", "hebbian=differential", *BRIEF]
    done(*words, "hydra/launcher=basic", "hydra.sweep.dir=out")
    rows = pd.read_csv("out/sweep.csv")
    assert set(rows.changed) == {"maze=double_t, lifetime.duration_s=2"}
    assert set(rows.controller) == {"GA", "differential"}


@pytest.mark.usefixtures("here")
def test_a_scenario_of_ones_own_has_the_name_of_its_file():
    done("evaluate", "scenario=dusk", *BRIEF, *a_folder_of_conf())
    (run,) = Path("runs/evaluate").iterdir()
    assert run.name.endswith("_dusk+lifetime.duration_s-2_seed1")
    rows = pd.read_csv(run / "metrics.csv", keep_default_na=False)
    assert set(zip(rows.scenario, rows.light, rows.changed, strict=True)) == {("dusk", 0.05, "lifetime.duration_s=2")}
    assert composed("evaluate", ["scenario=dusk", "scenario.light=1"], "conf").changed == "light=1"


# Other robots and networks


@pytest.fixture(scope="module")
def others(tmp_path_factory):
    """Champions of a robot with a LiDAR, and of a small network."""
    folder = tmp_path_factory.mktemp("others")
    done("evolve", "robot=epuck_lidar", *SMALL_GA, f"hydra.run.dir={folder}/lidar")
    done("evolve", "network.layers=[16,10,6,2]", *SMALL_GA, f"hydra.run.dir={folder}/small")
    return folder


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("name", "layers", "robot", "genes", "words"),
    [
        ("lidar", (32, 7, 5, 8, 4, 2), "epuck_lidar", 346, ["adaptation=novelty"]),
        ("small", (16, 10, 6, 2), "epuck", 242, []),
    ],
)
def test_a_champion_of_another_robot_or_network(others, here, name, layers, robot, genes, words):
    genome = files.load_genome(str(others / name), "obstacles")
    assert (genome.network.layers, genome.robot, len(genome.genes)) == (layers, robot, genome.plan.genes)
    assert genome.network.synapses == len(genome.weights)
    assert genome.baseline.reading_mean.shape == (2, layers[0])
    shown = " ".join(done("show", str(others / name)).stdout.split())
    assert f"robot {robot}" in shown
    assert "-".join(map(str, layers)) in shown
    done("evaluate", f"genome={others / name}", f"robot={robot}", *words, *SHORT, "hydra.run.dir=out")
    with np.load(here / "out" / "traces.npz") as traces:
        assert traces["sensors"].shape[-1] == layers[0]
        assert tuple(traces["layers"]) == layers
    done("replay", "out")
    assert (here / "out" / "replay.html").stat().st_size > 10_000
    done("show", "out")
    assert "same bytes" in done("rerun", "out").stdout
    assert genes == len(genome.genes)


def test_bundled_champions_of_version_0_1_load():
    with np.load(files.data_folder("runs/reference") / "champion_light.npz") as arrays:
        assert "robot" not in arrays
        genes = arrays["genome"]
    genome = files.load_genome("reference", "light")
    np.testing.assert_array_equal(genome.genes, genes)
    assert (genome.robot, genome.lights, genome.network.layers) == ("epuck", 8, (16, 7, 5, 8, 4, 2))
    assert genome.baseline.scenario == "highlight"


# A change in mid-life


@pytest.mark.thorough
def test_a_change_in_mid_life_from_end_to_end(here):
    change = "scenario.changes=[{at_s: 1, light: 1.0}, {at_s: 1.5, obstacles: 4}]"
    done("evaluate", change, *SHORT, "hydra.run.dir=run")
    assert set(metrics("run").changed) == {"light=1 at 1 s, obstacles=4 at 1.5 s, lifetime.duration_s=2"}
    with np.load("run/traces.npz") as traces:
        early = traces["time"][0] < 0.9 if traces["time"].ndim > 1 else traces["time"] < 0.9
        lit = traces["sensors"][0, :, :8].mean(axis=1)
    assert lit[~early][-1] != pytest.approx(lit[early].mean(), rel=0.05)
    done("evaluate", *SHORT, "hydra.run.dir=steady")
    assert not metrics("run").drop(columns="changed").equals(metrics("steady").drop(columns="changed"))
    assert (here / "run" / "figures" / "trajectories.png").read_bytes().startswith(b"\x89PNG")
    done("replay", "run")
    assert "light=1 at 1 s" in (here / "run" / "replay.html").read_text()
    assert "same bytes" in done("rerun", "run").stdout


# The files of conf/


@pytest.mark.parametrize("robot", groups("evaluate")["robot"])
@pytest.mark.parametrize("maze", groups("evaluate")["maze"])
@pytest.mark.parametrize(("verb", "schema"), first_of([("evaluate", EvaluateConfig), ("evolve", EvolveConfig)]))
def test_every_maze_with_every_robot(verb, schema, maze, robot):
    config = typed(composed(verb, [f"maze={maze}", f"robot={robot}"]), schema)
    assert (config.world.maze.name, config.world.robot.name) == (maze, robot)


RULES, ADAPTATIONS = groups("evaluate")["hebbian"], groups("evaluate")["adaptation"]


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("hebbian", "adaptation"),
    sorted({*itertools.product(RULES, ["none", "late"]), *itertools.product(["none", "paper"], ADAPTATIONS)}),
)
def test_adaptations_over_rules(hebbian, adaptation):
    config = typed(composed("evaluate", [f"hebbian={hebbian}", f"adaptation={adaptation}"]), EvaluateConfig)
    assert len(config.controllers) == ((hebbian, adaptation) != ("none", "none"))
    for controller in config.controllers:
        assert controller.adaptation.acts == (adaptation != "none")
        assert (controller.rule.N > 0) == (hebbian != "none")


def controllers(*words):
    return typed(composed("evaluate", list(words)), EvaluateConfig).controllers


def test_what_is_compared_by_its_name_is_what_the_name_alone_gives():
    main, *others = controllers("scenario=lowlight", "compare=[late,best,homeostasis,oja,mild]")
    assert main.name == "Hebbian"
    for other in others:
        group = "hebbian" if other.name in ("oja", "mild") else "adaptation"
        (alone,) = controllers("scenario=lowlight", f"{group}={other.name}")
        assert other == alone


@pytest.mark.parametrize("name", ["none", "paper"])
def test_none_beside_an_adaptation_is_the_papers_rule(name):
    late, beside = controllers("adaptation=late", f"compare=[{name}]")
    assert (late.name, beside) == ("late", controllers()[0])


def test_what_lives_anyway_is_not_compared_twice():
    assert [one.name for one in controllers("compare=[late,none]")] == ["Hebbian", "late"]
    assert [one.name for one in controllers("adaptation=late", "compare=[late,none]")] == ["late", "Hebbian"]
