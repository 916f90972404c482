"""How the cost of a step depends on how many robots live (CPU time), and what a second thread is worth (wall time)."""

import time
from collections.abc import Callable
from statistics import median

from step import LIFETIME, SCENARIO, individuals, microseconds

from epuckhebb.sim.block import live_block

REPEATS = 3


def measure() -> list[tuple[str, str]]:
    """Microseconds a robot-step for 1 to 5,000 robots on 1 thread, and the gain of 2 threads for 500."""
    live_block(individuals(2), SCENARIO, LIFETIME)  # loads the kernel
    rows = []
    for robots in (1, 10, 50, 500, 5000):
        spent = median(_once(robots, 1, time.process_time) for _ in range(REPEATS))
        rows.append((f"{robots} robots, 1 thread", f"{spent:.2f} us"))
    pairs = [(_once(500, 1), _once(500, 2)) for _ in range(REPEATS)]
    rows.append(("500 robots, 2 threads: gain", f"{median(one / two for one, two in pairs):.2f}"))
    return rows


def _once(robots: int, threads: int, clock: Callable[[], float] = time.perf_counter) -> float:
    block = individuals(robots)

    def run() -> int:
        live_block(block, SCENARIO, LIFETIME, threads)
        return robots * LIFETIME.steps

    return microseconds(run, clock)
