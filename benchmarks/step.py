"""What a control step costs: this engine against the program as one would first write it.

Both do the same: 8 rays, light, noise, network, plasticity, contact; the plain loop is `tests/reference.py`, plain
pymunk and NumPy for one robot. The robots are evolved ones and drive through the maze, so they meet walls as often as
robots do.
"""

import sys
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median

import numpy as np

from epuckhebb.config.parts import KINDS, part_class
from epuckhebb.controller.genome import make_plan
from epuckhebb.controller.network import PAPER_NETWORK
from epuckhebb.controller.plasticity.rule import InitialWeights, Rule
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.controller.random import Stream, key
from epuckhebb.evolution.optimizer import initial
from epuckhebb.tmaze.batch import run_lifetimes
from epuckhebb.tmaze.individual import GA_ALONE, Controller, Individual
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.maze import SIDES
from epuckhebb.tmaze.scenario import Scenario

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
import reference

REPEATS = 7
PLAIN_STEPS = 1500
SCENARIO, LIFETIME = Scenario(), Lifetime(duration_s=60, gain_rad_s=4.0)
GENES = Path(__file__).parents[1] / "runs" / "reference" / "champion_obstacles.npz"


def by(rule: type[Rule]) -> Controller:
    """A controller with this rule, at the paper's rate; weights at birth are the champion's."""
    return Controller(name="Hebbian", rule=rule(N=0.000015, initial_weights=InitialWeights.evolved))


HEBBIAN = by(Paper)


def individuals(count: int, controller: Controller = HEBBIAN) -> list[Individual]:
    """So many lifetimes of the bundled champion, each with its own noise, left and right in turn.

    What a rule evolves is drawn at random.
    """
    genes = initial(np.random.default_rng(1), 1, make_plan(PAPER_NETWORK, type(controller.rule)))[0]
    genes[: PAPER_NETWORK.synapses] = np.load(GENES)["genome"]
    return [
        Individual(
            genes=genes, side=SIDES[robot % 2], controller=controller, key=key(1, Stream.evaluation_noise, robot)
        )
        for robot in range(count)
    ]


def microseconds(run: Callable[[], int], clock: Callable[[], float] = time.process_time) -> float:
    """Time of one call of `run`, divided by the robot-steps that it returns."""
    began = clock()
    steps = run()
    return (clock() - began) / steps * 1e6


def ours(robots: list[Individual]) -> int:
    """Let robots live; returns how many robot-steps that were."""
    run_lifetimes(robots, SCENARIO, LIFETIME)
    return len(robots) * LIFETIME.steps


def plain() -> int:
    """Let a robot live in the plain loop, left and right; returns how many robot-steps that were."""
    champion = individuals(1)[0]
    for side in SIDES:
        robot = reference.Robot(
            champion.genes, SCENARIO, side, HEBBIAN, gain=LIFETIME.gain_rad_s, key=int(champion.key)
        )
        for _ in range(PLAIN_STEPS):
            robot.step()
    return len(SIDES) * PLAIN_STEPS


def measure() -> list[tuple[str, str]]:
    """A step of each engine, measured in turn; CPU time, medians, and the median of the ratios pair by pair."""
    block, without = individuals(50), individuals(50, GA_ALONE)
    others = {
        name: individuals(50, by(part_class("rule", name, "hebbian")))
        for name in KINDS["rule"].names
        if name != "paper"
    }

    for robots in (block, without, *others.values()):
        ours(robots[:2])
    times = [
        (
            microseconds(lambda: ours(block)),
            microseconds(lambda: ours(without)),
            microseconds(plain),
            *(microseconds(partial(ours, robots)) for robots in others.values()),
        )
        for _ in range(REPEATS)
    ]
    columns = list(zip(*times, strict=True))
    fast, fixed, slow = (median(column) for column in columns[:3])
    rest = columns[3:]
    ratios = [median(one / none for one, none in zip(column, columns[1], strict=True)) for column in rest]
    return [
        ("plain pymunk + NumPy, plasticity on", f"{slow:.1f} us"),
        ("epuckhebb, block of 50, plasticity on", f"{fast:.2f} us"),
        *(
            (f"the same, rule {name}", f"{median(column):.2f} us, {ratio:.2f} x N = 0")
            for name, column, ratio in zip(others, rest, ratios, strict=True)
        ),
        ("epuckhebb, block of 50, N = 0", f"{fixed:.2f} us"),
        ("ratio, plasticity on", f"{median(p / f for f, _, p, *_ in times):.0f}"),
    ]


if __name__ == "__main__":
    for name, figure in measure():
        print(f"{name:40s} {figure}")
