"""An environment of Gymnasium as a world: its settings, and one lifetime in it.

    F = min(1, n + (1 - n) r / reward_scale)   the live fitness that a plasticity rule gets
                                               r: reward of the step before, or of this step's own move; n: neutral

A lifetime is one episode, or `horizon` steps. All controllers of a repeat have the same seed of the environment.
"""

import math
import os
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.errors import PartError
from epuckhebb.controller.compiling.kernel import compiled
from epuckhebb.controller.controller import Controller
from epuckhebb.controller.own_class import calling
from epuckhebb.controller.random import Stream, rng
from epuckhebb.controller.ranges import check, within
from epuckhebb.worlds.changes import AT, CHANGES, DEAD, DELAY, FUNCTION, Faults, apply
from epuckhebb.worlds.spaces import Reader, actor, moments, space_parts
from epuckhebb.worlds.trial import Findings, try_world

_LONGEST = 1_000_000  # steps
_MOST_PROCESSES = 1024
_WINDOW, _RECOVERED = 50, 0.9  # steps, and the share of the reward before a change, at which a lifetime has recovered


@dataclass(kw_only=True)
class Environment:
    """The settings of an environment.

    id: of Gymnasium, PACKAGE:ID for one that a package brings, or FILE.py:NAME, the user's class, or function that
    makes one. options: arguments with which it is made. horizon: steps of a lifetime. scale: of all readings, or of
    each; None: from their bounds; `running`: from what was read in training. reward_scale: reward of a step at which
    the live fitness is 1. neutral_fitness: the live fitness of a step without reward. reads_reward: whether the reward
    of the step before is one more reading, the last. learns_after_move: whether the weights change after a move, with
    its own reward, or before it, with that of the step before. reward_weights: of a reward that is several numbers;
    None: it is one. step_s: length of a step [s], for what has time constants. changes: each `{at: STEP, NAME: VALUE}`;
    change: their name, of those in `named`.
    hidden: sizes of the hidden layers. population, generations, loops: of an evolution, with so many lifetimes of an
    individual. processes: 0 for one on each core.
    """

    name: str = ""
    id: str = ""
    options: dict[str, Any] = field(default_factory=dict)
    horizon: int = within(1, _LONGEST, default=500)
    scale: Any = None
    reward_scale: float = within(0, above=True, default=1.0)
    neutral_fitness: float = within(0, 1, below=True, default=0.0)
    reads_reward: bool = False
    learns_after_move: bool = False
    reward_weights: list[float] | None = None
    step_s: float = within(0, above=True, default=0.02)
    changes: list[Any] = field(default_factory=list)
    change: str | None = None
    named: dict[str, list[dict[str, Any]]] = field(default_factory=dict)
    hidden: list[int] = field(default_factory=lambda: [16])
    population: int = within(1, default=32)
    generations: int = within(1, default=60)
    loops: int = within(1, default=1)
    processes: int = within(0, _MOST_PROCESSES, default=0)

    def __post_init__(self) -> None:
        check(self, "environment")
        for change in self.changes:
            at = change.get(AT) if isinstance(change, Mapping) else None
            if not isinstance(at, int) or isinstance(at, bool) or len(change) < 2:
                raise ValueError(f"environment.changes must be a list of {{at: STEP, NAME: VALUE}}, got {change!r}")
            if not 0 <= at < self.horizon:
                raise ValueError(f"environment.changes: at must be below horizon={self.horizon}, got {at}")


@compiled
def live_fitness(reward: float, full: float, neutral: float) -> float:
    """The live fitness F of a reward: 1 at `full`, `neutral` at 0."""
    return min(1.0, neutral + (1.0 - neutral) * (reward / full))


@compiled
def reward_reading(reward: float, full: float) -> float:
    """A reward as a reading, from -1 to 1."""
    return max(-1.0, min(1.0, reward / full))


class Lived(NamedTuple):
    """A lifetime that is over. rewards, weight_changes, weight_steps: (steps,), the latter two only if recorded.

    weight_steps: sum of |W - W| between two steps. fitness: what evolution maximises. moments: of what was read.
    """

    rewards: Floats
    weight_change_mean: float
    weight_change_final: float
    saturated_fraction: float
    weight_changes: Floats
    weight_steps: Floats
    fitness: float = math.nan
    moments: Floats | None = None


def _finite(value: Any, what: str) -> float:
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = math.nan
    if not math.isfinite(number):
        hint = "; environment.reward_weights makes one number of several" if np.size(value) > 1 else ""
        raise ValueError(f"{what} must be a finite number, got {value!r}{hint}")
    return number


@dataclass(frozen=True, kw_only=True, eq=False)
class World:
    """An environment that is there. make: makes one. functions: changes of the user's, by their text in `changes`.

    in_training: whether lifetimes keep the moments of what is read.
    """

    settings: Environment
    make: Callable[..., Any]
    functions: Mapping[str, Callable[[Any], None]] = field(default_factory=dict)
    in_training: bool = False

    @property
    def name(self) -> str:
        """What it is called."""
        return self.settings.name

    experiment = name  # by which its champions are known

    @cached_property
    def _env(self) -> Any:
        return self.make()

    @cached_property
    def inputs(self) -> int:
        """The number of readings."""
        return len(self.read.names)

    @cached_property
    def outputs(self) -> int:
        """The number of outputs that make an action."""
        return sum(part.size for part in space_parts(self.actions, f"environment {self.name}: actions"))

    @property
    def actions(self) -> Any:
        """The space of its actions."""
        return getattr(self._env, "action_space", None)

    @cached_property
    def read(self) -> Reader:
        """The function from an observation to the readings, (inputs,)."""
        what = f"environment {self.name}: observations"
        return Reader(self.observations, self.settings.scale, what, reads_reward=self.settings.reads_reward)

    def rescaled(self, scale: Any, *, in_training: bool = False) -> "World":
        """This environment with another scale. in_training: whether its lifetimes keep moments."""
        return replace(self, settings=replace(self.settings, scale=scale), in_training=in_training)

    @property
    def observations(self) -> Any:
        """The space of its observations."""
        return getattr(self._env, "observation_space", None)

    @cached_property
    def turn(self) -> Callable[[Floats], Any]:
        """The function from the outputs, (outputs,), to an action."""
        try:
            return actor(self.actions)
        except ValueError as error:
            raise ValueError(f"environment {self.name}: {error}") from error

    @cached_property
    def changes(self) -> list[Mapping[str, Any]]:
        """The changes by their step."""
        return sorted(self.settings.changes, key=lambda change: int(change[AT]))

    @cached_property
    def _compiled(self) -> Any:
        """The environment, if its lifetimes can run as machine code; else None."""
        env = getattr(self._env, "unwrapped", None)
        return env if hasattr(env, "run_lifetime") else None

    def is_compiled(self, judge: Any = None) -> bool:
        """Whether lifetimes run as machine code, which threads can run. judge: a `Fitness`; None for the return."""
        names = {name for change in self.changes for name in change} - {AT, DEAD}
        is_plain = not names & {*CHANGES, FUNCTION} and self.settings.reward_weights is None
        return self._compiled is not None and is_plain and not self._kept(judge)

    def yardsticks(self, seeds: Sequence[int]) -> Mapping[str, float]:
        """What scripted controllers earn in lifetimes without changes, the mean return by name; of few environments."""
        env = None if self.changes else self._compiled
        return {} if env is None else env.yardsticks(seeds, self.settings.horizon)

    @staticmethod
    def _kept(judge: Any) -> set[str]:
        """What of each step must be kept for a fitness of the user's."""
        return {"observations", "infos"}.intersection(() if judge is None else judge.arguments("life"))

    @cached_property
    def split(self) -> int:
        """The step that divides a lifetime in two: that of the first change, or the middle."""
        return min((int(change[AT]) for change in self.settings.changes), default=self.settings.horizon // 2)

    def check(self) -> None:
        """Try the first step, also after each change; else a ValueError, of an environment of the user's too."""
        still = np.zeros(self.outputs)
        self.episode(self._env, lambda *_: still, 0, 1)
        if changes := self.changes:
            env = self.make()
            self.episode(env, lambda *_: still, 0, 1, [{**change, AT: 0} for change in changes])
            env.close()

    @cached_property
    def findings(self) -> Findings:
        """What random actions show: whether its lifetimes can be repeated, and what a reader must know."""
        return try_world(self)

    def episode(
        self,
        env: Any,
        act: Callable[[int, Floats, float, Any], Floats],
        seed: int,
        steps: int,
        changes: Sequence[Mapping[str, Any]] = (),
        watch: Callable[[Any], None] | None = None,
        keep: Callable[[Any, Any, bool], None] | None = None,
        learn: Callable[[int, float, float], None] | None = None,
    ) -> Floats:
        """The rewards of an episode, of so many steps at most. changes: by their step.

        act: the outputs at a step, for the readings, the reward of the step before and the observation. watch, keep:
        are called before each step with the environment, and after it with observation, info and whether it ended.
        learn: is called after a step with its number, its reward, and that as a reading.

        Raises:
            PartError: the environment, or a function of the user's, failed, or gave what it may not give.
        """
        changes = list(changes)
        faults, noise = Faults(readings=self.read.names), rng(seed, Stream.reading_noise)
        longest = max((change[DELAY] for change in changes if isinstance(change.get(DELAY), int)), default=0)
        past = deque[Any](maxlen=1 + max(0, longest))  # kept always: a delay may begin during the lifetime
        rewards, read, turn, do = np.zeros(steps), self.read, self.turn, env.step
        full, last, reading = self.settings.reward_scale, self.inputs - 1, 0.0
        reward, step, has_ended, is_cut = 0.0, -1, False, False
        folder = Path.cwd()
        try:
            observation, _ = env.reset(seed=seed)
            readings = read(observation)
            for step in range(steps):
                while changes and step == changes[0][AT]:
                    self.apply(changes.pop(0), env, faults)
                for number, deviation in faults.noise.items():
                    readings[number] += deviation * noise.standard_normal()
                if faults.dead:
                    readings[faults.dead] = 0.0
                action = turn(act(step, readings, reward, observation))
                if longest:
                    past.append(action)
                    action = past[max(0, len(past) - 1 - faults.delay)]
                if watch:
                    watch(env)
                observation, reward, has_ended, is_cut, info = do(action)
                if keep:
                    keep(observation, info, has_ended)
                rewards[step] = reward = self._reward(reward)
                if read.reads_reward:
                    reading = reward_reading(reward, full)
                if learn:
                    learn(step, reward, 0.0 if last in faults.dead else reading)
                readings = read(observation, reading)
                if has_ended or is_cut:
                    break
            _finite(rewards.sum(), "the sum of the rewards")
        except PartError:
            raise
        except BaseException:
            with calling(f"environment {self.name}: {f'step {step}' if step >= 0 else 'reset'} (seed {seed})"):
                raise
        finally:
            os.chdir(folder)  # an environment of the user's may go elsewhere
        return rewards[: step + 1]

    def _reward(self, reward: Any) -> float:
        """The reward as one number."""
        weights = self.settings.reward_weights
        if weights is None:
            return _finite(reward, "a reward")
        if np.shape(reward) != (len(weights),):
            raise ValueError(f"a reward must be {len(weights)} numbers, as environment.reward_weights, got {reward!r}")
        return _finite(np.dot(weights, reward), "a reward")

    def apply(self, change: Mapping[str, Any], env: Any, faults: Faults) -> None:
        """Change an environment, and what is between it and its controller; a PartError if that cannot be."""
        try:
            apply(change, env.unwrapped, faults, self.functions)
        except PartError:
            raise
        except ValueError as error:
            raise PartError(f"environment.changes: {error}") from error
        if self.settings.learns_after_move and self.read.reads_reward and self.inputs - 1 in faults.noise:
            what = "with environment.learns_after_move=true a rule hears the exact reward"
            raise PartError(f"environment.changes: noisy_readings of {self.read.names[-1]}: {what}")

    def live(
        self,
        controller: Controller,
        seed: int,
        *,
        frozen: bool = False,
        record: bool = False,
        is_fresh: bool = True,
        watch: Callable[[Any], None] | None = None,
        judge: Any = None,
    ) -> Lived:
        """Run a lifetime.

        seed: of the environment and of random initial weights. frozen: no plasticity from `split` on. record: keep
        changes of the weights. is_fresh: in an environment of its own, as every lifetime with changes; else in the one
        that is kept. watch: is called with the environment before each step. judge: a `Fitness`; None for the return.

        Raises:
            PartError: the weights, the environment, or a function of the user's, failed.
        """
        settings, horizon, rate = self.settings, self.settings.horizon, controller.rate
        recorded, end = np.zeros((2, horizon)), self.split if frozen else horizon
        full, neutral = settings.reward_scale, settings.neutral_fitness
        controller.reset(seed)

        def learning(step: int, change: Callable[[], Any]) -> Any:
            last_weights = controller.weights.copy() if record else controller.weights
            outputs = change()
            if record:
                recorded[:, step] = controller.weight_change, np.abs(controller.weights - last_weights).sum()
            return outputs

        values = list[Floats]()

        def act(step: int, readings: Floats, reward: float, observation: Any) -> Any:
            if step == end:
                controller.rate = 0.0
            if self.in_training:
                values.append(self.read.values(observation))
            if settings.learns_after_move:
                return controller.decide(readings)
            return learning(step, lambda: controller.act(readings, live_fitness(reward, full, neutral)))

        def learn(step: int, reward: float, reading: float) -> None:
            heard = reading if settings.reads_reward else None
            learning(step, lambda: controller.learn(live_fitness(reward, full, neutral), heard))

        seen: dict[str, Any] = {"observations": [], "infos": [], "terminated": False}
        kept = self._kept(judge)

        def keep(observation: Any, info: Any, has_ended: bool) -> None:
            seen["terminated"] = bool(has_ended)
            for name, value in (("observations", observation), ("infos", info)):
                if name in kept:
                    seen[name].append(deepcopy(value))  # an environment may change what it gave

        options = {"render_mode": "rgb_array"} if watch else {}
        is_compiled = not watch and self.is_compiled(judge)
        env = self.make(**options) if watch or self.changes or (is_fresh and not is_compiled) else self._env
        try:
            if is_compiled:
                run = env.unwrapped.run_lifetime
                rewards, *recorded = run(self, controller, seed, self.changes, frozen=end, record=record)
                recorded = np.array(recorded)
            else:
                hooks = watch, keep if judge else None, learn if settings.learns_after_move else None
                rewards = self.episode(env, act, seed, horizon, self.changes, *hooks)
        finally:
            controller.rate = rate
            if env is not self._env:
                env.close()
        controller.check()
        weight_changes, weight_steps = recorded[:, : len(rewards) * record]
        more = {"rewards": rewards, "steps": len(rewards), "weight_change_mean": controller.weight_change_mean}
        fitness = float(rewards.sum()) if judge is None else judge.judged({**seen, **more})
        return Lived(
            rewards,
            controller.weight_change_mean,
            controller.weight_change,
            controller.saturated_fraction,
            weight_changes,
            weight_steps,
            fitness,
            moments(np.array(values)) if values else None,
        )

    def metrics(self, lived: Lived) -> dict[str, float]:
        """The columns of `metrics.csv` that are about one lifetime."""
        rewards, split = lived.rewards, self.split
        has_reached = len(rewards) > split
        return {
            "return": float(rewards.sum()),
            "steps": len(rewards),
            "reached": int(has_reached),
            "return_before": float(rewards[:split].sum()),
            "return_after": float(rewards[split:].sum()) if has_reached else math.nan,
            "recovery_steps": self._recovery_steps(rewards),
            "weight_change_mean": lived.weight_change_mean,
            "weight_change_final": lived.weight_change_final,
            "saturated_fraction": lived.saturated_fraction,
        }

    def _recovery_steps(self, rewards: Floats) -> float:
        """Steps from the change until the reward has been near that before it for `_WINDOW` steps, after a loss.

        nan if it never is, and where nothing changes or the lifetime is cut short.
        """
        before, after = rewards[: self.split], rewards[self.split :]
        is_whole = len(rewards) == self.settings.horizon and len(before) and len(after) >= _WINDOW
        if not self.settings.changes or not is_whole:
            return math.nan
        needed = before.mean() - (1 - _RECOVERED) * abs(before.mean())
        is_less = np.convolve(after, np.full(_WINDOW, 1 / _WINDOW), "valid") < needed
        first = int(is_less.argmax())  # 0 where there is no loss
        back = np.flatnonzero(~is_less[first:])
        return float(first + back[0]) if len(back) else math.nan
