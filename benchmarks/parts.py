"""The parts of a control step, each in a compiled loop of its own."""

import math
import time
from collections.abc import Callable
from statistics import median
from typing import Any

import numpy as np
from numba import njit

import epuckhebb
from epuckhebb.sim import light, maze
from epuckhebb.sim.controller import GENES, NEURONS, forward, weights_at_birth
from epuckhebb.sim.epuck import cast, sense, sensor_rays
from epuckhebb.sim.noise import normal_numbers
from epuckhebb.sim.plasticity import CHANGE_ROOM, Hebbian, learn, rule
from epuckhebb.sim.world import World, move

LOOPS, REPEATS = 100_000, 7
loop: Any = njit(nogil=True, error_model="numpy")


@loop
def rays_loop(n, rays, walls, distance):
    for k in range(n):
        heading, y = 1.57 + k * 1e-6, -0.35 + k * 5e-6
        sensor_rays(0.007, y, math.cos(heading), math.sin(heading), rays)
        cast(0.007, y, rays, walls, distance)


@loop
def sense_loop(n, rays, distance, lit, numbers, activation):
    for _ in range(n):
        sense(rays, distance, lit, numbers, 1.0, activation)


@loop
def noise_loop(n, key, numbers):
    summed = 0.0
    for k in range(n):
        normal_numbers(key, k, numbers)
        summed += numbers[k % 16]
    return summed


@loop
def network_loop(n, weights, activation, drive):
    for k in range(n):
        activation[0] = k * 1e-6
        forward(weights, activation, drive)


@loop
def plasticity_loop(n, weights, trace, genes, activation, by, signs, correlation, change):
    for _ in range(n):
        learn(weights, trace, genes, activation, 1e-9, by, signs, correlation, change)


@loop
def world_loop(n, handles, speed):
    for _ in range(n):
        heading = handles.state[2]
        move(handles, math.cos(heading), math.sin(heading), speed, speed)


def measure() -> list[tuple[str, str]]:
    """Name and median time of each part."""
    walls, lit = maze.boxes(0), light.lights(0.1, light.Lamp(), True)
    rays, distance, numbers, activation = np.empty((6, 8)), np.empty(8), np.zeros(16), np.full(NEURONS, 0.3)
    genes, by = weights_at_birth(epuckhebb.load("reference")), rule(Hebbian(N=1e-5))
    trace, signs, room, change = np.zeros(GENES), np.ones(GENES), np.empty(GENES), np.empty(CHANGE_ROOM)
    still, wall, corner = (World(walls) for _ in range(3))
    still.place_robot(maze.START)
    wall.place_robot(maze.Pose(0.007, 0.16, math.pi / 2))
    corner.place_robot(maze.Pose(-0.375, 0.17, 3 * math.pi / 4))
    return [
        ("rays", _time(rays_loop, rays, walls, distance)),
        ("light and infra-red", _time(sense_loop, rays, distance, lit, numbers, activation)),
        ("noise", _time(noise_loop, np.uint64(7), numbers)),
        ("network", _time(network_loop, genes, activation, np.empty(8))),
        ("plasticity", _time(plasticity_loop, genes.copy(), trace, genes, activation, by, signs, room, change)),
        ("world, away from walls", _time(world_loop, still.handles, 0.0)),
        ("world, against a wall", _time(world_loop, wall.handles, 1.0)),
        ("world, in a corner", _time(world_loop, corner.handles, 1.0)),
    ]


def _time(compiled: Callable[..., None], *arguments: object) -> str:
    compiled(100, *arguments)
    spent = []
    for _ in range(REPEATS):
        began = time.process_time()
        compiled(LOOPS, *arguments)
        spent.append((time.process_time() - began) / LOOPS * 1e9)
    return f"{median(spent):.0f} ns"
