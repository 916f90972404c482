"""Moments of a recorded lifetime: when the world changed, and when the robot arrived at its goal."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.tmaze.maze import SIDES, Side
from epuckhebb.tmaze.samples import Samples
from epuckhebb.tmaze.scenario import Scenario


class Arrival(NamedTuple):
    """Whether and when a robot reached its goal; if goals move, the goal of that moment.

    time: when the robot was first at the goal [s], None if never. stayed: whether it was there at the last sample.
    wrong: whether it was at the goal of the other side then, and not at its own.
    """

    time: float | None
    stayed: bool
    wrong: bool

    @property
    def text(self) -> str:
        """How the lifetime ended, in a few words."""
        if self.stayed or self.wrong:
            return "at the goal" if self.stayed else "at the wrong goal"
        return "did not arrive" if self.time is None else "was at the goal, drove on"


def change_text(change: Mapping[str, Any]) -> str:
    """A change of a scenario, without its time: `light=1.0, obstacles=4`."""
    values = {key: list(value) if isinstance(value, tuple) else value for key, value in change.items() if key != "at_s"}
    return ", ".join(f"{key}={value}" for key, value in values.items())


def timed_change_text(change: Mapping[str, Any]) -> str:
    """A change of a scenario with its time: `60 s: light=1.0`."""
    return f"{change['at_s']:g} s: {change_text(change)}"


def put_back(time: NDArray[np.float64], pose: NDArray[np.float64], scenario: Scenario) -> NDArray[np.intp]:
    """The samples at which a robot was back at the start without driving there, (times,).

    time: (samples,) [s]. pose: (samples, 3) x, y [m], heading [rad].
    """
    if not scenario.task.has_trials:
        return np.empty(0, np.intp)
    robot = scenario.robot
    farthest = 1.5 * robot.motor_limit_rad_s * robot.wheel_radius_m * np.diff(time)
    return np.flatnonzero(np.hypot(*np.diff(pose[:, :2], axis=0).T) > farthest) + 1


def insert_gaps(
    time: NDArray[np.float64], pose: NDArray[np.float64], scenario: Scenario
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """A record with nan where the robot was put back to the start: no line is drawn there."""
    places = put_back(time, pose, scenario)
    return np.insert(time, places, time[places]), np.insert(pose, places, np.nan, axis=0)


def arrival(samples: Samples, scenario: Scenario, side: Side) -> Arrival:
    """When and whether a robot of a recorded lifetime arrived, to the sample; metrics have it to the step."""
    phases = np.searchsorted(samples.phase_began, samples.time, side="right") - 1  # nan sorts last
    inside = {}
    for end in SIDES:
        goals = np.array([world.goals_now[end] for _, world in scenario.phases])[np.maximum(phases, 0)]
        inside[end] = np.hypot(*(samples.pose[:, :2] - goals).T) < scenario.maze.goal_radius_m
    at_goal, (at_other_goal,) = inside.pop(side), inside.values()
    time = float(samples.time[at_goal.argmax()]) if at_goal.any() else None
    return Arrival(time, bool(at_goal[-1]), bool(at_other_goal[-1] and not at_goal[-1]))
