"""The Python of a lifetime in the maze: lifetimes of one step, on one thread; CPU time. More threads wait for it."""

import time
from collections.abc import Callable
from statistics import median

import numpy as np
from step import GENES, HEBBIAN

from epuckhebb.analysis.evaluate import evaluate
from epuckhebb.controller.network import PAPER_NETWORK
from epuckhebb.controller.random import Stream, rng
from epuckhebb.evolution.evolve import MazeEvaluator
from epuckhebb.evolution.optimizers.ga import GA
from epuckhebb.evolution.training import Training
from epuckhebb.store.folder import as_bytes
from epuckhebb.tmaze.individual import GA_ALONE
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.robot import STEP_S
from epuckhebb.tmaze.scenario import Scenario

REPEATS = 5
EVALUATED, POPULATION, LOOPS = 10_000, 3_334, 3  # 20,004 lifetimes of an evolution, on both sides
SCENARIO, LIFETIME = Scenario(), Lifetime(duration_s=STEP_S)


def measure() -> list[tuple[str, str]]:
    """Milliseconds a lifetime of `evaluate`, rows written, and of a generation of `evolve`."""
    genes = np.load(GENES)["genome"]
    population = rng(1, Stream.variation).uniform(-1.0, 1.0, (POPULATION, PAPER_NETWORK.synapses))
    ga = GA(population=POPULATION, loops=LOOPS)
    evaluator = MazeEvaluator(ga, SCENARIO, LIFETIME, Training(), 1, PAPER_NETWORK, GA_ALONE, threads=1)

    def evaluated(count: int) -> None:
        rows, _ = evaluate(genes, SCENARIO, [HEBBIAN], LIFETIME, repeats=count // 4, seed=1)
        as_bytes(rows)

    def evolved(count: int) -> None:
        evaluator.evaluate(population[: count // (2 * LOOPS)], 0)

    return [
        (f"evaluate, {EVALUATED:,} lifetimes", _milliseconds(evaluated, EVALUATED)),
        (f"evolve, {POPULATION * 2 * LOOPS:,} lifetimes", _milliseconds(evolved, POPULATION * 2 * LOOPS)),
    ]


def _milliseconds(run: Callable[[int], None], count: int) -> str:
    run(100)  # loads the kernel
    spent = []
    for _ in range(REPEATS):
        began = time.process_time()
        run(count)
        spent.append((time.process_time() - began) / count * 1e3)
    return f"{median(spent):.3f} ms ({min(spent):.3f})"


if __name__ == "__main__":
    for name, figure in measure():
        print(f"{name:40s} {figure}")
