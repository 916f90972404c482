"""`epuckhebb export --webots`: the controller drives as our own robot does, given what that one felt."""

import importlib.util
import json
import re
import sys
import types
from pathlib import Path

import numpy as np
import pytest
from cases import done, first_of, refused

import epuckhebb
from epuckhebb.controller.forward_pass import forward_pass
from epuckhebb.controller.network import PAPER_NETWORK
from epuckhebb.export.webots import left_out
from epuckhebb.store import genome
from epuckhebb.tmaze.scenario import Scenario

ROOT = Path(__file__).parents[1]
SECONDS = 6.4


class StandIn:
    """The devices of Webots, which give back what one of our robots felt, step by step, and note the commands."""

    def __init__(self, sensors, pose):
        self.sensors, self.pose, self.now, self.speeds = sensors, pose, -1, []
        self.module = types.ModuleType("controller")
        self.module.Robot = lambda: self

    def getDevice(self, name):  # noqa: N802  # as Webots has it
        return Device(self, name)

    def step(self, duration):
        assert duration == 32
        self.now += 1
        return 0 if self.now < len(self.sensors) else -1


class Device:
    def __init__(self, robot, name):
        self.robot, self.name = robot, name

    def enable(self, period):
        assert period == 32

    def getValue(self):  # noqa: N802
        number = int(self.name[2])
        scale, first = (4095.0, 0) if self.name.startswith("ls") else (2000.0, 8)
        return scale * self.robot.sensors[self.robot.now, first + number]

    def getValues(self):  # noqa: N802
        x, y, _ = self.robot.pose[self.robot.now]
        return [x, y, 0.0]

    def setPosition(self, position):  # noqa: N802
        assert position == np.inf

    def setVelocity(self, speed):  # noqa: N802
        if self.robot.now >= 0:
            self.robot.speeds.append(speed)


def played(monkeypatch, controller, traces, lifetime, side):
    """Let the controller drive through a lifetime; returns its speeds and its weights in the end."""
    robot = StandIn(traces["sensors"][lifetime], traces["pose"][lifetime])
    monkeypatch.setitem(sys.modules, "controller", robot.module)
    monkeypatch.setattr(sys, "argv", ["champion.py", side])
    spec = importlib.util.spec_from_file_location("played", controller)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    players = []

    class Noted(module.Player):
        def __init__(self, *told):
            super().__init__(*told)
            players.append(self)

    module.Player = Noted
    module.main()
    weights = np.concatenate([np.ravel(rows) for rows in players[0].weights])
    return np.reshape(robot.speeds, (-1, 2)), weights


@pytest.mark.parametrize("signal", first_of(["behaviour", "final", "lifetime_mean", "light_code"]))
@pytest.mark.usefixtures("here")
def test_the_controller_drives_and_learns_as_our_robot(monkeypatch, signal):
    words = [f"hebbian.signal={signal}", "hebbian.N=0.002", "repeats=1", "lifetime.record_every=1", "seed=3"]
    fast = ["lifetime.gain_rad_s=5", f"lifetime.duration_s={SECONDS}"]
    start = "maze.start={x: 0.03, y: 0.15, heading_deg: 30}"  # soon in the arm: the junction term matters
    result = done("evaluate", *words, *fast, start, "hydra.run.dir=run", "-q")
    result = done("export", "run", "--webots", "-o", "controllers/mine")
    *written, following = result.stdout.splitlines()
    assert written == [f"controllers/mine/{name}" for name in ("mine.py", "champion.json", "genes.npy", "mine.wbt")]
    assert all(map(Path.is_file, map(Path, written)))
    assert "move mine.wbt into its worlds/" in following
    world = Path(written[-1]).read_text()
    assert world.count('name "wall ') == 9
    assert world.count("{") == world.count("}")
    assert "  translation 0.03 0.15 0\n  rotation 0 0 1 0.523599\n" in world
    with np.load("run/traces.npz") as held:
        traces = dict(held)
    for lifetime, (controller, side) in enumerate(zip(traces["controller"], traces["side"], strict=True)):
        if controller == "GA":
            continue
        speeds, weights = played(monkeypatch, "controllers/mine/mine.py", traces, lifetime, side)
        np.testing.assert_allclose(speeds, 5 * traces["motors"][lifetime], rtol=0, atol=1e-9)
        np.testing.assert_allclose(weights, traces["weights"][lifetime, -1], rtol=0, atol=1e-6)
        assert np.abs(weights - traces["genome"]).sum() > 1
    if signal == "behaviour":
        x, y, _ = traces["pose"][-1, -1]
        assert x > 0.08
        assert y > 0.1


@pytest.mark.usefixtures("here")
def test_the_order_of_the_genes_is_that_of_the_page():
    (script,) = re.findall(
        r"^```python\n(.*?)^```$", (ROOT / "docs" / "webots.md").read_text(), re.MULTILINE | re.DOTALL
    )
    done("export", "reference_7", "--webots", "-o", "controllers/genes_only")
    names = {}
    exec(script, names)
    readings, first = np.random.default_rng(1).random(16), names["first"]
    genes = epuckhebb.load("reference_7")
    activation, drive = np.zeros(PAPER_NETWORK.neurons), np.zeros(PAPER_NETWORK.neurons)
    activation[:17] = [*readings, 1]
    forward_pass(PAPER_NETWORK)(genes, activation, drive)
    np.testing.assert_allclose(activation[17:24], np.tanh(readings @ first[:16] + first[16]), atol=1e-12)


@pytest.mark.usefixtures("here")
def test_a_champion_is_played_without_plasticity_with_genes_in_their_order():
    done("export", "reference_7", "--webots")
    told = json.loads(Path("epuckhebb_champion/champion.json").read_text())
    assert told["rule"] is None
    genes = np.load("epuckhebb_champion/genes.npy")
    np.testing.assert_array_equal(genes, genome.load_genome("reference_7", "obstacles").genes)
    np.testing.assert_array_equal(genes, told["weights"])


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["reference"], "type `epuckhebb export reference --webots`"),
        (["nowhere", "--webots"], "nowhere does not exist"),
        (["late", "--webots"], "controller late: Webots has"),
        (["reference", "--webots", "-o", "late"], "late holds files already"),
    ],
)
def test_what_cannot_be_exported_is_refused(here, words, message):
    short = ["lifetime.duration_s=0.064", "repeats=1", "lifetime.record_every=0", "-q"]
    done("evaluate", "adaptation=late", *short, "hydra.run.dir=late")
    assert message in refused("export", *words)
    assert sorted(path.name for path in here.iterdir()) == ["late"]


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("word", "wanted"), [("hebbian=carried", "hebbian.carries_history=false"), ("hebbian.every=2", "hebbian.every=1")]
)
def test_what_the_controller_for_webots_does_not_do_is_refused(word, wanted):
    short = ["lifetime.duration_s=0.064", "repeats=1", "lifetime.record_every=0", "-q"]
    done("evaluate", word, *short, "hydra.run.dir=run")
    assert wanted in refused("export", "run", "--webots", "-o", "c")


def test_a_champion_of_another_robot_is_named_by_it(here):
    small = ["ga.population=6", "ga.generations=2", "ga.elites=2", "ga.loops=1", "lifetime.duration_s=3"]
    done("evolve", "robot=epuck_lidar", *small, "scenario.paper_duration_s=10", "figures=none", "hydra.run.dir=evolved")
    assert "evolved is for robot epuck_lidar; only epuck" in refused("export", "evolved", "--webots", "-o", "c")
    assert not (here / "c").exists()


def test_what_the_files_for_webots_leave_out_is_named():
    """Each setting of a scenario is in the files, or named where it differs from the paper's."""
    broken = {"left_slip": 0.3, "dead_sensors": (3,), "distance_gain": 0.5, "right_wheel": 0.8, "mass_ratio": 2.0}
    assert left_out(Scenario()) == []
    assert left_out(Scenario(light=0.5, obstacles=4, sun_turn_deg=3.0)) == []
    assert sorted(left_out(Scenario(**broken))) == sorted(f"scenario.{name}" for name in broken)


@pytest.mark.usefixtures("here")
def test_an_export_says_what_it_leaves_out():
    short = ["lifetime.duration_s=0.064", "repeats=1", "lifetime.record_every=0", "-q"]
    done("evaluate", "scenario.left_slip=0.3", *short, "hydra.run.dir=run")
    assert "scenario.left_slip" in done("export", "run", "--webots").stdout
