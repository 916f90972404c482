"""Reversal learning in a T-maze: the robot must find out which end is rewarded, and again when that changes.

A lifetime has many trials. Each begins at rest at the start. It ends one second after the robot reaches an end of the
maze, or when its time is over. During that second a network input is the reward: 1 at the rewarded end, -1 at the
other, else 0. The lamp is off, and nothing else distinguishes the ends. At some trials, usually one, the other end
becomes the rewarded one. They are drawn for each lifetime, and some lifetimes have none, so counting does not help.
Weights, synapse states and the state of recurrent neurons last across trials.

Without any of these all trials are alike but for the noise, so a robot as good on either side is rewarded in half of
them. The reward shows which end was the good one, whichever the robot reached, so nothing need be explored. The best
choice is the end that is good more probably after all that was rewarded so far: in the usual task win-stay, lose-shift.

Source: after Soltoggio, Bullinaria, Mattiussi, Durr & Floreano, Evolutionary advantages of neuromodulated plasticity in
dynamic, reward-based scenarios, ALIFE XI, 2008. How often the world changes in a lifetime, and how long that is:
Kozielska & Weissing, A neural network model for the evolution of learning in changing environments, PLoS Comput. Biol.
20, 2024.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.kernel import compiled
from epuckhebb.controller.plasticity.rule import Reward
from epuckhebb.controller.random import Stream, rng
from epuckhebb.controller.ranges import Range, check_value, within
from epuckhebb.tmaze.fitness import goal_distance
from epuckhebb.tmaze.maze import Place, Pose, Side
from epuckhebb.tmaze.physics.pymunk import Handles, put_back
from epuckhebb.tmaze.robot import STEP_S
from epuckhebb.tmaze.sensors import InputGroup, RewardInput
from epuckhebb.tmaze.task import TRIAL, Hooks, Task, rewarded

_ENDS = {"left": -1, "right": 1}
_LAST_SWITCH = 8  # unless the lifetime is shorter, or the user says another


class First(Enum):
    """The end that is rewarded first: in each pair of lifetimes either one, or always the left one."""

    drawn = "drawn"
    left = "left"


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

    trials: of a lifetime. switches: how often the rewarded end changes in a lifetime. first_switch, last_switch: it
    changes at trials from the one to the other, counted from 1, two or more apart, all such sets of trials equally
    likely; None for the eighth trial, or the last one if there are fewer. never: share of the lifetimes in which it
    does not change. With no switches, these three mean nothing. first: the end that is rewarded first. Lifetimes come
    in pairs, of which the side names one, with the same switches. `drawn`: the side is the end that is rewarded first.
    `left`: in both that is the left end, and they differ in their noise. reward: as given, or, as a control, inverted
    where the network reads it; what counts stays the same. reward_s: for how long the reward is given [s].
    time_out_s: when a trial without an arrival is over [s]. time_outs: after this number of them the lifetime is over,
    and the remaining trials count as not rewarded. end_bonus, progress_bonus: fitness for reaching an end in every
    trial, and for coming near one, besides the rewarded share; they guide evolution before robots arrive.
    """

    inputs: ClassVar[tuple[InputGroup, ...]] = (RewardInput(),)
    has_trials: ClassVar[bool] = True

    trials: int = within(2, 1000, default=10)
    switches: int = within(0, default=1)
    first_switch: int = 2
    last_switch: int | None = None
    first: First = First.drawn
    never: float = within(0, 1, default=0.125)
    reward: Reward = Reward.given
    reward_s: float = within(STEP_S, default=1.0)
    time_out_s: float = within(STEP_S, default=30.0)
    time_outs: int = within(1, default=2)
    end_bonus: float = within(0, default=0.1)
    progress_bonus: float = within(0, default=0.1)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.last_switch is None:
            object.__setattr__(self, "last_switch", min(_LAST_SWITCH, self.trials))
        check_value("task.last_switch", self.last_switch, Range(2, self.trials))
        check_value("task.first_switch", self.first_switch, Range(2, self._last))
        if not _ways(self._window, self.switches):  # so many do not fit
            most = (self._window + 1) // 2
            raise ValueError(
                f"task.switches must be at most {most}, as many as fit from task.first_switch={self.first_switch} to "
                f"task.last_switch={self._last} (of task.trials={self.trials}), two trials apart; got {self.switches}"
            )

    def check(self, lamp_intensity: float, duration_s: float) -> None:
        """Refuse a lamp, which would show the first side, and a lifetime too short for every trial, by a ValueError."""
        if lamp_intensity != 0:
            raise ValueError(f"scenario.lamp.intensity must be 0 with task=reversal, got {lamp_intensity:g}")
        longest_s = self.trials * (_steps(self.time_out_s) + _steps(self.reward_s)) * STEP_S
        if duration_s < longest_s - 1e-9:
            raise ValueError(f"lifetime.duration_s must be {longest_s:g} s or more, got {duration_s:g}")

    def hooks(self, first: int) -> Hooks:
        """The functions that a lifetime calls. first: the place of the reward among the network's inputs."""

        @compiled
        def reward_input(activation: Floats, reward: float) -> None:
            activation[first] = reward

        return Hooks(reward_input, compiled(_nearer_distance), compiled(_end_step))

    def terms(self, goals: Mapping[Side, Place], start: Pose) -> Terms:
        """The numbers that these functions need. goals: the ends of the maze. start: of each trial."""
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
        """The trials of a lifetime before it starts. side: the end that is rewarded first, if that is drawn.

        A rule that acts before the change is frozen from the first switch on. In a lifetime without a switch that is
        the middle of the trials in which switches are drawn.
        """
        switches = self.drawn_switches(key)
        trials = np.zeros(self.trials, TRIAL)
        trials["nearest"] = math.inf
        trials["good"] = _ENDS["left" if self.first is First.left else side]
        for switch in switches:
            trials["good"][switch - 1 :] *= -1
        frozen_from = switches[0] if switches else (self.first_switch + self._last) // 2
        trials["frozen"][frozen_from - 1 :] = True
        return trials

    def drawn_switches(self, key: int) -> list[int]:
        """The trials, counted from 1, at which the other end becomes the rewarded one. key: of random numbers.

        Sets with gaps are the subsets of a shorter row of trials, drawn by the algorithm of Floyd (Bentley & Floyd,
        Commun. ACM 30 (1987) 754), which are then moved apart.
        """
        never, *places = rng(key, Stream.switches).random(1 + self.switches)
        if never < self.never:
            return []
        chosen: set[int] = set()
        room = self._window - (self.switches - 1)
        for last, number in enumerate(places, start=room - self.switches):
            at = int(number * (last + 1))
            chosen.add(last if at in chosen else at)
        return [self.first_switch + at + number for number, at in enumerate(sorted(chosen))]

    @property
    def _last(self) -> int:
        assert self.last_switch is not None  # since `__post_init__`
        return self.last_switch

    @property
    def _window(self) -> int:
        """At how many trials the rewarded end may change."""
        return self._last - self.first_switch + 1

    def limits(self) -> dict[str, float]:
        """Shares of rewarded trials: means over lifetimes, from how many sets of switches agree with what was seen.

        chance: of the best fixed sequence of choices. Where the first end is drawn, any sequence is right in one
        lifetime of a pair wherever it is wrong in the other. Where it is the left one, the best sequence takes the end
        that is good in more lifetimes, trial by trial.

        optimum: of the best choices after the rewards so far, which show all earlier good ends. After j switches, the
        last of them two trials ago or earlier, another one comes now in `switching` of the sets, and does not in
        `staying`; right after a switch none comes. The first trial is a guess, unless the first end is always the left
        one.
        """
        window, first, last = self._window, self.first_switch, self._last
        weight = (1 - self.never) / _ways(window, self.switches) if self.switches else 1.0
        is_drawn = self.first is First.drawn
        chance = optimum = 0.5 if is_drawn else 1.0
        for trial in range(2, self.trials + 1):
            stayed = 0.0  # probability that the good end is that of the first trial
            for j in range(self.switches + 1):
                left = self.switches - j
                later = _ways(min(window, last - trial), left)
                seen = _ways(min(trial - 1 - first, window), j)
                just = _ways(trial - 2 - first, j - 1) if first < trial <= last + 1 else 0
                switching = seen * weight * _ways(last - trial - 1, left - 1) if first <= trial <= last else 0.0
                staying = seen * weight * later + (self.never if self.switches and not j else 0.0)
                switched = just * weight * later
                optimum += max(switching, staying) + switched
                stayed += switching if j % 2 else staying + switched
            chance += 0.5 if is_drawn else max(stayed, 1 - stayed)
        return {"chance": chance / self.trials, "optimum": optimum / self.trials}

    def fitness(
        self,
        behaviour: float,  # noqa: ARG002  # of the paper's task
        reward: float,  # noqa: ARG002
        trials: NDArray[np.void],
        at_start: float,
    ) -> float:
        """The rewarded share, plus a little for reaching any end, or coming near one."""
        arrived = trials["reached"] != 0
        progress = np.where(arrived, 1.0, np.maximum(0.0, 1.0 - trials["nearest"] / at_start))
        return float(rewarded(trials).mean() + self.end_bonus * arrived.mean() + self.progress_bonus * progress.mean())


def _steps(seconds: float) -> int:
    return math.floor(seconds / STEP_S + 1e-9)


def _ways(trials: int, switches: int) -> int:
    """How many sets of so many switches, two trials or more apart, there are among trials; fewer than none are none."""
    places = max(trials, 0) - switches + 1
    return math.comb(places, switches) if min(places, switches) >= 0 else 0


def _nearer_distance(setup: Any, x: float, y: float) -> float:
    """Distance to the nearer end [m]: nothing but the reward may show which end is rewarded."""
    left = goal_distance(x, y, setup.terms.left.x, setup.terms.left.y)
    right = goal_distance(x, y, setup.terms.right.x, setup.terms.right.y)
    return min(left, right)


def _end_step(life: Any, space: Handles, setup: Any) -> None:
    """Give the reward if the robot is at an end, and begin the next trial when this one is over."""
    tally, terms = life.tally[0], setup.terms
    trial = life.trials[tally.trial]
    elapsed = tally.step - tally.began
    if trial.reached == 0:
        trial.nearest = min(trial.nearest, tally.goal_distance)
        if tally.goal_distance < setup.goal_radius:
            x, y = space.state[0], space.state[1]
            on_left = goal_distance(x, y, terms.left.x, terms.left.y) == tally.goal_distance
            trial.reached = -1 if on_left else 1
            trial.steps = elapsed
            tally.reward = terms.reward if trial.reached == trial.good else -terms.reward
            return
        if elapsed < terms.time_out:
            return
        trial.steps = elapsed
        tally.time_outs += 1
    elif elapsed < trial.steps + terms.reward_steps:
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
