"""Mazes: the paper's, random layouts, and those that cannot be."""

import hashlib
import math
from dataclasses import replace

import numpy as np
import pytest

from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.lifetime import contains
from epuckhebb.tmaze.maze import (
    SIDES,
    T_MAZE,
    Box,
    Niche,
    Place,
    Pose,
    boxes,
    gap,
    is_reachable,
)
from epuckhebb.tmaze.robot import EPUCK
from epuckhebb.tmaze.scenario import Scenario


@pytest.mark.parametrize(("side", "sign"), [("left", -1), ("right", 1)])
def test_the_correct_arm_is_the_one_with_the_goal(side, sign):
    arm = T_MAZE.arms[side]
    assert contains(arm, *T_MAZE.goals[side])
    assert contains(arm, sign * 0.09, 0.11)
    assert not contains(arm, -sign * 0.09, 0.11)
    assert not contains(arm, sign * 0.09, 0.09)
    assert not contains(arm, sign * 0.07, 0.11)


def test_obstacles_leave_3_mm_on_each_side():
    walls = boxes(T_MAZE, 4)
    left_arm_gap = walls[0, 2] - walls[9, 3]
    stem_gap = walls[12, 0] - walls[11, 1]
    assert left_arm_gap == pytest.approx(0.080, abs=5e-4)
    assert stem_gap == pytest.approx(0.080, abs=5e-4)


def test_layouts_are_where_they_have_always_been():
    """The hash is of the program before mazes became data; results are compared layout by layout."""
    content = hashlib.sha256()
    for layout in range(60):
        for obstacles in (0, 2, 4):
            content.update(np.ascontiguousarray(boxes(T_MAZE, obstacles, layout), "<f8").tobytes())
    assert content.hexdigest() == "9df1825335420f5101923567069235518d308eb6b318166573bfc54144bc421e"


def test_gap_is_the_distance_to_the_nearest_box():
    walls = np.array([[0.0, 1.0, 0.0, 1.0], [3.0, 4.0, 0.0, 1.0]])
    assert gap(0.5, 0.5, walls) == 0
    assert gap(2.2, 0.5, walls) == pytest.approx(0.8)
    assert gap(-3.0, 5.0, walls) == pytest.approx(5.0)
    assert gap(0.0, 0.0, walls[:0]) == math.inf


@pytest.mark.parametrize(
    ("plug", "sides"),
    [
        (Box(-0.2, 0.16, 0.02, 0.11), ["left"]),
        (Box(0.2, 0.16, 0.02, 0.11), ["right"]),
        (Box(0.2, 0.13, 0.02, 0.11), ["right"]),  # a gap of 28 mm is left
        (Box(0.2, 0.11, 0.02, 0.05), []),
        (Box(0.0, -0.1, 0.11, 0.02), ["left", "right"]),
    ],
)
def test_a_goal_behind_a_plugged_arm_is_refused(plug, sides):
    world = Scenario(placed=(plug,))
    room = T_MAZE.start, world.boxes, EPUCK.radius_m, T_MAZE.arena_m
    blocked = [side for side, goal in T_MAZE.goals.items() if not is_reachable(goal, 0.05, *room)]
    assert blocked == sides
    if sides:
        with pytest.raises(ValueError, match=rf"^maze\.goals\.{sides[0]}:"):
            world.check_lifetime(Lifetime())
        replace(world, changes=[{"at_s": 9.0, "placed": []}]).check_lifetime(Lifetime())  # it opens


def other(**values):
    return replace(T_MAZE, name="other", **values)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"walls": {"thin": Box(0, 0, 0.1, 0.0)}}, r"maze\.walls\.thin, its sizes, must"),
        ({"obstacle_counts": (0, 5)}, r"maze\.obstacle_counts must .* got \(0, 5\)"),
        ({"obstacle_counts": (0, 2)}, r"maze\.obstacle_counts must reach 4, got"),
        ({"goals": {"left": Place(0, 0), "right": Place(0.6, 0)}}, r"maze\.goals\.right must lie in"),
        ({"start": Pose(0, -0.7, 0)}, r"maze\.start must lie in"),
        ({"arena_m": 11.0}, r"maze\.arena_m must lie in"),
        ({"goal_radius_m": 0.0}, r"maze\.goal_radius_m must"),
        ({"niches": (Niche("z", (0, 1), (0, 1), (0, 1), (0, 1)),)}, r"maze\.niches\[0\] must run along x or y"),
    ],
)
def test_impossible_mazes_are_refused(values, message):
    with pytest.raises(ValueError, match=message):
        other(**values)


def test_a_start_in_a_wall_is_refused():
    with pytest.raises(ValueError, match=r"maze\.start = 0\.04, -0\.2: there is no room"):
        Scenario(maze=other(start=Pose(0.04, -0.2, 0)))


def test_a_layout_needs_niches_and_obstacles_are_counted():
    with pytest.raises(ValueError, match=r"scenario\.layout = 3"):
        Scenario(maze=other(niches=()), layout=3)
    with pytest.raises(ValueError, match=r"scenario\.obstacles must be one of 0, 1, 4"):
        Scenario(maze=other(obstacle_counts=(0, 1, 4)), obstacles=2)
    assert Scenario(maze=other(obstacle_counts=(0, 1, 4)), obstacles=1).obstacles == 1


def test_mazes_are_compared_by_what_they_hold():
    assert replace(T_MAZE) == T_MAZE
    assert hash(replace(T_MAZE)) == hash(T_MAZE)
    assert other() != T_MAZE
    assert set(T_MAZE.goals) == set(SIDES)
