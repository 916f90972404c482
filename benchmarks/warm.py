"""What commands cost whose kernels are on disk: what a user waits for, day by day."""

import os
import pty
import subprocess
import sys
import tempfile
import time
from contextlib import suppress
from pathlib import Path
from statistics import median

import commands

REPEATS = 5
IMPORTS = "import numpy, numba, pymunk, hydra, typer, rich"
WORDS = {
    "evaluate scenario=lowlight": ["evaluate", "scenario=lowlight"],
    "the same, figures=none": ["evaluate", "scenario=lowlight", "figures=none"],
    "scenario.light=0.3 figures=none": ["evaluate", "scenario.light=0.3", "figures=none"],
}


def measure() -> list[tuple[str, str]]:
    """Seconds of `evaluate`, until its table is on a terminal and until its end, beside bare imports; of `evolve`."""
    with tempfile.TemporaryDirectory() as folder:
        here = Path(folder)
        _evaluate(here)  # compiles
        commands.spent(here, "evolve", "ga.generations=1")
        table, end = zip(*(_evaluate(here) for _ in range(REPEATS)), strict=True)
        program = [sys.executable, "-c", IMPORTS]
        times: dict[str, list[tuple[float, float]]] = {"the imports alone": [], **{name: [] for name in WORDS}}
        for _ in range(REPEATS):  # in turn: the machine may have other work
            times["the imports alone"].append(commands.spent_by(program, here))
            for name, words in WORDS.items():
                times[name].append(commands.spent(here, *words))
        return [
            *((name, commands.told(*spent)) for name, spent in times.items()),
            ("evaluate, until its table is on the terminal", f"{median(table):.2f} s"),
            ("evaluate", f"{median(end):.2f} s"),
            ("evolve, the paper's size", commands.told(*(commands.spent(here, "evolve") for _ in range(REPEATS)))),
        ]


def _evaluate(here: Path) -> tuple[float, float]:
    """Seconds until an evaluation has its table on a terminal, and until its end."""
    terminal, its_end = pty.openpty()
    words = [commands.EPUCKHEBB, "evaluate", "scenario=4obstacles"]
    began, said = time.perf_counter(), b""
    running = subprocess.Popen(words, cwd=here, env=commands.environment(here), stdout=its_end, stderr=its_end)
    os.close(its_end)
    while b"Success" not in said:  # in the head of the table
        said += os.read(terminal, 1000)
    until_table = time.perf_counter() - began
    with suppress(OSError):  # its end is closed: the command has ended
        while os.read(terminal, 1000):
            pass
    if running.wait():
        raise RuntimeError(said.decode())
    return until_table, time.perf_counter() - began
