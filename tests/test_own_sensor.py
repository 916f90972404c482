"""Sensors of the user's own: evolved, resumed, evaluated, replayed and rerun; what they read; bad ones."""

import math
import shutil
from pathlib import Path

import numpy as np
import pytest
from cases import done, refused

from epuckhebb import Lifetime, Sensor
from epuckhebb.config import plugins
from epuckhebb.sim.batch import run_lifetimes
from epuckhebb.sim.network import Network
from epuckhebb.sim.own_sensor import SensorError
from epuckhebb.sim.robot import EPUCK, Robot
from epuckhebb.sim.scenario import Scenario
from epuckhebb.sim.session import Individual
from epuckhebb.store.genome import load_genome

EXAMPLE = Path(__file__).parents[1] / "examples" / "own_sensor"
ROBOT = ["robot=epuck_more", "--config-dir", "examples/own_sensor"]
SMALL_GA = ["ga.population=4", "ga.loops=1", "ga.elites=1", "lifetime.duration_s=2", "scenario.paper_duration_s=10"]
SHORT = ["lifetime.duration_s=2", "repeats=1"]
ONE = "{sensor: bad.py:%s}"


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A folder outside the package with the example, and runs by it; not to be changed."""
    folder = tmp_path_factory.mktemp("sensors")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        shutil.copytree(EXAMPLE, folder / "examples" / "own_sensor")
        done("evolve", *ROBOT, *SMALL_GA, "ga.generations=2", "hydra.run.dir=evolved")
        done("evaluate", *ROBOT, "genome=evolved", *SHORT, "hydra.run.dir=evaluated")
    return folder


@pytest.fixture
def copy(runs, tmp_path, monkeypatch):
    """A copy of that folder, in which anything may be done."""
    monkeypatch.chdir(shutil.copytree(runs, tmp_path / "own"))
    return Path.cwd()


def test_an_evolution_with_them_is_resumed_to_the_same_champion(copy):
    done("evolve", *ROBOT, *SMALL_GA, "ga.generations=1", "hydra.run.dir=again")
    done("evolve", "resume=again", "ga.generations=2", "-q")
    for name in ("champion.npz", "history.csv"):
        assert (copy / "again" / name).read_bytes() == (copy / "evolved" / name).read_bytes()


def test_runs_with_them_are_shown_replayed_and_rerun_without_the_file(copy):
    shutil.rmtree(copy / "examples")
    assert "GoalDistance" in done("show", "evolved").stdout
    done("replay", "evaluated")
    page = (copy / "evaluated" / "replay.html").read_text()
    assert all(name in page for name in ("Compass north", "Compass east", "GoalDistance", "FloorPatch"))
    assert "with the sensors Compass north, Compass east" in refused("export", "evolved", "--webots", "-o", "c")
    for run in ("evaluated", "evolved"):
        assert "bit-identical" in done("rerun", run).stdout


@pytest.mark.usefixtures("copy")
def test_a_champion_of_other_sensors_is_refused():
    assert load_genome("evolved", "obstacles").sensors == "Compass north, Compass east, GoalDistance, FloorPatch"
    said = refused("evaluate", "genome=evolved", *SHORT)
    assert "own sensors are Compass north, Compass east, GoalDistance, FloorPatch; those of robot epuck" in said
    other = "robot.sensors=[{sensor: examples/own_sensor/my_sensors.py:FloorPatch}]"
    assert "those of robot epuck are FloorPatch" in refused("evaluate", "genome=evolved", other, *SHORT)
    for words in (["adaptation=self_check"], ["adaptation=best"]):
        said = refused("evaluate", "genome=evolved", *ROBOT, *words, *SHORT)
        assert "no model of the sensors Compass, GoalDistance, FloorPatch" in said


def sensor(name, **settings):
    return plugins.class_named(f"{EXAMPLE}/my_sensors.py:{name}", Sensor, "sensor")(**settings)


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
    own = (sensor("Compass"), sensor("GoalDistance", reach=0.8), sensor("FloorPatch", at_y=-0.1, radius=0.1))
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
    _, samples = recorded(genomes[0], sensor("GoalDistance", noise=0.05), noise=1.0)
    _, again = recorded(genomes[0], sensor("GoalDistance", noise=0.05), noise=1.0)
    np.testing.assert_array_equal(samples.sensors, again.sensors)
    goal = Scenario().goals_now["left"]
    distance = np.hypot(samples.pose[:, 0] - goal.x, samples.pose[:, 1] - goal.y)
    assert np.std(samples.sensors[:, 16] - (1 - distance)) == pytest.approx(0.05, rel=0.15)
    _, wild = recorded(genomes[0], sensor("GoalDistance", noise=5.0), noise=1.0)
    assert {0.0, 1.0} <= set(wild.sensors[:, 16])
    assert ((wild.sensors[:, 16] >= 0) & (wild.sensors[:, 16] <= 1)).all()


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
        ("[{sensor: bad.py:Fine, nose: 1}]", ["robot.sensors[0].nose is no key", "Did you mean noise?"]),
        ("[{sensor: bad.py:Fine, noise: loud}]", ["robot.sensors[0].noise must be a finite number"]),
        ("[{sensor: bad.py:Fine, noise: -1}]", ["noise of sensor Fine must be 0 or more"]),
    ],
)
def test_what_cannot_be_a_sensor_is_refused_before_anything_runs(sensors, texts):
    Path("bad.py").write_text(BAD)
    said = refused("evolve", f"robot.sensors={sensors}", "lifetime.duration_s=2", "hydra.run.dir=out")
    for text in texts:
        assert text in said
    assert not Path("out").exists()


@pytest.mark.usefixtures("here")
def test_a_sensor_that_does_not_compile_is_named():
    Path("bad.py").write_text(BAD)
    said = refused("evolve", f"robot.sensors=[{ONE % 'Muddled'}]", *SMALL_GA, "hydra.run.dir=out")
    assert "sensor Muddled of" in said
    assert "does not compile" in said
    assert not Path("out").exists()


@pytest.mark.usefixtures("copy")
def test_jobs_of_a_multirun_find_it_wherever_their_worker_started():
    own = "robot.sensors=[{sensor: examples/own_sensor/my_sensors.py:Compass, noise: 0.05}]"
    done("evolve", "-m", "seed=1,2", own, *SMALL_GA, "ga.generations=1", "hydra.sweep.dir=out", "hydra/launcher=basic")
    for job in (0, 1):
        words = Path(f"out/{job}/.hydra/overrides.yaml").read_text()
        assert f"sensor:{Path.cwd()}/examples/own_sensor/my_sensors.py" in words
        assert load_genome(f"out/{job}", "obstacles").sensors == "Compass north, Compass east"
