"""What the tests share: genomes, robots, lives beside the oracle, golden files, a limit on the size of files."""

import gc
import re
import shutil
import signal
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
import reference
from hypothesis import settings
from omegaconf import OmegaConf

from epuckhebb.config.build import make_robot
from epuckhebb.controller.network import PAPER_NETWORK, Network, split_layers
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.studies.study import find_study
from epuckhebb.tmaze.batch import run_lifetimes
from epuckhebb.tmaze.individual import GA_ALONE, Controller, Individual
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.scenario import Scenario

HERE = Path(__file__).parent
settings.register_profile("ordinary", max_examples=20, deadline=None)
settings.register_profile("thorough", max_examples=100, deadline=None)
settings.load_profile("ordinary")
for study in ("flock", "leaderboard", "reproduce"):  # which registers their keys
    find_study(study)


def pytest_configure():
    """Hear signals that a shell lets what it runs in the background ignore, and that this program then ignores, too."""
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if hasattr(signal, "SIGHUP"):
        signal.signal(signal.SIGHUP, signal.SIG_DFL)


def pytest_collection_finish():
    """Search for garbage seldom: composing a configuration and compiling a kernel make next to none, and much else."""
    gc.freeze()
    gc.set_threshold(20_000, 10, 10)


def pytest_addoption(parser):
    parser.addoption("--regenerate", action="store_true", help="write the golden files anew; read the diff")
    parser.addoption("--torture-seed", type=int, default=1, help="seed of the torture tests")


@pytest.fixture
def here(tmp_path, monkeypatch):
    """An empty folder of the test's own, which is the current one."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def copy(runs, tmp_path, monkeypatch):
    """A copy of the folder `runs` of a test file, in which anything may be done, and which is the current one."""
    monkeypatch.chdir(shutil.copytree(runs, tmp_path / "own"))
    return Path.cwd()


@pytest.fixture(scope="session")
def genomes():
    """(6, 234), from an independent prototype of the same world; data/README.md says how they came about."""
    return np.load(HERE / "data" / "genomes.npz")["genomes"]


@pytest.fixture
def golden(request):
    """Compare a text with the golden file of that name, or write it with --regenerate."""

    def compare(name, text):
        path = HERE / "golden" / name
        if request.config.getoption("--regenerate"):
            path.write_text(text)
        assert text == path.read_text(), f"{name} differs; if that is meant, run pytest --regenerate and read the diff"

    return compare


@pytest.fixture
def generated(request):
    """Compare a part of a page, between two marks, with what it should be, or write it with --regenerate."""

    def compare(page, name, expected):
        text = page.read_text(encoding="utf-8")
        begin, end = re.search(rf"<!-- {name}: .* -->\n", text).end(), text.index(f"<!-- end of {name} -->")
        if request.config.getoption("--regenerate"):
            page.write_text(text[:begin] + expected + text[end:], encoding="utf-8")
        else:
            told = f"{page.name} is stale; run: pytest tests/{request.path.name} --regenerate"
            assert text[begin:end] == expected, told

    return compare


@pytest.fixture(scope="session")
def run_lifetime():
    """Live one robot: a function from genome and settings to (outcome, samples)."""

    def live(genome, side="left", N=0.0, seconds=8.0, key=1, scenario=None, record_every=1, controller=None, **more):
        rule = {name: more.pop(name) for name in ("signal", "w_max", "floor") if name in more}
        own = ("network", "start", "signs", "nominal", "yoking")
        who = {name: more.pop(name) for name in own if name in more}
        controller = controller or Controller(name="Hebbian", rule=Paper(N=N, **rule))
        individual = Individual(
            genes=genome, side=side, controller=controller, key=np.uint64(key), record=record_every > 0, **who
        )
        lifetime = Lifetime(duration_s=seconds, record_every=record_every, **more)
        return run_lifetimes([individual], scenario or Scenario(), lifetime)[0]

    return live


@pytest.fixture(scope="session")
def lidar():
    """An e-puck with a ring of 24 rays that feel walls up to half a metre away, instead of its infra-red sensors."""
    return make_robot(OmegaConf.to_container(OmegaConf.load(HERE.parent / "conf" / "robot" / "epuck_lidar.yaml")))


@pytest.fixture(scope="session")
def constant():
    """Genes that turn the wheels at (left, right) times the same speed whatever is sensed, 0.95 at most."""

    def genes(left=1.0, right=1.0, network=PAPER_NETWORK):
        weights = np.zeros(network.synapses)
        layers = split_layers(network, weights)
        layers[0][network.bias, 0] = 2.0
        for layer in layers[1:-1]:
            layer[0, 0] = 2.0
        layers[-1][0] = 2.0 * left, 2.0 * right
        return weights

    return genes


@pytest.fixture(scope="session")
def beside_the_oracle(run_lifetime):
    """Live a robot and its oracle, hold every step against each other, and return (outcome, samples, oracle)."""

    def both(
        genes,
        side="left",
        scenario=None,
        controller=GA_ALONE,
        network=PAPER_NETWORK,
        seconds=30.0,
        gain=4.0,
        key=9,
        **more,
    ):
        scenario = scenario or Scenario()
        outcome, samples = run_lifetime(
            genes,
            side,
            seconds=seconds,
            key=key,
            scenario=scenario,
            controller=controller,
            network=network,
            gain_rad_s=gain,
            **more,
        )
        robot = reference.robot_of(network)(
            genes, scenario, side, controller, network=network, gain=gain, key=key, **more
        )
        expected, steps = reference.live(robot, len(samples.time))
        whole, samples = samples, type(samples)(*(array[: len(steps)] for array in samples))
        np.testing.assert_allclose(samples.pose, [s[:3] for s in steps], rtol=0, atol=1e-9)
        np.testing.assert_allclose(samples.sensors, [s[3] for s in steps], rtol=0, atol=1e-7)
        np.testing.assert_allclose(samples.motors, [s[4:6] for s in steps], rtol=0, atol=1e-7)
        np.testing.assert_allclose(samples.fitness, [s[7] for s in steps], rtol=0, atol=1e-7)
        np.testing.assert_allclose(samples.rate, [s[8] for s in steps], rtol=1e-6, atol=1e-12)
        np.testing.assert_allclose(samples.weight_change, [s[9] for s in steps], rtol=1e-7, atol=1e-12)
        np.testing.assert_allclose(outcome[: len(expected)], expected, rtol=1e-8, atol=1e-9)
        return outcome, whole, robot

    return both


@pytest.fixture
def small_files():
    """A context that gives a function to limit the size [bytes] of the files that this process can write in it."""
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)

    @contextmanager
    def limited():
        try:
            yield lambda size: resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)

    return limited


@pytest.fixture(scope="session")
def wide():
    """A network for the robot with 24 rays, and genes that drive it about."""
    network = Network((32, 7, 5, 8, 4, 2))
    return network, np.random.default_rng(79).uniform(-1, 1, network.synapses)
