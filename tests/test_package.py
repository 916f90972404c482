"""The wheel and the sdist, and every verb of the wheel in an environment and a folder of its own."""

import json
import os
import signal
import subprocess
import sys
import tarfile
import venv
import zipfile
from pathlib import Path
from urllib.request import urlopen

import pytest

from epuckhebb.cli.commands import app

ROOT = Path(__file__).parents[1]
TINY = ["lifetime.duration_s=3", "-q"]
SMALL_GA = ["ga.population=6", "ga.generations=2", "ga.elites=2", "ga.loops=1"]
WORDS = {
    "evolve": [*TINY, *SMALL_GA, "hydra.run.dir=evolved"],
    "evaluate": [*TINY, "genome=evolved", "hydra.run.dir=evaluated"],
    "sweep": ["light", *TINY, "repeats=1", "scenario.light=1,0.5", "hydra/launcher=two_cores"],
    "reproduce": ["light", "champions=1", "repeats=1", "rates=[0.002]", *SMALL_GA, "-q"],
    "replay": ["evaluated"],
    "figure": ["evaluated", "trajectories", "--format", "pdf"],
    "show": ["evaluated"],
    "keys": ["scenario"],
    "export": ["evaluated", "--webots"],
    "flock": ["--quick", "-q"],
    "leaderboard": ["light", "champions=1", "--dry-run"],
    "rerun": ["evaluated"],
}
pytestmark = pytest.mark.slow


def run(*words, cwd):
    environment = {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "EPUCKHEBB"))}
    done = subprocess.run(words, cwd=cwd, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{words}\n{done.stdout}{done.stderr}"
    return done.stdout


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """The sdist, and the wheel made from it."""
    folder = tmp_path_factory.mktemp("dist")
    run(sys.executable, "-m", "build", "--outdir", str(folder), str(ROOT), cwd=folder)
    (sdist,), (wheel,) = folder.glob("*.tar.gz"), folder.glob("*.whl")
    return sdist, wheel


def data():
    conf = {f"conf/{file.relative_to(ROOT / 'conf')}" for file in (ROOT / "conf").rglob("*.yaml")}
    champions = {f"runs/reference/champions/{file.name}" for file in (ROOT / "runs/reference/champions").glob("*.npz")}
    showcases = {f"runs/reference/champion_{name}.npz" for name in ("light", "obstacles")}
    return conf | champions | showcases | {"runs/reference/success.csv"}


def test_both_hold_the_configuration_and_the_champions(built):
    sdist, wheel = built
    with tarfile.open(sdist) as archive:
        names = {name.partition("/")[2] for name in archive.getnames()}
    assert data() <= names
    assert "docs/clusters.md" in names
    with zipfile.ZipFile(wheel) as archive:
        assert {f"epuckhebb/{name}" for name in data()} <= set(archive.namelist())


def test_both_can_be_published(built):
    run(sys.executable, "-m", "twine", "check", "--strict", *map(str, built), cwd=built[0].parent)


def test_every_verb_outside_the_repository(built, tmp_path):
    venv.create(tmp_path / "venv", with_pip=True)
    scripts = tmp_path / "venv" / "bin"
    run(scripts / "python", "-m", "pip", "install", "--quiet", built[1], cwd=tmp_path)
    commands = [command.callback.__name__ for command in app.registered_commands]
    assert set(commands) == {*WORDS, "play"}
    work = tmp_path / "work"
    work.mkdir()
    for command, words in WORDS.items():
        run(scripts / "epuckhebb", command, *words, cwd=work)
    serving = [scripts / "epuckhebb", "play", "--no-browser"]
    with subprocess.Popen(serving, cwd=work, stdout=subprocess.PIPE, text=True) as play:
        page, _, _ = play.stdout.readline().partition("#")
        with urlopen(page) as answer:
            assert "<html" in answer.read().decode()
        play.send_signal(signal.SIGINT)
        assert play.wait(timeout=60) == 0
    where = run(scripts / "python", "-c", "import epuckhebb; print(epuckhebb.__file__)", cwd=work)
    assert where.startswith(str(tmp_path))
    told = json.loads((work / "evaluated" / "provenance.json").read_text())
    assert told["code"]["commit"] is None
    assert "sweep" in run(scripts / "epuckhebb", "--help", cwd=work)
