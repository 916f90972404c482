"""Reversal learning in a T-maze: the robot must find out which end is rewarded, and again when that changes.

A lifetime has many trials. Each begins at rest at the start. It ends one second after the robot reaches an end of the
maze, or when its time is over. During that second a network input is the reward: 1 at the rewarded end, -1 at the
other, else 0. The lamp is off, and nothing else distinguishes the ends. In one trial the other end becomes the rewarded
one, for the rest of the lifetime. That trial is drawn for each lifetime, and some lifetimes have none, so counting does
not help. Weights, synapse states and the state of recurrent neurons last across trials.

Without any of these all trials are alike but for the noise, so a robot as good on either side is rewarded in half of
them. The best strategy is win-stay, lose-shift.

Source: after Soltoggio, Bullinaria, Mattiussi, Durr & Floreano, Evolutionary advantages of neuromodulated plasticity in
dynamic, reward-based scenarios, ALIFE XI, 2008.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import compiled
from epuckhebb.controller.plasticity.rule import Reward
from epuckhebb.controller.random import Stream, rng
from epuckhebb.controller.ranges import Range, check_value, within
from epuckhebb.tmaze.fitness import distance_to
from epuckhebb.tmaze.maze import Place, Pose, Side
from epuckhebb.tmaze.physics.pymunk import Handles, put_back
from epuckhebb.tmaze.robot import STEP_S
from epuckhebb.tmaze.sensors import InputGroup, RewardInput
from epuckhebb.tmaze.task import TRIAL, Hooks, Task, rewarded

_ENDS = {"left": -1, "right": 1}


class Terms(NamedTuple):
    """The numbers of the task in a maze. left, right: its ends. start: of each trial.

    reward: the input at the rewarded end. reward_steps, time_out: steps for which it is given, and after which a trial
    is over. time_outs: after this number of them the lifetime is over.
    """

    left: Place
    right: Place
    start: Pose
    reward: float
    reward_steps: int
    time_out: int
    time_outs: int


@dataclass(frozen=True, kw_only=True)
class Reversal(Task):
    """The settings of reversal learning.

    trials: of a lifetime. first_switch, last_switch: the rewarded end changes at one of these trials, counted from 1,
    all equally likely. never: share of the lifetimes in which it does not change. reward: as given, or, as a control,
    inverted where the network reads it; what counts stays the same. reward_s: for how long the reward is given [s].
    time_out_s: when a trial without an arrival is over [s]. time_outs: after this number of them the lifetime is over,
    and the remaining trials count as not rewarded. end_bonus, progress_bonus: fitness for reaching an end in every
    trial, and for coming near one, besides the rewarded share; they guide evolution before robots arrive.
    """

    inputs: ClassVar[tuple[InputGroup, ...]] = (RewardInput(),)
    has_trials: ClassVar[bool] = True

    trials: int = within(2, 1000, default=10)
    first_switch: int = 2
    last_switch: int = 8
    never: float = within(0, 1, default=0.125)
    reward: Reward = Reward.given
    reward_s: float = within(STEP_S, default=1.0)
    time_out_s: float = within(STEP_S, default=30.0)
    time_outs: int = within(1, default=2)
    end_bonus: float = within(0, default=0.1)
    progress_bonus: float = within(0, default=0.1)

    def __post_init__(self) -> None:
        super().__post_init__()
        check_value("task.last_switch", self.last_switch, Range(2, self.trials))
        check_value("task.first_switch", self.first_switch, Range(2, self.last_switch))

    def check(self, lamp_intensity: float, duration_s: float) -> None:
        """See `Task`: a lamp would show the first side, and there must be time for every trial."""
        if lamp_intensity != 0:
            raise ValueError(f"scenario.lamp.intensity must be 0 with task=reversal, got {lamp_intensity:g}")
        longest_s = self.trials * (_steps(self.time_out_s) + _steps(self.reward_s)) * STEP_S
        if duration_s < longest_s - 1e-9:
            raise ValueError(f"lifetime.duration_s must be {longest_s:g} s or more, got {duration_s:g}")

    def hooks(self, first: int) -> Hooks:
        """See `Task`."""

        @compiled
        def reward_input(activation: Floats, reward: float) -> None:
            activation[first] = reward

        return Hooks(reward_input, compiled(_to_nearer_end), compiled(_end_step))

    def terms(self, goals: Mapping[Side, Place], start: Pose) -> Terms:
        """See `Task`."""
        return Terms(
            Place(*map(float, goals["left"])),
            Place(*map(float, goals["right"])),
            Pose(*map(float, start)),
            -1.0 if self.reward is Reward.inverted else 1.0,
            _steps(self.reward_s),
            _steps(self.time_out_s),
            self.time_outs,
        )

    def initial_trials(self, side: Side, key: int) -> NDArray[np.void]:
        """See `Task`. side: the end that is rewarded first."""
        switch = self.switch(key)
        trials = np.zeros(self.trials, TRIAL)
        trials["nearest"] = math.inf
        trials["good"] = _ENDS[side]
        if switch:
            trials["good"][switch - 1 :] *= -1
        return trials

    def switch(self, key: int) -> int:
        """The trial, counted from 1, from which on the other end is rewarded; 0 for none. key: of random numbers."""
        drawn = rng(key, Stream.switches)
        never, place = drawn.random(2)
        return 0 if never < self.never else self.first_switch + int(place * (self.last_switch - self.first_switch + 1))

    def switches(self) -> dict[int, float]:
        """The probability of each trial that the rewarded end changes there; 0: never."""
        likely = range(self.first_switch, self.last_switch + 1)
        return {0: self.never, **dict.fromkeys(likely, (1 - self.never) / len(likely))}

    def limits(self) -> dict[str, float]:
        """See `Task`.

        Lifetimes come in pairs: one with each end rewarded first, and the switch at the same trial. A fixed sequence of
        choices is therefore right in one lifetime wherever it is wrong in the other: chance. The optimum is on average
        over lifetimes. The first trial is a guess. From then on the last reward shows the good end, and the best choice
        is to stay with it while a change is less likely than not: win-stay, lose-shift. After the change the good end
        is certain.
        """
        chances = self.switches()
        expected = 0.5
        for trial in range(2, self.trials + 1):
            before = sum(chances.get(earlier, 0.0) for earlier in range(2, trial))
            here = chances.get(trial, 0.0)
            expected += before + max(here, 1 - before - here)
        return {"chance": 0.5, "optimum": expected / self.trials}

    def fitness(
        self,
        behaviour: float,  # noqa: ARG002  # of the paper's task
        reward: float,  # noqa: ARG002
        trials: NDArray[np.void],
        at_start: float,
    ) -> float:
        """See `Task`: the rewarded share, plus a little for reaching any end, or coming near one."""
        arrived = trials["reached"] != 0
        progress = np.where(arrived, 1.0, np.maximum(0.0, 1.0 - trials["nearest"] / at_start))
        return float(rewarded(trials).mean() + self.end_bonus * arrived.mean() + self.progress_bonus * progress.mean())


def _steps(seconds: float) -> int:
    return math.floor(seconds / STEP_S + 1e-9)


def _to_nearer_end(setup: Any, x: float, y: float) -> float:
    """Distance to the nearer end [m]: nothing but the reward may show which end is rewarded."""
    left = distance_to(x, y, setup.terms.left.x, setup.terms.left.y)
    right = distance_to(x, y, setup.terms.right.x, setup.terms.right.y)
    return min(left, right)


def _end_step(life: Any, space: Handles, setup: Any) -> None:
    """Give the reward if the robot is at an end, and begin the next trial when this one is over."""
    tally, terms = life.tally[0], setup.terms
    this = life.trials[tally.trial]
    elapsed = tally.step - tally.began
    if this.reached == 0:
        this.nearest = min(this.nearest, tally.goal_distance)
        if tally.goal_distance < setup.goal_radius:
            x, y = space.state[0], space.state[1]
            on_left = distance_to(x, y, terms.left.x, terms.left.y) == tally.goal_distance
            this.reached = -1 if on_left else 1
            this.steps = elapsed
            tally.reward = terms.reward if this.reached == this.good else -terms.reward
            return
        if elapsed < terms.time_out:
            return
        this.steps = elapsed
        tally.time_outs += 1
    elif elapsed < this.steps + terms.reward_steps:
        return
    tally.reward = 0.0
    tally.trial += 1
    if tally.trial == life.trials.shape[0] or tally.time_outs == terms.time_outs:
        tally.over = True
        return
    # Weights, synapse states and the sums for the metrics last; all else starts anew.
    tally.began = tally.step
    tally.undirected_sum = 0.0
    tally.left_speed, tally.right_speed = 0.0, 0.0
    put_back(space, terms.start.x, terms.start.y, terms.start.heading)
