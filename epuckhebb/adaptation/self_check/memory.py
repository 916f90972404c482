"""The memory of a self-check: sensor readings of the manoeuvre in training, and how they depend on causes."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from epuckhebb.adaptation.self_check.calibration import calibrate, check_space
from epuckhebb.controller import random
from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.random import Stream
from epuckhebb.tmaze.maze import SIDES, Pose, Side
from epuckhebb.tmaze.robot import Robot
from epuckhebb.tmaze.scenario import Scenario

REPEATS = 20  # manoeuvres of each kind
_WEAK = 0.9  # share of its speed at which the weak wheel is measured
_BESIDE = (0.0007, 0.0007, 0.015)  # m, m, rad beside the start, at which a wrong start is measured
_RIDGE = 1e-4
EFFECTS = 2 + len(_BESIDE)  # wheels, then places


@dataclass(frozen=True, kw_only=True)
class SelfMemory:
    """What the self-check compares with, and from which it predicts dead sensors.

    experiment, scenario: the training world. light: level of its sun. lights: how many inputs are light sensors.
    mean: (2, steps, inputs) sensor readings of the manoeuvre, without and with the lamp. spread: (steps, inputs) their
    standard deviation. effects: (5, steps, inputs) their change per unit of loss of the left and of the right wheel,
    and per m, m and rad beside the start. moments: means over lifetimes of all products of two of (1, the readings,
    the products of two readings), the upper triangle row by row.
    """

    experiment: str
    scenario: str
    light: float
    lights: int
    mean: Floats
    spread: Floats
    effects: Floats
    moments: Floats

    @property
    def inputs(self) -> int:
        """How many readings there are."""
        return int(self.mean.shape[2])


def check_robot(robot: Robot) -> None:
    """Check that a robot has the sensors for a self-check; else a ValueError."""
    own = [group.name for group in robot.sensors[2:]]
    if own:
        raise ValueError(
            f"the self-check has no model of the sensors {', '.join(own)} of robot {robot.name}; leave out "
            "robot.sensors, or give adaptation.self_check=false"
        )
    if robot.light.places != robot.distance.places or not robot.distance.curve[-1].value > 0:
        raise ValueError(
            f"the self-check needs infra-red sensors like the e-puck's; those of robot {robot.name} are others: each "
            "must also sense the light (light_places as distance_places), and read more than 0 far from walls (last "
            "value of distance_curve). Give robot=epuck, or adaptation.self_check=false"
        )


def can_check_itself(world: Scenario) -> bool:
    """Whether the robot of a training world has the sensors for a self-check, and space for the manoeuvre."""
    try:
        check_robot(world.robot)
        check_space(world)
    except ValueError:
        return False
    return True


def measure_self(training_world: Scenario, readings: Sequence[Floats]) -> SelfMemory:
    """Measure calibration manoeuvres in the training world; the same arguments always give the same memory.

    readings: (samples, inputs) each, of lifetimes there.

    Raises:
        ValueError: the robot lacks the sensors, or would touch a wall.
    """
    check_robot(training_world.robot)
    check_space(training_world)
    start = np.array(training_world.maze.start)

    def measured(kind: int, world: Scenario, side: Side = "left", beside: Floats | float = 0.0) -> Floats:
        place = Pose(*(start + beside).tolist())
        keys = [random.key(0, Stream.calibration_noise, kind, SIDES.index(side), repeat) for repeat in range(REPEATS)]
        return np.array([calibrate(world, side, key, start=place).readings for key in keys])

    unlit, lit = (measured(0, training_world, side) for side in SIDES)
    mean = np.array([unlit.mean(axis=0), lit.mean(axis=0)])
    weak = replace(training_world, left_wheel=_WEAK), replace(training_world, right_wheel=_WEAK)
    effects = [(measured(1, world).mean(axis=0) - mean[0]) / (1.0 - _WEAK) for world in weak]
    for size, axis in zip(_BESIDE, np.eye(3), strict=True):
        plus, minus = (measured(2, training_world, beside=sign * size * axis).mean(axis=0) for sign in (1, -1))
        effects.append((plus - minus) / (2.0 * size))
    return SelfMemory(
        experiment=training_world.experiment,
        scenario=training_world.name,
        light=training_world.light,
        lights=training_world.robot.light.count,
        mean=mean,
        spread=unlit.std(axis=0),
        effects=np.array(effects),
        moments=moments(readings),
    )


def moments(readings: Sequence[Floats]) -> Floats:
    """The moments of sensor readings, (samples, inputs) each; see `SelfMemory`."""
    inputs = readings[0].shape[1]
    first, second = np.triu_indices(inputs)
    total = np.zeros((1 + inputs + len(first),) * 2)
    for s in readings:
        terms = np.column_stack([np.ones(len(s)), s, s[:, first] * s[:, second]])
        total += terms.T @ terms
    means: Floats = total[np.triu_indices(len(total))] / sum(map(len, readings))
    return means


def regression(moments: Floats, inputs: int, dead: NDArray[np.int64], others: NDArray[np.int64]) -> Floats:
    """Q of the regression z Q z, z = (1, the others), for the inputs `dead`: (dead, others + 1, others + 1).

    Ridge regression of each on the constant, the others and their products of two: c = (T'T + 1e-4 I)^-1 T'y, means
    instead of sums.
    """
    first, second = np.triu_indices(inputs)
    terms = 1 + inputs + len(first)
    whole = np.zeros((terms, terms))
    whole[np.triu_indices(terms)] = moments
    whole += np.triu(whole, 1).T
    products = np.flatnonzero(np.isin(first, others) & np.isin(second, others))
    used = np.concatenate([[0], 1 + others, 1 + inputs + products])
    squares = whole[np.ix_(used, used)] + _RIDGE * np.eye(len(used))
    coefficients = _solve(squares, whole[np.ix_(used, 1 + dead)])
    found = np.zeros((len(dead), len(others) + 1, len(others) + 1))
    found[:, 0, :] = coefficients[: len(others) + 1].T
    row, column = np.triu_indices(len(others))
    found[:, 1 + row, 1 + column] = coefficients[len(others) + 1 :].T
    return found


def _solve(matrix: NDArray[np.float64], right: NDArray[np.float64]) -> NDArray[np.float64]:
    """Solve A x = b for a symmetric positive definite A: (n, n), b: (n, columns).

    Gauss elimination, one element at a time: bit-identical on every machine. Those of LAPACK depend on the number of
    threads and on the kind of processor. Source: Golub and Van Loan, *Matrix Computations* (2013), section 3.2.
    """
    rows, size = np.column_stack([matrix, right]), len(matrix)
    for k in range(size - 1):  # no pivots are needed for such a matrix
        rows[k + 1 :, k + 1 :] -= (rows[k + 1 :, k] / rows[k, k])[:, None] * rows[k, k + 1 :]
    found = rows[:, size:]
    for k in reversed(range(size)):
        found[k] /= rows[k, k]
        found[:k] -= rows[:k, k, None] * found[k]
    return found
