"""The outcome of a lifetime: success, the end at which the robot is, and all other metrics.

Success is decided in `measure_outcomes`: the robot is within 5 cm of its goal at the last step.
"""

import math
from collections.abc import Sequence
from enum import StrEnum
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.compiling.readonly import readonly
from epuckhebb.controller.plasticity.weight_change import saturated_fraction
from epuckhebb.tmaze import fitness
from epuckhebb.tmaze.life import Life
from epuckhebb.tmaze.maze import SIDES, Side
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.task import NO_TRIALS, TRIAL


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


def measure_outcomes(
    lives: Life, world: Scenario, side: Side, at_start: Sequence[float], bound: float, poses: Sequence[Sequence[float]]
) -> list[Outcome]:
    """The metrics of lifetimes so far, of one step or more.

    lives: their arrays, as `Block` has them. world: of the last step. side: of the goal. at_start: distance from each
    start to the nearest goal [m]. bound: of the weights. poses: of the robots after the last step.
    """
    tally, radius = lives.tally[:, 0], world.maze.goal_radius_m
    (other_goal,) = (world.goals_now[end] for end in SIDES if end != side)
    steps, distances = tally["step"], tally["goal_distance"]
    behaviour = (tally["behaviour_sum"] / steps).tolist()
    reward = [fitness.reward(distance) for distance in distances.tolist()]
    trials = lives.trials.view(np.uint8).copy().view(TRIAL)  # copied byte by byte, as a record's padding is not
    columns = (  # in the order of the fields of an outcome
        tally["time_to_goal"].tolist(),
        tally["path_length"].tolist(),
        distances.tolist(),
        behaviour,
        reward,
        (tally["weight_change_sum"] / steps).tolist(),
        (tally["weight_change"] + tally["scaling"]).tolist(),
        (tally["contacts"] / steps).tolist(),
        (distances < radius).tolist(),
        map(world.task.fitness, behaviour, reward, readonly(trials), at_start),
        steps.tolist(),
        saturated_fraction(lives.weights, bound).tolist(),
        [x for x, *_ in poses],
        [y for _, y, *_ in poses],
        lives.track[:, 0].tolist(),
        [math.dist(pose[:2], other_goal) < radius for pose in poses],
    )
    outcomes = list(map(Outcome, *columns))
    if world.fitness.is_custom:
        for k, outcome in enumerate(outcomes):
            facts = {**outcome._asdict(), "paper": outcome.fitness, "trials": readonly(trials[k])}
            outcomes[k] = outcome._replace(fitness=world.fitness.judge_lifetime(facts, lives.score[k]))
    if world.task.has_trials:
        for k, outcome in enumerate(outcomes):
            outcomes[k] = of_trials = OutcomeOfTrials(*outcome)
            of_trials._trials = trials[k]
    return outcomes
