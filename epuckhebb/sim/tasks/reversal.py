"""Reversal learning in a T-maze: one end is rewarded, and which one it is must be found out, and then found out again.

A life is many trials. Each begins at the start, at rest, and ends a second after the robot has come to either end of
the maze, or when its time is over. For that second an input of the network tells it the reward: 1 at the end that is
rewarded, -1 at the other, else 0. The lamp is off and nothing else tells the ends apart. In some trial the other end
becomes the rewarded one, for the rest of the life. Which trial that is, is drawn for each life, and in some lives it
never comes, so that it cannot be counted. Weights live on across the trials, and so does what the synapses keep; the
network has no other memory.

Without plasticity all trials are alike but for the noise, so a robot that is as good on either side comes to the
rewarded end in half of them. Who stays with the end that was rewarded and shifts from the one that was not does best.

Source: after Soltoggio, Bullinaria, Mattiussi, Durr & Floreano, Evolutionary advantages of neuromodulated plasticity in
dynamic, reward-based scenarios, ALIFE XI, 2008.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim.compiled import compiled
from epuckhebb.sim.fitness import distance_to
from epuckhebb.sim.maze import Place, Pose, Side
from epuckhebb.sim.physics import Handles, put_back
from epuckhebb.sim.random import Stream, rng
from epuckhebb.sim.robot import STEP_S
from epuckhebb.sim.sensors import InputGroup, RewardInput
from epuckhebb.sim.task import TRIAL, Hooks, Task, rewarded

_ENDS = {"left": -1, "right": 1}


class Terms(NamedTuple):
    """The numbers of the task in a maze. left, right: its ends. start: of each trial.

    told, time_out: steps for which the reward is told, and after which a trial is over. time_outs: after so many of
    them the life is over.
    """

    left: Place
    right: Place
    start: Pose
    told: int
    time_out: int
    time_outs: int


@dataclass(frozen=True, kw_only=True)
class Reversal(Task):
    """The settings of reversal learning.

    trials: of a life. first_switch, last_switch: the rewarded end changes at one of these trials, counted from 1, all
    as likely. never: share of the lives in which it does not change. reward_s: for how long the reward is told [s].
    time_out_s: after so long a trial without an arrival is over [s]. time_outs: after so many of these the life is
    over, and the trials that are left count as not rewarded. end_bonus, progress_bonus: what a life in which every
    trial comes to an end, and what one in which every trial comes as near as can be, gets beside the rewarded share;
    for evolution, which else would see nothing of robots that do not arrive yet.

    Raises:
        ValueError: a value is outside the range named in the message.
    """

    inputs: ClassVar[tuple[InputGroup, ...]] = (RewardInput(),)
    has_trials: ClassVar[bool] = True

    trials: int = 10
    first_switch: int = 2
    last_switch: int = 8
    never: float = 0.125
    reward_s: float = 1.0
    time_out_s: float = 30.0
    time_outs: int = 2
    end_bonus: float = 0.1
    progress_bonus: float = 0.1

    def __post_init__(self) -> None:
        """Refuse tasks that cannot be."""
        if not 2 <= self.trials <= 1000:
            raise ValueError(f"task.trials must lie between 2 and 1000, got {self.trials}")
        if not 2 <= self.first_switch <= self.last_switch <= self.trials:
            raise ValueError(
                "task.first_switch and task.last_switch must be trials from 2 to task.trials "
                f"({self.trials}), the first not after the last, got {self.first_switch} and "
                f"{self.last_switch}"
            )
        if not 0 <= self.never <= 1:
            raise ValueError(f"task.never must lie in [0, 1], got {self.never}")
        for name in ("reward_s", "time_out_s"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) >= STEP_S):
                raise ValueError(f"task.{name} must be at least one step, {STEP_S} s, got {getattr(self, name)}")
        if self.time_outs < 1:
            raise ValueError(f"task.time_outs must be 1 or more, got {self.time_outs}")
        for name in ("end_bonus", "progress_bonus"):
            if not (math.isfinite(getattr(self, name)) and getattr(self, name) >= 0):
                raise ValueError(f"task.{name} must be 0 or more, got {getattr(self, name)}")

    @property
    def longest_s(self) -> float:
        """How long a life can last [s]."""
        return self.trials * (_steps(self.time_out_s) + _steps(self.reward_s)) * STEP_S

    def check_lamp(self, intensity: float) -> None:
        """See `Task`: a lamp would tell the first side."""
        if intensity != 0:
            raise ValueError(
                "scenario.lamp.intensity must be 0 with task=reversal, where the lamp says nothing (it would be lit in "
                f"lives in which the right end is rewarded first), got {intensity:g}"
            )

    def check_time(self, duration_s: float) -> None:
        """See `Task`: each trial must have its time."""
        if duration_s < self.longest_s - 1e-9:
            raise ValueError(
                f"lifetime.duration_s must be at least {self.longest_s:g} s with task=reversal, the longest that its "
                f"{self.trials} trials can last, got {duration_s:g}"
            )

    def hooks(self, first: int) -> Hooks:
        """See `Task`."""

        @compiled
        def reward_input(activation: NDArray[np.float64], reward: float) -> None:
            activation[first] = reward

        return Hooks(reward_input, compiled(_to_nearer_end), compiled(_end_step))

    def terms(self, goals: Mapping[Side, Place], start: Pose) -> Terms:
        """See `Task`."""
        return Terms(
            Place(*map(float, goals["left"])),
            Place(*map(float, goals["right"])),
            Pose(*map(float, start)),
            _steps(self.reward_s),
            _steps(self.time_out_s),
            self.time_outs,
        )

    def initial_trials(self, side: Side, key: int) -> NDArray[np.void]:
        """See `Task`. side: the end that is rewarded first."""
        switch = self.switch(key)
        told = np.zeros(self.trials, TRIAL)
        told["nearest"] = math.inf
        told["good"] = _ENDS[side]
        if switch:
            told["good"][switch - 1 :] *= -1
        return told

    def switch(self, key: int) -> int:
        """The trial, counted from 1, from which on the other end is rewarded; 0 for none. key: of what is drawn."""
        drawn = rng(key, Stream.switches)
        never, place = drawn.random(2)
        return 0 if never < self.never else self.first_switch + int(place * (self.last_switch - self.first_switch + 1))

    def switches(self) -> dict[int, float]:
        """How likely each trial is to be the one at which the rewarded end changes, 0 standing for none."""
        likely = range(self.first_switch, self.last_switch + 1)
        return {0: self.never, **dict.fromkeys(likely, (1 - self.never) / len(likely))}

    def optimum(self) -> float:
        """The share of rewarded trials that nobody can beat, on average over lives.

        The first trial is a guess. From then on who remembers the last reward knows which end was the good one, and
        stays with it while a change is less likely than not; here that is win-stay, lose-shift. Once it has changed,
        it is known for good.
        """
        chances = self.switches()
        expected = 0.5
        for trial in range(2, self.trials + 1):
            before = sum(chances.get(earlier, 0.0) for earlier in range(2, trial))
            now = chances.get(trial, 0.0)
            expected += before + max(now, 1 - before - now)
        return expected / self.trials

    def fitness(
        self,
        behaviour: float,  # noqa: ARG002  # of the paper's task
        reward: float,  # noqa: ARG002
        trials: NDArray[np.void],
        at_start: float,
    ) -> float:
        """See `Task`: the rewarded share, and a little for coming to an end at all, and near one."""
        arrived = trials["reached"] != 0
        progress = np.where(arrived, 1.0, np.maximum(0.0, 1.0 - trials["nearest"] / at_start))
        return float(rewarded(trials).mean() + self.end_bonus * arrived.mean() + self.progress_bonus * progress.mean())


def _steps(seconds: float) -> int:
    return math.floor(seconds / STEP_S + 1e-9)


def _to_nearer_end(trial: Any, x: float, y: float) -> float:
    """How far away the nearer end is [m]; which of them is rewarded must not show in anything but the reward."""
    left = distance_to(x, y, trial.terms.left.x, trial.terms.left.y)
    right = distance_to(x, y, trial.terms.right.x, trial.terms.right.y)
    return min(left, right)


def _end_step(life: Any, space: Handles, trial: Any) -> None:
    """See whether the robot has come to an end, tell it the reward, and begin the next trial when this one is over."""
    tally, terms = life.tally[0], trial.terms
    now = life.trials[tally.trial]
    lived = tally.step - tally.began
    if now.reached == 0:
        now.nearest = min(now.nearest, tally.goal_distance)
        if tally.goal_distance < trial.goal_radius:
            x, y = space.state[0], space.state[1]
            on_left = distance_to(x, y, terms.left.x, terms.left.y) == tally.goal_distance
            now.reached = -1 if on_left else 1
            now.steps = lived
            tally.reward = 1.0 if now.reached == now.good else -1.0
            return
        if lived < terms.time_out:
            return
        now.steps = lived
        tally.time_outs += 1
    elif lived < now.steps + terms.told:
        return
    tally.reward = 0.0
    tally.trial += 1
    if tally.trial == life.trials.shape[0] or tally.time_outs == terms.time_outs:
        tally.over = True
        return
    # The weights and what synapses keep live on, and the sums from which a life's metrics come; nothing else does.
    tally.began = tally.step
    tally.undirected_sum = 0.0
    tally.left_speed, tally.right_speed = 0.0, 0.0
    put_back(space, terms.start.x, terms.start.y, terms.start.heading)
