"""Sensors of the user's own: evolved, resumed, evaluated, replayed and rerun; what they read; bad ones."""

import math
import shutil
from pathlib import Path

import numpy as np
import pytest
from cases import SHORT, SMALL_GA, check_resumed, done, refused, refused_before, runs_of

from epuckhebb import Lifetime, Sensor
from epuckhebb.config import plugins
from epuckhebb.controller.network import Network
from epuckhebb.store.genome import load_genome
from epuckhebb.tmaze.batch import run_lifetimes
from epuckhebb.tmaze.own_sensor import SensorError
from epuckhebb.tmaze.robot import EPUCK, Robot
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.session import Individual

EXAMPLE = Path(__file__).parents[1] / "examples" / "own_sensor"
ROBOT = ["robot=epuck_more", "--config-dir", "examples/own_sensor"]
ONE = "{sensor: bad.py:%s}"


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    return runs_of(
        tmp_path_factory.mktemp("sensors"),
        EXAMPLE,
        ["evolve", *ROBOT, *SMALL_GA, "ga.generations=2", "hydra.run.dir=evolved"],
        ["evaluate", *ROBOT, "genome=evolved", *SHORT, "hydra.run.dir=evaluated"],
        place="examples/own_sensor",
    )


@pytest.mark.thorough
@pytest.mark.usefixtures("copy")
def test_an_evolution_with_them_is_resumed_to_the_same_champion():
    check_resumed([*ROBOT, *SMALL_GA], ("ga.generations=1", "ga.generations=2"))


@pytest.mark.thorough
def test_runs_with_them_are_shown_replayed_and_rerun_without_the_file(copy):
    shutil.rmtree(copy / "examples")
    assert "GoalDistance" in done("show", "evolved").stdout
    done("replay", "evaluated")
    page = (copy / "evaluated" / "replay.html").read_text()
    assert all(name in page for name in ("Compass north", "Compass east", "GoalDistance", "FloorPatch"))
    assert "with the sensors Compass north, Compass east" in refused("export", "evolved", "--webots", "-o", "c")
    for run in ("evaluated", "evolved"):
        assert "bit-identical" in done("rerun", run).stdout


@pytest.mark.thorough
@pytest.mark.usefixtures("copy")
def test_a_champion_of_other_sensors_is_refused():
    assert load_genome("evolved", "obstacles").sensors == "Compass north, Compass east, GoalDistance, FloorPatch"
    said = refused("evaluate", "genome=evolved", *SHORT)
    assert "own sensors are Compass north, Compass east, GoalDistance, FloorPatch; those of robot epuck" in said
    other = "robot.sensors=[{sensor: examples/own_sensor/my_sensors.py:FloorPatch}]"
    assert "those of robot epuck are FloorPatch" in refused("evaluate", "genome=evolved", other, *SHORT)


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
    with pytest.raises(ValueError, match="dead_sensors must be a list of whole numbers, 0 to 7"):
        Scenario(robot=robot, dead_sensors=(8,))


class Far(Sensor):
    """It is right at the start, and wrong on the way."""

    @staticmethod
    def read(goal_distance):
        return 2.0 - 2.0 * goal_distance if goal_distance < 0.56 else 0.5


@pytest.mark.thorough
def test_a_reading_outside_0_to_1_ends_the_run(genomes):
    with pytest.raises(SensorError, match=r"sensor Far: reading must lie in \[0, 1\] .*, `read` gave 1\."):
        recorded(genomes[0], Far(), seconds=60)


BAD = """\
import random
from typing import ClassVar
from epuckhebb import Sensor

class Nothing(Sensor): pass
class Curious(Sensor):
    read = staticmethod(lambda weather: weather)
class Lucky(Sensor):
    read = staticmethod(lambda x: random.random())
class Bare(Sensor):
    reach: float = 1.0
    read = staticmethod(lambda x: 0.0)
class Forgetful(Sensor):
    @staticmethod
    def read(by):
        return by.reach
class Negative(Sensor):
    read = staticmethod(lambda x: -0.5)
class Undefined(Sensor):
    read = staticmethod(lambda x: float("nan"))
class Several(Sensor):
    read = staticmethod(lambda x: (0.1, 0.2))
class Few(Sensor):
    readings: ClassVar = ("a", "b", "c")
    read = staticmethod(lambda x: (0.1, 0.2))
class Failing(Sensor):
    read = staticmethod(lambda x: [][1])
class Muddled(Sensor):
    read = staticmethod(lambda x: float(str(0.5)))
class Fine(Sensor):
    read = staticmethod(lambda x: 0.5)
"""


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("sensors", "texts"),
    [
        ("far", ["robot.sensors must be a list"]),
        ("[far]", ["robot.sensors[0] must be {sensor: FILE.py:NAME}", "far"]),
        ("[{noise: 1}]", ["robot.sensors[0] must be {sensor: FILE.py:NAME}"]),
        ("[{recorded: Fine, readings: [a]}]", ["robot.sensors[0] must be {sensor: FILE.py:NAME}"]),
        (f"[{ONE % 'Fin'}]", ["has no sensor Fin", "Did you mean Fine?"]),
        (f"[{ONE % 'Nothing'}]", ["sensor Nothing has no static method `read`"]),
        (f"[{ONE % 'Curious'}]", ["unknown arguments weather", "goal_distance"]),
        (f"[{ONE % 'Lucky'}]", ["draws from random"]),
        (f"[{ONE % 'Bare'}]", ["reach is not a setting; write @dataclass"]),
        (f"[{ONE % 'Forgetful'}]", ["`by` has no reach"]),
        (f"[{ONE % 'Negative'}]", ["sensor Negative: reading must lie in [0, 1]", "-0.5"]),
        (f"[{ONE % 'Undefined'}]", ["sensor Undefined: reading must lie in [0, 1]", "nan"]),
        (f"[{ONE % 'Several'}]", ["`read` must give reading, it gave (0.1, 0.2)"]),
        (f"[{ONE % 'Few'}]", ["`read` must give a and b and c, it gave (0.1, 0.2)"]),
        (f"[{ONE % 'Failing'}]", ["sensor Failing: `read` failed: IndexError"]),
        (f"[{ONE % 'Fine'}, {ONE % 'Fine'}]", ["each once"]),
        (f"[{ONE % 'Muddled'}]", ["sensor Muddled of", "does not compile"]),
        ("[{sensor: bad.py:Fine, nose: 1}]", ["robot.sensors[0].nose is no key", "Did you mean noise?"]),
        ("[{sensor: bad.py:Fine, noise: loud}]", ["robot.sensors[0].noise must be a finite number"]),
        ("[{sensor: bad.py:Fine, noise: -1}]", ["noise of sensor Fine must be 0 or more"]),
    ],
)
def test_what_cannot_be_a_sensor_is_refused_before_anything_runs(sensors, texts):
    Path("bad.py").write_text(BAD)
    refused_before("out", ["evolve", f"robot.sensors={sensors}", *SMALL_GA, "hydra.run.dir=out"], texts)


@pytest.mark.thorough
@pytest.mark.usefixtures("copy")
def test_jobs_of_a_multirun_find_it_wherever_their_worker_started():
    own = "{sensor: examples/own_sensor/my_sensors.py:%s}"
    own = f"robot.sensors=[{own % 'Compass, noise: 0.05'},{own % 'GoalDistance'},{own % 'FloorPatch, at_y: 0.1'}]"
    done("evolve", "-m", "seed=1,2", own, *SMALL_GA, "ga.generations=1", "hydra.sweep.dir=out", "hydra/launcher=basic")
    for job in (0, 1):
        words = Path(f"out/{job}/.hydra/overrides.yaml").read_text()
        assert f"sensor:{Path.cwd()}/examples/own_sensor/my_sensors.py" in words
        assert load_genome(f"out/{job}", "obstacles").sensors.startswith("Compass north, Compass east")
