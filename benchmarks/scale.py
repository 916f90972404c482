"""How the cost of a step depends on how many robots live (CPU time), and what a second thread is worth (wall time).

The control beside it: what a second process is worth that shares nothing with the first. More than that the machine
does not give to anyone.
"""

import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, wait
from multiprocessing import get_context
from statistics import median

from step import LIFETIME, SCENARIO, individuals, microseconds

from epuckhebb.tmaze.batch import run_lifetimes

REPEATS = 3


def measure() -> list[tuple[str, str]]:
    """Microseconds a robot-step for 1 to 5,000 robots on 1 thread; and the gain of 2 threads and of 2 processes."""
    run_lifetimes(individuals(2), SCENARIO, LIFETIME)  # loads the kernel
    rows = []
    for robots in (1, 10, 50, 500, 5000):
        spent = median(_once(robots, 1, time.process_time) for _ in range(REPEATS))
        rows.append((f"{robots} robots, 1 thread", f"{spent:.2f} us"))
    pairs = [(_once(500, 1), _once(500, 2)) for _ in range(REPEATS)]
    rows.append(("500 robots, 2 threads: gain", f"{median(one / two for one, two in pairs):.2f}"))
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        wait([pool.submit(_once, 500, 1) for _ in range(2)])  # both are started, and have their kernel
        gains = [2 * _together(pool, 1) / _together(pool, 2) for _ in range(REPEATS)]
    rows.append(("500 robots each, 2 processes that share nothing: gain", f"{median(gains):.2f}"))
    return rows


def _together(pool: ProcessPoolExecutor, processes: int) -> float:
    """Seconds until so many processes have let 500 robots live."""
    began = time.perf_counter()
    wait([pool.submit(_once, 500, 1) for _ in range(processes)])
    return time.perf_counter() - began


def _once(robots: int, threads: int, clock: Callable[[], float] = time.perf_counter) -> float:
    block = individuals(robots)

    def run() -> int:
        run_lifetimes(block, SCENARIO, LIFETIME, threads)
        return robots * LIFETIME.steps

    return microseconds(run, clock)
