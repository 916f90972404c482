"""An adaptation put together: its settings, and the functions that a lifetime calls."""

import math
from dataclasses import dataclass, fields
from enum import Enum
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from epuckhebb.adaptation import change_signals
from epuckhebb.adaptation.change_signal import ChangeSignal, no_nominal
from epuckhebb.adaptation.exploration import halting_exploration, motor_noise_exploration, wall_exploration
from epuckhebb.adaptation.gate import PlasticWhen, Stay, gates
from epuckhebb.adaptation.homeostasis import HomeostasisState, homeostasis, initial_homeostasis_state
from epuckhebb.adaptation.wall_following import wall_following
from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.own_class import load_class, part_names, stored
from epuckhebb.controller.plasticity.control import Control
from epuckhebb.controller.plasticity.rule import NoRule, Rule
from epuckhebb.controller.random import noise_workspace_size
from epuckhebb.controller.ranges import check, within
from epuckhebb.controller.wiring import LAYERS, Wiring
from epuckhebb.tmaze.fitness import Signal
from epuckhebb.tmaze.individual import NO_HOOKS, Hooks, NoAdaptation
from epuckhebb.tmaze.robot import STEP_S, Robot

NONE = "none"
NEVER = 1e9  # a threshold that no signal reaches


class Exploration(Enum):
    """How a robot drives while the gate is open, beside learning: by its network, or along walls."""

    motor_noise = "motor_noise"
    wall_following = "wall_following"


@dataclass(kw_only=True)
class Adaptation(NoAdaptation):
    """When plasticity acts in a lifetime, how the robot explores meanwhile, and whether its light weights are scaled.

    name: in tables. change_signal: the signal that opens the gate, a name or a class; with `none` the gate is
    always open, and only homeostasis is used. threshold, slope: the gate is closed up to the threshold and opens by
    the slope for each unit of the signal above it; inf: at once. active_s, rest_s: while the signal lasts, the gate
    is open and closed in turn for these times [s]; active_s = 0: no rests. start_by_s: the gate also opens at this
    time [s], if the robot has never been at its goal. exploration: what the robot does while the gate is open.
    motor_noise: standard deviation of noise on both wheels' outputs then. plastic_when: when plasticity acts; `late`:
    while the gate is open, and the weights are reset when it closes; `goal_signal`: at the goal, and they are kept.
    stay: what else keeps the robot at the goal. homeostasis: whether the weights from the light sensors are scaled
    until the light looks as in the training world.
    """

    change_signal: Any = NONE
    threshold: float = within(-math.inf, default=0.0)
    slope: float = within(0, above=True, default=math.inf)
    active_s: float = within(0, default=0.0)
    rest_s: float = within(0, default=0.0)
    start_by_s: float = within(0, above=True, default=math.inf)
    exploration: Exploration = Exploration.motor_noise
    motor_noise: float = within(0, default=0.0)
    plastic_when: PlasticWhen = PlasticWhen.late
    stay: Stay = Stay.none
    homeostasis: bool = False

    def __post_init__(self) -> None:
        allowed = (NONE, *part_names(change_signals))
        is_own = not isinstance(self.change_signal, str) or ":" in self.change_signal
        if not is_own and self.change_signal not in allowed:
            choices = f"one of {', '.join(allowed)}, or FILE.py:NAME"
            raise ValueError(f"adaptation.change_signal must be {choices}, got {self.change_signal!r}")
        check(self, "adaptation")
        if self.rest_s > 0 and self.active_s == 0:
            raise ValueError(f"adaptation.rest_s = {self.rest_s:g} needs adaptation.active_s above 0")
        if self.change_signal == NONE:
            gated = [field for field in fields(self)[2:] if field.name != "homeostasis"]
            unused = [field.name for field in gated if getattr(self, field.name) != field.default]
            if unused:
                raise ValueError(f"adaptation.{unused[0]} does nothing without adaptation.change_signal; give one")
        kind = None if is_own or self.change_signal == NONE else load_class(change_signals, self.change_signal)
        self.signal: type[ChangeSignal] | None = self.change_signal if isinstance(self.change_signal, type) else kind
        self.is_gated = self.signal is not None
        self.acts = self.is_gated or self.homeostasis  # all that acts compares with nominal statistics
        self.follows_walls = self.exploration is not Exploration.motor_noise
        at_once = self.start_by_s <= STEP_S and self.threshold <= 0 and self.active_s == 0
        self.is_network_unused = self.exploration is Exploration.wall_following and at_once

    @property
    def parts(self) -> tuple[Any, ...]:
        """What its functions are made from; nothing for one that does nothing, so that its kernel has one name."""
        functions = self.signal, self.follows_walls, self.plastic_when, self.stay, self.homeostasis
        return functions if self.acts else ()

    @property
    def knowledge(self) -> tuple[str, ...]:
        """What it is given or what was written by hand, beside its senses."""
        takes = self.signal.arguments("signal") if self.signal else ()
        times = (
            bool({"time_s", "away_s", "arrived"} & {*takes}) and self.threshold < NEVER and not self.is_network_unused
        )
        uses = {
            "clock": times,
            "correct side": times,
            "goal signal": self.is_gated,  # at the goal, the gate of exploration is closed
            "hand-written": self.follows_walls or self.stay.halts,
        }
        return tuple(kind for kind, used in uses.items() if used)

    def check(self, rule: Rule, duration_s: float, wiring: Wiring | None) -> None:
        """Check that it goes with a rule, a lifetime's length and a network; else a ValueError."""
        if self.plastic_when is PlasticWhen.goal_signal and isinstance(rule, NoRule):
            raise ValueError("adaptation.plastic_when=goal_signal needs a plasticity rule: give hebbian=stay")
        if rule.control is not Control.none and self.is_gated and self.plastic_when is PlasticWhen.late:
            choices = " or ".join(choice.name for choice in PlasticWhen if choice is not PlasticWhen.late)
            settings = f"hebbian.control={rule.control.name} with adaptation={self.name}"
            raise ValueError(
                f"{settings}, which resets the weights; give another, with adaptation.plastic_when={choices}"
            )
        if duration_s <= self.start_by_s < math.inf:
            most = f"less than lifetime.duration_s = {duration_s:g}, or inf for never"
            raise ValueError(f"adaptation.start_by_s must be {most}, got {self.start_by_s:g}")
        if self.homeostasis and wiring is not None:
            raise ValueError(f"adaptation={self.name} needs network.wiring={LAYERS}, got {wiring.name}, without layers")
        if rule.signal == Signal.fitness and self.signal and "fitness" in self.signal.arguments("signal"):
            raise ValueError(f"hebbian.signal=fitness does not go with adaptation={self.name}; give another of the two")

    def numbers(self) -> Any:
        """The settings that its functions need, as numbers."""
        return Gate(*(float(getattr(self, name)) for name in Gate._fields)) if self.acts else ()

    def hooks(self, robot: Robot, post: int) -> Hooks:
        """The functions that a lifetime calls. post: how many neurons the first layer of connections leads to."""
        limit = robot.motor_limit_rad_s
        explore, open_gate = NO_HOOKS.explore, NO_HOOKS.open_gate
        if self.signal is not None:
            explore = motor_noise_exploration(limit)
            if self.follows_walls:
                explore = wall_exploration(wall_following(robot), limit)
            if self.stay.halts:
                explore = halting_exploration(explore)
            open_gate = gates(self.signal, self.plastic_when, self.stay)
        return Hooks(
            scale=homeostasis(robot.light.count, post) if self.homeostasis else NO_HOOKS.scale,
            open_gate=open_gate,
            explore=explore,
            resets=self.is_gated and self.plastic_when is not PlasticWhen.goal_signal,
        )

    def initial_state(self, robot: Robot) -> Any:
        """What its functions store from step to step, before the first one."""
        if not self.acts:
            return ()
        return AdaptationState(
            recent=np.zeros(robot.inputs + 1),
            signal=stored(self.signal.state if self.signal else {}, 1),
            hand=np.zeros(1),
            homeostasis=initial_homeostasis_state(robot.light.count),
            noise=np.zeros(noise_workspace_size(16)),
        )

    def no_nominal(self, robot: Robot) -> Any:
        """Nominal statistics for an individual that has none."""
        return no_nominal(robot.inputs, robot.light.count) if self.acts else ()


class Gate(NamedTuple):
    """The numbers of an `Adaptation`, for the kernel."""

    threshold: float
    slope: float
    active_s: float
    rest_s: float
    motor_noise: float
    start_by_s: float


class AdaptationState(NamedTuple):
    """What an adaptation carries from step to step, besides the tally of the lifetime.

    recent: recent means, (inputs + 1,). signal: one record, what the signal of change stores. hand: (1,) the side on
    which the robot follows a wall, 1 left, -1 right, 0 while it follows none. noise: workspace.
    """

    recent: Floats
    signal: NDArray[np.void]
    hand: Floats
    homeostasis: HomeostasisState
    noise: Floats
