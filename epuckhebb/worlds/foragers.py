"""Scripted foragers: what a controller can earn in `epuckhebb.worlds.foraging`, beside what it does earn.

| forager | what it takes for food |
| --- | --- |
| knows | what is food |
| win-stay lose-shift | the colour that it ate last, if that was food; else the other one |
| innate | green items, in summer and in winter: 0 on average, and nobody who cannot learn gets more |

All move alike: to food if it is ahead or to a side; else where nothing is, mostly on; else against the wall, which turns
them. Among items that are no food, they eat one now and then, or they would stay there for ever.
"""

from collections.abc import Callable

import numpy as np

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.random import Stream, rng
from epuckhebb.worlds.foraging import Foraging, is_summer

_TURNS = 0.05  # share of the steps without food with a turn, so that no forager walks in a circle
_ESCAPES = 0.2  # share of the steps with no free cell in which it eats what it finds
GREEN, BLUE = range(2)
LEFT, AHEAD, RIGHT = range(3)

Belief = Callable[[Foraging, int, int | None], int]  # what is food now, from what was so far and what eating has told

FORAGERS: dict[str, Belief] = {
    "knows": lambda world, *_: GREEN if is_summer(world.state.robot, world.season, world.winter) else BLUE,
    "win-stay lose-shift": lambda _, belief, told: belief if told is None else told,
    "innate": lambda _, belief, __: belief,
}


def earned(world: Foraging, forager: str, seed: int, steps: int) -> Floats:
    """The rewards of a scripted forager, (steps,), in a lifetime of this seed."""
    believe, drawn = FORAGERS[forager], rng(seed, Stream.environment_check)
    (readings, _), belief, told, rewards = world.reset(seed=seed), GREEN, None, np.zeros(steps)
    for step in range(steps):
        belief = believe(world, belief, told)
        way = _way(readings, belief, drawn)
        eaten = GREEN if readings[2 * way] > 0 else BLUE
        readings, reward, *_ = world.step(way)
        told = None if reward == 0 else eaten if reward > 0 else 1 - eaten
        rewards[step] = reward
    return rewards


def _way(readings: Floats, food: int, drawn: np.random.Generator) -> int:
    """Where to go. readings: (6,), green and blue of the cells to the left, ahead and to the right."""
    cells = readings.reshape(3, 2) > 0
    is_food, is_wall, is_empty = cells[:, food] & ~cells[:, 1 - food], cells.all(axis=1), ~cells.any(axis=1)
    sides = [LEFT, RIGHT] if drawn.random() < 0.5 else [RIGHT, LEFT]
    order = [*sides, AHEAD] if drawn.random() < _TURNS else [AHEAD, *sides]
    is_stuck = not (is_food | is_empty).any() and drawn.random() < _ESCAPES
    choices = (~is_wall,) if is_stuck else (is_food, is_empty, is_wall)
    return next((way for those in choices for way in order if those[way]), AHEAD)


def by_season(rewards: Floats, season: int) -> Floats:
    """The reward of each whole season, (..., seasons). rewards: (..., steps)."""
    seasons = rewards.shape[-1] // season
    return rewards[..., : seasons * season].reshape(*rewards.shape[:-1], seasons, season).sum(axis=-1)
