"""An environment of Gymnasium as a world: its settings, its readings and actions, and one lifetime in it.

    reading = tanh(x / scale)      of a Box; a Discrete observation is a 1 among zeros
    action  = the outputs, from -1 to 1, between the bounds of a Box; the place of the largest output of a Discrete
    F       = min(1, reward of the step before / reward_scale)      the live fitness that a plasticity rule gets

A lifetime is one episode, or `horizon` steps. All controllers of a repeat have the same seed of the environment.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.controller import Controller
from epuckhebb.controller.own_class import calling
from epuckhebb.controller.ranges import check, within
from epuckhebb.worlds.changes import AT, Faults, apply, readings_of

_LONGEST = 1_000_000  # steps
_MOST_PROCESSES = 1024
_WINDOW, _RECOVERED = 50, 0.9  # steps, and the share of the reward before a change, at which a lifetime has recovered


@dataclass(kw_only=True)
class Environment:
    """The settings of an environment.

    id: of Gymnasium, or FILE.py:NAME, a class of the user's. options: arguments with which it is made. horizon: steps
    of a lifetime. scale: of all readings, or of each. reward_scale: reward of a step at which the live fitness is 1.
    step_s: length of a step [s], for what has time constants. changes: each `{at: STEP, NAME: VALUE}`; change: their
    name, of those in `named`. hidden: sizes of the hidden layers. population, generations, loops: of an evolution, with
    so many lifetimes of an individual. processes: 0 for one on each core.
    """

    name: str = ""
    id: str = ""
    options: dict[str, Any] = field(default_factory=dict)
    horizon: int = within(1, _LONGEST, default=500)
    scale: Any = 1.0
    reward_scale: float = within(0, above=True, default=1.0)
    step_s: float = within(0, above=True, default=0.02)
    changes: list[Any] = field(default_factory=list)
    change: str | None = None
    named: dict[str, Any] = field(default_factory=dict)
    hidden: list[int] = field(default_factory=lambda: [16])
    population: int = within(1, default=32)
    generations: int = within(1, default=60)
    loops: int = within(1, default=1)
    processes: int = within(0, _MOST_PROCESSES, default=0)

    def __post_init__(self) -> None:
        check(self, "environment")
        for change in self.changes:
            if not isinstance(change, Mapping) or not isinstance(change.get(AT), int) or len(change) < 2:
                raise ValueError(f"environment.changes must be a list of {{at: STEP, NAME: VALUE}}, got {change!r}")
            if not 0 <= change[AT] < self.horizon:
                raise ValueError(f"environment.changes: at must be below horizon={self.horizon}, got {change[AT]}")


class Lived(NamedTuple):
    """A lifetime that is over. rewards, weight_changes, weight_steps: (steps,), the latter two only if recorded.

    weight_steps: sum of |W - W| between two steps.
    """

    rewards: Floats
    weight_change_mean: float
    weight_change_final: float
    saturated_fraction: float
    weight_changes: Floats
    weight_steps: Floats


@dataclass(frozen=True, kw_only=True, eq=False)
class World:
    """An environment that is there. make: makes one. functions: changes of the user's, by their text in `changes`."""

    settings: Environment
    make: Callable[..., Any]
    functions: Mapping[str, Callable[[Any], None]] = field(default_factory=dict)

    @cached_property
    def name(self) -> str:
        """What it is called."""
        return self.settings.name

    @cached_property
    def _env(self) -> Any:
        return self.make()

    @cached_property
    def inputs(self) -> int:
        """The number of readings."""
        return readings_of(getattr(self._env, "observation_space", None), f"environment {self.name}: observations")

    @cached_property
    def outputs(self) -> int:
        """The number of outputs that make an action."""
        space: Any = getattr(self._env, "action_space", None)
        kind = type(space).__name__
        if kind not in ("Box", "Discrete"):
            raise ValueError(f"environment {self.name}: actions must be of Box or Discrete, and are of {kind}")
        return int(space.n if kind == "Discrete" else np.prod(space.shape))

    @cached_property
    def split(self) -> int:
        """The step that divides a lifetime in two: that of the first change, or the middle."""
        return min((int(change[AT]) for change in self.settings.changes), default=self.settings.horizon // 2)

    def check(self) -> None:
        """Try the first step, the scales and the changes; else a ValueError, of an environment of the user's too."""
        settings = self.settings
        inputs, scale = self.inputs, np.asarray(settings.scale, float)
        if scale.shape not in ((), (inputs,)) or not (np.isfinite(scale).all() and (scale > 0).all()):
            raise ValueError(f"environment.scale must be a number above 0, or {inputs} of them, got {settings.scale}")
        still, env = np.zeros(self.outputs), self._env
        with calling(f"environment {self.name}"):
            first, _ = env.reset(seed=0)
            second, reward, _, _, _ = env.step(self.turn(still))
            read = [self.read(first), self.read(second)]
            if {one.shape for one in read} != {(inputs,)} or not np.isfinite([np.sum(read), reward]).all():
                raise ValueError(f"it gave observations {first!r} and {second!r}, and reward {reward!r}")
        if settings.changes:
            env = self.make()
            for change in settings.changes:
                try:
                    apply(change, env.unwrapped, Faults(), self.functions)
                except ValueError as error:
                    raise ValueError(f"environment.changes: {error}") from error
            env.close()

    @cached_property
    def read(self) -> Callable[[Any], Floats]:
        """The function from an observation to the readings, (inputs,)."""
        if type(self._env.observation_space).__name__ == "Discrete":
            first, eye = int(self._env.observation_space.start), np.eye(self.inputs)
            return lambda observation: np.array(eye[int(observation) - first])
        shrink = 1.0 / np.broadcast_to(np.asarray(self.settings.scale, float), self.inputs)
        return lambda observation: np.tanh(np.asarray(observation, np.float64).ravel() * shrink)

    @cached_property
    def turn(self) -> Callable[[Floats], Any]:
        """The function from the outputs, (outputs,), to an action."""
        space = self._env.action_space
        if type(space).__name__ == "Discrete":
            first = int(space.start)
            return lambda outputs: first + int(outputs.argmax())
        bounded = np.isfinite(space.low) & np.isfinite(space.high)
        low, high = np.where(bounded, space.low, -1.0), np.where(bounded, space.high, 1.0)
        middle, half = ((high + low) / 2.0).astype(float), ((high - low) / 2.0).astype(float)
        if not middle.any() and middle.ndim == 1:
            return lambda outputs: (outputs * half).astype(space.dtype)
        return lambda outputs: (middle + outputs.reshape(middle.shape) * half).astype(space.dtype)

    def live(
        self,
        controller: Controller,
        seed: int,
        *,
        frozen: bool = False,
        record: bool = False,
        watch: Callable[[Any], None] | None = None,
    ) -> Lived:
        """Run a lifetime.

        seed: of the environment and of random initial weights. frozen: no plasticity from `split` on. record: keep
        changes of the weights. watch: is called with the environment before each step.

        Raises:
            PartError: the weights, or a function of the user's, failed.
            ArithmeticError: rewards stopped being finite.
        """
        settings = self.settings
        changes = sorted(settings.changes, key=lambda change: int(change[AT]))
        env = self.make(render_mode="rgb_array") if watch else self.make() if changes else self._env
        faults, rng, waiting = Faults(), np.random.default_rng(seed), list[Any]()
        rewards, found, rate = np.zeros(settings.horizon), np.zeros((2, settings.horizon)), controller.rate
        read, turn, act, do, full = self.read, self.turn, controller.act, env.step, settings.reward_scale
        has_faults, has_ended, is_cut = False, False, False
        observation, _ = env.reset(seed=seed)
        controller.reset(seed)
        reward, step = 0.0, 0
        try:
            for step in range(settings.horizon):
                while changes and step == changes[0][AT]:
                    apply(changes.pop(0), env.unwrapped, faults, self.functions)
                    has_faults = True
                if frozen and step == self.split:
                    controller.rate = 0.0
                readings = read(observation)
                if has_faults:
                    readings[faults.dead] = 0.0
                    for place, deviation in faults.noise.items():
                        readings[place] += deviation * rng.standard_normal()
                before = controller.weights.copy() if record else controller.weights
                action = turn(act(readings, min(1.0, reward / full)))
                if record:
                    found[:, step] = controller.weight_change, np.abs(controller.weights - before).sum()
                if has_faults and faults.delay:
                    waiting.append(action)
                    action = waiting.pop(0) if len(waiting) > faults.delay else waiting[0]
                if watch:
                    watch(env)
                observation, reward, has_ended, is_cut, _ = do(action)
                rewards[step] = reward
                if has_ended or is_cut:
                    break
        finally:
            controller.rate = rate
            if env is not self._env:
                env.close()
        controller.check()
        steps = step + 1
        if not np.isfinite(rewards).all():
            raise ArithmeticError(f"environment {self.name}: rewards are infinite or nan (seed {seed})")
        return Lived(
            rewards[:steps],
            controller.weight_change_mean,
            controller.weight_change,
            controller.saturated_fraction,
            *found[:, : steps * record],
        )

    def metrics(self, lived: Lived) -> dict[str, float]:
        """The columns of `metrics.csv` that are about one lifetime."""
        rewards, split = lived.rewards, self.split
        before, after = rewards[:split], rewards[split:]
        recovery = math.nan
        if self.settings.changes and len(before) and len(rewards) == self.settings.horizon and len(after) >= _WINDOW:
            wanted = before.mean() - (1 - _RECOVERED) * abs(before.mean())
            is_less = np.convolve(after, np.full(_WINDOW, 1 / _WINDOW), "valid") < wanted
            back = np.flatnonzero(~is_less[is_less.argmax() :])
            recovery = float(is_less.argmax() + back[0]) if len(back) else math.nan
        return {
            "return": float(rewards.sum()),
            "steps": len(rewards),
            "return_before": float(before.sum()),
            "return_after": float(after.sum()),
            "recovery_steps": recovery,
            "weight_change_mean": lived.weight_change_mean,
            "weight_change_final": lived.weight_change_final,
            "saturated_fraction": lived.saturated_fraction,
        }
