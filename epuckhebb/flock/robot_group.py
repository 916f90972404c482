"""Several robots in one space: they collide, and their distance sensors see each other as discs.

Each robot is a lifetime of its own, with its own genes, start, and noise key. In a step all robots sense, then all
decide, then the space moves them at once. Their order is part of every result: it is that of their contacts in pymunk.
Robots that never come near one another run bit-identically to robots that are alone.
"""

import math
from collections.abc import Sequence
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.errors import explained
from epuckhebb.controller.compiling.kernel import compiled
from epuckhebb.controller.genotype import Genotype
from epuckhebb.controller.wiring import Neurons
from epuckhebb.tmaze.individual import Individual
from epuckhebb.tmaze.life import Life, Lifetime, Setup
from epuckhebb.tmaze.maze import Pose, gap
from epuckhebb.tmaze.outcome import Outcome
from epuckhebb.tmaze.physics.pymunk import MOTION, PYMUNK, PymunkSpace
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.session import Session, own_parts
from epuckhebb.tmaze.simulator import Simulator

_SHARED = ("side", "controller", "network")  # of an individual: one lamp, one kernel and one rate for all
_OF_ALL = ("adaptation", "trials", "workspace", "numbers", "history")  # of a `Life`: what they do not have each


# The parts of a lifetime; `epuckhebb.tmaze.lifetime_kernel` puts them here.
_part: Any = None
decide = settle = to_goal = turn_wheels = move_all = _part


class Group(NamedTuple):
    """What robots in one space carry, first axis of arrays the robots.

    records: a `Life`, in which adaptation, trials and workspace are those of one robot. motion: (robots, 6), the view
    of the space's state. wheels: (robots, 4) and before: (robots, 2), workspace.
    """

    records: Life
    keys: NDArray[np.uint64]
    motion: Floats
    wheels: Floats
    before: Floats


@compiled
def life_of(group: Group, i: int) -> Life:
    """The lifetime of one robot of a group."""
    records, genes, neurons = group.records, group.records.genotype, group.records.neurons
    return Life(
        Genotype(
            genes.weights[i],
            genes.synapse_state[i],
            genes.coefficients[i],
            genes.modulatory[i],
            genes.lengths[i],
            genes.signs[i],
            genes.neurons,
        ),
        group.keys[i],
        records.tally[i],
        records.weights[i],
        records.synapse_state[i],
        records.activation[i],
        records.recent[i],
        records.adaptation,
        records.trials,
        records.score[i],
        Neurons(neurons.state[i], neurons.parameters[i], neurons.numbers, neurons.step_s),
        records.workspace,
        records.past[i],
    )


def live_group(group: Group, setup: Setup, space: Any, until: int) -> None:
    """Run the lifetimes of the robots of a space until before step `until`, or until one is lost. group: updated.

    In a step all robots sense and decide, in their order, before any moves.
    """
    motion, wheels, before = group.motion, group.wheels, group.before
    robots, lost = motion.shape[0], False
    for step in range(group.records.tally[0][0].step, until):
        for i in range(robots):
            life, at = life_of(group, i), Pose(motion[i, 0], motion[i, 1], motion[i, 2])
            tally, cos, sin = life.tally[0], math.cos(at.heading), math.sin(at.heading)
            tally.goal_distance = to_goal(setup, at.x, at.y)
            left, right = decide(life, setup, space, motion, at, cos, sin, step)
            left, right = turn_wheels(setup.faults, tally, life.past, left, right, setup.gain, life.key, step)
            wheels[i, 0], wheels[i, 1], wheels[i, 2], wheels[i, 3] = left, right, cos, sin
            before[i, 0], before[i, 1] = at.x, at.y
        move_all(space, motion, wheels)
        for i in range(robots):
            tally, was = group.records.tally[i][0], Pose(before[i, 0], before[i, 1], 0.0)
            lost = settle(tally, setup, was, Pose(motion[i, 0], motion[i, 1], motion[i, 2]), step) or lost
        if lost:
            break


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
        self._live = simulator.kernel(live_group, first.controller, first.network, simulator.more_faults)
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
        self._group = Group(
            records=_stacked([session.life for session in self._sessions]),
            keys=np.array([one.key for one in individuals], np.uint64),
            motion=self._space.handles.state[: MOTION * count].reshape(count, MOTION),
            wheels=np.zeros((count, 4)),
            before=np.zeros((count, 2)),
        )
        for number, session in enumerate(self._sessions):
            session.life = life_of(self._group, number)

    @property
    def steps(self) -> int:
        """How many steps have been run."""
        return self._sessions[0].steps

    @property
    def poses(self) -> list[Pose]:
        """Where the robots are."""
        return [Pose(*row[:3]) for row in self._group.motion.tolist()]

    def step(self, count: int = 1) -> None:
        """Run so many steps, fewer if the lifetime ends before; the errors are those of `Session.step`."""
        until = min(self.steps + count, self.lifetime.steps)
        try:
            self._live(self._group, self._sessions[0].setup, self._space.handles, until)
        except Exception as error:  # machine code raises nothing, so it comes from compiling
            session = self._sessions[0]
            raise explained(own_parts(session.individual, session.world), error) from error
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


def _stacked(records: Sequence[Any]) -> Any:
    """Records whose arrays have the robots as first axis; of what all share, that of the first robot."""
    first = records[0]
    if isinstance(first, np.ndarray):
        stacked = np.empty((len(records), *first.shape), first.dtype)
        for number, array in enumerate(records):
            stacked[number] = array
        return stacked
    own = [name for name in getattr(first, "_fields", ()) if name not in _OF_ALL]
    return first._replace(**{name: _stacked([getattr(one, name) for one in records]) for name in own}) if own else first
