"""The robots of conf/robot: they load, the e-puck is the one in the code, wrong ones are refused."""

import math
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from cases import first_of
from omegaconf import OmegaConf

from epuckhebb.config.build import make_robot
from epuckhebb.controller.genome import make_plan
from epuckhebb.controller.network import HIDDEN, Network
from epuckhebb.controller.plasticity.rule import NoRule
from epuckhebb.tmaze.batch import run_lifetimes
from epuckhebb.tmaze.fitness import avoid
from epuckhebb.tmaze.individual import Individual
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.robot import EPUCK
from epuckhebb.tmaze.scenario import Scenario

CONF = Path(__file__).parents[1] / "conf" / "robot"
FILES = sorted(CONF.glob("*.yaml"))
GONE = object()


def told(name):
    return OmegaConf.to_container(OmegaConf.load(CONF / f"{name}.yaml"))


@pytest.mark.parametrize("name", first_of(file.stem for file in FILES))
def test_each_robot_lives(name):
    robot = make_robot(told(name))
    assert robot.name == name
    net = Network((robot.inputs, *HIDDEN, 2))
    genes = np.random.default_rng(1).uniform(-1, 1, make_plan(net, NoRule).genes)
    who = Individual(genes=genes, side="right", key=np.uint64(1), network=net)
    ((outcome, _),) = run_lifetimes([who], Scenario(robot=robot), Lifetime(duration_s=2))
    assert 0 < outcome.path_length < 0.1


def test_the_e_puck_is_the_one_in_the_code():
    assert make_robot(told("epuck")) == EPUCK


def test_the_laser_tells_touch_from_the_middle_of_a_corridor_and_reads_afar():
    robot = make_robot(told("epuck_lidar"))
    echo = robot.distance.echo()
    turret = 0.035
    assert robot.distance.count == 24
    assert [math.hypot(x, y) for x, y, _ in robot.distance.places] == pytest.approx([turret] * 24, abs=1e-4)
    read = [echo(distance)[0] / robot.distance.full_scale for distance in np.arange(0, 0.5, 0.001)]
    assert all(nearer >= farther for nearer, farther in pairwise(read))
    assert echo(robot.radius_m - turret)[0] == 1.0  # a wall that the robot touches
    assert avoid(echo(0.0525 - turret)[0]) > 0.85  # the walls beside it in a corridor of 105 mm
    assert echo(0.2)[0] - echo(0.3)[0] > 3 * echo(0.2)[1] * echo(0.2)[0]  # afar, 10 cm are more than the noise
    assert echo(0.51)[0] == 0.0


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("axle_m", GONE, r"robot\.axle_m is missing"),
        ("axle_mm", 52, r"robot\.axle_mm is no key of .* Did you mean axle_m\?"),
        ("axle_m", "52 mm", r"robot\.axle_m: .*number.*52 mm"),
        ("name", None, r"robot\.name: .*None"),
        ("light_places", [[0, 0]], r"robot\.light_places\[0\]: .* length 3, .*\[0, 0\]"),
        ("light_places", [[0, 0, "ahead"]], r"robot\.light_places\[0\]\[2\]: .*number.*ahead"),
        ("distance_places", 8, r"robot\.distance_places: .*8"),
        ("distance_curve", [[0, 1]], r"robot\.distance_curve\[0\]: .* length 3"),
    ],
)
def test_wrong_robots_are_refused(key, value, message):
    wrong = told("epuck")
    if value is GONE:
        del wrong[key]
    else:
        wrong[key] = value
    with pytest.raises(ValueError, match=message):
        make_robot(wrong)
