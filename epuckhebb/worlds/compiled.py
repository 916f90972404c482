"""Environments of numba functions: environments of Gymnasium, whose lifetimes also run as machine code, in threads.

A class with three functions, `begin`, `look` and `move`, is an environment of Gymnasium, step by step. A whole lifetime
with a controller runs in one call of machine code. Both give the same numbers, to the bit.
"""

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from functools import cache
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

import gymnasium
import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller import random as counters
from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.compiling.errors import explained
from epuckhebb.controller.compiling.kernel import SameTypes, compiled, kernel, written
from epuckhebb.controller.controller import Controller, State, step_parts
from epuckhebb.controller.network import Network
from epuckhebb.controller.own_class import building_block, namedtuple_of, number, user_classes
from epuckhebb.controller.plasticity.rule import Rule, Schedule, make_schedule
from epuckhebb.controller.random import Stream
from epuckhebb.controller.ranges import check
from epuckhebb.worlds.changes import AT, Faults
from epuckhebb.worlds.environment import live_fitness, reward_reading

if TYPE_CHECKING:
    from epuckhebb.worlds.environment import World

_PIECE = 256  # steps whose weights are kept at a time, where changes of the weights are recorded
_PICTURES = "rgb_array"

_part: Any = None
READINGS, READS_REWARD, LEARNS_AFTER = 0, False, False
begin = look = move = act = decide = update = _part  # parts, which `_parts` and `_kernel` put here


class Readings(gymnasium.spaces.Box):
    """Numbers from -1 to 1 that go to the network as they are. names: of each."""

    def __init__(self, names: Sequence[str]) -> None:
        super().__init__(-1.0, 1.0, (len(names),), np.float64)
        self.names = tuple(names)


class Terms(NamedTuple):
    """What a lifetime has of its controller and of the settings of its environment.

    numbers, floor: of the rule. step_s: of the neurons. full, neutral: of the live fitness. key: of random numbers.
    """

    numbers: tuple[float, ...]
    floor: float
    step_s: float
    full: float
    neutral: float
    key: np.uint64


@dataclass(kw_only=True, eq=False)
class Compiled(gymnasium.Env[Floats, Any]):
    """An environment of three functions, which numba compiles.

    A subclass is a dataclass with `kw_only=True, eq=False`; its fields that are numbers are settings, `by`, and keys
    `environment.options.NAME`. It names its `readings`, and its `actions`, of which the network chooses one in each
    step (the largest output, the first of several), or its `motors`, which get outputs from -1 to 1. A method makes
    what a lifetime carries, and three static methods work on it, with any of these arguments:

        start(self)                          a tuple of arrays, which `begin` gets as they are
        begin(state, by, random)             before the first step
        look(state, by, readings)            fills the readings, -1 to 1
        move(state, by, action, random)      one step; returns its reward. action: number of the choice, or the outputs

    `draw(random)`, of `epuckhebb.controller.random`, gives a number in [0, 1); it depends on the seed alone. Functions
    that these call have `@compiled`, of `epuckhebb.controller.compiling.kernel`, above them. `picture(self)` draws
    `self.state`, and is needed for a film alone. A lifetime has no end of its own.
    """

    KEY: ClassVar[str] = "environment"
    METHODS: ClassVar[tuple[str, ...]] = ("move",)
    readings: ClassVar[tuple[str, ...]] = ()
    actions: ClassVar[tuple[str, ...]] = ()
    motors: ClassVar[tuple[str, ...]] = ()
    begin: ClassVar[Any] = None
    look: ClassVar[Any] = None
    move: ClassVar[Any] = None
    metadata: ClassVar[dict[str, Any]] = {"render_modes": [_PICTURES], "render_fps": 25}  # type: ignore[misc]

    render_mode: str | None = None

    def __post_init__(self) -> None:
        """Check the settings."""
        check(self, "environment.options")
        self.numbers()
        self.observation_space: Any = Readings(self.readings)
        self.action_space = (
            gymnasium.spaces.Discrete(len(self.actions))
            if self.actions
            else gymnasium.spaces.Box(-1.0, 1.0, (len(self.motors),), np.float64)
        )

    @property
    def _kind(self) -> Any:
        return type(self)

    def start(self) -> Any:
        """What a lifetime carries, a tuple of arrays of zeros."""
        raise NotImplementedError

    def picture(self) -> NDArray[np.uint8]:
        """What `self.state` looks like, (height, width, 3)."""
        raise NotImplementedError(f"{type(self).__name__} has no `picture`")

    def yardsticks(self, seeds: Sequence[int], steps: int) -> Mapping[str, float]:  # noqa: ARG002  # a subclass has some
        """What scripted controllers earn in lifetimes of so many steps: the mean return over these seeds, by name."""
        return {}

    @classmethod
    def settings(cls) -> tuple[str, ...]:
        """The names of the settings that are numbers, in the order in which the functions have them."""
        kind: Any = cls
        return tuple(_kinds(kind))

    def numbers(self) -> tuple[Any, ...]:
        """The settings that are numbers, of the kinds of their defaults; a ValueError if one is of another kind."""
        kinds = _kinds(self._kind)
        values = {name: kind(getattr(self, name)) for name, kind in kinds.items()}
        for name, value in values.items():
            if value != getattr(self, name):
                whole = "true or false" if kinds[name] is bool else "a whole number"
                raise ValueError(f"environment.options.{name} must be {whole}, got {getattr(self, name)}")
        return tuple(values.values())

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Floats, dict[str, Any]]:
        """Begin a lifetime. seed: of all that is random in it."""
        super().reset(seed=seed, options=options)
        seed = int(self.np_random.integers(2**31)) if seed is None else seed
        self.state, self._random, readings = self.start(), _random(seed), np.zeros(len(self.readings))
        self._call(_steps(self._kind)[0], self.state, self.numbers(), self._random, readings)
        return readings, {}

    def step(self, action: Any) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
        """Take one step."""
        taken = int(action) if self.actions else np.array(action, np.float64)
        readings, rewards = np.zeros(len(self.readings)), np.zeros(1)
        self._call(_steps(self._kind)[1], self.state, self.numbers(), self._random, taken, readings, rewards)
        return readings, float(rewards[0]), False, False, {}

    def render(self) -> Any:
        """What the state looks like, (height, width, 3), where pictures were asked for."""
        return self.picture() if self.render_mode == _PICTURES else None

    def run_lifetime(
        self,
        world: "World",
        controller: Controller,
        seed: int,
        changes: Sequence[Mapping[str, Any]],
        *,
        frozen: int,
        record: bool,
    ) -> tuple[Floats, Floats, Floats]:
        """The rewards of a lifetime as machine code; if recorded, weight changes and what each step changed, too.

        changes: by their step, numbers of this environment and dead readings. frozen: the first step without
        plasticity. Threads may share a world, and no environment.
        """
        settings, network = world.settings, controller.network
        horizon, inputs = settings.horizon, network.inputs
        rule: Any = type(controller.rule)
        live = _kernel(
            self._kind, rule, network, make_schedule(controller.rule), settings.reads_reward, settings.learns_after_move
        )
        full, neutral = settings.reward_scale, settings.neutral_fitness
        terms = Terms(controller.numbers, controller.floor, controller.step_s, full, neutral, controller.key)
        state, random, waiting = self.start(), _random(seed), list(changes)
        faults, alive = Faults(readings=world.read.names), np.ones(inputs)
        rewards, weight_changes, weight_steps = np.zeros((3, horizon))
        kept = np.zeros((_PIECE + 1 if record else 0, network.synapses))
        stops = {horizon, min(frozen, horizon), *(int(change[AT]) for change in changes)}
        if record:
            stops |= set(range(0, horizon, _PIECE))
        step = 0
        for stop in sorted(stops):
            arguments = state, random, self.numbers(), terms, controller.rate, alive, rewards, weight_changes, kept
            if stop > step:
                kept[:1] = controller.weights
                self._call(live, controller.state, *arguments, step, stop, part=controller)
                if record:
                    steps = np.abs(kept[1 : stop - step + 1] - kept[: stop - step])
                    weight_steps[step:stop] = steps.sum(axis=1)
            step = stop
            controller.rate = 0.0 if step >= frozen else controller.rate
            while waiting and step == waiting[0][AT]:
                world.apply(waiting.pop(0), self, faults)
                alive[:] = 1.0
                alive[faults.dead] = 0.0
        controller.steps = horizon
        return rewards, weight_changes, weight_steps

    def _call(self, function: Any, *arguments: Any, part: Controller | None = None) -> None:
        try:
            function.call(*arguments)
        except Exception as error:  # of numba, or of an index beyond an array
            kinds = [] if part is None else user_classes([part.rule, part.network.wiring])
            raise explained([type(self), *kinds], error) from error


@cache
def _kinds(kind: Any) -> dict[str, Any]:
    """The kind of each setting that is a number: that of its default."""
    kinds = {setting.name: type(setting.default) for setting in fields(kind)}
    return {name: number for name, number in kinds.items() if issubclass(number, bool | int | float)}


def _random(seed: int) -> NDArray[np.uint64]:
    return np.array([counters.key(seed, Stream.environment)], np.uint64)


def _enter(state: Any, numbers: Any, random: NDArray[np.uint64], readings: Floats) -> None:
    begin(state, numbers, random)
    look(state, numbers, readings)


def _go(state: Any, numbers: Any, random: NDArray[np.uint64], action: Any, readings: Floats, rewards: Floats) -> None:
    rewards[0] = move(state, numbers, action, random)
    look(state, numbers, readings)


def _live(
    life: State,
    state: Any,
    random: NDArray[np.uint64],
    numbers: Any,
    terms: Terms,
    rate: float,
    alive: Floats,
    rewards: Floats,
    weight_changes: Floats,
    kept: Floats,
    first: int,
    until: int,
) -> None:
    """A lifetime from a step until before another. alive: (inputs,), 0 for a dead reading. kept: weights by step."""
    activation = life.activation
    if first == 0:
        begin(state, numbers, random)
    reward = rewards[first - 1] if first > 0 else 0.0
    for step in range(first, until):
        look(state, numbers, activation[:READINGS])
        if READS_REWARD:
            activation[READINGS] = reward_reading(reward, terms.full)
        for k in range(alive.shape[0]):
            if alive[k] == 0.0:
                activation[k] = 0.0
        last_reward = reward
        decide(life)
        if not LEARNS_AFTER:
            fitness = live_fitness(last_reward, terms.full, terms.neutral)
            update(life, terms.numbers, rate, terms.floor, fitness, terms.step_s, terms.key, step)
        reward = rewards[step] = act(state, numbers, activation, random)
        if LEARNS_AFTER:
            if READS_REWARD:
                activation[READINGS] = reward_reading(reward, terms.full) * alive[READINGS]
            fitness = live_fitness(reward, terms.full, terms.neutral)
            update(life, terms.numbers, rate, terms.floor, fitness, terms.step_s, terms.key, step)
        weight_changes[step] = life.tally[0]
        if kept.shape[0] > 0:
            for k in range(kept.shape[1]):
                kept[step - first + 1, k] = life.weights[k]


@compiled
def _choice(activation: Floats, first: int, count: int) -> int:
    """The number of the largest output, the first of several."""
    best = 0
    for k in range(1, count):
        if activation[first + k] > activation[first + best]:
            best = k
    return best


@cache
def _parts(kind: Any) -> dict[str, Any]:
    """The functions of a class as parts of kernels, with its settings by name."""
    begin = _called(kind, "begin", "state, numbers, random")
    look = _called(kind, "look", "state, numbers, readings")
    move = _called(kind, "move", "state, numbers, action, random")
    arguments = "state, numbers, action, random"
    return {
        "begin": begin,
        "look": look,
        "move": written(arguments, f"number(move({arguments}))", {"number": number, "move": move}),
    }


def _called(kind: type[Compiled], name: str, arguments: str) -> Any:
    """A building block with these arguments, which calls a function of a class with those that it has."""
    function, allowed = getattr(kind, name), arguments.replace("numbers", "by").split(", ")
    names = list(inspect.signature(function).parameters)
    if unknown := [name for name in names if name not in allowed]:
        raise ValueError(f"{kind.__name__}: `{name}` takes {', '.join(unknown)}; known are {', '.join(allowed)}")
    call = f"function({', '.join('By(*numbers)' if name == 'by' else name for name in names)})"
    return written(arguments, call, {"function": building_block(function), "By": namedtuple_of("By", kind.settings())})


@cache
def _steps(kind: Any) -> tuple[Any, Any]:
    """The first look, and a step, as machine code."""
    parts = _parts(kind)
    return SameTypes(kernel(_enter, (kind, "enter"), **parts)), SameTypes(kernel(_go, (kind, "go"), **parts))


@cache
def _kernel(
    kind: Any, rule: type[Rule], network: Network, schedule: Schedule, reads_reward: bool, learns_after: bool
) -> Any:
    """A lifetime in an environment with a rule and a network, as machine code."""
    parts, first, count = _parts(kind), network.first_output, network.outputs
    action = f"choice(activation, {first}, {count})" if kind.actions else f"activation[{first} : {first + count}]"
    act = f"move(state, numbers, {action}, random)"
    made = kernel(
        _live,
        (kind, rule, network, schedule, reads_reward, learns_after),
        **parts,
        **step_parts(rule, network, schedule),
        READINGS=len(kind.readings),
        READS_REWARD=reads_reward,
        LEARNS_AFTER=learns_after,
        act=written("state, numbers, activation, random", act, {"move": parts["move"], "choice": _choice}),
    )
    return SameTypes(made)
