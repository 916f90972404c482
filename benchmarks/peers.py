"""A control step of another program of this kind, timed in turn with ours: same maze, robots, rays, network, one core.

Kheperax (Grillotti & Cully 2023) compiles all robots of a batch into one JAX program. The plain loop is
`tests/reference.py`, the program as one would first write it. What each does and does not do stands beside its figure:
a ratio of unlike things says nothing alone. `nox -s peers` installs Kheperax and writes `benchmarks/peers.md`.
"""

import os
from collections.abc import Callable
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from statistics import median

import jax
import numpy as np
from kheperax.simu.geoms import Pos, Segment
from kheperax.simu.maze import Maze
from kheperax.simu.posture import Posture
from kheperax.tasks.config import KheperaxConfig
from kheperax.tasks.main import KheperaxTask
from step import LIFETIME, individuals, microseconds, ours, plain

from epuckhebb.analysis.tables import Table
from epuckhebb.controller.network import PAPER_NETWORK
from epuckhebb.tmaze.individual import GA_ALONE
from epuckhebb.tmaze.maze import T_MAZE, boxes
from epuckhebb.tmaze.robot import EPUCK

ROBOTS, REPEATS = 50, 7
RESULTS = Path(__file__).with_name("peers.md")
DOES = {
    "epuckhebb, plasticity on": (
        "8 rays with the sensors' curve and noise, 8 light sensors, rigid contacts, network, plasticity, live fitness",
        "–",
    ),
    "epuckhebb, plasticity off": ("the same without plasticity", "plasticity"),
    "Kheperax": (
        "8 rays, 2 bumpers, network of the same hidden layers; a robot that would touch a wall stays where it was",
        "rigid contacts, noise, light, plasticity, live fitness; single precision",
    ),
    "plain pymunk + NumPy": ("all that epuckhebb does, to the same numbers", "–"),
}


def kheperax() -> Callable[[], int]:
    """A function that lets a batch of Kheperax's robots live in our maze and returns how many robot-steps that were."""
    jax.tree_leaves = jax.tree.leaves  # which Kheperax 0.2 asks for, and newer JAX calls otherwise
    walls = boxes(T_MAZE)
    low, high = walls[:, [0, 2]].min(axis=0), walls[:, [1, 3]].max(axis=0)
    maze = Maze.create(
        [Segment(Pos(*one), Pos(*other)) for one, other in _edges_of_corridors(walls)],
        (tuple(low.tolist()), tuple(high.tolist())),
    )
    config = KheperaxConfig.get_default()
    config.episode_length = LIFETIME.steps
    config.mlp_policy_hidden_layer_sizes = PAPER_NETWORK.layers[1:-1]
    config.maze = maze
    config.robot = config.robot.replace(
        posture=Posture(*T_MAZE.start),
        radius=EPUCK.radius_m,
        laser_ranges=EPUCK.distance.reach_m,
        laser_angles=jax.numpy.array([np.radians(place.azimuth) for place in EPUCK.distance.places]),
    )
    env, network, score = KheperaxTask.create_default_task(config, jax.random.PRNGKey(0))
    readings = jax.numpy.zeros((ROBOTS, env.observation_size))
    genomes = jax.vmap(network.init)(jax.random.split(jax.random.PRNGKey(1), ROBOTS), readings)
    compiled = jax.jit(score)

    def live() -> int:
        jax.block_until_ready(compiled(genomes, jax.random.PRNGKey(2)))
        return ROBOTS * LIFETIME.steps

    live()
    return live


def _edges_of_corridors(walls: np.ndarray) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """Those edges of boxes (boxes, 4) that a robot can come to: the outside of their middle is in no other box."""
    found = []
    low, high = walls[:, [0, 2]].min(axis=0), walls[:, [1, 3]].max(axis=0)
    for left, right, bottom, top in walls.tolist():
        for one, other, out in (
            ((left, bottom), (left, top), (-1, 0)),
            ((right, bottom), (right, top), (1, 0)),
            ((left, bottom), (right, bottom), (0, -1)),
            ((left, top), (right, top), (0, 1)),
        ):
            beside = (np.array(one) + other) / 2 + 1e-3 * np.array(out)  # a millimetre away
            inside = (walls[:, [0, 2]] < beside).all(axis=1) & (beside < walls[:, [1, 3]]).all(axis=1)
            if (low < beside).all() and (beside < high).all() and not inside.any():
                found.append((one, other))
    return found


def main() -> None:
    """Measure all in turn, and write the page."""
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})  # before JAX begins to work: with two cores it takes longer
    plastic, fixed, batch = individuals(ROBOTS), individuals(ROBOTS, GA_ALONE), kheperax()
    timed: dict[str, Callable[[], int]] = {
        "epuckhebb, plasticity on": lambda: ours(plastic),
        "epuckhebb, plasticity off": lambda: ours(fixed),
        "Kheperax": batch,
        "plain pymunk + NumPy": plain,
    }
    for robots in (plastic, fixed):
        ours(robots[:2])  # compiled before
    times = [{name: microseconds(live) for name, live in timed.items()} for _ in range(REPEATS)]
    rows = []
    for name, (does, lacks) in DOES.items():
        ratio = median(one[name] / one["epuckhebb, plasticity off"] for one in times)
        rows.append([name, f"{median(one[name] for one in times):.2f} us", f"{ratio:.2f}", does, lacks])
    packages = ", ".join(f"{name} {version(name)}" for name in ("epuckhebb", "kheperax", "jax", "pymunk", "numba"))
    page = (
        f"# Peers\n\n{datetime.now(UTC):%Y-%m-%d}, {packages}; one core, load average {os.getloadavg()[0]:.2f} at the "
        f"end. CPU time of a robot-step, medians of {REPEATS} turns, {ROBOTS} robots, {LIFETIME.steps} steps each, "
        "compiled before; the ratio is the median of the ratios turn by turn. `nox -s peers` measures anew.\n\n"
    )
    head = ["", "a robot-step", "ratio to epuckhebb, plasticity off", "does", "does not"]
    RESULTS.write_text(page + Table(head, rows).markdown(), encoding="utf-8")
    print(RESULTS.read_text(encoding="utf-8"))


if __name__ == "__main__":
    main()
