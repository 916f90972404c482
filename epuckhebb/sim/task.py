"""What every task is: settings, functions that a lifetime calls, and how well a life has done.

A task is one file of `tasks/`, with a subclass of `Task` that holds its settings, and a file of `conf/task/` with their
values: `kind`, the name of its file, and the settings. The paper's is `trial`: a life is one trial, at the end of which
the robot should be at its goal. In others a life is many trials, and the robot is put back between them.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim.compiled import compiled
from epuckhebb.sim.fitness import distance_to
from epuckhebb.sim.maze import Place, Pose, Side
from epuckhebb.sim.sensors import InputGroup, RewardInput

TRIAL = np.dtype(
    [
        ("good", np.int64),  # the end that is rewarded: -1 left, 1 right
        ("reached", np.int64),  # the end that the robot came to: -1 left, 1 right, 0 none
        ("steps", np.int64),  # until it came there, or until its time was over
        ("nearest", np.float64),  # m: as near as it came to an end
    ],
    align=True,
)
NO_TRIALS = np.zeros(0, TRIAL)  # of a life that is one trial, of which its outcome tells all


def rewarded(trials: NDArray[np.void]) -> NDArray[np.bool_]:
    """Which trials, records of `TRIAL`, were rewarded, (trials,)."""
    told: NDArray[np.bool_] = trials["reached"] == trials["good"]
    return told


class Hooks(NamedTuple):
    """The functions of a task that a lifetime calls.

    reward_input(activation, reward): gives the network the reward, if it has an input for that. to_goal(trial, x, y):
    how far away the goal is [m]. end_step(life, space, trial): what there is to do when a step is over.
    """

    reward_input: Callable[[NDArray[np.float64], float], None]
    to_goal: Callable[[Any, float, float], float]
    end_step: Callable[[Any, Any, Any], None]


@dataclass(frozen=True, kw_only=True)
class Task:
    """A task; subclasses hold its settings.

    inputs: those that it gives the network itself, after the robot's. has_trials: whether a lifetime is more than one
    trial.
    """

    inputs: ClassVar[tuple[InputGroup, ...]] = ()
    has_trials: ClassVar[bool] = False

    @property
    def name(self) -> str:
        """What it is called: as its file."""
        return type(self).__module__.rpartition(".")[2]

    @property
    def input_count(self) -> int:
        """How many inputs of the network are its own."""
        return sum(group.count for group in self.inputs)

    @property
    def gives_reward(self) -> bool:
        """Whether the last input of the network is a reward."""
        return RewardInput() in self.inputs

    def check_lamp(self, intensity: float) -> None:
        """Refuse a lamp that the task cannot do with.

        Raises:
            ValueError: it cannot.
        """

    def check_time(self, duration_s: float) -> None:
        """Refuse lifetimes that are too short for it.

        Raises:
            ValueError: they are.
        """

    def hooks(self, first: int) -> Hooks:  # noqa: ARG002  # others need it
        """Its functions. first: the place of its first input among those of the network."""
        return Hooks(compiled(_untold), compiled(_to_one_goal), compiled(_nothing))

    def terms(self, goals: Mapping[Side, Place], start: Pose) -> tuple[Any, ...]:  # noqa: ARG002  # others need them
        """The numbers that its functions need. goals: the ends of the maze. start: of each trial."""
        return ()

    def initial_trials(self, side: Side, key: int) -> NDArray[np.void]:  # noqa: ARG002  # others need them
        """The trials of a life before it begins, records of `TRIAL`. key: of what is drawn."""
        return NO_TRIALS

    def fitness(
        self,
        behaviour: float,
        reward: float,
        trials: NDArray[np.void],  # noqa: ARG002  # others need them
        at_start: float,  # noqa: ARG002
    ) -> float:
        """How well a life has done: in the paper, the mean of the behaviour fitness and of the goal reward at the end.

        at_start: how far away the goal is where the robot starts [m].
        """
        return (behaviour + reward) / 2.0


def _untold(activation: NDArray[np.float64], reward: float) -> None:
    """A network that has no input for a reward is told none."""


def _to_one_goal(trial: Any, x: float, y: float) -> float:
    """How far away the goal of this side is [m]."""
    return distance_to(x, y, trial.goal_x, trial.goal_y)


def _nothing(life: Any, space: Any, trial: Any) -> None:
    """A life that is one trial goes on until its time is over."""
