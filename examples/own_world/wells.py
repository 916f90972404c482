"""A world of your own: a corridor with a well at each end. One gives water; after a while, the other does."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from epuckhebb.controller.random import draw
from epuckhebb.controller.ranges import within
from epuckhebb.worlds.compiled import Compiled

PLACE, STEP, WET, GIVES = range(4)  # what a lifetime carries; a well that gives is -1, left, or 1, right


@dataclass(kw_only=True, eq=False)
class Wells(Compiled):
    """A corridor of 2 `length` + 1 cells, in which a robot goes left or right.

    At a well it gets a reward: 1 for water, else -0.2; then it is in the middle again. The well with water is drawn for
    each lifetime, and changes every `drought` steps. slip: chance of a step that is drawn.
    """

    readings: ClassVar = ("place", "at_left", "at_right")
    actions: ClassVar = ("left", "right")

    length: int = within(1, 100, default=3)
    drought: int = within(1, default=100)
    slip: float = within(0, 1, default=0.1)

    def start(self):
        return (np.zeros(4),)

    @staticmethod
    def begin(state, random):
        robot = state[0]
        robot[GIVES] = 1.0 if draw(random) < 0.5 else -1.0

    @staticmethod
    def look(state, by, readings):
        robot = state[0]
        readings[0] = robot[PLACE] / by.length
        readings[1] = 1.0 if robot[WET] < 0 else 0.0  # the well that it came from
        readings[2] = 1.0 if robot[WET] > 0 else 0.0

    @staticmethod
    def move(state, by, action, random):
        robot, reward = state[0], 0.0
        if draw(random) < by.slip:
            action = 1 if draw(random) < 0.5 else 0
        robot[PLACE] += 1.0 if action == 1 else -1.0
        robot[WET] = 0.0
        if abs(robot[PLACE]) >= by.length:
            robot[WET] = 1.0 if robot[PLACE] > 0 else -1.0
            reward = 1.0 if robot[WET] == robot[GIVES] else -0.2
            robot[PLACE] = 0.0
        robot[STEP] += 1.0
        if robot[STEP] % by.drought == 0.0:
            robot[GIVES] = -robot[GIVES]
        return reward
