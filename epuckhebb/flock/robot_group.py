"""Several robots in one space: they collide, and their distance sensors see each other as discs.

Each robot is a lifetime of its own, with its own genes, start, and noise key. In a step all robots sense, then all
decide, then the space moves them at once. Their order is part of every result: it is that of their contacts in pymunk.
Robots that never come near one another run bit-identically to robots that are alone.
"""

import math
from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.errors import explained
from epuckhebb.controller.compiling.kernel import SameTypes
from epuckhebb.tmaze.faults import turn_wheels
from epuckhebb.tmaze.individual import Individual
from epuckhebb.tmaze.life import Life, Lifetime, Setup
from epuckhebb.tmaze.maze import Pose, gap
from epuckhebb.tmaze.outcome import Outcome
from epuckhebb.tmaze.physics.pymunk import MOTION, PYMUNK, PymunkSpace
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.session import Session, own_parts
from epuckhebb.tmaze.simulator import Simulator

_SHARED = ("side", "controller", "network")  # of an individual: one lamp, one kernel and one rate for all

# The parts of a lifetime; `epuckhebb.tmaze.simulator` puts them here.
_part: Any = None
decide = settle = to_goal = move_all = _part


def decide_one(life: Life, setup: Setup, space: Any, motion: Floats, wheels: Floats, number: int) -> None:
    """Let one robot sense, act and learn. motion: (robots, 6), of the space. wheels: (robots, 4), its row is filled."""
    tally, at = life.tally[0], Pose(motion[number, 0], motion[number, 1], motion[number, 2])
    cos, sin, step = math.cos(at.heading), math.sin(at.heading), tally.step
    tally.goal_distance = to_goal(setup, at.x, at.y)
    left, right = decide(life, setup, space, motion, at, cos, sin, step)
    left, right = turn_wheels(setup.faults, tally, life.past, left, right, setup.gain, life.key, step)
    wheels[number, 0], wheels[number, 1], wheels[number, 2], wheels[number, 3] = left, right, cos, sin


def move_group(
    tallies: NDArray[np.void], setup: Setup, space: Any, motion: Floats, wheels: Floats, before: Floats
) -> None:
    """Move all robots, and count the step. tallies: (robots, 1). before: (robots, 2), workspace."""
    for i in range(motion.shape[0]):
        before[i, 0], before[i, 1] = motion[i, 0], motion[i, 1]
    move_all(space, motion, wheels)
    for i in range(motion.shape[0]):
        tally, was = tallies[i][0], Pose(before[i, 0], before[i, 1], 0.0)
        settle(tally, setup, was, Pose(motion[i, 0], motion[i, 1], motion[i, 2]), tally.step)


class RobotGroup:
    """Lifetimes of several robots in one space, run with `step`.

    individuals: two or more, in an order that is part of the result, each with its own `start` and `key`. They have the
    same side, controller and network.
    """

    def __init__(self, individuals: Sequence[Individual], world: Scenario, lifetime: Lifetime | None = None) -> None:
        _check(individuals, world)
        self.lifetime = Lifetime() if lifetime is None else lifetime
        simulator = Simulator(world, self.lifetime)
        self._sessions = [Session(one, world, self.lifetime, simulator=simulator) for one in individuals]
        first, count = individuals[0], len(individuals)
        self._decide, self._move = (
            SameTypes(simulator.kernel(page, first.controller, first.network)) for page in (decide_one, move_group)
        )
        self._space = PymunkSpace(world.boxes, world.robot, world.wall_friction, count)
        starts = [world.maze.start if one.start is None else one.start for one in individuals]
        walls, radius, arena = world.boxes, world.robot.radius_m, world.maze.arena_m
        for number, (x, y, _) in enumerate(starts):
            if not max(abs(x), abs(y)) < arena or gap(x, y, walls) < radius:
                raise ValueError(f"robot {number} of {len(starts)} does not fit the maze at its start, {x:g}, {y:g}")
        for (one, start), (other, place) in combinations(enumerate(starts), 2):
            apart = math.dist(start[:2], place[:2])
            if apart < 2 * radius:
                raise ValueError(
                    f"robots {one} and {other} overlap at the start: their centres are {apart:g} m apart, and must be "
                    f"{2 * radius:g} m apart or more"
                )
        self._space.place_robot(*starts)
        self._motion = self._space.handles.state[: MOTION * count].reshape(count, MOTION)
        self._wheels, self._before = np.zeros((count, 4)), np.zeros((count, 2))
        self._tallies = np.stack([session.life.tally for session in self._sessions])
        for session, tally in zip(self._sessions, self._tallies, strict=True):
            session.life = session.life._replace(tally=tally)

    @property
    def steps(self) -> int:
        """How many steps have been run."""
        return self._sessions[0].steps

    @property
    def poses(self) -> list[Pose]:
        """Where the robots are."""
        return [Pose(*row[:3]) for row in self._motion.tolist()]

    def step(self, count: int = 1) -> None:
        """Run so many steps, fewer if the lifetime ends before; the errors are those of `Session.step`."""
        first, where = self._sessions[0], (self._space.handles, self._motion, self._wheels)
        try:
            for _ in range(min(count, self.lifetime.steps - self.steps)):
                for number, session in enumerate(self._sessions):
                    self._decide.call(session.life, session.setup, *where, number)
                self._move.call(self._tallies, first.setup, *where, self._before)
                if self._tallies["lost"].any():
                    break
        except Exception as error:  # machine code raises nothing, so it comes from compiling
            raise explained(own_parts(first.individual, first.world), error) from error
        for session in self._sessions:
            session.check()

    def outcomes(self) -> list[Outcome]:
        """The metrics of each lifetime so far, of one step or more."""
        return [session.outcome(pose) for session, pose in zip(self._sessions, self.poses, strict=True)]


def _check(individuals: Sequence[Individual], world: Scenario) -> None:
    if len(individuals) < 2:
        raise ValueError(f"there must be two robots or more in a space, got {len(individuals)}")
    for name in _SHARED:
        if any(getattr(one, name) != getattr(individuals[0], name) for one in individuals):
            raise ValueError(f"robots in one space must have the same {name}")
    if any(one.record or one.after is not None for one in individuals):
        raise ValueError("robots in one space are not recorded, and carry no history; give record=False, after=None")
    if individuals[0].controller.adaptation.acts:
        raise ValueError("robots in one space cannot have an adaptation; give each a controller without one")
    if world.physics != PYMUNK:
        raise ValueError(f"robots in one space need physics={PYMUNK.name}, got {world.physics.name}")
    if len(world.phases) > 1 or world.task.has_trials or world.put is not None:
        raise ValueError(f"robots in one space need a world that never changes, and one trial, got {world.name}")
