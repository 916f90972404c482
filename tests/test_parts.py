"""Parts that a user brings or changes: a rule from a file, what differs in a world, other robots and networks."""

import hashlib
import json
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cases import SHORT, SMALL_GA, call, done, first_of, refused

import epuckhebb
from epuckhebb.config.compose import composed
from epuckhebb.runs.evaluate import as_evolved
from epuckhebb.store.genome import load_genome
from epuckhebb.store.run import Run
from epuckhebb.tmaze import session

ONE_GENERATION = [*SMALL_GA, "ga.generations=1"]
BRIEF = ["lifetime.duration_s=2", "lifetime.record_every=0", "repeats=1"]
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


def metrics(run):
    return pd.read_csv(Path(run) / "metrics.csv", keep_default_na=False, na_values=[""])


def hashes(run):
    """The SHA-256 of the user's files that a run says that it used."""
    told = json.loads((Path(run) / "provenance.json").read_text())
    return [sha256 for own in told["own_code"].values() for sha256 in own["sha256"].values()]


def copies(run, name="my_rules.py"):
    """The texts of the copies of a file in a run folder."""
    return [file.read_text() for file in sorted(Path(run).glob(f"own_code/*/{name}"))]


@pytest.fixture
def own(here):
    """A folder with a rule of one's own."""
    (here / "my_rules.py").write_text(MY_RULES)
    return here


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A folder with a rule of one's own, and runs by it: `evaluated`, and `evolved` from scratch; not to be changed."""
    folder = tmp_path_factory.mktemp("own")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        Path("my_rules.py").write_text(MY_RULES)
        done("evaluate", *OJA, "hebbian.decay=2", "scenario=4obstacles", *SHORT, "hydra.run.dir=evaluated")
        done("evolve", *OJA, *ONE_GENERATION, "hydra.run.dir=evolved")
    return folder


# A rule of one's own


def test_a_rule_of_ones_own_lives_and_is_kept(runs):
    run = runs / "evaluated"
    rows = metrics(run)
    assert list(rows.controller.unique()) == ["GA", "oja"]
    plastic = rows[rows.controller == "oja"]
    assert set(plastic.N) == {0.0001}
    assert (plastic.weight_change_mean > 0).all()
    assert copies(run) == [MY_RULES]
    assert hashes(run) == [hashlib.sha256(MY_RULES.encode()).hexdigest()]
    config = (run / ".hydra" / "config.yaml").read_text()
    assert "decay: 2" in config
    assert "trace_decay" not in config  # is the paper's rule's


@pytest.mark.parametrize(("run", "after"), first_of([("evaluated", "changed"), ("evolved", "removed")]))
def test_a_rerun_takes_the_copy(copy, run, after):
    if after == "changed":
        (copy / "my_rules.py").write_text(ANOTHER)
    else:
        (copy / "my_rules.py").unlink()
    assert "bit-identical" in done("rerun", run).stdout
    (again,) = (copy / "runs").glob("*/*")
    assert copies(again) == [MY_RULES]
    assert hashes(again) == hashes(run)
    assert "bit-identical" in done("rerun", str(again)).stdout


@pytest.mark.parametrize("copied", [ANOTHER, None])
def test_a_copy_that_was_changed_or_lost_is_refused(copy, copied):
    (file,) = copy.glob("evaluated/own_code/*/my_rules.py")
    if copied:
        file.write_text(copied)
    else:
        file.unlink()
    assert "my_rules.py" in refused("rerun", "evaluated")
    assert not (copy / "runs").exists()


@pytest.mark.usefixtures("own")
def test_an_evolution_does_not_go_on_with_another_rule():
    words = [*ONE_GENERATION, "lifetime.duration_s=0.1"]
    done("evolve", *OJA, *words, "hydra.run.dir=evolved")
    Path("my_rules.py").write_text(ANOTHER)
    assert "my_rules.py, or a file that it imports, is not what evolved began with" in refused(
        "evolve", "resume=evolved", "ga.generations=2", "-q"
    )


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


@pytest.mark.usefixtures("own")
def test_in_a_file_of_ones_own():
    done("evaluate", "hebbian=mine", *BRIEF, "hydra.run.dir=out", *a_folder_of_conf())
    rows = metrics("out")
    assert list(rows.controller.unique()) == ["GA", "mine"]
    assert set(rows[rows.controller == "mine"].N) == {0.0003}


@pytest.mark.usefixtures("own")
def test_below_compare():
    own = [
        "compare.own={rule: my_rules.py:oja, N: 0.0001}",
        "compare.more={rule: my_rules.py:oja, N: 0.0001, decay: 2}",
    ]
    done("evaluate", "hebbian=none", *own, *BRIEF, "hydra.run.dir=out")
    rows = metrics("out")
    assert list(rows.controller.unique()) == ["GA", "own", "more"]
    assert copies("out") == [MY_RULES]
    done("evaluate", *OJA, *BRIEF, "hydra.run.dir=alone")
    measured = ["weight_change_mean", "path_length_m", "fitness"]
    alone = metrics("alone")
    np.testing.assert_array_equal(rows[rows.controller == "own"][measured], alone[alone.controller == "oja"][measured])


@pytest.mark.thorough
@pytest.mark.usefixtures("own")
def test_in_a_sweep_and_changed_it_makes_new_jobs():
    words = ["sweep", "rates", *BRIEF, "hydra/launcher=basic", "hydra.sweep.dir=out", *a_folder_of_conf()]
    assert "0 done before, 2 to do" in done(*words).stderr
    assert "2 done before, 0 to do" in done(*words).stderr
    assert set(pd.read_csv("out/sweep.csv").controller) == {"GA", "mine"}
    Path("my_rules.py").write_text(MY_RULES + "\n# only a remark\n")
    assert "0 done before, 2 to do" in done(*words).stderr
    assert len(list(Path("out").glob("job_*"))) == 4


@pytest.mark.thorough
@pytest.mark.usefixtures("here")
def test_what_a_rule_evolves_goes_with_the_champion():
    """In a file and in Python; a champion that lacks it is refused."""
    own = [f"hebbian.rule={EXAMPLES}/own_rule/evolved_rule.py:Layered", "hebbian.N=0.0001"]
    done("evolve", *own, *ONE_GENERATION, "hydra.run.dir=evolved")
    genome = load_genome("evolved", "obstacles")
    assert genome.plan.text() == "234 weights, 5 grow, 5 leak"
    assert "234 weights, 5 grow, 5 leak" in done("show", "evolved").stdout
    done("evaluate", "genome=evolved", *own, *BRIEF, "hydra.run.dir=out")
    rows = epuckhebb.evaluate(genome.genes, *own, *BRIEF).metrics
    written = metrics("out")
    measured = ["controller", "weight_change_mean", "path_length_m", "fitness"]
    pd.testing.assert_frame_equal(rows[measured], written[measured])
    assert (rows.weight_change_mean[rows.controller == "layered"] > 0).all()
    champion, _ = epuckhebb.evolve(*own, *ONE_GENERATION)
    np.testing.assert_array_equal(champion, genome.genes)
    assert "takes grow, leak from the genome" in refused("evaluate", *own, *BRIEF)


def test_weights_that_are_nan_fail_loudly(own, monkeypatch):
    """As a rule would make them; it takes a kernel of its own to do that, so they are born so."""
    monkeypatch.setattr(session, "initial_weights_of", lambda genes: np.full_like(genes, np.nan))
    result = call("evaluate", *OJA, *BRIEF, "hydra.run.dir=out")
    assert result.exit_code == 1, result.output
    for text in ("left trial", "scenario base", "controller GA", "nan", "step"):
        assert text in result.stderr
    status = Run(own / "out").status
    assert status["state"] == "failed"
    assert "controller GA" in status["error"]
    assert not (own / "out" / "metrics.csv").exists()


# What changed


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
    assert "bit-identical" in done("rerun", str(run)).stdout


@pytest.mark.usefixtures("own")
def test_a_scenario_of_ones_own_has_the_name_of_its_file():
    done("evaluate", "scenario=dusk", *BRIEF, *a_folder_of_conf())
    (run,) = Path("runs/evaluate").iterdir()
    assert run.name.endswith("_dusk+lifetime.duration_s-2_seed1")
    rows = pd.read_csv(run / "metrics.csv", keep_default_na=False)
    assert set(zip(rows.scenario, rows.light, rows.changed, strict=True)) == {("dusk", 0.05, "lifetime.duration_s=2")}
    assert composed("evaluate", ["scenario=dusk", "scenario.light=1"], "conf").changed == "light=1"


# Other robots and networks


def test_the_robot_follows_from_the_champion_unless_it_is_named(here):
    for name, robot in (("lidar", "epuck_lidar"), ("mine", "mine"), ("odd", "nobody_has_this")):
        np.savez(f"{name}.npz", genome=np.zeros(280), layers=[32, 8, 2], robot=robot, lights=8)
    (here / "conf" / "robot").mkdir(parents=True)
    (here / "conf" / "robot" / "mine.yaml").write_text("defaults: [epuck_lidar]\n")
    for words, robot in (
        (["genome=lidar.npz"], "epuck_lidar"),
        (["genome=lidar.npz,lidar.npz", "seed=1,2"], "epuck_lidar"),
        (["genome=mine.npz"], "mine"),
        (["genome=odd.npz"], ""),
        (["genome=reference"], ""),
        (["genome=lidar.npz,reference"], ""),
        (["genome=nowhere.npz"], ""),
        (["seed=3"], ""),
    ):
        assert as_evolved(words, "conf") == [*words, *([f"robot={robot}"] if robot else [])]
    for named in ("robot=epuck", "robot.radius_m=0.04"):
        assert as_evolved(["genome=lidar.npz", named]) == ["genome=lidar.npz", named]
    assert "robot:\n  name: epuck_lidar" in done("evaluate", "genome=lidar.npz", "--cfg=job").stdout
    with pytest.raises(ValueError, match="robot epuck_lidar has 8 and 24"):
        epuckhebb.evaluate("lidar.npz", hebbian={"signal": "light_code"}, progress=False)


@pytest.fixture(scope="module")
def others(tmp_path_factory):
    """Champions of a robot with a LiDAR, and of a small network."""
    folder = tmp_path_factory.mktemp("others")
    done("evolve", "robot=epuck_lidar", *ONE_GENERATION, f"hydra.run.dir={folder}/lidar")
    done("evolve", "network.layers=[16,10,6,2]", *ONE_GENERATION, f"hydra.run.dir={folder}/small")
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
    genome = load_genome(str(others / name), "obstacles")
    assert (genome.network.layers, genome.robot, len(genome.genes)) == (layers, robot, genome.plan.genes)
    assert genome.network.synapses == len(genome.weights)
    assert genome.nominal.reading_mean.shape == (2, layers[0])
    shown = " ".join(done("show", str(others / name)).stdout.split())
    assert f"robot {robot}" in shown
    assert "-".join(map(str, layers)) in shown
    done("evaluate", f"genome={others / name}", *words, *SHORT, "hydra.run.dir=out")  # the robot is the champion's
    with np.load(here / "out" / "traces.npz") as traces:
        assert traces["sensors"].shape[-1] == layers[0]
        assert tuple(traces["layers"]) == layers
    done("replay", "out")
    assert (here / "out" / "replay.html").stat().st_size > 10_000
    done("show", "out")
    assert "bit-identical" in done("rerun", "out").stdout
    assert genes == len(genome.genes)


# A change in mid-life
