"""A benchmark that looks inside the program still finds what it looks for."""

import subprocess
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parent.parent / "benchmarks"


@pytest.mark.thorough
def test_the_share_of_steps_is_measured(here):
    words = ["ga.generations=2", "ga.population=10", "lifetime.duration_s=10", "hydra.run.dir=inside"]
    words = [sys.executable, BENCHMARKS / "inside.py", *words]
    printed = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    of_the_process, of_the_generations = map(int, printed.split())
    assert 0 < of_the_process < 100
    assert 0 < of_the_generations < 100
    assert (here / "inside" / "status.json").exists()
