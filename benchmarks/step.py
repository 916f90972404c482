"""What a control step costs: this engine against the program as one would first write it, in one run.

Both do the same: 8 rays, light, noise, network, plasticity, contact; the plain loop is `tests/reference.py`, plain
pymunk and NumPy for one robot. Times are CPU time of one thread; medians of several repeats. The robots are evolved
ones and drive through the maze, so they meet walls as often as robots do.
"""

import os
import statistics
import sys
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path

import epuckhebb
from epuckhebb.sim.lifetime import Life, Lifetime, live_block
from epuckhebb.sim.maze import SIDES
from epuckhebb.sim.plasticity import Hebbian
from epuckhebb.sim.scenario import Scenario
from epuckhebb.sim.streams import Stream, key

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
import reference

BLOCK, REPEATS, SECONDS = 50, 7, 60.0
PLAIN_STEPS = 1500
SCENARIO, HEBBIAN, LIFETIME = Scenario(), Hebbian(N=0.000015), Lifetime(duration_s=SECONDS, gain_rad_s=4.0)


def main() -> None:
    genome = epuckhebb.load("reference")
    lives = [
        Life(genome=genome, side=SIDES[robot % 2], hebbian=HEBBIAN, key=key(1, Stream.evaluation_noise, robot))
        for robot in range(BLOCK)
    ]

    def ours() -> int:
        live_block(lives, SCENARIO, LIFETIME)
        return BLOCK * LIFETIME.steps

    def plain() -> int:
        for side in SIDES:
            robot = reference.Robot(genome, SCENARIO, side, HEBBIAN, LIFETIME.gain_rad_s, key=lives[0].key)
            for _ in range(PLAIN_STEPS):
                robot.step()
        return len(SIDES) * PLAIN_STEPS

    ours()
    plain()
    pairs = [(_microseconds(ours), _microseconds(plain)) for _ in range(REPEATS)]
    ratio = statistics.median(slow / fast for fast, slow in pairs)
    print(f"pymunk {version('pymunk')}, numba {version('numba')}, numpy {version('numpy')}, {os.cpu_count()} cores")
    print(f"plain pymunk + NumPy   {statistics.median(slow for _, slow in pairs):8.2f} us a robot-step")
    print(f"epuckhebb, block of {BLOCK} {statistics.median(fast for fast, _ in pairs):8.2f} us a robot-step")
    print(f"ratio                  {ratio:8.1f}")


def _microseconds(run: Callable[[], int]) -> float:
    began = time.process_time()
    steps = run()
    return (time.process_time() - began) / steps * 1e6


if __name__ == "__main__":
    main()
