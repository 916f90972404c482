"""The mazes of conf/maze: they load, the paper's is the one in the code, wrong ones are refused, drawn ones can be."""

import copy
import math
from pathlib import Path

import numpy as np
import pytest
from omegaconf import OmegaConf

from epuckhebb.config.build import make_maze
from epuckhebb.controller.network import PAPER_NETWORK
from epuckhebb.tmaze.batch import run_lifetimes
from epuckhebb.tmaze.individual import Individual
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.light import Lamp
from epuckhebb.tmaze.maze import SIDES, T_MAZE, Pose, Region, boxes, gap
from epuckhebb.tmaze.robot import EPUCK
from epuckhebb.tmaze.scenario import Scenario

CONF = Path(__file__).parents[1] / "conf" / "maze"
FILES = sorted(CONF.glob("*.yaml"))


def told(file):
    return OmegaConf.to_container(OmegaConf.load(file))


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_a_robot_can_live_in_each_maze(file):
    maze = make_maze(told(file))
    assert maze.name == file.stem
    lamp = Lamp(**told(file)["lamp"])
    for obstacles in maze.obstacle_counts:
        for layout in range(3 if maze.niches else 1):
            world = Scenario(maze=maze, obstacles=obstacles, layout=layout, lamp=lamp)
            world.check_lifetime(Lifetime())


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_the_lamp_of_each_maze_is_seen_from_the_start_and_at_the_first_junction(file):
    maze, lamp = make_maze(told(file)), Lamp(**told(file)["lamp"])
    to_x, to_y = maze.start.x - lamp.x_m, maze.start.y - lamp.y_m
    shines = (lamp.towards_x * to_x + lamp.towards_y * to_y) / math.hypot(to_x, to_y)
    assert shines > math.cos(lamp.beam_rad)


def test_the_papers_maze_is_the_one_in_the_code():
    maze = make_maze(told(CONF / "t_maze.yaml"))
    assert maze == T_MAZE
    for obstacles, layout in ((0, 0), (2, 0), (4, 0), (4, 1)):
        assert boxes(maze, obstacles, layout).tobytes() == boxes(T_MAZE, obstacles, layout).tobytes()
    lamp = told(CONF / "t_maze.yaml")["lamp"]
    assert Lamp(**lamp) == Lamp()


@pytest.mark.parametrize(
    ("name", "arm", "stem"), [("wide", 0.136, 0.139), ("110", 0.1155, 0.1177), ("90", 0.0945, 0.0963)]
)
def test_corridors_are_as_wide_as_said_and_obstacles_leave_gaps_of_80_mm(name, arm, stem):
    maze = make_maze(told(CONF / f"t_maze_{name}.yaml"))
    near, stem_left, stem_right = (maze.walls[name] for name in ("crossbar_near_left", "stem_left", "stem_right"))
    assert (stem_right.x - stem_right.width / 2) - (stem_left.x + stem_left.width / 2) == pytest.approx(stem)
    arms = [box.y + box.height / 2 for name, box in maze.obstacles.items() if name.startswith("arm")]
    far = maze.walls["crossbar_far"].y - maze.walls["crossbar_far"].height / 2
    assert far - (near.y + near.height / 2) == pytest.approx(arm)
    assert [far - top for top in arms] == pytest.approx([0.08, 0.08])
    left, right = maze.obstacles["stem_from_left"], maze.obstacles["stem_from_right"]
    assert (right.x - right.width / 2) - (left.x + left.width / 2) == pytest.approx(0.08)


def test_bounds_of_arms_that_are_left_out_are_infinite_and_degrees_are_converted():
    maze = make_maze(told(CONF / "t_maze.yaml"))
    assert maze.arms["left"] == Region(-math.inf, -0.08, 0.10, math.inf)
    assert maze.start == Pose(0.007, -0.35, math.pi / 2)


GONE = object()


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("walls.stem_left.width", "wide", r"maze\.walls\.stem_left\.width: .*number.*wide"),
        ("walls.stem_left.width", GONE, r"maze\.walls\.stem_left\.width is missing"),
        (
            "walls.stem_left.widht",
            0.05,
            r"maze\.walls\.stem_left\.widht is no key of .* Did you mean width\?",
        ),
        ("walls.stem_left", [0, 0, 1, 1], r"maze\.walls\.stem_left: "),
        ("obstacle", {}, r"maze\.obstacle is no key of .* Did you mean obstacles\?"),
        ("obstacle_counts", [0, 2.5], r"maze\.obstacle_counts\[1\]: .*2\.5"),
        ("niches", [{"along": "x"}], r"maze\.niches\[0\]\.walls is missing"),
        ("start.heading", 1.57, r"maze\.start\.heading is no key of .* Did you mean heading_deg\?"),
        ("start.x", -0.08, r"maze\.start = -0\.08, -0\.35: there is no room"),
    ],
)
def test_wrong_mazes_are_refused(key, value, message):
    wrong = copy.deepcopy(told(CONF / "t_maze.yaml"))
    *path, last = key.split(".")
    place = wrong
    for part in path:
        place = place[part]
    if value is GONE:
        del place[last]
    else:
        place[last] = value
    with pytest.raises(ValueError, match=message):
        Scenario(maze=make_maze(wrong))


DRAWING = """
#########
#L     R#
#### ####
   #S#
   ###
"""
CELL = 0.11  # m: the width of a corridor


def drawn(drawing):
    """A maze from a drawing, as plain mappings: a box for each #, the start S looks ahead, the goals are L and R."""
    lines = drawing.strip("\n").split("\n")
    width, height = max(map(len, lines)), len(lines)
    at = {
        (row, column): {"x": (column - (width - 1) / 2) * CELL, "y": ((height - 1) / 2 - row) * CELL}
        for row, line in enumerate(lines)
        for column in range(len(line))
    }
    found = {mark: [at[r, c] for r, c in at if lines[r][c] == mark] for mark in "#SLR"}
    return {
        "name": "drawn",
        "walls": {f"wall_{n}": place | {"width": CELL, "height": CELL} for n, place in enumerate(found["#"])},
        "start": found["S"][0] | {"heading_deg": 90},
        "goals": {"left": found["L"][0], "right": found["R"][0]},
        "arms": {"left": {"right": -CELL}, "right": {"left": CELL}},
        "arena_m": (max(width, height) + 1) / 2 * CELL,
    }


@pytest.mark.parametrize("side", SIDES)
def test_a_robot_finds_its_way_in_a_maze_that_was_drawn(side):
    """It turns away from walls on either side, and else drives an arc towards the side of its goal."""
    maze = make_maze(drawn(DRAWING))
    layers = [np.eye(*shape) * 1.1 for shape in PAPER_NETWORK.shapes]  # two neurons of each layer hand on the wheels
    layers[0] = np.zeros(PAPER_NETWORK.shapes[0])
    layers[0][PAPER_NETWORK.bias, :2] = (0.45, 0.55) if side == "left" else (0.55, 0.45)
    layers[0][EPUCK.light.count + np.array([7, 6, 5]), :2] = (1, -1)  # a wall at the left: the left wheel turns faster
    layers[0][EPUCK.light.count + np.array([0, 1, 2]), :2] = (-1, 1)
    for layer in layers[1:]:
        layer[2:] = 0
    genes = np.concatenate([layer.ravel() for layer in layers])
    who = Individual(genes=genes, side=side, key=np.uint64(1), record=True)
    life = Lifetime(duration_s=25, gain_rad_s=4.0, record_every=1)
    ((outcome, samples),) = run_lifetimes([who], Scenario(maze=maze), life)
    assert outcome.time_to_goal < 20
    walls = boxes(maze)
    assert min(gap(x, y, walls) for x, y, _ in samples.pose) > EPUCK.radius_m - 0.002
