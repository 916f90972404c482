"""Changes by hand: put the robot elsewhere, set blocks down, light the lamp, scale N, reset the weights."""

import json
import random
from dataclasses import replace

import numpy as np
import pytest

from epuckhebb.config import hand
from epuckhebb.config.compose import load
from epuckhebb.config.schema import EvaluateConfig, EvolveConfig
from epuckhebb.controller.network import starting_weights
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.runtime.errors import ConfigError
from epuckhebb.tmaze.batch import run_lifetimes
from epuckhebb.tmaze.individual import GA_ALONE, Controller, Individual
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.maze import SIDES, Pose, gap
from epuckhebb.tmaze.robot import EPUCK, STEP_S
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.session import Session

LEARNING = Controller(name="Hebbian", rule=Paper(N=0.002))
LIFETIME = Lifetime(duration_s=20.0, gain_rad_s=4.0, record_every=1)


def wish(draw):
    """Something that one may want to change; some of it cannot be."""
    block = [draw.uniform(-0.4, 0.4), draw.uniform(-0.4, 0.2), draw.uniform(0.004, 0.08), 0.04]
    return draw.choice(
        [
            {"put": [draw.uniform(-0.4, 0.4), draw.uniform(-0.4, 0.25), draw.uniform(-3, 3)]},
            {"put": [0.007, draw.uniform(-0.36, 0.16), draw.uniform(-3, 3)], "reset": True},
            {"light": draw.random(), "lamp_on": draw.choice([None, True, False])},
            {"lamp": {"x_m": draw.uniform(-0.1, 0.1)}, "rate": draw.choice([0.0, 1.0, 1000.0])},
            {"placed": [block] * draw.randrange(3)},
            {"dead_sensors": draw.sample(range(8), draw.randrange(3)), "left_wheel": draw.random()},
            {"reset": True},
        ]
    )


def live_by_hand(individual, world, seed):
    """A lifetime that is disturbed at random moments, and all that was done to it."""
    draw, session, done, refused = random.Random(seed), Session(individual, world, LIFETIME), [], 0
    while not session.is_over:
        session.step(draw.choice([1, 1, 2, 5, 25]))
        change = {"at_s": session.steps * STEP_S, **wish(draw)}
        try:
            changed = session.world.changed(change)
        except ValueError:
            refused += 1
        else:
            if not session.is_over:
                done.append(change)
                session.change(replace(changed, changes=[c for c in world.changes if c["at_s"] >= change["at_s"]]))
    assert refused
    return session, done


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("controller", [GA_ALONE, LEARNING])
def test_what_is_done_by_hand_gives_the_same_bits_in_one_piece(genomes, side, controller):
    individual = Individual(genes=genomes[0], side=side, key=np.uint64(1), controller=controller, record=True)
    world = Scenario(obstacles=4, changes=({"at_s": 8.0, "light": 1.0, "placed": []}, {"at_s": 16.0, "reset": True}))
    session, done = live_by_hand(individual, world, seed=len(side) + len(controller.name))
    assert len(done) > 40
    assert any("put" in change for change in done)
    [(outcome, samples)] = run_lifetimes([individual], replace(world, hand=done), LIFETIME)
    assert np.array(session.outcome()).tobytes() == np.array(outcome).tobytes()
    for live, whole in zip(session.samples[:-1], samples[:-1], strict=True):  # but for when each world began
        assert live.tobytes() == whole.tobytes()


def lived_with(genes, side="left", controller=LEARNING, **change):
    """A lifetime of 4 s to which something is done after 2 s, and that to which nothing is."""
    individual = Individual(genes=genes, side=side, key=np.uint64(1), controller=controller, record=True)
    lifetime = replace(LIFETIME, duration_s=4.0)
    worlds = Scenario(), Scenario(hand=({"at_s": 64 * STEP_S, **change},))
    return [run_lifetimes([individual], world, lifetime)[0] for world in worlds]


def test_a_robot_that_is_put_somewhere_drives_on_from_there(genomes):
    (_, plain), (outcome, moved) = lived_with(genomes[0], put=[0.25, 0.16, 1.0])
    assert moved.pose[63].tobytes() == plain.pose[63].tobytes()
    assert moved.pose[64].tolist() == [0.25, 0.16, 1.0]
    way = np.hypot(*np.diff(moved.pose[:, :2], axis=0).T)
    assert way[63] > 0.2  # by hand
    assert outcome.path_length == pytest.approx(way.sum() - way[63], abs=0.01)  # which is no way of its own


def test_a_lamp_by_hand_is_that_of_the_other_side(genomes):
    (_, plain), (_, lit) = lived_with(genomes[0], lamp_on=True)
    (_, right), _ = lived_with(genomes[0], "right", rate=1.0)
    assert (plain.sensors[0] != right.sensors[0]).any()
    assert (plain.sensors[64] != lit.sensors[64]).any()
    (_, same), (_, off) = lived_with(genomes[0], lamp_on=False)
    assert same.sensors.tobytes() == off.sensors.tobytes()


def test_a_factor_scales_the_rate(genomes):
    (_, plain), (_, scaled) = lived_with(genomes[0], rate=3.0)
    assert scaled.rate[63] == plain.rate[63]
    assert scaled.rate[64] == 3 * plain.rate[64] > 0
    (_, _), (_, off) = lived_with(genomes[0], rate=0.0)
    assert not off.rate[64:].any()
    assert off.weights[64:].tobytes() == np.tile(off.weights[63], (len(off.weights) - 64, 1)).tobytes()


def test_a_reset_brings_the_genes_back(genomes):
    (_, plain), (_, reset) = lived_with(genomes[0], reset=True, rate=0.0)
    assert plain.weight_change[64] > 0
    assert not reset.weight_change[64:].any()
    assert reset.weights[64].tobytes() == starting_weights(genomes[0]).astype(np.float32).tobytes()


def test_a_block_stops_the_robot(constant):
    (_, plain), (_, stopped) = lived_with(constant(), controller=GA_ALONE, placed=[[0.007, -0.1, 0.04, 0.04]])
    assert plain.pose[-1, 1] > -0.1
    assert stopped.pose[-1, 1] < -0.12 - EPUCK.radius_m + 0.002


def test_a_robot_is_put_among_walls_that_wait_for_it(constant):
    """A block that would appear where the robot stands waits; a place among the new walls is free of them."""
    block, there = [0.007, -0.35, 0.1, 0.02], Pose(0.007, 0.0, np.pi / 2)
    hand_ = ({"at_s": STEP_S, "placed": [block]}, {"at_s": 10 * STEP_S, "put": list(there)})
    individual = Individual(genes=constant(0.0, 0.0), side="left", key=np.uint64(1), record=True)
    session = Session(individual, Scenario(hand=hand_), LIFETIME)
    session.step(5)
    assert session.pose.y == pytest.approx(-0.35)
    session.step(6)
    assert gap(session.pose.x, session.pose.y, session.world.boxes) > EPUCK.radius_m
    assert session.pose[:2] == pytest.approx(there[:2])
    assert session._space.handles.walls.tolist() == session.world.boxes.tolist()


def test_what_is_past_of_a_world_does_not_happen_again(genomes):
    individual = Individual(genes=genomes[0], side="left", key=np.uint64(1), controller=LEARNING)
    world = Scenario(changes=({"at_s": 1.0, "put": [0.25, 0.16, 1.0], "reset": True},))
    session = Session(individual, world, LIFETIME)
    session.step(100)
    before = session.pose, session.life.weights.tobytes()
    session.change(world)
    assert (session.pose, session.life.weights.tobytes()) == before


REFUSED = [
    ({"put": [0.0, 0.0]}, "put must be"),
    ({"put": [float("nan"), 0.0, 0.0]}, "put must be"),
    ({"put": [9.0, 9.0, 0.0]}, "no room"),
    ({"put": [-0.2, 0.082, 0.0]}, "no room"),  # in a wall
    ({"put": [0.007, -0.2, 0.0], "placed": [[0.0, -0.2, 0.03, 0.03]]}, "no room"),
    ({"placed": 3}, "placed must be"),
    ({"placed": [[0, 0, 0.03]]}, "placed must be"),
    ({"placed": [[0, 0, 0.03, 0.6]]}, "sides of a block"),
    ({"placed": [[0.6, 0, 0.03, 0.03]]}, "middle of a block"),
    ({"placed": [[0, 0, 0.03, 0.03]] * 21}, "at most 20"),
    ({"rate": -1}, "rate must"),
    ({"lamp_on": 7}, "lamp_on must"),
    ({"reset": "x"}, "reset must"),
    ({"at_s": 0.0, "reset": True}, "at_s must be more than 0"),
    ({"moved": 1}, "must have at_s and some of"),
]


@pytest.mark.parametrize(("change", "message"), REFUSED)
@pytest.mark.parametrize("key", ["changes", "hand"])
def test_what_cannot_be_is_refused(key, change, message):
    with pytest.raises(ValueError, match=message) as told:
        Scenario(**{key: ({"at_s": 1.0, **change},)})
    assert f"scenario.{key}[0]" in str(told.value)


def test_a_file_of_changes_is_read_as_it_was_written(tmp_path):
    changes = [{"at_s": 7 * STEP_S, "put": [0.1 / 3, 0.15, -1.0]}, {"at_s": 1.0, "light": 0.5, "placed": []}]
    file = tmp_path / "mine.json"
    file.write_bytes(hand.written(changes))
    assert list(hand.read(str(file))) == json.loads(file.read_bytes()) == changes
    config = load(EvaluateConfig, [f"scenario.hand={file}", "scenario.light=0.2"])
    assert config.world.hand == tuple(changes)
    assert config.changed == "light=0.2, 2 changes by hand"


BAD_FILES = ["", "{}", "[1]", '[{"at_s": 1', "[[]]", '[{"at_s": 1e999, "light": 1}]', '[{"light": 1}]']


@pytest.mark.parametrize("text", BAD_FILES)
def test_a_file_that_holds_no_changes_is_refused(tmp_path, text):
    file = tmp_path / "mine.json"
    file.write_text(text)
    with pytest.raises(ConfigError, match=r"scenario\.hand"):
        load(EvaluateConfig, [f"scenario.hand={file}"])


def test_a_file_that_cannot_be_read_is_refused(tmp_path):
    for name, message in (("none.json", "No such file"), (".", "directory")):
        with pytest.raises(ConfigError, match=message):
            hand.read(str(tmp_path / name))


def test_an_evolution_takes_no_changes_by_hand(tmp_path):
    file = tmp_path / "mine.json"
    file.write_bytes(hand.written([{"at_s": 1.0, "light": 0.5}]))
    with pytest.raises(ConfigError, match="is for `epuckhebb evaluate`"):
        load(EvolveConfig, [f"scenario.hand={file}"])
