"""What a look at the paper's study costs, and how soon a sweep of hundreds of jobs begins; all is compiled."""

import signal
import subprocess
import tempfile
import time
from pathlib import Path

import commands


def measure() -> list[tuple[str, str]]:
    """Seconds of `reproduce all --quick`, and until the first job of `sweep adaptive` has begun."""
    with tempfile.TemporaryDirectory() as folder:
        here = Path(folder)
        commands.spent(here, "reproduce", "all", "--quick")  # compiles
        quick = commands.spent(here, "reproduce", "all", "--quick", "seed=2")
        _first_job(here, "compiles")
        return [
            ("reproduce all --quick", commands.told(quick)),
            ("sweep adaptive, until its first job has begun", f"{_first_job(here, 'compiled'):.2f} s"),
        ]


def _first_job(here: Path, name: str) -> float:
    """Seconds until a job of the sweep has said that it has begun; then the sweep is interrupted."""
    place = here / name
    place.mkdir()
    began = time.perf_counter()
    words = [commands.EPUCKHEBB, "sweep", "adaptive", "--quiet"]
    sweep = subprocess.Popen(words, cwd=place, env=commands.environment(here), stderr=subprocess.DEVNULL)
    while not any(place.glob("runs/sweep/*/*/*/status.json")):  # the sweep's own is there earlier
        if sweep.poll() is not None:
            raise RuntimeError("the sweep has ended before its first job")
        time.sleep(0.02)
    spent = time.perf_counter() - began
    sweep.send_signal(signal.SIGINT)
    sweep.wait()
    return spent
