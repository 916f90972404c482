"""What differs in a world is named; other robots and networks; a change during a lifetime."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cases import SHORT, SMALL_GA, call, done

import epuckhebb
from epuckhebb.config.compose import composed
from epuckhebb.controller import genotype
from epuckhebb.runs.evaluate import inherit_choices
from epuckhebb.store.genome import load_genome
from epuckhebb.store.run import Run

ONE_GENERATION = [*SMALL_GA, "ga.generations=1"]
BRIEF = ["lifetime.duration_s=2", "lifetime.record_every=0", "repeats=1"]


def metrics(run):
    return pd.read_csv(Path(run) / "metrics.csv", keep_default_na=False, na_values=[""])


def test_weights_that_are_nan_fail_loudly(here, monkeypatch):
    """As a rule would make them; it takes a kernel of its own to do that, so the initial ones are."""
    monkeypatch.setattr(genotype, "starting_weights", lambda genes: np.full_like(genes, np.nan))
    result = call("evaluate", *BRIEF, "hydra.run.dir=out")
    assert result.exit_code == 1, result.output
    for text in ("left trial", "scenario base", "controller GA", "nan", "step"):
        assert text in result.stderr
    status = Run(here / "out").status
    assert status["state"] == "failed"
    assert "controller GA" in status["error"]
    assert not (here / "out" / "metrics.csv").exists()


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


@pytest.mark.usefixtures("here")
def test_a_scenario_of_ones_own_has_the_name_of_its_file():
    Path("conf/scenario").mkdir(parents=True)
    Path("conf/scenario/dusk.yaml").write_text("defaults: [base, _self_]\nlight: 0.05\n")
    done("evaluate", "scenario=dusk", *BRIEF, "--config-dir", "conf")
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
        assert inherit_choices(words, "conf") == [*words, *([f"robot={robot}"] if robot else [])]
    for named in ("robot=epuck", "robot.radius_m=0.04"):
        assert inherit_choices(["genome=lidar.npz", named]) == ["genome=lidar.npz", named]
    assert "robot:\n  name: epuck_lidar" in done("evaluate", "genome=lidar.npz", "--cfg=job").stdout
    with pytest.raises(ValueError, match="unlike epuck_lidar"):
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
