"""Foraging: a field with green and blue items; which of them is food changes with the season, and only eating tells.

    summer: +1 for a green item, -1 for a blue one      winter: the reverse

Each step the robot senses the cells to its left, ahead and to its right, turns left, goes on or turns right, and moves
by one cell, unless there is the wall. An item that it enters is eaten, and appears elsewhere. In a few steps it slips:
it turns or goes on by chance, else a controller without noise would sooner or later go in circles for ever.

A controller that gets no reward gets 0 on average: each lifetime begins with a summer or with a winter, which is drawn.
One that reads the reward of its last step may get more without any plasticity: where it stands is a memory, too.

After Yaman, Iacca, Mocanu, Coler, Fletcher & Pechenizkiy, Evolving plasticity for autonomous learning under changing
environmental conditions, Evolutionary Computation 29, 2021 (arXiv 1904.01709). The numbers are ours: with them,
win-stay lose-shift earns more than half of what one earns who knows the season (`epuckhebb.worlds.foragers`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import gymnasium
import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import compiled
from epuckhebb.controller.random import draw
from epuckhebb.controller.ranges import within
from epuckhebb.worlds.compiled import Compiled
from epuckhebb.worlds.foragers import BLUE, FORAGERS, GREEN, earned

ID = "epuckhebb/Foraging-v0"
_PIXELS = 32  # of a cell, in a picture
_COLOURS = {"ground": (245, 245, 240), "green": (0, 158, 115), "blue": (0, 114, 178), "robot": (40, 40, 40)}
ROW, COLUMN, HEADING, STEP, SEASON, EATEN = range(6)  # of a robot; headings are 0 up, 1 right, 2 down, 3 left


class Field(NamedTuple):
    """What a lifetime carries.

    cells: (size, size), 0 or the number of an item, from 1; the first half of them are green. places: row and column of
    each item, (items, 2). robot: (6,) whole numbers; EATEN is the item of the last step, or 0.
    """

    cells: NDArray[np.int64]
    places: NDArray[np.int64]
    robot: NDArray[np.int64]


@compiled
def below(count: int, random: NDArray[np.uint64]) -> int:
    """A whole number from 0 to below `count`."""
    return int(draw(random) * count)


@compiled
def place(state: Field, item: int, random: NDArray[np.uint64]) -> None:
    """Put an item into an empty cell, where the robot is not."""
    size, robot = state.cells.shape[0], state.robot
    row, column = below(size, random), below(size, random)
    while state.cells[row, column] != 0 or (row == robot[ROW] and column == robot[COLUMN]):
        row, column = below(size, random), below(size, random)
    put(state, item, row, column)


@compiled
def put(state: Field, item: int, row: int, column: int) -> None:
    """Put an item into a cell."""
    state.cells[row, column] = item
    state.places[item - 1, 0], state.places[item - 1, 1] = row, column


@compiled
def is_inside(state: Field, row: int, column: int) -> bool:
    """Whether a cell is in the field, and not of its wall."""
    rows, columns = state.cells.shape
    return bool(0 <= row < rows and 0 <= column < columns)


@compiled
def beside(row: int, column: int, heading: int) -> tuple[int, int]:
    """The cell beside another one, in a direction."""
    return row + (heading == 2) - (heading == 0), column + (heading == 1) - (heading == 3)


@compiled
def is_summer(robot: NDArray[np.int64], season: int, winter: bool) -> bool:
    """Whether green items are food at this step."""
    return not winter or (robot[STEP] // season + robot[SEASON]) % 2 == 0


@dataclass(kw_only=True, eq=False)
class Foraging(Compiled):
    """A field with items, whose colours change places with the season.

    size: cells of a side. items: of each colour. season: its steps. summer_first: chance that a lifetime begins with a
    summer. slip: chance of a step that is drawn. winter: whether there are winters. moving: chance of an item to move
    by a cell, in each step.
    """

    readings: ClassVar = tuple(
        f"{side}_{colour}" for side in ("left", "ahead", "right") for colour in ("green", "blue")
    )
    actions: ClassVar = ("left", "ahead", "right")

    size: int = within(3, 1000, default=20)
    items: int = within(1, default=30)
    season: int = within(1, default=500)
    summer_first: float = within(0, 1, default=0.5)
    slip: float = within(0, 1, default=0.05)
    winter: bool = True
    moving: float = within(0, 1, default=0.0)

    def __post_init__(self) -> None:
        """Check the settings."""
        super().__post_init__()
        if 4 * self.items > self.size**2:  # else a free place is hard to find
            most = self.size**2 // 4
            raise ValueError(
                f"environment.options.items must be {most} or less with size={self.size}, got {self.items}"
            )

    def start(self) -> Field:
        """What a lifetime carries, all zero."""
        cells, places = np.zeros((self.size, self.size), np.int64), np.zeros((2 * self.items, 2), np.int64)
        return Field(cells, places, np.zeros(6, np.int64))

    @staticmethod
    def begin(state: Field, by: Any, random: NDArray[np.uint64]) -> None:
        """Draw the first season, and put all items somewhere; the robot is in the middle."""
        state.robot[SEASON] = int(draw(random) >= by.summer_first)
        state.robot[ROW] = state.robot[COLUMN] = state.cells.shape[0] // 2
        for item in range(1, state.places.shape[0] + 1):
            place(state, item, random)

    @staticmethod
    def look(state: Field, readings: Floats) -> None:
        """Two readings of a cell to the left, ahead and to the right: green, blue, both for the wall, or none."""
        robot, half = state.robot, state.places.shape[0] // 2
        for k in range(3):
            row, column = beside(robot[ROW], robot[COLUMN], (robot[HEADING] + k + 3) % 4)
            wall = not is_inside(state, row, column)
            item = 0 if wall else state.cells[row, column]
            readings[2 * k] = 1.0 if wall or 1 <= item <= half else 0.0
            readings[2 * k + 1] = 1.0 if wall or item > half else 0.0

    @staticmethod
    def move(state: Field, by: Any, action: int, random: NDArray[np.uint64]) -> float:
        """Turn left (0), go on (1) or turn right (2), and move by a cell; the reward is that of an item eaten."""
        robot, half, reward = state.robot, state.places.shape[0] // 2, 0.0
        if draw(random) < by.slip:
            action = below(3, random)
        robot[HEADING] = (robot[HEADING] + action + 3) % 4
        robot[EATEN] = 0
        row, column = beside(robot[ROW], robot[COLUMN], robot[HEADING])
        if is_inside(state, row, column):
            robot[ROW], robot[COLUMN] = row, column
            robot[EATEN] = item = state.cells[row, column]
            if item > 0:
                reward = 1.0 if (item <= half) == is_summer(robot, by.season, by.winter) else -1.0
                state.cells[row, column] = 0
                place(state, item, random)
        if by.moving > 0.0:
            wander(state, by.moving, random)
        robot[STEP] += 1
        return reward

    @property
    def food(self) -> int:
        """The colour of food in this step."""
        return GREEN if is_summer(self.state.robot, self.season, self.winter) else BLUE

    @property
    def eaten(self) -> int | None:
        """The colour of the item that was eaten in the last step, if any was."""
        item = int(self.state.robot[EATEN])
        return None if item == 0 else GREEN if item <= self.items else BLUE

    def yardsticks(self, seeds: Sequence[int], steps: int) -> Mapping[str, float]:
        """What the scripted foragers earn, the mean return by name."""
        return {name: float(np.mean([earned(self, name, seed, steps).sum() for seed in seeds])) for name in FORAGERS}

    def picture(self) -> NDArray[np.uint8]:
        """The field from above; the robot has a light nose."""
        state = self.state
        kinds = np.where(state.cells == 0, 0, np.where(state.cells <= self.items, 1, 2))  # the first items are green
        colours = np.array([_COLOURS[name] for name in ("ground", "green", "blue")], np.uint8)
        image: NDArray[np.uint8] = colours[kinds]
        image[state.robot[ROW], state.robot[COLUMN]] = _COLOURS["robot"]
        image = image.repeat(_PIXELS, 0).repeat(_PIXELS, 1)
        nose = beside(0, 0, state.robot[HEADING])
        middle = [int(_PIXELS * (state.robot[k] + 0.5 + 0.3 * nose[k])) for k in (ROW, COLUMN)]
        image[middle[0] - 4 : middle[0] + 4, middle[1] - 4 : middle[1] + 4] = 255
        return image


@compiled
def wander(state: Field, chance: float, random: NDArray[np.uint64]) -> None:
    """Let items move by a cell, if that is free."""
    for item in range(1, state.places.shape[0] + 1):
        if draw(random) < chance:
            row, column = state.places[item - 1]
            to_row, to_column = beside(row, column, below(4, random))
            is_free = is_inside(state, to_row, to_column) and state.cells[to_row, to_column] == 0
            if is_free and (to_row != state.robot[ROW] or to_column != state.robot[COLUMN]):
                state.cells[row, column] = 0
                put(state, item, to_row, to_column)


gymnasium.register(id=ID, entry_point=f"{__name__}:Foraging")
