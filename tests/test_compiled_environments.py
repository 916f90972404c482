"""Environments of numba functions: a lifetime as machine code is that which Gymnasium's steps give, to the bit."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import numpy as np
import pytest

from epuckhebb.config import load
from epuckhebb.config.environments import EvolveEnvironment, make_world
from epuckhebb.controller.compiling.errors import PartError
from epuckhebb.controller.controller import Controller
from epuckhebb.controller.genome import make_plan
from epuckhebb.controller.network import Network
from epuckhebb.controller.plasticity.rules.modulated import Modulated
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.controller.random import draw
from epuckhebb.runs.gymnasium import make_setup, run_lifetimes
from epuckhebb.worlds.compiled import Compiled
from epuckhebb.worlds.environment import Environment, World
from epuckhebb.worlds.foraging import Foraging
from epuckhebb.worlds.lives import Work

EXAMPLE = Path(__file__).parents[1] / "examples" / "own_world" / "wells.py"
HORIZON = 600  # more than one piece of recorded weights
CHANGES = [{"at": 100, "season": 7, "moving": 0.1}, {"at": 300, "dead_readings": ["reward", "ahead_green"]}]


@dataclass(kw_only=True, eq=False)
class Balance(Compiled):
    """A value that drifts; two motors push it, and the reward is the larger the nearer it is to 0."""

    readings: ClassVar = ("value", "pushed")
    motors: ClassVar = ("up", "down")
    drift: float = 0.3
    reach: int = 2

    def start(self):
        return (np.zeros(2),)

    @staticmethod
    def begin(state, random):
        state[0][0] = draw(random) - 0.5

    @staticmethod
    def look(state, readings):
        readings[0], readings[1] = np.tanh(state[0][0]), state[0][1]

    @staticmethod
    def move(state, by, action, random):
        state[0][1] = (action[0] - action[1]) / 2
        state[0][0] += by.drift * (draw(random) - 0.5) + 0.2 * state[0][1]
        return 1.0 - abs(state[0][by.reach - 2])


def foraging(*words):
    """The setup of an evolution, and genes with which a robot moves about."""
    mine = [f"environment.horizon={HORIZON}", "environment.options.slip=0.5", "hebbian=modulated", "hebbian.N=0.05"]
    config = load(EvolveEnvironment, ["environment=foraging", *mine, *words])
    setup = make_setup(config)
    genes = make_plan(setup.network, Modulated).genes
    return config, setup, np.random.default_rng(4).uniform(-1.5, 1.5, genes)


def lived_both_ways(world, controller, monkeypatch, **how):
    """A lifetime as machine code and step by step."""
    assert world.is_compiled()
    fast = world.live(controller, 9, record=True, **how)
    with monkeypatch.context() as patched:
        patched.setattr(World, "is_compiled", lambda *_: False)
        return fast, world.live(controller, 9, record=True, **how)


def assert_same(fast, slow):
    for name, one, other in zip(fast._fields, fast, slow, strict=True):
        np.testing.assert_array_equal(one, other, name)


@pytest.mark.parametrize(("changes", "frozen"), [([], False), (CHANGES, False), (CHANGES, True)])
def test_a_compiled_lifetime_is_that_of_its_steps(changes, frozen, monkeypatch):
    _, setup, genes = foraging()
    settings = setup.world.settings
    settings.changes = changes
    fast, slow = lived_both_ways(setup.world, setup.controller(Work(0, genes, ())), monkeypatch, frozen=frozen)
    assert_same(fast, slow)
    assert np.abs(fast.rewards).sum() > 20
    assert fast.weight_steps.min() == 0.0 if frozen else fast.weight_steps.max() > 0.0


def test_motors_and_weights_that_change_before_the_move(monkeypatch):
    world = World(settings=Environment(name="balance", horizon=300), make=Balance)
    network = Network((2, 3, 2))
    genes = np.random.default_rng(1).uniform(-1, 1, network.synapses)
    fast, slow = lived_both_ways(world, Controller(genes, network, Paper(N=0.01, signal="reward")), monkeypatch)
    assert_same(fast, slow)
    assert fast.weight_change_mean > 0


def test_what_a_step_alone_has_is_run_step_by_step():
    class Judge:
        def __init__(self, *names):
            self.names = names

        def arguments(self, _method):
            return self.names

    world = make_world(load(EvolveEnvironment, ["environment=foraging"]).environment)
    assert world.is_compiled(Judge("rewards"))
    assert not world.is_compiled(Judge("observations"))
    for change in ({"action_delay": 2}, {"noisy_readings": {"ahead_green": 0.1}}, {"function": "a.py:f"}):
        settings = Environment(id=world.settings.id, changes=[{"at": 1, **change}])
        assert not World(settings=settings, make=world.make).is_compiled()


def test_threads_do_not_change_results():
    config, _, genes = foraging()
    works = [Work(0, genes * scale, (1, 2)) for scale in (0.5, 1.0, 1.5)]
    one, two = (run_lifetimes(config, works, threads) for threads in (1, 2))
    for lives, others in zip(one, two, strict=True):
        for fast, other in zip(lives, others, strict=True):
            assert_same(fast, other)


def test_an_index_beyond_an_array_names_the_class():
    world = Balance(reach=9)
    world.reset(seed=1)
    with pytest.raises(PartError, match="Balance"):
        world.step(np.zeros(2))


def test_lifetimes_of_a_seed_are_alike_and_others_are_not():
    world = Foraging()
    seen = [world.reset(seed=seed) and world.state.cells.copy() for seed in (1, 2, 1, None, None)]
    assert np.array_equal(seen[0], seen[2])
    assert not any(np.array_equal(seen[a], seen[b]) for a, b in ((0, 1), (0, 3), (3, 4)))


def test_the_example_is_a_world_in_which_one_well_gives():
    """Who goes to one well gets water half of the time: at each end either 1 or -.2."""
    config = load(EvolveEnvironment, [f"environment={EXAMPLE}:Wells", "environment.options.slip=0"])
    env = config.world.make()
    env.reset(seed=1)
    rewards = np.array([env.step(0)[1] for _ in range(600)])
    assert config.world.is_compiled()
    assert (np.flatnonzero(rewards) == np.arange(2, 600, 3)).all()
    starts = np.flatnonzero(np.diff(rewards[2::3])) * 3
    assert len(starts) == 5  # droughts of 100 steps
    assert set(rewards[rewards != 0]) == {1.0, -0.2}
