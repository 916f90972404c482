"""Run the program in processes that are killed with -9 at a chosen write, as `python killed.py WORDS... -- POINT...`.

A point is the number of a write and where in it: `3 before`, `3 beside` (the new file beside its place) or `3 after`.
After each, `evolve resume=` goes on to the end. Everything is imported and compiled once; each process is a fork.
"""

import os
import signal
import sys
from pathlib import Path

import epuckhebb
import epuckhebb.runs.evolve
from epuckhebb.cli import commands
from epuckhebb.store import disk


def die_at(number, where):
    """Make the process kill itself at a write."""
    write, replace = disk.write_atomic, Path.replace
    seen = 0

    def die():
        os.kill(os.getpid(), signal.SIGKILL)

    def dying_replace(self, target):
        if seen == number and where == "beside":
            die()
        return replace(self, target)

    def dying_write(target, content):
        nonlocal seen
        seen += 1
        if seen == number and where == "before":
            die()
        write(target, content)
        if seen == number:
            die()

    disk.write_atomic, Path.replace = dying_write, dying_replace


def run(words, point=None):
    """The exit status of a fork that runs the program."""
    child = os.fork()
    if child:
        return os.waitpid(child, 0)[1]
    if point:
        die_at(int(point[0]), point[1])
    sys.argv = ["epuckhebb", *words]
    commands.app()
    return None


if __name__ == "__main__":
    cut = sys.argv.index("--")
    words, points = sys.argv[1:cut], sys.argv[cut + 1 :]
    epuckhebb.evolve("ga.population=2", "ga.elites=1", "ga.generations=1", "ga.loops=1", "lifetime.duration_s=1")
    for point in zip(points[::2], points[1::2], strict=True):
        folder = f"killed_{'_'.join(point)}"
        assert run([*words, f"hydra.run.dir={folder}"], point) == signal.SIGKILL, point
        assert run(["evolve", f"resume={folder}", "-q"]) == 0, point
