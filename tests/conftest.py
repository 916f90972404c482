"""What the tests share: the checked genomes, small lifetimes, golden files, and a limit on the size of files."""

from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from epuckhebb.sim.lifetime import Life, Lifetime, live_block
from epuckhebb.sim.plasticity import Hebbian
from epuckhebb.sim.scenario import Scenario

HERE = Path(__file__).parent


def pytest_addoption(parser):
    parser.addoption("--regenerate", action="store_true", help="write the golden files anew; read the diff")


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


@pytest.fixture(scope="session")
def lived():
    """Live one robot: a function from genome and settings to (outcome, samples)."""

    def live(genome, side="left", N=0.0, seconds=8.0, key=1, scenario=None, record_every=1, **more):
        hebbian = Hebbian(N=N, **{k: more.pop(k) for k in ("signal", "w_max", "floor") if k in more})
        life = Life(genome=genome, side=side, hebbian=hebbian, key=np.uint64(key), record=True)
        lifetime = Lifetime(duration_s=seconds, record_every=record_every, **more)
        return live_block([life], scenario or Scenario(), lifetime)[0]

    return live


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
