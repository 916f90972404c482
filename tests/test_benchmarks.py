"""Benchmarks find what they measure."""

import importlib
import subprocess
import sys
from pathlib import Path
from unittest.mock import MagicMock

import pytest

BENCHMARKS = Path(__file__).parent.parent / "benchmarks"
NOT_HERE = [
    "jax",
    *(f"kheperax.{name}" for name in ("simu.geoms", "simu.maze", "simu.posture", "tasks.config", "tasks.main")),
]
NAMES = sorted(file.stem for file in BENCHMARKS.glob("*.py") if file.stem != "inside")  # which runs when it is imported


@pytest.fixture
def benchmark(monkeypatch):
    """Imports a benchmark; what no session of tests installs is a dummy."""
    monkeypatch.syspath_prepend(BENCHMARKS)
    for name in NOT_HERE:
        monkeypatch.setitem(sys.modules, name, MagicMock())
    yield importlib.import_module
    for name in NAMES:
        sys.modules.pop(name, None)


@pytest.mark.parametrize("name", NAMES)
def test_each_is_imported(benchmark, name):
    assert benchmark(name).__doc__


@pytest.mark.thorough
def test_each_part_of_a_step_is_timed(benchmark, monkeypatch):
    parts = benchmark("parts")
    monkeypatch.setattr(parts, "LOOPS", 10)
    monkeypatch.setattr(parts, "REPEATS", 1)
    assert [figure.split()[1] for _, figure in parts.measure()] == ["ns"] * 7


@pytest.mark.thorough
def test_the_share_of_steps_is_measured(here):
    words = ["ga.generations=2", "ga.population=10", "lifetime.duration_s=10", "hydra.run.dir=inside"]
    words = [sys.executable, BENCHMARKS / "inside.py", *words]
    printed = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    of_the_process, of_the_generations = map(int, printed.split())
    assert 0 < of_the_process < 100
    assert 0 < of_the_generations < 100
    assert (here / "inside" / "status.json").exists()
