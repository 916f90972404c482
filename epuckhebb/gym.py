"""The robot as an environment of Gymnasium, for reinforcement learning: `pip install "epuckhebb[gym]"`.

    import epuckhebb.gym  # registers the environment, and epuckhebb/Foraging-v0
    env = gymnasium.make("epuckhebb/TMaze-v0", scenario="base", reward="fitness")

An observation is the sensor readings of the next control step, an action the outputs for the left and the right wheel.
An episode is a lifetime: the same step as in `evaluate`, so a champion that is driven from here is bit-identical to it.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np

import epuckhebb.worlds.foraging  # noqa: F401  # registers it
from epuckhebb.config import EvolveConfig, load, make_overrides, values_of
from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.network import PAPER_NETWORK, WEIGHT_LIMIT, GivenOutputs, Network
from epuckhebb.controller.plasticity.rule import NO_RULE
from epuckhebb.controller.random import Stream, key
from epuckhebb.runs import compile_kernels
from epuckhebb.runtime import ConfigError
from epuckhebb.tmaze.individual import Individual
from epuckhebb.tmaze.maze import SIDES, Side
from epuckhebb.tmaze.robot import OUTPUTS
from epuckhebb.tmaze.session import Session
from epuckhebb.tmaze.simulator import Simulator

ID = "epuckhebb/TMaze-v0"
_OF_WORLD = ("scenario", "change", "maze", "robot", "task", "fitness", "physics", "lifetime")  # groups that count here
REWARDS = ("fitness", "success", "progress")


class TMaze(gymnasium.Env[Floats, Floats]):
    """A robot in a maze; an episode is a lifetime of `evolve`, 60 s at 4 rad/s unless `overrides` say otherwise.

    Observation: the sensor readings, 0 to 1, light first (a task may add a reward, -1 to 1). Action: the outputs for
    the left and the right wheel, -1 to 1. The rewards of an episode add up to its `fitness`; to its `success`, 1 at the
    last step if the robot is at its goal; or to its `progress`, how much nearer to the goal it is at the end than at
    the start [m]. An episode terminates at the end of the lifetime.

    side: `left` (lamp off) or `right`; None for either at random. overrides: more settings as on the command line, for
    example "fitness.function=FILE.py:NAME". config_dir: a folder with more configuration files.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012  # as Gymnasium has it

    def __init__(
        self,
        scenario: str = "base",
        reward: str = "fitness",
        side: Side | None = None,
        overrides: Sequence[str] = (),
        config_dir: str | Path | None = None,
        render_mode: None = None,
    ) -> None:
        if render_mode is not None:
            raise ConfigError(f"render_mode must be None: nothing is drawn here, got {render_mode!r}")
        if reward not in REWARDS:
            raise ConfigError(f"reward must be one of {', '.join(REWARDS)}, got {reward!r}")
        words = make_overrides(overrides, {"scenario": scenario, "hebbian": "none"})
        for name in values_of(words[2:]):
            if name.partition(".")[0] not in _OF_WORLD:
                raise ConfigError(f"{name} does nothing here; overrides set {', '.join(_OF_WORLD)}")
        config = load(EvolveConfig, words, None if config_dir is None else str(config_dir))
        self.world, self.lifetime, self.reward, self.side = config.world, config.lifetime, reward, side
        self.network = GivenOutputs((self.world.inputs, OUTPUTS), self.world.task.gives_reward)
        lowest = np.zeros(self.world.inputs)
        lowest[self.world.robot.inputs :] = -1.0
        self.observation_space = gymnasium.spaces.Box(lowest, np.ones(self.world.inputs), dtype=np.float64)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (OUTPUTS,), np.float64)
        compile_kernels([], self.network, self.world)
        self._simulator = Simulator(self.world, self.lifetime, NO_RULE)
        self._session: Session | None = None

    def __reduce__(self) -> Any:
        """Say why it cannot be copied, nor pickled."""
        raise TypeError("the physics of an environment cannot be copied; make another one, and reset it with one seed")

    @property
    def session(self) -> Session:
        """The lifetime of this episode."""
        if self._session is None:
            raise gymnasium.error.ResetNeeded("call reset() before the first step()")
        return self._session

    def reset(self, *, seed: int | None = None, options: dict[str, Any] | None = None) -> tuple[Floats, dict[str, Any]]:
        """Begin a lifetime.

        options: `side`, and `key`, the number of its sensor noise (`evaluation_key`); both are drawn without them.
        """
        super().reset(seed=seed)
        drawn, number = SIDES[int(self.np_random.integers(2))], self.np_random.integers(2**63)
        choice = {"side": self.side, "key": number, **(options or {})}
        if choice["side"] not in (*SIDES, None):
            raise ConfigError(f"side must be {' or '.join(SIDES)}, or None for either, got {choice['side']!r}")
        individual = Individual(
            genes=np.zeros(self.network.synapses),
            side=choice["side"] or drawn,
            key=np.uint64(choice["key"]),
            network=self.network,
            task_key=int(number),
        )
        self._session = Session(individual, self.world, self.lifetime, simulator=self._simulator)
        x, y, _ = self.session.pose
        goal = self.world.goals_now[individual.side]
        self._rewarded, self._distance = 0.0, float(np.hypot(x - goal.x, y - goal.y))
        return self.session.look(), {"side": individual.side}

    def step(self, action: Floats) -> tuple[Floats, float, bool, bool, dict[str, Any]]:
        """Run one control step, 32 ms."""
        outputs = np.asarray(action, np.float64)
        if outputs.shape != (OUTPUTS,) or not (np.abs(outputs) <= 1.0).all():
            raise ValueError(f"an action must be two numbers from -1 to 1, left and right wheel, got {action!r}")
        self.session.life.weights[:OUTPUTS] = outputs
        sum_before = self._sum()
        self.session.step()
        is_over = self.session.is_over
        distance = float(self.session.life.tally["goal_distance"][0])
        info: dict[str, Any] = {"goal_distance": distance, "success": distance < self.world.maze.goal_radius_m}
        if is_over:
            info["outcome"] = self.session.outcome()
        if self.reward == "progress":
            reward = self._distance - distance
            self._distance = distance
        elif self.reward == "success":
            reward = float(is_over and info["success"])
        else:
            reward = (self._sum() - sum_before) / self.lifetime.steps
            if is_over:
                reward = info["outcome"].fitness - self._rewarded
            self._rewarded += reward
        return self.session.look(), reward, is_over, False, info

    def _sum(self) -> float:
        """The part of the fitness that is a sum over the steps, times the steps: that of the paper, or of `step`."""
        if self.world.fitness.is_custom:
            return float(self.session.life.score["sum"][0])
        return 0.0 if self.world.task.has_trials else float(self.session.life.tally["behaviour_sum"][0]) / 2.0


def evaluation_key(seed: int, repeat: int, side: Side) -> int:
    """The key of the sensor noise that `evaluate` has for this seed, repeat (from 0) and side, for `reset`."""
    return int(key(seed, Stream.evaluation_noise, repeat, SIDES.index(side)))


def genome_from_policy(weights: Sequence[Any], bias: Any, network: Network = PAPER_NETWORK) -> Floats:
    """The genes of a policy that has the layers of a network, tanh after each, and a bias in the first layer alone.

    weights: for each layer of connections an array (postsynaptic, presynaptic) as `torch.nn.Linear.weight` has it, from
    -2 to 2. bias: (neurons of the first hidden layer,).
    """
    layers = [np.asarray(one, np.float64).T for one in weights]
    first = np.asarray(bias, np.float64)
    shapes = [(network.inputs, network.post[0]), *network.shapes[1:]]
    if [one.shape for one in layers] != shapes or first.shape != shapes[0][1:]:
        wanted = ", ".join(str(shape[::-1]) for shape in shapes)
        raise ConfigError(f"a policy for layers {network} needs {wanted}, got {[one.T.shape for one in layers]}")
    genes = np.concatenate([np.vstack([layers[0], first]).ravel(), *(one.ravel() for one in layers[1:])])
    if not (np.abs(genes) <= WEIGHT_LIMIT).all():
        raise ConfigError(f"weights must lie in [-{WEIGHT_LIMIT:g}, {WEIGHT_LIMIT:g}], got {np.abs(genes).max():g}")
    return genes


gymnasium.register(id=ID, entry_point=f"{__name__}:TMaze")
