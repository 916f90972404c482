"""Scripted foragers: what a controller can earn in `epuckhebb.worlds.foraging`, beside what it does earn.

| forager | what it takes for food |
| --- | --- |
| knows | what is food |
| win-stay lose-shift | the colour that it ate last, if that was food; else the other one |
| innate | green items, in summer and in winter: 0 on average, as for all who get no reward |

All move alike: to food if it is ahead or to a side; else where nothing is, mostly on; else against the wall, which
turns them; else on. They slip as every robot does.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from epuckhebb.controller.arrays import Floats

if TYPE_CHECKING:
    from epuckhebb.worlds.foraging import Foraging

GREEN, BLUE = range(2)
LEFT, AHEAD, RIGHT = range(3)

_ITEMS, _EMPTY, _WALL = ((1.0, 0.0), (0.0, 1.0)), (0.0, 0.0), (1.0, 1.0)  # what the two readings of a cell are
_TURN = 8  # steps from one turn without need to the next, one to the left, one to the right

Belief = Callable[[Any, int, int | None], int]  # food now, from what was so far and what eating told

FORAGERS: dict[str, Belief] = {
    "knows": lambda world, *_: world.food,
    "win-stay lose-shift": lambda _, belief, told: belief if told is None else told,
    "innate": lambda _, belief, __: belief,
}


def earned(world: "Foraging", forager: str, seed: int, steps: int) -> Floats:
    """The rewards of a scripted forager, (steps,), in a lifetime of this seed."""
    believe = FORAGERS[forager]
    (readings, _), belief, shown, rewards = world.reset(seed=seed), GREEN, None, np.zeros(steps)
    for step in range(steps):
        belief = believe(world, belief, shown)
        readings, reward, *_ = world.step(_way(readings, belief, step))
        shown = world.eaten
        if shown is not None and reward < 0:
            shown = 1 - shown
        rewards[step] = reward
    return rewards


def _way(readings: Floats, food: int, step: int) -> int:
    """Where to go. readings: (6,), green and blue of the cells to the left, ahead and to the right."""
    values = readings.tolist()
    cells = [*zip(values[::2], values[1::2], strict=True)]
    sides = (LEFT, RIGHT) if step // _TURN % 2 else (RIGHT, LEFT)
    order = (AHEAD, *sides) if step % _TURN else (*sides, AHEAD)
    return next((way for cell in (_ITEMS[food], _EMPTY, _WALL) for way in order if cells[way] == cell), AHEAD)


def season_sums(rewards: Floats, season: int) -> Floats:
    """The reward of each whole season, (..., seasons). rewards: (..., steps)."""
    seasons = rewards.shape[-1] // season
    parts = rewards[..., : seasons * season].reshape(*rewards.shape[:-1], seasons, season)
    return np.asarray(parts.sum(axis=-1))
