"""What the robot is to do in a lifetime: a task's settings, the functions that a lifetime calls, and its fitness.

A task is one file of `tasks/`, with a subclass of `Task` that holds its settings, and a file of `conf/task/` with their
values: `kind`, the name of its file, and the settings. In the paper's task, `trial`, a lifetime is one trial, at the
end of which the robot should be at its goal. In others a lifetime has many trials, each from the start.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import compiled, nothing
from epuckhebb.controller.own_class import OwnClass
from epuckhebb.tmaze.fitness import goal_distance
from epuckhebb.tmaze.maze import Place, Pose, Side
from epuckhebb.tmaze.sensors import InputGroup, RewardInput

TRIAL = np.dtype(
    [
        ("good", np.int64),  # the end that is rewarded: -1 left, 1 right
        ("reached", np.int64),  # the end that the robot reached: -1 left, 1 right, 0 none
        ("steps", np.int64),  # until it arrived, or until the time was over
        ("nearest", np.float64),  # m: the least distance from an end
        ("frozen", np.bool_),  # whether a rule that acts before the change does not act in it
    ],
    align=True,
)
_TO_ONE_GOAL = compiled(lambda setup, x, y: goal_distance(x, y, setup.goal_x, setup.goal_y))
while_not_frozen = compiled(
    lambda life, _setup, _fitness, _step: 0.0 if life.trials[life.tally[0].trial].frozen else 1.0
)
NO_TRIALS = np.zeros(0, TRIAL)  # of a lifetime that is one trial, described by its outcome


def rewarded(trials: NDArray[np.void]) -> NDArray[np.bool_]:
    """Which trials, records of `TRIAL`, were rewarded, (trials,)."""
    rewarded: NDArray[np.bool_] = trials["reached"] == trials["good"]
    return rewarded


class Hooks(NamedTuple):
    """The functions of a task that a lifetime calls.

    reward_input(activation, reward): gives the network the reward, if it has an input for that. to_goal(setup, x, y):
    distance to the goal [m]. end_step(life, space, setup): called after every step.
    """

    reward_input: Callable[[Floats, float], None]
    to_goal: Callable[[Any, float, float], float]
    end_step: Callable[[Any, Any, Any], None]


@dataclass(frozen=True, kw_only=True)
class Task(OwnClass):
    """A task; subclasses hold its settings.

    inputs: network inputs of the task, after the robot's. has_trials: whether a lifetime has more than one trial.
    """

    PART: ClassVar[str] = "task"
    KEY: ClassVar[str] = "task.kind"
    inputs: ClassVar[tuple[InputGroup, ...]] = ()
    has_trials: ClassVar[bool] = False

    @property
    def gives_reward(self) -> bool:
        """Whether the last input of the network is a reward."""
        return RewardInput() in self.inputs

    def limits(self) -> dict[str, float]:
        """Shares of rewarded trials to compare with, by name: without learning, and the best; none for one trial."""
        return {}

    def check(self, lamp_intensity: float, duration_s: float) -> None:
        """Check that the task allows such a lamp, and that a lifetime is long enough; else a ValueError."""

    def hooks(self, first: int) -> Hooks:  # noqa: ARG002  # others need it
        """The functions that a lifetime calls. first: the place of the task's first input among the network's."""
        return Hooks(nothing, _TO_ONE_GOAL, nothing)

    def terms(self, goals: Mapping[Side, Place], start: Pose) -> tuple[Any, ...]:  # noqa: ARG002  # others need them
        """The numbers that these functions need. goals: the ends of the maze. start: of each trial."""
        return ()

    def initial_trials(self, side: Side, key: int) -> NDArray[np.void]:  # noqa: ARG002  # others need them
        """The trials of a lifetime before it starts, records of `TRIAL`. key: of random numbers."""
        return NO_TRIALS

    def fitness(
        self,
        behaviour: float,
        reward: float,
        trials: NDArray[np.void],  # noqa: ARG002  # others need them
        at_start: float,  # noqa: ARG002
    ) -> float:
        """The fitness of a lifetime: in the paper, the mean of behaviour fitness and final goal reward.

        at_start: distance from the start to the goal [m].
        """
        return (behaviour + reward) / 2.0
