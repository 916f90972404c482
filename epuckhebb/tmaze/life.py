"""The records of a lifetime: its settings, what it begins with, and what it carries from step to step.

`epuckhebb.tmaze.lifetime` has the equations, which read and write these records.
"""

import math
from dataclasses import dataclass
from itertools import accumulate
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.readonly import map_arrays
from epuckhebb.controller.genotype import Genotype
from epuckhebb.controller.plasticity.update import Workspace
from epuckhebb.controller.ranges import check, within
from epuckhebb.controller.wiring import Neurons
from epuckhebb.tmaze.faults import Faults
from epuckhebb.tmaze.fitness import History
from epuckhebb.tmaze.light import Lights
from epuckhebb.tmaze.maze import Region
from epuckhebb.tmaze.robot import STEP_S, Robot
from epuckhebb.tmaze.samples import Samples
from epuckhebb.tmaze.senses import SenseWorkspace

LONGEST_S = 1e9  # 31 years: more is surely a slip
WORD = 8  # bytes
_MOST_SAMPLES = 1_000_000  # of a lifetime; each takes 1.3 kB, mostly weights

TALLY = np.dtype(
    [
        ("step", np.int64),  # done so far
        ("contacts", np.int64),  # steps with a distance reading above 0.8
        ("arrived", np.bool_),  # whether the robot ever was at its goal
        ("lost", np.bool_),  # whether it left the arena or its pose is not finite
        ("junction", np.float64),  # 1 once it has been in the correct arm
        ("undirected_sum", np.float64),  # of combined fitness without the junction term
        ("behaviour_sum", np.float64),  # of combined fitness
        ("weight_change", np.float64),  # sum of |W - W_gene|
        ("weight_change_sum", np.float64),
        ("scale", np.float64),  # of the weights from the light sensors, by homeostasis
        ("scaling", np.float64),  # sum of |W - W_gene| from that scale
        ("path_length", np.float64),  # m
        ("goal_distance", np.float64),  # m
        ("time_to_goal", np.float64),  # s, nan until it arrives
        ("need", np.float64),  # g of the last step
        ("change_signal", np.float64),  # nan without a signal
        ("failed_signal", np.int64),  # the step, counted from 1, at which a signal of the user's first was nan
        ("away_s", np.float64),  # since the start, or since it was at the goal
        ("exploring", np.bool_),  # whether the gate of exploration is open
        ("halted", np.bool_),  # whether it stands still at the goal
        ("late_s", np.float64),  # how long the signal of change has been above its threshold
        ("noise_left", np.float64),  # on the wheels' outputs, of exploration
        ("noise_right", np.float64),
        ("left_speed", np.float64),  # rad/s at which the wheels move the robot
        ("right_speed", np.float64),
        ("trial", np.int64),  # its number, from 0, where a lifetime is many trials
        ("began", np.int64),  # the step with which it began
        ("time_outs", np.int64),  # trials that were over without an arrival
        ("reward", np.float64),  # as the network receives it
        ("over", np.bool_),  # whether all trials are over
    ],
    align=True,
)
INITIAL_TALLY = np.zeros(1, TALLY)
INITIAL_TALLY["time_to_goal"], INITIAL_TALLY["change_signal"] = math.nan, math.nan
INITIAL_TALLY["need"], INITIAL_TALLY["scale"] = 1.0, 1.0


@dataclass(kw_only=True)
class Lifetime:
    """How a lifetime is run.

    duration_s: its length [s]. gain_rad_s: wheel speed [rad/s] of a network output of 1. noise: 1 for the sensors' own
    noise, 0 for none, other values scale it. record_every: steps between two recorded samples, 0 to record nothing.
    """

    duration_s: float = within(STEP_S, LONGEST_S, usual=36_000, default=250.0)
    gain_rad_s: float = within(0, above=True, default=1.0)
    noise: float = within(0, default=1.0)
    record_every: int = within(0, LONGEST_S / STEP_S, default=0)

    def __post_init__(self) -> None:
        check(self, "lifetime")
        if self.record_every and self.steps / self.record_every > _MOST_SAMPLES:  # a slip of the unit fills the memory
            raise ValueError(f"lifetime.record_every={self.record_every} gives more than {_MOST_SAMPLES:,} samples")

    @property
    def steps(self) -> int:
        """Whole control steps of 32 ms in the lifetime."""
        return math.floor(self.duration_s / STEP_S + 1e-9)


class Life(NamedTuple):
    """All that a lifetime carries from step to step, but for the space in which the robot stands.

    key: (1,) of all noise. tally: one record of `TALLY`. weights: (synapses,). synapse_state: (synapses,) records.
    activation: (neurons,). recent: (steps, neurons), activations of the last steps. adaptation: what it carries.
    trials: records of `epuckhebb.tmaze.task.TRIAL`, none where a lifetime is one trial. score: one record, what its
    fitness stores. neurons: of a wiring; its state lasts as long as the lifetime. past: what late sensors and wheels
    need (`epuckhebb.tmaze.faults`). track: of the changes of the weights, where controls need it, else nothing.
    """

    genotype: Genotype
    key: NDArray[np.uint64]
    tally: NDArray[np.void]
    weights: Floats
    synapse_state: NDArray[np.void]
    activation: Floats
    recent: Floats
    adaptation: Any
    trials: NDArray[np.void]
    score: NDArray[np.void]
    neurons: Neurons
    workspace: Workspace
    senses: SenseWorkspace
    past: Floats
    track: Any


def stack_rows(record: Any, count: int) -> tuple[NDArray[np.uint64], Any]:
    """Put what lifetimes carry side by side, a row for each; where they are several, one more, for the one that runs.

    record: of arrays, and of such records, whose first axis is lifetimes, or 1 if all are alike. Returns the rows, and
    the record with views of them.
    """
    arrays: list[NDArray[Any]] = []
    map_arrays(record, arrays.append)
    ends = list(accumulate(-(-array[0].nbytes // WORD) for array in arrays))
    rows, begins = np.zeros((count + (count > 1), ends[-1]), np.uint64), iter([0, *ends])

    def put(array: Any) -> Any:
        strides = rows.strides[0], *array[0].strides
        view = np.ndarray((len(rows), *array.shape[1:]), array.dtype, rows, WORD * next(begins), strides)
        view[:count] = array
        return view

    return rows, map_arrays(record, put)


class Setup(NamedTuple):
    """What stays the same while a lifetime runs in one world.

    rate: N at the wheel gain of this lifetime. floor, signal, history: of the live fitness. rule: the settings of the
    rule, as numbers. adaptation: those of the adaptation. nominal: what it compares with. lit: the lights. goal_x,
    goal_y, goal_radius: m. arm: the region in which the robot has turned the right way. arena: m, half side. faults:
    what is wrong with the robot. terms: the numbers of the task. fitness: those of the fitness. gain: wheel speed
    [rad/s] of a network output of 1. noise_level: 1 for the sensors' own noise. record_every: steps between two
    samples, 0 for none.
    """

    rate: float
    floor: float
    signal: int
    history: History
    rule: tuple[float, ...]
    adaptation: Any
    nominal: Any
    lit: Lights
    goal_x: float
    goal_y: float
    goal_radius: float
    arm: Region
    arena: float
    faults: Faults
    terms: tuple[Any, ...]
    fitness: tuple[float, ...]
    gain: float
    noise_level: float
    record_every: int
    samples: Samples


def pad_samples(samples: Samples, life: Life, robot: Robot, record_every: int, pose: Floats) -> None:
    """Fill the samples after an early end of a lifetime: the robot stays where it was.

    record_every: as in `live`. pose: x, y [m], heading [rad] at the end.
    """
    tally = life.tally[0]
    rest = slice(-(-int(tally["step"]) // record_every), None)
    samples.time[rest] = np.arange(len(samples.time))[rest] * record_every * STEP_S
    samples.pose[rest], samples.weights[rest] = pose[:3], life.weights
    samples.activations[rest] = life.activation[len(life.activation) - samples.activations.shape[1] :]
    samples.sensors[rest, : robot.inputs] = life.activation[: robot.inputs]  # and no reward
    samples.weight_change[rest] = tally["weight_change"] + tally["scaling"]
