"""A flock of e-pucks on a plane: they align, keep their distance, and some of them know where the goal is.

The controller is written by hand; no network is evolved. Each robot wants to drive where those that it listens to
drive, weighted by its couplings, and to keep a distance. Those that know the way add it. The goal is a direction, +x.
After a while one robot breaks: its heading becomes noisier, and it no longer knows the way.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import kernel
from epuckhebb.controller.random import Stream, key, normal, rng
from epuckhebb.controller.ranges import Range, check, check_value, within
from epuckhebb.flock.coupling import Coupling, Moment, changed, shuffled, transfer_entropy
from epuckhebb.tmaze.maze import Pose
from epuckhebb.tmaze.physics.pymunk import MOTION, Handles, PymunkSpace, mover_of_all
from epuckhebb.tmaze.robot import EPUCK, STEP_S

HOLD = 5  # steps between two decisions of a robot
PERIOD = 40  # decisions between two changes of the couplings
WINDOW = 100  # decisions of which the transfer entropy is estimated
RECORD = 5  # decisions between two recorded poses
DECISION_S, CHANGE_S, SAMPLE_S = HOLD * STEP_S, HOLD * PERIOD * STEP_S, HOLD * RECORD * STEP_S
SPEED = 2.5  # rad/s of the wheels, straight ahead
TURN = 3.0  # rad/s of the wheels per rad of error, and at most
SPRING_M, SPRING = 0.18, 0.7  # the distance that robots keep, and how strongly
GOAL = 0.15  # how strongly the goal draws a robot that knows it
BREAKS = ("none", "stranger", "knower")


@dataclass(kw_only=True)
class Flock:
    """The settings of a run.

    robots: how many. knowers: how many of them know the way, the first ones. breaks: which robot breaks, a stranger
    to the way (the last robot), a knower (the first one), or none. at_s: when [s]. loudness: its noise from then on,
    times that of others. noise: standard deviation of a wanted heading [rad]. range_m: how far a robot perceives
    others [m]. spacing_m: between neighbours at the start. duration_s: of the run.
    """

    robots: int = within(2, 100, default=10)
    knowers: int = 2
    breaks: str = "none"
    at_s: float = 1200.0
    loudness: float = within(0, 100, default=2.5)
    noise: float = within(0, 100, default=0.3)
    range_m: float = within(2 * EPUCK.radius_m, 100, default=2.0)  # nearer robots would overlap
    spacing_m: float = within(2 * EPUCK.radius_m, 100, default=0.16)
    duration_s: float = within(2 * CHANGE_S, 1e6, default=2400.0)

    def __post_init__(self) -> None:
        check(self, "flock")
        check_value("flock.knowers", self.knowers, Range(1, self.robots))
        check_value("flock.at_s", self.at_s, Range(CHANGE_S, self.duration_s - CHANGE_S))
        if self.breaks not in BREAKS:
            raise ValueError(f"flock.breaks must be one of {', '.join(BREAKS)}, got {self.breaks!r}")
        if self.breaks == "stranger" and self.knowers == self.robots:
            raise ValueError(f"flock.breaks=stranger needs flock.knowers below {self.robots}, got {self.knowers}")

    @property
    def places(self) -> list[Pose]:
        """Where the robots start, in rows; their headings are drawn."""
        columns = math.ceil(math.sqrt(self.robots))
        return [Pose(self.spacing_m * (k % columns), self.spacing_m * (k // columns), 0.0) for k in range(self.robots)]

    @property
    def broken(self) -> int:
        """The number of the robot that breaks, -1 for none."""
        return {"none": -1, "stranger": self.robots - 1, "knower": 0}[self.breaks]

    @property
    def decisions(self) -> int:
        """How often each robot decides."""
        return math.floor(self.duration_s / DECISION_S + 1e-9)


class Record(NamedTuple):
    """What a run leaves. path: (samples, robots, 3) x, y [m] and heading [rad], every `SAMPLE_S`.

    weights: (changes + 1, robots, robots), the couplings from the start on, every `CHANGE_S`. least_gap: between the
    rims of two robots [m].
    """

    path: Floats
    weights: Floats
    least_gap: float


class _Band(NamedTuple):
    """What robots carry in a run, first axis the robots.

    motion: their places first. wheels: workspace of a step. loud: times their noise. knows: 1 for those that know the
    way, else 0. keys: of the noise. aims, headings: where each wants to look and looks at its last decision [rad].
    """

    motion: Floats
    wheels: Floats
    loud: Floats
    knows: Floats
    keys: NDArray[np.uint64]
    aims: Floats
    headings: Floats


def drive(
    space: Handles,
    band: _Band,
    weights: Floats,
    noise: float,
    sight: float,
    first: int,
    until: int,
    turns: Floats,
    path: Floats,
    least: Floats,
) -> None:
    """Let the robots drive from a decision until before another one.

    turns: (decisions, robots) [rad], path: (samples, robots, 3), least: (1,) distance of two centres [m]; updated.
    """
    motion, wheels, aims, headings = band.motion, band.wheels, band.aims, band.headings
    robots = motion.shape[0]
    for decision in range(first, until):
        for i in range(robots):
            x, y, headings[i] = motion[i, 0], motion[i, 1], motion[i, 2]
            along_x, along_y, listened, pull_x, pull_y = 0.0, 0.0, 0.0, 0.0, 0.0
            for j in range(robots):
                to_x, to_y = motion[j, 0] - x, motion[j, 1] - y
                away = math.sqrt(to_x * to_x + to_y * to_y)
                if i == j or away > sight:
                    continue
                least[0] = min(least[0], away)
                along_x += weights[i, j] * math.cos(motion[j, 2])
                along_y += weights[i, j] * math.sin(motion[j, 2])
                listened += weights[i, j]
                pull = min(1.0, max(-3.0, (away - SPRING_M) / SPRING_M))
                if pull > 0.0:  # attraction is of those that it listens to, distance is kept from all
                    pull *= weights[i, j]
                pull_x += pull * to_x / away
                pull_y += pull * to_y / away
            listened = max(listened, 1e-9)
            to_x = along_x / listened + SPRING * pull_x / (robots - 1) + GOAL * band.knows[i]
            to_y = along_y / listened + SPRING * pull_y / (robots - 1)
            aims[i] = math.atan2(to_y, to_x) + noise * band.loud[i] * normal(band.keys[i], decision)
        if decision % RECORD == 0:
            for i in range(robots):
                for k in range(3):
                    path[decision // RECORD, i, k] = motion[i, k]
        for _ in range(HOLD):
            for i in range(robots):
                error = aims[i] - motion[i, 2]
                error -= 2.0 * math.pi * math.floor(error / (2.0 * math.pi) + 0.5)
                turn = min(TURN, max(-TURN, TURN * error))
                speed = SPEED * max(0.2, math.cos(error))
                wheels[i, 0], wheels[i, 1] = speed - turn, speed + turn
                wheels[i, 2], wheels[i, 3] = math.cos(motion[i, 2]), math.sin(motion[i, 2])
            move_all(space, motion, wheels)
        for i in range(robots):
            turns[decision % WINDOW, i] = motion[i, 2] - headings[i]


move_all = mover_of_all(EPUCK)


@cache
def _drive() -> Callable[..., None]:
    return kernel(drive, ())


class FlockRun:
    """A flock that drives, run with `advance`.

    seed: of the headings at the start and of all noise, which is that of a robot whatever the coupling. done: decisions
    that each robot has made. broken: the number of the robot that broke, -1 for none. weights: the couplings, the last
    of `history`. motion: (robots, 6), the robots' places first.
    """

    def __init__(self, flock: Flock, seed: int) -> None:
        self.flock, self.done, self.broken, count = flock, 0, -1, flock.robots
        drawn, self._mixing = rng(seed, Stream.flock, 0), rng(seed, Stream.flock, 1)
        self.space = PymunkSpace(np.zeros((0, 4)), EPUCK, count=count)
        headings = drawn.uniform(-math.pi, math.pi, count).tolist()
        places = (pose._replace(heading=heading) for pose, heading in zip(flock.places, headings, strict=True))
        self.space.place_robot(*places)
        self.motion = self.space.handles.state[: MOTION * count].reshape(count, MOTION)
        keys = np.array([key(seed, Stream.flock, 2, robot) for robot in range(count)], np.uint64)
        knows = (np.arange(count) < flock.knowers).astype(float)
        self._band = _Band(
            self.motion, np.zeros((count, 4)), np.ones(count), knows, keys, np.zeros(count), np.zeros(count)
        )
        self.weights = np.ones((count, count)) - np.eye(count)
        self.history, self._x_before = [self.weights], self.motion[:, 0].copy()
        self._turns, self.path = np.zeros((WINDOW, count)), np.zeros((-(-flock.decisions // RECORD), count, 3))
        self.least = np.full(1, math.inf)

    def break_robot(self, robot: int) -> None:
        """Break a robot, for good: it is louder, and no longer knows the way."""
        self.broken, self._band.loud[robot], self._band.knows[robot] = robot, self.flock.loudness, 0.0

    def advance(self, until: int, coupling: Coupling, *, control: bool = False) -> None:
        """Drive until before a decision. control: whether the coupling is given numbers of other robots, as a control.

        Raises:
            PartError: the coupling gave no weights.
        """
        flock, band, space = self.flock, self._band, self.space.handles
        noise, sight = float(flock.noise), float(flock.range_m)
        while (first := self.done) < until:
            self.done = min(until, (first // PERIOD + 1) * PERIOD)
            _drive()(space, band, self.weights, noise, sight, first, self.done, self._turns, self.path, self.least)
            if self.done % PERIOD:
                continue
            x = self.motion[:, 0].copy()
            now = Moment(
                self.weights,
                transfer_entropy(np.roll(self._turns, -self.done % WINDOW, axis=0)),
                (x - self._x_before) / (SPEED * EPUCK.wheel_radius_m * CHANGE_S),
                self.broken,
                self.done * DECISION_S,
            )
            self._x_before = x
            if self.done >= WINDOW:
                self.weights = changed(coupling, shuffled(now, self._mixing) if control else now)
            self.history.append(self.weights)


def run(flock: Flock, coupling: Coupling, seed: int, *, control: bool = False) -> Record:
    """Run a flock.

    control: whether the coupling is given the transfer entropy of other pairs and the fitness of other robots.

    Raises:
        PartError: the coupling gave no weights.
    """
    running = FlockRun(flock, seed)
    running.advance(round(flock.at_s / DECISION_S), coupling, control=control)
    if flock.broken >= 0:
        running.break_robot(flock.broken)
    running.advance(flock.decisions, coupling, control=control)
    return Record(running.path, np.array(running.history), float(running.least[0]) - 2 * EPUCK.radius_m)
