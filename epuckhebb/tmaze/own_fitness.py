"""What evolution maximises: the paper's fitness, or a class of the user's own.

An own fitness has a static method `step`, which is compiled into the kernel, a static method `life`, which is plain
Python and called when a lifetime is over, or both. A fitness that has only `life` needs no kernel of its own.
"""

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller.compiling.errors import PartError
from epuckhebb.controller.compiling.kernel import zero
from epuckhebb.controller.own_class import OwnClass, calling, make_number_call

PAPER = "paper"
_OF_STEP = {  # the arguments that `step` may have, and how the kernel has them
    "left": "left",
    "right": "right",
    "nearest": "nearest",
    "contact": "contact",
    "behaviour": "behaviour",
    "junction": "tally.junction",
    "goal_distance": "tally.goal_distance",
    "arrived": "not math.isnan(tally.time_to_goal)",
    "x": "at.x",
    "y": "at.y",
    "heading": "at.heading",
    "readings": "readings",
    "time_s": "time_s",
    "state": "state",
    "by": "by",
}
_ARGUMENTS = "tally, state, numbers, left, right, nearest, contact, behaviour, at, readings, time_s"
OF_OUTCOME = (  # the fields of an outcome that `life`, and `tell` of an optimizer, may name
    *("success", "time_to_goal", "path_length", "final_distance", "behaviour", "reward", "contact_fraction"),
    *("weight_change_mean", "steps", "x", "y"),
)
_OF_LIFE = ("paper", *OF_OUTCOME, "trials", "by")  # the arguments that `life` may have
_WITH_STEP = ("mean", "state")  # and those that only `step` makes
_OF_EPISODE = ("rewards", "observations", "infos", "terminated")  # and those that only an environment has
IN_MAZE = {"step": tuple(_OF_STEP), "life": (*_WITH_STEP, *_OF_LIFE)}
IN_ENVIRONMENT = {"life": (*_OF_EPISODE, "steps", "weight_change_mean", "by")}

Score = Callable[..., float]


@dataclass(frozen=True, kw_only=True)
class Fitness(OwnClass):
    """How well a robot does, a number of which evolution wants more; this one is that of the paper.

    A subclass adds settings as fields, and has one or both of these static methods. Each may name any of these
    arguments, in any order. `step`, compiled by numba, gives the value of a control step:

        left, right      outputs for the two wheels, -1 to 1
        nearest          the largest distance reading, 0 to 1; contact: whether it is above 0.8
        behaviour        the paper's combined fitness of this step; junction: 1 once the robot was in the correct arm
        goal_distance    m from the goal; arrived: whether the robot ever was at its goal
        x, y, heading    of the robot, m and rad
        readings         the inputs of the network
        time_s           since the start
        state            the numbers named in the class attribute `state`, to be read and set
        by               the settings

    `life`, plain Python, gives the fitness of a lifetime. Without it, that is the mean over the steps:

        mean             of what `step` gave; state: as the last step left it (both only with `step`)
        paper            the fitness that the task has by itself
        success, time_to_goal, path_length, final_distance, behaviour, reward, contact_fraction, weight_change_mean,
        steps            as in `epuckhebb.tmaze.outcome.Outcome`
        x, y             m, where the robot is at the end
        trials           of a task with many trials
        by               the settings

    In an environment there is only `life`, of `steps`, `weight_change_mean`, `by`, and:

        rewards          of each step, (steps,)
        observations, infos   lists of what each step gave
        terminated       whether the episode ended by itself, and was not cut off at the horizon

    state: name -> initial value, a number or a tuple of numbers, of what is stored from step to step.
    """

    PART: ClassVar[str] = "fitness"
    KEY: ClassVar[str] = "fitness.function"
    METHODS: ClassVar[tuple[str, ...]] = ("step", "life")
    state: ClassVar[Mapping[str, Any]] = {}
    step: ClassVar[Callable[..., float] | None] = None
    life: ClassVar[Callable[..., float] | None] = None

    @property
    def name(self) -> str:
        """What it is called: `paper`, or as its class."""
        return type(self).__name__ if self.is_custom else PAPER

    @property
    def is_custom(self) -> bool:
        """Whether it is another than the paper's."""
        return type(self) is not Fitness

    @classmethod
    def allowed_arguments(cls, method: str) -> Collection[str]:
        """The names of the arguments that a method may have; none where they are fixed."""
        return _OF_STEP if method == "step" else (*(_WITH_STEP if cls.step else ()), *_OF_LIFE, *_OF_EPISODE)

    def check_world(self, allowed: Mapping[str, Collection[str]]) -> None:
        """Refuse a fitness of another kind of world; else a ValueError. allowed: the arguments of each method there."""
        methods = [method for method in self.METHODS if getattr(self, method)]
        wrong = [name for method in methods for name in self.arguments(method) if name not in allowed.get(method, ())]
        if wrong or not (self.life or "step" in allowed):
            has = "; ".join(f"`{method}` of {', '.join(names)}" for method, names in allowed.items())
            raise ValueError(f"fitness {self.name} takes {', '.join(wrong) or 'nothing'}; here is {has}")

    def initial_state(self) -> NDArray[np.void]:
        """One record: the sum over the steps, 0, and what is stored from step to step."""
        initial = self.state if self.step else {}
        kinds = [("sum", np.float64, ()), *((name, np.float64, np.shape(value)) for name, value in initial.items())]
        record = np.zeros(1, np.dtype(kinds, align=True))
        for name, value in initial.items():
            record[name] = value
        return record

    def judge_lifetime(self, facts: Mapping[str, Any], state: NDArray[np.void]) -> float:
        """The fitness of a lifetime. facts: the values of the arguments `paper` to `trials`, and others, by name.

        Raises:
            PartError: `life` failed, or its result is no finite number.
        """
        mean: float = float(state["sum"][0]) / facts["steps"]
        if not math.isfinite(mean):
            raise PartError(f"fitness {self.name}: the values of its steps have the mean {mean}")
        if self.life is None:
            return mean
        return self.judged({**facts, "mean": mean, "state": state.view(np.recarray)[0]})

    def judged(self, facts: Mapping[str, Any]) -> float:
        """What `life` gives. facts: the values of its arguments, and others, by name.

        Raises:
            PartError: it failed, or its result is no finite number.
        """
        assert self.life is not None  # checked before
        values = {**facts, "by": self}
        with calling(f"fitness {self.name}: `life`"):
            value: Any = self.life(**{name: values[name] for name in self.arguments("life")})
        is_number = isinstance(value, int | float | np.number | np.bool_)
        if not is_number or not math.isfinite(value):
            raise PartError(f"fitness {self.name}: `life` must return a finite number, it returned {value!r}")
        return float(value)


PAPER_FITNESS = Fitness()


def scored(fitness: Fitness) -> type[Fitness]:
    """The class whose `step` a kernel has: that of the paper, without one, also for a fitness that has only `life`."""
    return type(fitness) if fitness.step else Fitness


def make_score(kind: type[Fitness]) -> Score:
    """The function `score(tally, state, numbers, left, ..., time_s)` that gives the value of a step."""
    made: Score = zero
    if kind.step is not None:
        made = make_number_call(kind, kind.step, kind.arguments("step"), _OF_STEP, _ARGUMENTS, "numbers")
    return made
