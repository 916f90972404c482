"""The parts of a control step, each in a compiled loop of its own."""

import math
import time
from collections.abc import Callable
from statistics import median
from typing import Any

import numpy as np
from numba import njit
from step import GENES

from epuckhebb.config import load_any
from epuckhebb.controller.controller import Controller
from epuckhebb.controller.forward_pass import forward_pass
from epuckhebb.controller.genome import make_plan
from epuckhebb.controller.genotype import Genotype
from epuckhebb.controller.network import PAPER_NETWORK, starting_weights
from epuckhebb.controller.own_class import stored
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.controller.plasticity.update import StepContext, make_update, make_workspace
from epuckhebb.controller.random import normal_numbers
from epuckhebb.tmaze import light
from epuckhebb.tmaze.maze import T_MAZE, Pose, boxes
from epuckhebb.tmaze.physics.pymunk import PYMUNK, PymunkSpace, mover
from epuckhebb.tmaze.robot import EPUCK, STEP_S
from epuckhebb.tmaze.senses import sense_workspace, senses

LOOPS, REPEATS = 100_000, 7
loop: Any = njit(nogil=True, error_model="numpy")
sense, draw_noise, forward, move = senses(EPUCK, PYMUNK), normal_numbers(16), forward_pass(PAPER_NETWORK), mover(EPUCK)
learn = make_update(Paper, PAPER_NETWORK)


@loop
def senses_loop(n, space, lit, numbers, room, activation):
    for k in range(n):
        heading, y = 1.57 + k * 1e-6, -0.35 + k * 5e-6
        sense(0.007, y, math.cos(heading), math.sin(heading), space, lit, numbers, 1.0, room, activation)


@loop
def noise_loop(n, key, numbers):
    summed = 0.0
    for k in range(n):
        draw_noise(key, k, numbers)
        summed += numbers[k % 16]
    return summed


@loop
def network_loop(n, weights, activation, drive):
    for k in range(n):
        activation[0] = k * 1e-6
        forward(weights, activation, drive)


@loop
def plasticity_loop(n, weights, synapse_state, genotype, activation, numbers, workspace):
    context = StepContext(0.5, np.uint64(1), 0, STEP_S)
    for _ in range(n):
        learn(weights, synapse_state, genotype, activation, 1e-9, context, numbers, workspace)


@loop
def physics_loop(n, handles, speed):
    for _ in range(n):
        heading = handles.state[2]
        move(handles, math.cos(heading), math.sin(heading), speed, speed)


def measure() -> list[tuple[str, str]]:
    """Name and median time of each part."""
    walls, lit, network = boxes(T_MAZE), light.lights(0.1, light.Lamp(), True), PAPER_NETWORK
    numbers, activation = np.zeros(16), np.full(network.neurons, 0.3)
    genes, settings = starting_weights(np.load(GENES)["genome"]), Paper(N=1e-5).numbers()
    state, nothing = stored(Paper.synapse_state, network.synapses), np.empty(0)
    genotype = Genotype(genes, state, np.empty((0, network.synapses)), nothing, nothing, np.ones(network.synapses))
    plasticity = genes.copy(), state, genotype, activation, settings, make_workspace(network)
    still, wall, corner = (PymunkSpace(walls, EPUCK) for _ in range(3))
    still.place_robot(T_MAZE.start)
    wall.place_robot(Pose(0.007, 0.16, math.pi / 2))
    corner.place_robot(Pose(-0.375, 0.17, 3 * math.pi / 4))
    return [
        (
            "rays, light and infra-red",
            _time(senses_loop, still.handles, lit, numbers, sense_workspace(EPUCK, PYMUNK), activation),
        ),
        ("noise", _time(noise_loop, np.uint64(7), numbers)),
        ("network", _time(network_loop, genes, activation, np.empty(network.neurons))),
        ("plasticity", _time(plasticity_loop, *plasticity)),
        ("physics, away from walls", _time(physics_loop, still.handles, 0.0)),
        ("physics, against a wall", _time(physics_loop, wall.handles, 1.0)),
        ("physics, in a corner", _time(physics_loop, corner.handles, 1.0)),
        *((f"foraging, a whole robot-step, {name}", foraging(name)) for name in ("N = 0", "abcd", "modulated")),
    ]


def foraging(rule: str) -> str:
    """The time of a robot-step in `environment=foraging`, with its default network and random genes."""
    name = "none" if rule == "N = 0" else rule
    config = load_any("evolve", ["environment=foraging", f"hebbian={name}"])
    genes = np.random.default_rng(1).uniform(-1, 1, make_plan(config.network_made, type(config.rule)).genes)
    controller, steps = Controller(genes, config.network_made, config.rule), config.environment.horizon
    lives = LOOPS // steps

    def live(_: int) -> None:
        for seed in range(lives):
            config.world.live(controller, seed)

    return _time(live)


def _time(compiled: Callable[..., None], *arguments: object) -> str:
    compiled(100, *arguments)
    spent = []
    for _ in range(REPEATS):
        began = time.process_time()
        compiled(LOOPS, *arguments)
        spent.append((time.process_time() - began) / LOOPS * 1e9)
    return f"{median(spent):.0f} ns"
