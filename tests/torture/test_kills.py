"""Every verb, killed twice at random moments by a random signal: the same command goes on to the same bytes."""

import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from epuckhebb.store.run import Run

pytestmark = pytest.mark.torture

ROUNDS = 5  # of each verb, with two kills each
SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGKILL)
PROGRAM = (
    "from epuckhebb.runtime.errors import end_on_signals; end_on_signals(); print('ready', flush=True); "
    "from epuckhebb.__main__ import main; main()"
)
WORDS = {
    "evaluate": ["evaluate", "repeats=60", "lifetime.duration_s=100", "hydra.run.dir=run"],
    "evolve": ["evolve", "ga.population=20", "ga.generations=40", "ga.loops=1", "hydra.run.dir=run"],
    "reproduce": [
        "reproduce",
        "obstacles",
        *("champions=3", "repeats=3", "rates=[0.002]", "ga.population=10", "ga.elites=2", "ga.generations=4"),
    ],
    "sweep": ["sweep", "obstacles", "seed=range(1,5)", "repeats=4", "hydra.sweep.dir=run"],
}


def start(words, folder):
    """A process of its own group that runs the program, as soon as it knows how to be interrupted."""
    started = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, *words, "-q"],
        cwd=folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
    )
    assert started.stdout.readline() == "ready\n"
    return started


def kill(words, folder, moment, number):
    """Run the program and kill it after so many seconds; whether it was still at work then."""
    with start(words, folder) as started:
        time.sleep(moment)
        was_at_work = started.poll() is None
        started.send_signal(number)
        told = started.communicate(timeout=120)[1]
    told = re.sub(r"Exception ignored in.*?KeyboardInterrupt: ?\n", "", told, flags=re.DOTALL)  # while one is freed
    assert "Traceback" not in told
    if was_at_work and number != signal.SIGKILL:
        just_done = {0, -number} if is_finished(folder, words[0]) else {0}  # as it ends, Python handles no signals
        assert started.returncode in {130, *just_done}, told
    until = time.monotonic() + 60
    while time.monotonic() < until:  # its workers see that it is gone, and go
        try:
            os.killpg(started.pid, 0)
        except ProcessLookupError:
            return was_at_work
        time.sleep(0.05)
    raise AssertionError("workers outlive who started them")


def finish(words, folder):
    with start(words, folder) as started:
        told = started.communicate(timeout=600)[1]
    assert started.returncode == 0, told


def going_on(words, folder):
    """What a user types to go on after a kill."""
    run = folder / "run"
    if words[0] == "evolve" and (run / "provenance.json").is_file():
        return ["evolve", "resume=run"]
    if words[0] in ("evolve", "evaluate") and run.is_dir():
        shutil.rmtree(run)
    return words


def results(folder):
    """The bytes of every table and of every array that a call left."""
    found = [file for pattern in ("*.csv", "*.npz") for file in folder.rglob(pattern)]
    assert found
    assert not list(folder.rglob("*.tmp"))
    return {str(file.relative_to(folder)): file.read_bytes() for file in found}


@pytest.mark.parametrize("command", WORDS)
def test_killed_twice_it_goes_on_to_the_same_bytes(command, tmp_path, request):
    chance = random.Random(f"{request.config.getoption('--torture-seed')} {command}")
    words, whole = WORDS[command], tmp_path / "whole"
    whole.mkdir()
    finish(words, whole)  # compiles what is not in the cache
    shutil.rmtree(whole)
    whole.mkdir()
    began = time.monotonic()
    finish(words, whole)
    lasts = time.monotonic() - began
    expected = results(whole)
    killed = 0
    for number in range(10 * ROUNDS):
        folder = tmp_path / str(number)
        folder.mkdir()
        for _ in range(2):
            if is_finished(folder, command):
                break
            killed += kill(going_on(words, folder), folder, chance.uniform(0, lasts), chance.choice(SIGNALS))
        if not is_finished(folder, command):
            finish(going_on(words, folder), folder)
        assert results(folder) == expected
        shutil.rmtree(folder)
        if killed >= 2 * ROUNDS:
            break
    print(f"{command}: killed {killed} times")
    assert killed >= 2 * ROUNDS


def is_finished(folder: Path, command):
    statuses = list(folder.glob("run/status.json" if command != "reproduce" else "runs/reproduce/*/status.json"))
    return bool(statuses) and Run(statuses[0].parent).recorded_status.get("state") == "finished"
