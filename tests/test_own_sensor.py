"""Sensors of the user's own: evolved, resumed, evaluated, replayed and rerun; what they read; bad ones."""

import math
from pathlib import Path

import numpy as np
import pytest

from epuckhebb import Lifetime, Sensor
from epuckhebb.config import plugins
from epuckhebb.controller.compiling.errors import PartError
from epuckhebb.controller.network import Network
from epuckhebb.tmaze.batch import run_lifetimes
from epuckhebb.tmaze.individual import Individual
from epuckhebb.tmaze.robot import EPUCK, Robot
from epuckhebb.tmaze.scenario import Scenario

EXAMPLE = Path(__file__).parents[1] / "examples" / "own_sensor"


def sensor(name, **settings):
    return plugins.class_named(f"{EXAMPLE}/my_sensors.py:{name}", Sensor, "sensor")(**settings)


def of_the_example():
    """The sensors of its robot: what has other settings would be compiled anew."""
    return sensor("Compass", noise=0.05), sensor("GoalDistance"), sensor("FloorPatch", at_y=0.1)


def recorded(genes, *own, noise=0.0, seconds=20.0):
    robot = Robot(sensors=(*EPUCK.sensors, *own))
    network = Network((robot.inputs, 7, 5, 8, 4, 2))
    weights = np.zeros(network.synapses)
    first = weights[: (robot.inputs + 1) * 7].reshape(-1, 7)
    paper = genes[: 17 * 7].reshape(-1, 7)
    first[:16], first[-1] = paper[:16], paper[16]
    weights[first.size :] = genes[17 * 7 :]
    individual = Individual(genes=weights, side="left", key=np.uint64(3), network=network, record=True)
    lifetime = Lifetime(duration_s=seconds, gain_rad_s=4, record_every=1, noise=noise)
    return run_lifetimes([individual], Scenario(robot=robot), lifetime)[0]


def test_they_read_what_plain_python_reads_and_change_nothing_else(genomes):
    own = of_the_example()
    outcome, samples = recorded(genomes[0], *own)
    usual, alone = recorded(genomes[0])
    np.testing.assert_array_equal(samples.pose, alone.pose)
    np.testing.assert_array_equal(samples.sensors[:, :16], alone.sensors)
    assert outcome.path_length == usual.path_length
    goal = Scenario().goals_now["left"]
    for (x, y, heading), readings in zip(samples.pose, samples.sensors[:, 16:], strict=True):
        distance = math.hypot(x - goal.x, y - goal.y)
        expected = [*own[0].read(heading), own[1].read(distance, own[1]), own[2].read(x, y, own[2])]
        np.testing.assert_allclose(readings, expected, rtol=0, atol=1e-12)
    assert set(samples.sensors[:, -1]) == {0.0, 1.0}


def test_noise_is_that_of_the_sensor_and_stays_within_0_and_1(genomes):
    (_, samples), (_, again) = (recorded(genomes[0], *of_the_example(), noise=1.0) for _ in range(2))
    np.testing.assert_array_equal(samples.sensors, again.sensors)
    compass, heading = samples.sensors[:, 16:18], samples.pose[:, 2]
    expected = (1 + np.column_stack([np.sin(heading), np.cos(heading)])) / 2
    far = (expected > 0.2) & (expected < 0.8)  # from 0 and 1
    assert np.std((compass - expected)[far]) == pytest.approx(0.05, rel=0.15)
    assert {0.0, 1.0} <= {compass.min(), compass.max()}


def test_a_dead_sensor_is_one_of_the_rim():
    robot = Robot(sensors=(*EPUCK.sensors, sensor("Compass")))
    assert robot.sensor_numbers == 8
    with pytest.raises(ValueError, match="dead_sensors must be different whole numbers, 0 to 7"):
        Scenario(robot=robot, dead_sensors=(8,))


class Far(Sensor):
    """It is right at the start, and wrong on the way."""

    @staticmethod
    def read(goal_distance):
        return 2.0 - 2.0 * goal_distance if goal_distance < 0.56 else 0.5


@pytest.mark.thorough
def test_a_reading_outside_0_to_1_ends_the_run(genomes):
    with pytest.raises(PartError, match=r"sensor Far: reading must lie in \[0, 1\], `read` gave 1\."):
        recorded(genomes[0], Far(), seconds=60)
