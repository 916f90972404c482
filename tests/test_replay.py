"""The page that replays recorded lifetimes."""

import base64
import hashlib
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

from epuckhebb.analysis import replay
from epuckhebb.analysis.evaluate import Traces, evaluate
from epuckhebb.analysis.moments import arrival
from epuckhebb.controller.network import Network, starting_weights
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.tmaze.individual import GA, HEBBIAN, Controller, Individual
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.maze import T_MAZE, Box, Maze, Place, Pose, Region
from epuckhebb.tmaze.robot import Robot
from epuckhebb.tmaze.samples import Samples, empty_samples
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.sensors import DistanceSensors, LightSensors
from epuckhebb.tmaze.sensors import Place as Sensor
from epuckhebb.tmaze.session import Session

COLUMNS = {"x": ("pose", 0), "y": ("pose", 1), "heading": ("pose", 2), "left": ("motors", 0), "right": ("motors", 1)}
SAME_NAME = {"sensors": "sensors", "fitness": "fitness", "rate": "rate", "weightChange": "weight_change"}
ARRIVES = Path(__file__).parents[1] / "runs/reference/champions/obstacles_seed001.npz"  # at both goals, always
FOUR = Scenario(name="4obstacles", obstacles=4)


def hebbian(rate):
    return Controller(name=HEBBIAN, rule=Paper(N=rate))


@pytest.fixture(scope="module")
def genes():
    return np.load(ARRIVES)["genome"]


@pytest.fixture(scope="module")
def run(genes):
    """(metrics, traces) of a full lifetime with and without plasticity, on each side."""
    return evaluate(genes, FOUR, [hebbian(1.5e-5)], Lifetime(record_every=8), repeats=1, seed=1)


@pytest.fixture(scope="module")
def page(run, genes):
    return replay.page(run[1], genes, FOUR, "four obstacles", gain_rad_s=1.0)


def filled(genes, scenario=None, seconds=4.0):
    """What the page of short lifetimes holds."""
    world = scenario or Scenario()
    _, traces = evaluate(genes, world, [], Lifetime(duration_s=seconds, record_every=8), repeats=1, seed=1)
    return content(replay.page(traces, genes, world, "title", gain_rad_s=1.0))


def content(page):
    return json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.DOTALL)[1])


def unpacked(packed):
    return packed["step"] * np.frombuffer(base64.b64decode(packed["numbers"]), "<i2").astype(float)


def test_page_needs_nothing_else(page):
    program = re.sub(r'id="data">.*?</script>', "", page, flags=re.DOTALL)
    assert not re.search(r"https?:|@import|\bfetch\b|XMLHttpRequest|import\(|url\(", program)
    assert re.findall(r'\b(?:src|href)="([^"]*)"', program) == ["data:,"]


def test_page_allows_only_its_own_style_and_script(page):
    policy = re.search(r'Content-Security-Policy" content="([^"]*)"', page)[1]
    assert policy.startswith("default-src 'none'; ")
    for tag in ("style", "script"):
        text = re.search(f"<{tag}>(.*?)</{tag}>", page, re.DOTALL)[1]
        digest = base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
        assert f"{tag}-src 'sha256-{digest}'" in policy


def test_page_holds_the_traces_to_within_half_a_step_of_quantisation(run, page, genes):
    _, traces = run
    lives = content(page)["lifetimes"]
    for k, (controller, side) in enumerate(zip(traces.controller, traces.side, strict=True)):
        life = lives[side][[GA, HEBBIAN].index(controller)]
        expected = {name: getattr(traces.samples, array)[k][:, column] for name, (array, column) in COLUMNS.items()}
        expected |= {name: getattr(traces.samples, array)[k] for name, array in SAME_NAME.items()}
        expected["change"] = traces.samples.weights[k] - starting_weights(genes).astype(np.float32)
        for name, values in expected.items():
            if not values.any():
                assert life[name] == {"step": 0, "numbers": ""}, name
                continue
            assert life[name]["step"] <= np.abs(values).max() / 32000, name
            np.testing.assert_allclose(unpacked(life[name]), values.ravel(), atol=0.51 * life[name]["step"], rtol=0)


def test_long_recordings_are_thinned_out():
    lifetime = Lifetime(duration_s=80.0, record_every=1)
    genome = np.random.default_rng(1).uniform(-1, 1, 234)
    _, traces = evaluate(genome, Scenario(), [hebbian(1e-3)], lifetime, repeats=1, seed=1)
    held = content(replay.page(traces, genome, Scenario(), "title", gain_rad_s=1.0))
    assert (held["samples"], held["steps"], held["interval"]) == (834, 3, pytest.approx(0.096))
    x = held["lifetimes"]["right"][1]["x"]
    np.testing.assert_allclose(unpacked(x), traces.samples.pose[3, ::3, 0], atol=x["step"])


def test_a_title_cannot_become_markup():
    _, traces = evaluate(np.zeros(234), Scenario(), [], Lifetime(duration_s=1.0, record_every=8), repeats=1, seed=1)
    page = replay.page(traces, np.zeros(234), Scenario(), "</title><script>alert(1)</script>{{data}}", gain_rad_s=1.0)
    assert "<script>alert" not in page
    assert "{{data}}" in page  # as text, not filled in


def test_arrival_is_the_time_to_goal_of_the_metrics(run, page):
    times = {(row["controller"], row["side"]): row["time_to_goal_s"] for row in run[0]}
    for side, lives in content(page)["lifetimes"].items():
        for controller, life in zip((GA, HEBBIAN), lives, strict=True):
            assert life["arrival"] == pytest.approx(times[controller, side], abs=0.257)


MOVED = {"left": (-0.25, 0.155), "right": (0.1, 0.155)}


def test_arrival_counts_the_goal_of_the_moment(genes):
    """At the goal where it is now, not where it was or will be; and so do the metrics."""
    moving = Scenario(changes=[{"at_s": 30.0, "goals": MOVED}, {"at_s": 70.0, "goals": T_MAZE.goals}])
    metrics, traces = evaluate(genes, moving, [], Lifetime(duration_s=120.0, record_every=8), repeats=1, seed=1)
    for k, row in enumerate(metrics):
        arrived = arrival(Samples(*(array[k] for array in traces.samples)), moving, row["side"])
        assert arrived.time == pytest.approx(row["time_to_goal_s"], abs=0.257)
        assert arrived.stayed == bool(row["success"])


def standing(x, y, *began):
    """What is recorded of a robot that stands at a place for six seconds, in worlds that began at these times."""
    still = empty_samples(6, Network())._replace(time=np.arange(6.0), phase_began=np.array(began))
    still.pose[:, :2] = x, y
    return still


def test_a_goal_that_comes_to_the_robot_is_an_arrival():
    world = Scenario(changes=[{"at_s": 3.0, "goals": MOVED}])
    arrived = arrival(standing(-0.25, 0.155, 0.0, 94 * 0.032), world, "left")
    assert (arrived.time, arrived.stayed) == (4.0, True)
    assert arrival(standing(-0.25, 0.155, 0.0), Scenario(), "left").time is None


def test_new_walls_wait_for_the_robot_to_move_away(genes):
    """And so does the light that changes meanwhile."""
    start = Pose(-0.114, 0.16, 0.0)  # below the obstacle of the left arm
    world = Scenario(changes=[{"at_s": 0.1, "obstacles": 4}, {"at_s": 0.2, "light": 1.0}])
    began = []
    for weights in (genes, np.zeros(234)):
        individual = Individual(genes=weights, side="left", key=np.uint64(1), start=start, record=True)
        session = Session(individual, world, Lifetime(duration_s=60.0, gain_rad_s=4.0, record_every=8))
        session.step(10_000)
        began.append(session.samples.phase_began.tolist())
    moving, still = began
    assert moving[0] == still[0] == 0.0
    assert 0.2 < moving[1] == moving[2] < 60.0
    assert np.isnan(still[1:]).all()


def test_page_holds_the_world_of_each_moment(genes):
    world = Scenario(
        changes=[
            {"at_s": 1.0, "light": 1.0, "dead_sensors": [3]},
            {
                "at_s": 2.0,
                "obstacles": 2,
                "lamp": {"towards_x": 0.0, "towards_y": 1.0},
                "left_wheel": 0.7,
                "left_slip": 0.2,
            },
            {"at_s": 3.0, "goals": MOVED, "distance_gain": 0.75, "mass_ratio": 2, "wall_friction": 0.3},
        ]
    )
    data = filled(genes, world)
    assert [change["text"] for change in data["changes"]] == [
        "light=1.0, dead_sensors=[3]",
        "obstacles=2, lamp={'towards_x': 0.0, 'towards_y': 1.0}, left_wheel=0.7, left_slip=0.2",
        f"goals={MOVED}, distance_gain=0.75, mass_ratio=2, wall_friction=0.3",
    ]
    worlds = data["worlds"]
    assert [held["light"] for held in worlds] == [0.1, 1.0, 1.0, 1.0]
    assert [held["dead"] for held in worlds] == [[], [3], [3], [3]]
    assert [len(held["obstacles"]) for held in worlds] == [0, 0, 2, 2]
    assert [held["lamp"]["towards"] for held in worlds] == pytest.approx([math.pi, math.pi, math.pi / 2, math.pi / 2])
    assert worlds[2]["faults"] == "dead_sensors=[3], left_wheel=0.7, left_slip=0.2"
    assert {"distance_gain=0.75", "mass_ratio=2", "wall_friction=0.3"} < {*worlds[3]["faults"].split(", ")}
    assert [held["goals"]["right"] for held in worlds] == [[0.36, 0.155]] * 3 + [[0.1, 0.155]]
    assert data["lifetimes"]["left"][0]["begins"] == pytest.approx([0, 1.024, 2.016, 3.008])


CORRIDOR = Maze(  # from the start up, then to the right
    name="corridor",
    walls={
        "left": Box(0.0, 0.5, 0.1, 1.2),
        "far": Box(0.6, 1.15, 1.3, 0.1),
        "end": Box(1.2, 1.0, 0.1, 0.4),
        "near": Box(0.75, 0.85, 0.9, 0.1),
        "right": Box(0.35, 0.4, 0.1, 1.0),
        "behind": Box(0.2, -0.1, 0.5, 0.1),
    },
    start=Pose(0.17, 0.1, math.pi / 2),
    goals={"left": Place(0.17, 1.0), "right": Place(1.0, 1.0)},
    goal_radius_m=0.08,
    arms={"left": Region(right=0.3), "right": Region(left=0.3)},
    arena_m=1.5,
)
RAYS = Robot(
    name="rays",
    radius_m=0.05,
    sensors=(
        LightSensors(places=(Sensor(0.03, 0.0, 0.0),)),
        DistanceSensors(
            places=tuple(Sensor(0.0, 0.0, 15.0 * number) for number in range(24)), reach_m=0.14, stretch=0.5
        ),
    ),
)


def test_any_maze_robot_and_network():
    network = Network((25, 7, 5, 8, 4, 2))
    chance, samples = np.random.default_rng(1), empty_samples(16, network)
    genes = chance.uniform(-1, 1, network.synapses)
    samples.time[:], samples.pose[:, :2] = np.arange(16) * 0.256, CORRIDOR.start[:2]
    stacked = Samples(*(np.stack([array] * 4) for array in samples))
    stacked.weights[:] = chance.uniform(-1, 1, stacked.weights.shape)
    traces = Traces(controller=[GA, GA, HEBBIAN, HEBBIAN], side=["left", "right"] * 2, samples=stacked)
    world = Scenario(maze=CORRIDOR, robot=RAYS)
    data = content(replay.page(traces, genes, world, "title", gain_rad_s=1.0, network=network))
    assert data["layers"] == [25, 7, 5, 8, 4, 2]
    assert data["speed"] == pytest.approx(100 * 1.0 * RAYS.wheel_radius_m)  # cm/s
    assert len(data["initial"]) == network.synapses
    assert len(unpacked(data["lifetimes"]["left"][1]["change"])) == data["samples"] * network.synapses
    robot, maze = data["robot"], data["maze"]
    assert (robot["radius"], len(robot["lights"]), len(robot["distances"])) == (0.05, 1, 24)
    assert robot["reach"] == pytest.approx(0.14)  # where its curve ends
    assert robot["distances"][6] == pytest.approx([0, 0, math.pi / 2])
    assert data["inputs"][:2] == ["light", "distance 0"]
    assert len(set(data["inputs"])) == 25
    assert maze["start"] == [0.17, 0.1]
    assert maze["goalRadius"] == 0.08
