"""How the cost of a step depends on how many robots live, and what a second thread is worth; wall time, medians."""

import time
from statistics import median

from step import LIFETIME, SCENARIO, lives, microseconds

from epuckhebb.sim.lifetime import Lifetime, live_block

REPEATS = 5


def measure() -> list[tuple[str, str]]:
    """Microseconds a robot-step for 1 to 5,000 robots on 1 thread, and the gain of 2 threads for 500."""
    rows = []
    for robots in (1, 10, 50, 500, 5000):
        seconds = 60.0 if robots <= 500 else 6.0  # equal work would take a minute; the step costs the same
        spent = median(_once(robots, 1, seconds) for _ in range(REPEATS))
        rows.append((f"{robots} robots, 1 thread", f"{spent:.2f} us"))
    pairs = [(_once(500, 1), _once(500, 2)) for _ in range(REPEATS)]
    rows.append(("500 robots, 2 threads: gain", f"{median(one / two for one, two in pairs):.2f}"))
    return rows


def _once(robots: int, threads: int, seconds: float = LIFETIME.duration_s) -> float:
    block = lives(robots)
    lifetime = Lifetime(duration_s=seconds, gain_rad_s=LIFETIME.gain_rad_s)

    def run() -> int:
        live_block(block, SCENARIO, lifetime, threads)
        return robots * lifetime.steps

    return microseconds(run, time.perf_counter)
