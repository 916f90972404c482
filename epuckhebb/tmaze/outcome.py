"""The outcome of a lifetime: success, the end at which the robot is, and all other metrics.

Success is decided in `outcome_of`: the robot is within 5 cm of its goal at the last step.
"""

import math
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.compiling.readonly import readonly
from epuckhebb.controller.plasticity.weight_change import saturated_fraction
from epuckhebb.tmaze import fitness
from epuckhebb.tmaze.life import Life, tally_of
from epuckhebb.tmaze.maze import SIDES, Pose, Side
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.task import NO_TRIALS


class End(StrEnum):
    """Where a robot is at the last step: within the goal radius of its goal, of the other side's goal, or elsewhere.

    Where both goals are that near, its own counts.
    """

    right = "right"
    wrong = "wrong"
    elsewhere = "elsewhere"


class Outcome(NamedTuple):
    """The metrics of a lifetime.

    time_to_goal: s, first time within 5 cm of the goal, nan if never. path_length: m. final_distance: m from the goal.
    behaviour: mean combined fitness over the steps. reward: goal reward at the end. weight_change_mean,
    weight_change_final: sum over weights of |W - W_gene|. contact_fraction: share of steps with a distance reading
    above 0.8. success: whether the robot was within 5 cm of its goal at the last step. fitness: how well it did its
    task; the paper's final fitness unless that is another. steps: done. saturated_fraction: share of the final weights
    at their bound. x, y: m, where the robot is at the end. weight_path: sum of |W(t + 1) - W(t)| over all steps and
    weights, without resets to the genes; nan where it was not measured. other_goal: whether the robot is within 5 cm of
    the other side's goal at the end.
    """

    time_to_goal: float
    path_length: float
    final_distance: float
    behaviour: float
    reward: float
    weight_change_mean: float
    weight_change_final: float
    contact_fraction: float
    success: bool
    fitness: float
    steps: int
    saturated_fraction: float
    x: float
    y: float
    weight_path: float
    other_goal: bool

    @property
    def end(self) -> End | None:
        """The end at which the robot is at the last step; None where a lifetime is many trials."""
        return End.right if self.success else End.wrong if self.other_goal else End.elsewhere

    @property
    def trials(self) -> NDArray[np.void]:
        """The trials of the lifetime, records of `epuckhebb.tmaze.task.TRIAL`; none where it is one."""
        return NO_TRIALS


class OutcomeOfTrials(Outcome):
    """The metrics of a lifetime of many trials."""

    _trials: NDArray[np.void]

    @property
    def end(self) -> None:
        """No end: a lifetime of many trials has one in each."""

    @property
    def trials(self) -> NDArray[np.void]:
        """The trials of the lifetime, records of `epuckhebb.tmaze.task.TRIAL`."""
        return self._trials


def outcome_of(life: Life, world: Scenario, side: Side, at_start: float, bound: float, pose: Pose) -> Outcome:
    """The metrics of a lifetime so far, of one step or more.

    world: of the last step. side: of the goal. at_start: distance from its start to the nearest goal [m]. bound: of the
    weights. pose: of the robot after the last step.
    """
    tally, trials = tally_of(life), readonly(life.trials)
    (other_goal,) = (world.goals_now[other] for other in SIDES if other != side)
    behaviour, goal_reward = tally.behaviour_sum / tally.step, fitness.reward(tally.goal_distance)
    outcome = Outcome(
        tally.time_to_goal,
        tally.path_length,
        tally.goal_distance,
        behaviour,
        goal_reward,
        tally.weight_change_sum / tally.step,
        tally.weight_change + tally.scaling,
        tally.contacts / tally.step,
        tally.goal_distance < world.maze.goal_radius_m,
        world.task.fitness(behaviour, goal_reward, trials, at_start),
        tally.step,
        saturated_fraction(life.weights, bound),
        *pose[:2],
        float(life.track.path[0]) if life.track else math.nan,
        math.dist(pose[:2], other_goal) < world.maze.goal_radius_m,
    )
    if world.fitness.is_own:
        facts = {**outcome._asdict(), "paper": outcome.fitness, "trials": trials}
        outcome = outcome._replace(fitness=world.fitness.of_lifetime(facts, life.score))
    if len(life.trials):
        outcome = OutcomeOfTrials(*outcome)
        outcome._trials = life.trials
    return outcome
