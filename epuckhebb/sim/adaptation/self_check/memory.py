"""What a robot remembers of home for its self-check: how the dance feels there, and how its readings hang together."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim import random
from epuckhebb.sim.adaptation.self_check.dance import calibrate, check_space
from epuckhebb.sim.maze import SIDES, Pose, Side
from epuckhebb.sim.random import Stream
from epuckhebb.sim.robot import Robot
from epuckhebb.sim.scenario import Scenario

REPEATS = 20  # dances of each kind
_WEAK = 0.9  # the wheel with which the memory of a weak wheel is made
_BESIDE = (0.0007, 0.0007, 0.015)  # m, m, rad beside the start with which the memory of a wrong start is made
_RIDGE = 1e-4
EFFECTS = 2 + len(_BESIDE)  # wheels, then places


@dataclass(frozen=True, kw_only=True)
class SelfMemory:
    """What the self-check compares with, and what it makes up dead sensors from.

    experiment, scenario: home. light: level of its sun. lights: how many of the readings are of light. mean: (2, steps,
    inputs) readings of the dance, without and with the lamp. spread: (steps, inputs) their standard deviation. effects:
    (5, steps, inputs) how they change per unit of loss of the left and of the right wheel, and per m, m and rad that
    the robot starts beside its place. moments: means over lifetimes of all products of two of (1, the readings, the
    products of two readings), the upper triangle row by row.
    """

    experiment: str
    scenario: str
    light: float
    lights: int
    mean: NDArray[np.float64]
    spread: NDArray[np.float64]
    effects: NDArray[np.float64]
    moments: NDArray[np.float64]

    @property
    def inputs(self) -> int:
        """How many readings there are."""
        return int(self.mean.shape[2])


def check_robot(robot: Robot) -> None:
    """Refuse a robot that cannot check itself.

    Raises:
        ValueError: it has not the sensors.
    """
    others = len(robot.sensors) > 2
    if others or robot.light.places != robot.distance.places or not robot.distance.curve[-1].value > 0:
        raise ValueError(
            f"the self-check needs infra-red sensors like the e-puck's; those of robot {robot.name} are others: each "
            "must feel the light too (light_places as distance_places), and read more than 0 where no wall is, unless "
            "it is dead (last value of distance_curve). Give robot=epuck, or adaptation.self_check=false"
        )


def can_check_itself(home: Scenario) -> bool:
    """Whether the robot of a training world has the sensors to check itself, and room there to dance."""
    try:
        check_robot(home.robot)
        check_space(home)
    except ValueError:
        return False
    return True


def remember_self(home: Scenario, readings: Sequence[NDArray[np.float64]]) -> SelfMemory:
    """Dance in the training world and remember it; the same home and readings are always remembered the same.

    home: the training world. readings: (samples, inputs) each, of lifetimes there.

    Raises:
        ValueError: the robot has not the sensors, or would touch a wall.
    """
    check_robot(home.robot)
    check_space(home)
    start = np.array(home.maze.start)

    def dances(
        kind: int, world: Scenario, side: Side = "left", beside: NDArray[np.float64] | float = 0.0
    ) -> NDArray[np.float64]:
        place = Pose(*(start + beside).tolist())
        keys = [random.key(0, Stream.calibration_noise, kind, SIDES.index(side), repeat) for repeat in range(REPEATS)]
        return np.array([calibrate(world, side, key, start=place).readings for key in keys])

    unlit, lit = (dances(0, home, side) for side in SIDES)
    mean = np.array([unlit.mean(axis=0), lit.mean(axis=0)])
    weak = replace(home, left_wheel=_WEAK), replace(home, right_wheel=_WEAK)
    effects = [(dances(1, world).mean(axis=0) - mean[0]) / (1.0 - _WEAK) for world in weak]
    for size, axis in zip(_BESIDE, np.eye(3), strict=True):
        plus, minus = (dances(2, home, beside=sign * size * axis).mean(axis=0) for sign in (1, -1))
        effects.append((plus - minus) / (2.0 * size))
    return SelfMemory(
        experiment=home.experiment,
        scenario=home.name,
        light=home.light,
        lights=home.robot.light.count,
        mean=mean,
        spread=unlit.std(axis=0),
        effects=np.array(effects),
        moments=moments(readings),
    )


def moments(readings: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    """The moments of readings, (samples, inputs) each, as `SelfMemory` has them."""
    inputs = readings[0].shape[1]
    first, second = np.triu_indices(inputs)
    total = np.zeros((1 + inputs + len(first),) * 2)
    for some in readings:
        terms = np.column_stack([np.ones(len(some)), some, some[:, first] * some[:, second]])
        total += terms.T @ terms
    means: NDArray[np.float64] = total[np.triu_indices(len(total))] / sum(map(len, readings))
    return means


def regression(
    moments: NDArray[np.float64], inputs: int, dead: NDArray[np.int64], others: NDArray[np.int64]
) -> NDArray[np.float64]:
    """Q of z Q z, z = (1, the others), that gives the readings `dead`: (dead, others + 1, others + 1).

    Ridge regression of each on the constant, the others and their products of two: c = (T'T + 1e-4 I)^-1 T'y, means
    instead of sums.
    """
    first, second = np.triu_indices(inputs)
    terms = 1 + inputs + len(first)
    whole = np.zeros((terms, terms))
    whole[np.triu_indices(terms)] = moments
    whole += np.triu(whole, 1).T
    products = np.flatnonzero(np.isin(first, others) & np.isin(second, others))
    kept = np.concatenate([[0], 1 + others, 1 + inputs + products])
    squares = whole[np.ix_(kept, kept)] + _RIDGE * np.eye(len(kept))
    coefficients = np.linalg.solve(squares, whole[np.ix_(kept, 1 + dead)])
    found = np.zeros((len(dead), len(others) + 1, len(others) + 1))
    found[:, 0, :] = coefficients[: len(others) + 1].T
    row, column = np.triu_indices(len(others))
    found[:, 1 + row, 1 + column] = coefficients[len(others) + 1 :].T
    return found
