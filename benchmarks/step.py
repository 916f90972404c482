"""What a control step costs: this engine against the program as one would first write it.

Both do the same: 8 rays, light, noise, network, plasticity, contact; the plain loop is `tests/reference.py`, plain
pymunk and NumPy for one robot. The robots are evolved ones and drive through the maze, so they meet walls as often as
robots do.
"""

import sys
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median

import epuckhebb
from epuckhebb.sim.lifetime import Life, Lifetime, live_block
from epuckhebb.sim.maze import SIDES
from epuckhebb.sim.plasticity import Hebbian
from epuckhebb.sim.scenario import Scenario
from epuckhebb.sim.streams import Stream, key

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
import reference

REPEATS = 7
PLAIN_STEPS = 1500
SCENARIO, HEBBIAN, LIFETIME = Scenario(), Hebbian(N=0.000015), Lifetime(duration_s=60, gain_rad_s=4.0)


def lives(count: int, hebbian: Hebbian = HEBBIAN) -> list[Life]:
    """So many lifetimes of the bundled champion, each with its own noise, left and right in turn."""
    genome = epuckhebb.load("reference")
    return [
        Life(genome=genome, side=SIDES[robot % 2], hebbian=hebbian, key=key(1, Stream.evaluation_noise, robot))
        for robot in range(count)
    ]


def microseconds(run: Callable[[], int], clock: Callable[[], float] = time.process_time) -> float:
    """Time of one call of `run`, divided by the robot-steps that it returns."""
    began = clock()
    steps = run()
    return (clock() - began) / steps * 1e6


def measure() -> list[tuple[str, str]]:
    """A step of each engine, measured in turn; CPU time, medians, and the median of the ratios pair by pair."""
    block, without = lives(50), lives(50, Hebbian(N=0.0))

    def ours(robots: list[Life]) -> int:
        live_block(robots, SCENARIO, LIFETIME)
        return len(robots) * LIFETIME.steps

    def plain() -> int:
        for side in SIDES:
            robot = reference.Robot(block[0].genome, SCENARIO, side, HEBBIAN, LIFETIME.gain_rad_s, key=block[0].key)
            for _ in range(PLAIN_STEPS):
                robot.step()
        return len(SIDES) * PLAIN_STEPS

    ours(block[:2])
    times = [
        (microseconds(lambda: ours(block)), microseconds(lambda: ours(without)), microseconds(plain))
        for _ in range(REPEATS)
    ]
    fast, fixed, slow = (median(column) for column in zip(*times, strict=True))
    return [
        ("plain pymunk + NumPy, plasticity on", f"{slow:.1f} us"),
        ("epuckhebb, block of 50, plasticity on", f"{fast:.2f} us"),
        ("epuckhebb, block of 50, N = 0", f"{fixed:.2f} us"),
        ("ratio, plasticity on", f"{median(p / f for f, _, p in times):.0f}"),
    ]


if __name__ == "__main__":
    for name, figure in measure():
        print(f"{name:40s} {figure:>10s}")
