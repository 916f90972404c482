"""What evolution maximises: the paper's fitness, or a class of the user's own.

An own fitness has a static method `step`, which is compiled into the kernel, a static method `life`, which is plain
Python and called when a lifetime is over, or both. A fitness that has only `life` needs no kernel of its own.
"""

import math
from collections import namedtuple
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from epuckhebb.sim import own_class
from epuckhebb.sim.arrays import Floats
from epuckhebb.sim.compiling.kernel import compiled, in_module
from epuckhebb.sim.robot import STEP_S

PAPER = "paper"
_namedtuple: Any = namedtuple  # mypy wants the names of the fields written out
_OF_STEP = {  # the arguments that `step` may have, and how the kernel has them
    "left": "left",
    "right": "right",
    "nearest": "nearest",
    "contact": "contact",
    "behaviour": "behaviour",
    "junction": "tally.junction",
    "goal_distance": "tally.goal_distance",
    "arrived": "not math.isnan(tally.time_to_goal)",
    "x": "x",
    "y": "y",
    "heading": "heading",
    "readings": "readings",
    "time_s": "time_s",
    "state": "state",
    "by": "by",
}
_ARGUMENTS = "tally, state, numbers, left, right, nearest, contact, behaviour, x, y, heading, readings, time_s"
OF_OUTCOME = (  # the fields of an outcome that `life`, and `tell` of an optimizer, may name
    "success",
    "time_to_goal",
    "path_length",
    "final_distance",
    "behaviour",
    "reward",
    "contact_fraction",
    "weight_change_mean",
    "steps",
    "x",
    "y",
)
_OF_LIFE = ("paper", *OF_OUTCOME, "trials", "by")  # the arguments that `life` may have
_WITH_STEP = ("mean", "state")  # and those that only `step` makes

Score = Callable[..., float]


class FitnessError(ValueError):
    """A fitness gave no number; the message says which, and what it gave."""


@dataclass(frozen=True, kw_only=True)
class Fitness:
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
        steps            as in `epuckhebb.sim.outcome.Outcome`
        x, y             m, where the robot is at the end
        trials           of a task with many trials
        by               the settings

    state: name -> initial value, a number or a tuple of numbers, of what is stored from step to step.
    """

    state: ClassVar[Mapping[str, Any]] = {}
    step: ClassVar[Callable[..., float] | None] = None
    life: ClassVar[Callable[..., float] | None] = None

    @property
    def name(self) -> str:
        """What it is called: `paper`, or as its class."""
        return type(self).__name__ if self.is_own else PAPER

    @property
    def is_own(self) -> bool:
        """Whether it is another than the paper's."""
        return type(self) is not Fitness

    @classmethod
    def settings(cls) -> tuple[str, ...]:
        """The names of the settings that are numbers, in the order in which a kernel has them."""
        return own_class.number_settings(cls)

    def numbers(self) -> tuple[float, ...]:
        """The settings that are numbers, for `step`."""
        return tuple(float(getattr(self, name)) for name in self.settings()) if self.step else ()

    def initial_state(self) -> NDArray[np.void]:
        """One record: the sum over the steps, 0, and what is stored from step to step."""
        initial = self.state if self.step else {}
        kinds = [("sum", np.float64, ()), *((name, np.float64, np.shape(value)) for name, value in initial.items())]
        record = np.zeros(1, np.dtype(kinds, align=True))
        for name, value in initial.items():
            record[name] = value
        return record

    def of_lifetime(self, facts: Mapping[str, Any], state: NDArray[np.void]) -> float:
        """The fitness of a lifetime. facts: the values of the arguments `paper` to `trials` by name.

        Raises:
            FitnessError: `life` failed, or its result is no finite number.
        """
        mean: float = float(state["sum"][0]) / facts["steps"]
        if not math.isfinite(mean):
            raise FitnessError(f"fitness {self.name}: the values of its steps have the mean {mean}")
        if self.life is None:
            return mean
        known = {**facts, "mean": mean, "state": state.view(np.recarray)[0], "by": self}
        try:
            value: Any = self.life(**{name: known[name] for name in _arguments_of_life(type(self))})
        except Exception as error:  # what a user's code may raise has no end
            raise FitnessError(f"fitness {self.name}: `life` failed: {type(error).__name__}: {error}") from error
        is_number = isinstance(value, int | float | np.number | np.bool_)
        if not is_number or not math.isfinite(value):
            raise FitnessError(f"fitness {self.name}: `life` must return a finite number, it returned {value!r}")
        return float(value)


PAPER_FITNESS = Fitness()


def scored(fitness: Fitness) -> type[Fitness]:
    """The class whose `step` a kernel has: that of the paper, without one, also for a fitness that has only `life`."""
    return type(fitness) if fitness.step else Fitness


def check_class(kind: type[Fitness]) -> None:
    """Check the functions of a fitness.

    Raises:
        ValueError: it has neither, an argument or a state is unknown, or it draws random numbers that no run repeats.
    """
    what = f"fitness {kind.__name__}"
    if kind.step is None and kind.life is None:
        raise ValueError(f"{what} has no static method `step` for each step, and no `life` for a lifetime")
    own_class.check_fields(what, kind)
    if kind.step is not None:
        _arguments_of_step(kind)
    if kind.life is not None:
        _arguments_of_life(kind)
    for function in functions_of(kind):
        own_class.check_repeatable(what, function)


def _arguments_of_step(kind: type[Fitness]) -> tuple[str, ...]:
    assert kind.step is not None  # who asks has looked
    records = {"by": kind.settings(), "state": tuple(kind.state)}
    return own_class.arguments(f"fitness {kind.__name__}", kind.step, _OF_STEP, records)


def _arguments_of_life(kind: type[Fitness]) -> tuple[str, ...]:
    assert kind.life is not None  # who asks has looked
    known = (*(_WITH_STEP if kind.step else ()), *_OF_LIFE)
    return own_class.arguments(f"fitness {kind.__name__}", kind.life, known, {})


def functions_of(fitness: Fitness | type[Fitness]) -> tuple[Callable[..., float], ...]:
    """The functions of a fitness; none of the paper's."""
    return tuple(function for function in (fitness.step, fitness.life) if function is not None)


def facts_of(outcome: Any) -> dict[str, Any]:
    """The values of the arguments `paper` to `trials` of `life`. outcome: of a lifetime."""
    return {name: getattr(outcome, name) for name in (*OF_OUTCOME, "trials")} | {"paper": outcome.fitness}


def _no_score(
    tally: Any,
    state: Any,
    numbers: tuple[float, ...],
    left: float,
    right: float,
    nearest: float,
    contact: bool,
    behaviour: float,
    x: float,
    y: float,
    heading: float,
    readings: Floats,
    time_s: float,
) -> float:
    """The paper's fitness has no `step`."""
    return 0.0


def score_of(kind: type[Fitness]) -> Score:
    """The function `score(tally, state, numbers, left, ..., time_s)` that gives the value of a step."""
    if kind.step is None:
        return compiled(_no_score)
    # Only what `step` has as arguments is computed, so the call is written when the class is known.
    given = ", ".join(_OF_STEP[name] for name in _arguments_of_step(kind))
    parts = {"step": compiled(in_module(kind.step, __name__)), "math": math}
    value = compiled(eval(f"lambda {_ARGUMENTS}, by: step({given})", parts))
    parts = {"value": value, "By": _namedtuple("By", kind.settings())}
    score: Score = compiled(eval(f"lambda {_ARGUMENTS}: float(value({_ARGUMENTS}, By(*numbers)))", parts))
    return score


def example_arguments(fitness: Fitness, tally: Any, inputs: int) -> tuple[Any, ...]:
    """Arguments with which `score` can be called by itself."""
    state, readings = fitness.initial_state()[0], np.zeros(inputs)
    return (tally, state, fitness.numbers(), 0.0, 0.0, 0.0, False, 0.0, 0.0, 0.0, 0.0, readings, STEP_S)
