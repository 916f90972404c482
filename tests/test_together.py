"""Several robots in one space: bit-identical to robots alone where they are far apart, discs that collide where not."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pymunk
import pytest

from epuckhebb.adaptation.adaptation import Adaptation
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.flock.robot_group import RobotGroup
from epuckhebb.store.genome import load_genome
from epuckhebb.tmaze.batch import run_lifetimes
from epuckhebb.tmaze.individual import GA_ALONE, Controller, Individual
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.light import Lamp, lights
from epuckhebb.tmaze.maze import T_MAZE, Box, Pose
from epuckhebb.tmaze.physics.pymunk import COLLISION_SLOP, PYMUNK
from epuckhebb.tmaze.robot import EPUCK
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.senses import sense_workspace, senses
from epuckhebb.tmaze.tasks.reversal import Reversal

NO_WALLS = SimpleNamespace(walls=np.zeros((0, 4)))
HEBBIAN = Controller(name="Hebbian", rule=Paper(N=0.002))
PLACES = [(1.5 * (k % 3), 1.5 * (k // 3)) for k in range(6)]
MAZES = replace(  # six T-mazes side by side
    T_MAZE,
    name="six",
    walls={
        f"{name}_{k}": box._replace(x=box.x + x, y=box.y + y)
        for k, (x, y) in enumerate(PLACES)
        for name, box in T_MAZE.walls.items()
    },
    obstacles={},
    obstacle_counts=(0,),
    arena_m=10.0,
)
SIDE = 1.0  # m: half of an arena without anything in it
ARENA = replace(
    T_MAZE,
    name="arena",
    walls={
        "left": Box(-SIDE - 0.05, 0, 0.1, 2.2),
        "right": Box(SIDE + 0.05, 0, 0.1, 2.2),
        "near": Box(0, -SIDE - 0.05, 2.2, 0.1),
        "far": Box(0, SIDE + 0.05, 2.2, 0.1),
    },
    obstacles={},
    obstacle_counts=(0,),
    arena_m=1.1,
)


def individuals(starts, controller=GA_ALONE, side="left"):
    return [
        Individual(
            genes=load_genome(f"reference_{101 + k}", "obstacles").genes,
            side=side,
            key=np.uint64(k),
            start=start,
            controller=controller,
        )
        for k, start in enumerate(starts)
    ]


def in_arena(count):
    return [Pose(0.3 * (k % 4) - 0.45, 0.3 * (k // 4) - 0.3, 2.0 * k) for k in range(count)]


@pytest.mark.parametrize("controller", [GA_ALONE, HEBBIAN], ids=["GA", "Hebbian"])
def test_robots_far_apart_are_bit_identical_to_robots_alone(controller):
    world, lifetime = Scenario(maze=MAZES), Lifetime(duration_s=120.0)
    starts = [Pose(T_MAZE.start.x + x, T_MAZE.start.y + y, T_MAZE.start.heading) for x, y in PLACES]
    for side in ("left", "right"):
        robots = individuals(starts, controller, side)
        alone = [outcome for outcome, _ in run_lifetimes(robots, world, lifetime)]
        group = RobotGroup(robots, world, lifetime)
        group.step(1000)
        group.step(lifetime.steps)
        assert group.steps == lifetime.steps
        assert np.array(group.outcomes()).tobytes() == np.array(alone).tobytes()
    assert max(outcome.contact_fraction for outcome in alone) > 0  # pymunk was asked


def test_the_order_of_robots_that_sense_each_other_and_do_not_touch_changes_no_bit():
    world, lifetime = Scenario(maze=ARENA), Lifetime(duration_s=1.0)
    robots = individuals([Pose(0.11 * (k % 2), 0.11 * (k // 2), 2.0 * k) for k in range(4)])
    group, other = RobotGroup(robots, world, lifetime), RobotGroup(robots[::-1], world, lifetime)
    for one in (group, other):
        one.step(lifetime.steps)
    assert group.poses == other.poses[::-1]
    assert np.array(group.outcomes()).tobytes() == np.array(other.outcomes()[::-1]).tobytes()
    apart = RobotGroup([replace(robots[0], start=Pose(-0.8, -0.8, 0.0)), *robots[1:]], world, lifetime)
    apart.step(lifetime.steps)
    assert apart.poses[1] != group.poses[1]  # it sensed the first


def test_robots_collide_and_another_run_is_bit_identical():
    world, lifetime = Scenario(maze=ARENA), Lifetime(duration_s=60.0, gain_rad_s=4.0)
    runs = [RobotGroup(individuals(in_arena(10)), world, lifetime) for _ in range(2)]
    least = math.inf
    for _ in range(200):
        runs[0].step(9)
        places = np.array(runs[0].poses)[:, :2]
        apart = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))[np.triu_indices(10, 1)]
        least = min(least, apart.min())
    assert 2 * EPUCK.radius_m - 2e-3 < least < 2 * EPUCK.radius_m + COLLISION_SLOP
    runs[1].step(1800)
    assert runs[0].poses == runs[1].poses


def test_distance_sensors_see_other_robots_as_discs():
    rng, ring = np.random.default_rng(0), EPUCK.distance.places
    read, workspace, readings = senses(EPUCK, PYMUNK), sense_workspace(EPUCK, PYMUNK), np.zeros(EPUCK.inputs)
    lit, noise = lights(0.1, Lamp(), lamp_on=False), np.zeros(16)
    seen = 0
    for _ in range(500):
        heading, bearing, apart = rng.uniform(0, 6.28), rng.uniform(0, 6.28), rng.uniform(0.0745, 0.15)
        motion = np.zeros((2, 6))
        motion[1, :2] = apart * math.cos(bearing), apart * math.sin(bearing)
        space = pymunk.Space()
        space.add(pymunk.Circle(space.static_body, EPUCK.radius_m, tuple(motion[1, :2])))
        with np.errstate(divide="ignore", invalid="ignore"):
            read(
                0.0, 0.0, math.cos(heading), math.sin(heading), NO_WALLS, lit, noise, 0.0, workspace, readings,
                robots=motion,
            )  # fmt: skip
        for place, distance in zip(ring, workspace.scratch[1], strict=True):
            x = math.cos(heading) * place.x - math.sin(heading) * place.y
            y = math.sin(heading) * place.x + math.cos(heading) * place.y
            look = heading + math.radians(place.azimuth)
            hit = space.segment_query_first(
                (x, y), (x + 0.3 * math.cos(look), y + 0.3 * math.sin(look)), 0, pymunk.ShapeFilter()
            )
            if apart <= EPUCK.radius_m * 2 + EPUCK.distance.reach_m:
                assert distance == pytest.approx(0.3 * hit.alpha if hit else math.inf, abs=1e-12)
                seen += hit is not None
    assert seen > 300


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"count": 1}, "two robots or more"),
        ({"starts": [Pose(0, 0, 0), Pose(0.05, 0, 0)]}, "robots 0 and 1 overlap"),
        ({"starts": [Pose(0, 0, 0), Pose(0.98, 0, 0)]}, "robot 1 of 2 does not fit"),
        ({"adaptation": Adaptation(change_signal="late")}, "cannot have an adaptation"),
        ({"changes": ({"at_s": 1.0, "light": 1.0},)}, "never changes"),
        ({"record": True}, "are not recorded"),
        ({"after": individuals([Pose(0, 0, 0)])[0]}, "carry no history"),
        ({"task": Reversal(), "lamp": Lamp(intensity=0.0)}, "one trial"),
    ],
    ids=["count", "overlap", "wall", "adaptation", "changes", "record", "after", "trials"],
)
def test_what_does_not_work_together_is_refused(change, message):
    starts = change.pop("starts", in_arena(change.pop("count", 3)))
    controller = Controller(name="x", rule=Paper(N=0.002), adaptation=change.pop("adaptation", Adaptation()))
    own = {name: change.pop(name) for name in ("record", "after") if name in change}
    robots = [replace(one, **own) for one in individuals(starts, controller)]
    with pytest.raises(ValueError, match=message):
        RobotGroup(robots, Scenario(maze=ARENA, **change))
