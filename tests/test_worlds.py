"""An environment as a world: readings, actions, faults between them, seeds, and what a trial finds."""

import json
import math
import re

import gymnasium
import numpy as np
import pytest
from gymnasium.spaces import Box, Dict, Discrete, MultiBinary, MultiDiscrete, Text, Tuple, flatten
from gymnasium.wrappers import RescaleAction

from epuckhebb.controller.compiling.errors import PartError
from epuckhebb.controller.random import Stream, rng
from epuckhebb.worlds.environment import Environment, Lived, World
from epuckhebb.worlds.spaces import Reader, actor, space_parts

FLOAT_MAX = np.finfo(np.float32).max


class Sum(gymnasium.Env):
    """Readings are random walks from a random start; the last action moves the first one."""

    observation_space = Box(-np.inf, np.inf, (3,), np.float64)
    action_space = Box(-1.0, 1.0, (1,), np.float64)
    carried, speed, unread = 0.0, 1.0, 1.0

    def __init__(self):
        self.actions, self.seeds = [], []

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.seeds.append(seed)
        self.place = self.np_random.standard_normal(3)
        return self.place.copy(), {}

    def step(self, action):
        self.actions.append(float(action[0]))
        self.place = self.place + 0.1 * self.np_random.standard_normal(3)
        self.place[0] += self.speed * action[0]
        return self.place + self.carried, float(action[0]), False, False, {}


class Keeps(Sum):
    """Something of a lifetime stays after a reset, as the running mean of a wrapper does."""

    def step(self, action):
        self.carried += 0.01
        return super().step(action)


class Third(Sum):
    """Its third reset differs, as that of BipedalWalker-v3."""

    def reset(self, *, seed=None, options=None):
        seen, info = super().reset(seed=seed)
        return seen + (len(self.seeds) == 3), info


class Unseeded(Sum):
    """It draws without its seed, as Meta-World 3.1.1 does."""

    def reset(self, *, seed=None, options=None):
        return super().reset()


def world(kind=Sum, changes=(), **settings):
    """A world of an environment of a class here, and the environments that it made."""
    made = []

    def make(**_):
        made.append(kind())
        return made[-1]

    settings = {"name": "here", "horizon": 40, "changes": list(changes), **settings}
    return World(settings=Environment(**settings), make=make), made


def run(kind=Sum, changes=(), outputs=lambda _: 0.0, seed=3, steps=30):
    """The readings of an episode of 30 steps, and its environment."""
    here, _ = world(kind, changes)
    env, seen = kind(), []

    def act(step, readings, _reward, _observation):
        seen.append(readings)
        return np.array([outputs(step)])

    here.episode(env, act, seed, steps, here.changes)
    return np.array(seen), env


def test_actions_wait_as_long_as_the_last_change_says():
    delays = {3: 5, 10: 2, 14: 0, 17: 3}
    changes = [{"at": at, "action_delay": delay} for at, delay in delays.items()]
    _, env = run(changes=changes, outputs=lambda step: step / 100)
    delay, expected = 0, []
    for step in range(30):
        delay = delays.get(step, delay)
        expected.append(max(0, step - delay) / 100)
    assert env.actions == expected


def test_noise_of_readings_has_a_stream_of_its_own():
    changes = [{"at": 0, "noisy_readings": {1: 0.5}}]
    plain, noisy = run()[0], run(changes=changes)[0]
    drawn = rng(3, Stream.reading_noise).standard_normal(30)
    np.testing.assert_array_equal(noisy[:, 1], plain[:, 1] + 0.5 * drawn)
    np.testing.assert_array_equal(noisy[:, [0, 2]], plain[:, [0, 2]])
    worlds = np.random.default_rng(3).standard_normal(90)
    assert not np.isin(drawn, worlds).any()


@pytest.mark.parametrize("dies", [0, 4])
def test_a_dead_reading_is_0_whatever_its_noise(dies):
    changes = [{"at": 2, "noisy_readings": {0: 0.5, 1: 0.5}}, {"at": dies, "dead_readings": [0]}]
    seen = run(changes=changes)[0]
    assert (seen[dies:, 0] == 0).all()
    assert (seen[:, 1] != 0).all()


def test_faults_of_readings_leave_the_state_of_an_environment_alone():
    class Lamps(Sum):
        observation_space = MultiBinary(2)

        def reset(self, *, seed=None, options=None):
            self.lit = np.ones(2)
            return self.lit, {}

        def step(self, action):
            return self.lit, float(self.lit.sum()), False, False, {}

    made, _ = world(Lamps, [{"at": 1, "dead_readings": [0]}])
    rewards = made.episode(Lamps(), lambda *_: np.zeros(1), 1, 3, made.changes)
    assert rewards.tolist() == [2.0, 2.0, 2.0]


def test_dead_readings_count_the_readings_that_a_controller_gets():
    seen, _ = run(changes=[{"at": 10, "dead_readings": [0, 2]}])
    assert (seen[10:, [0, 2]] == 0).all()
    assert (seen[:10] != 0).all()
    assert (seen[:, 1] != 0).all()


class Fewer(gymnasium.ObservationWrapper):
    """A wrapper that leaves out readings."""

    def __init__(self, env=None):
        super().__init__(env or Sum())
        self.observation_space = Box(-np.inf, np.inf, (2,), np.float64)

    def observation(self, observation):
        return observation[:2]


def test_readings_are_counted_outside_of_wrappers():
    with pytest.raises(ValueError, match="from 0 to 1"):
        world(Fewer, [{"at": 5, "dead_readings": [2]}])[0].check()


@pytest.mark.parametrize(
    ("low", "high"),
    [([-1.0, -1.0], [1.0, 1.0]), ([-2.0, 0.0], [2.0, 10.0]), ([-0.4, 1.0], [0.4, 3.0])],
)
def test_actions_are_rescaled_as_by_gymnasium(low, high):
    class Bounded(gymnasium.Env):
        action_space = Box(np.array(low, np.float32), np.array(high, np.float32))
        observation_space = Discrete(2)

    turn = actor(Bounded.action_space)
    for outputs in np.random.default_rng(1).uniform(-1, 1, (50, 2)):
        wanted = RescaleAction(Bounded(), np.float32(-1), np.float32(1)).action(np.float32(outputs))
        assert turn(outputs) == pytest.approx(wanted, rel=1e-5, abs=1e-6)
        assert turn(outputs).dtype == np.float32
    assert list(turn(-np.ones(2))) == list(np.float32(low))
    assert list(turn(np.ones(2))) == list(np.float32(high))


def test_whole_actions_are_rounded_and_reach_both_ends():
    turn = actor(Box(0, 3, (1,), np.int64))
    found = [int(turn(np.array([output]))[0]) for output in np.linspace(-1, 1, 601)]
    assert sorted(set(found)) == [0, 1, 2, 3]
    assert found.count(3) == pytest.approx(found.count(0), abs=1)  # np.rint takes .5 to the even number
    assert int(actor(Box(1, 255, (1,), np.uint8))(np.array([1.0]))[0]) == 255


@pytest.mark.parametrize("bound", [np.inf, FLOAT_MAX, 1e30])
def test_actions_without_bounds_are_outputs_and_a_note_says_so(bound):
    class Free(Sum):
        action_space = Box(-np.float32(bound), np.float32(bound), (1,))

    assert actor(Free.action_space)(np.array([0.5]))[0] == 0.5
    assert "Actions 0 have no bounds" in " ".join(world(Free)[0].findings.notes)


@pytest.mark.parametrize(("low", "high"), [(0, np.inf), (-np.inf, 1), (0, FLOAT_MAX)])
def test_actions_with_a_bound_on_one_side_are_refused(low, high):
    class Half(Sum):
        action_space = Box(np.float32(low), np.float32(high), (1,))

    with pytest.raises(ValueError, match=r"environment here: action 0 .*TransformAction"):
        world(Half)[0].check()


def test_scale_comes_from_bounds_where_there_are_some():
    space = Box(
        np.array([-1.2, -0.07, -np.inf, 0.0, -FLOAT_MAX]), np.array([0.6, 0.07, np.inf, 255.0, FLOAT_MAX]), dtype=float
    )
    read = Reader(space)
    assert list(read.scale) == pytest.approx([1.2, 0.07, 3.0, 255.0, 3.0])
    assert list(Reader(space, 2.0).scale) == [2.0] * 5
    assert list(read(np.array([1.2, 0.07, 3.0, 0, 0]))) == pytest.approx([math.tanh(1)] * 3 + [0, 0])
    read = Reader(space, [[1.0, 0, 0, 0, 0], [2.0, 1, 1, 1, 1]])
    assert read(np.array([3.0, 0, 0, 0, 0]))[0] == math.tanh(1)
    for wrong in ([1.0, 2.0], 0, -1, [1, 1, 1, 1, 0], [[0] * 5, [0] * 5], [[np.nan] * 5, [1] * 5], "x", np.nan):
        with pytest.raises(ValueError, match=r"environment\.scale must be a number above 0, or 5 of them"):
            Reader(space, wrong)


class Goals(Sum):
    """Its reward is two numbers."""

    def step(self, action):
        observation, reward, *others = super().step(action)
        return observation, np.array([reward, -1.0]), *others


def test_a_reward_of_several_numbers_is_their_weighted_sum():
    made, _ = world(Goals, reward_weights=[1.0, 0.25])
    rewards = made.episode(Goals(), lambda *_: np.array([0.5]), 1, 4)
    assert rewards.tolist() == [0.25] * 4
    for weights in (None, [1.0]):
        made, _ = world(Goals, reward_weights=weights)
        with pytest.raises(PartError, match=r"environment\.reward_weights"):
            made.check()


class Told:
    """Stands for a controller, and keeps what it is told."""

    weights, weight_change, weight_change_mean, saturated_fraction, rate = np.zeros(1), 0.0, 0.0, 0.0, 1.0

    def __init__(self):
        self.seen, self.learnt = [], []

    def reset(self, seed):
        pass

    def check(self):
        pass

    def decide(self, readings):
        self.seen.append(readings)
        return np.array([len(self.seen) / 10])

    def act(self, readings, fitness):
        self.learnt.append(fitness)
        return self.decide(readings)

    def learn(self, fitness, reading=None):
        self.learnt.append((fitness, reading))


def test_a_reward_may_be_a_reading_and_may_teach_the_move_that_brought_it():
    dead = [{"at": 2, "dead_readings": ["reward"]}]
    made, _ = world(horizon=3, reads_reward=True, learns_after_move=True, neutral_fitness=0.7, changes=dead)
    assert (made.inputs, made.read.names[-1]) == (4, "reward")
    told = Told()
    made.live(told, 1)  # the rewards are .1, .2 and .3
    np.testing.assert_allclose([readings[3] for readings in told.seen], [0.0, 0.1, 0.0])
    np.testing.assert_allclose(told.learnt, [(0.73, 0.1), (0.76, 0.2), (0.79, 0.0)])
    made, _ = world(horizon=3, neutral_fitness=0.5, reward_scale=0.1)
    made.live(told := Told(), 1)
    np.testing.assert_allclose(told.learnt, [0.5, 1.0, 1.0])
    assert len(told.seen[0]) == 3


def test_a_noisy_reward_is_refused_where_a_rule_would_hear_the_exact_one():
    noisy = [{"at": 2, "noisy_readings": {"reward": 0.1}}]
    made, _ = world(horizon=3, reads_reward=True, changes=noisy)
    made.check()
    made, _ = world(horizon=3, reads_reward=True, learns_after_move=True, changes=noisy)
    with pytest.raises(PartError, match=r"environment\.changes"):
        made.check()


NESTED = Dict(
    {
        "where": Tuple((Box(-2.0, 2.0, (2, 2), np.float64), Discrete(3, start=-1))),
        "hands": MultiDiscrete([2, 4], start=[0, 1]),
        "keys": MultiBinary([2, 2]),
        "far": Box(0.0, 5.0, (), np.float64),
    }
)


def test_readings_of_nested_spaces_are_those_of_gymnasium():
    read = Reader(NESTED)
    NESTED.seed(1)
    for observation in (NESTED.sample() for _ in range(20)):
        flat = flatten(NESTED, observation)
        expected = np.where(read.is_measured, np.tanh(flat * (1 / read.scale)), flat)
        np.testing.assert_array_equal(read(observation), expected)
        np.testing.assert_array_equal(read.values(observation), np.where(read.is_measured, flat, 0))
    by_name = dict(zip(read.names, read.scale, strict=True))
    assert (by_name["far"], by_name["where.0.3"], by_name["where.1=0"]) == (5, 2, 1)
    assert len(by_name) == flatten(NESTED, NESTED.sample()).size


def test_actions_of_nested_spaces_are_actions():
    turn, count = actor(NESTED), sum(part.size for part in space_parts(NESTED, "actions"))
    for outputs in np.random.default_rng(1).uniform(-1, 1, (50, count)):
        assert NESTED.contains(turn(outputs))
    names = Reader(NESTED).names
    action = turn(np.array([1.0 if name in ("hands.1", "hands.3", "where.1=2", "keys.2") else -1.0 for name in names]))
    assert (action["hands"].tolist(), action["where"][1], action["keys"].tolist()) == ([1, 2], 1, [[0, 0], [1, 0]])


def test_texts_are_left_out_and_a_note_says_so():
    class Told(Sum):
        observation_space = Dict({"image": Sum.observation_space, "mission": Text(9)})

        def reset(self, **more):
            return {"image": super().reset(**more)[0], "mission": "go"}, {}

        def step(self, action):
            observation, *others = super().step(action)
            return {"image": observation, "mission": "go"}, *others

    made, _ = world(Told)
    assert made.read.names == ["image.0", "image.1", "image.2"]
    assert "left out: mission" in " ".join(made.findings.notes)
    told, _ = run(Told, changes=[{"at": 3, "dead_readings": ["image.0"]}])
    np.testing.assert_array_equal(told, run(changes=[{"at": 3, "dead_readings": [0]}])[0])


def test_actions_with_a_text_are_refused():
    class Says(Sum):
        action_space = Dict({"move": Box(-1.0, 1.0, (1,)), "say": Text(3)})

    with pytest.raises(ValueError, match="environment here: actions"):
        world(Says)[0].check()


@pytest.mark.parametrize("space", [Text(3), Dict({"a": Text(3)}), gymnasium.spaces.Sequence(Discrete(2))])
def test_spaces_that_hold_no_fixed_numbers_are_refused(space):
    with pytest.raises(ValueError, match="environment here: observations"):
        Reader(space, what="environment here: observations")


def test_readings_that_say_nothing_are_noted():
    class Blind(Sum):
        def step(self, action):
            seen, *others = super().step(action)
            return np.array([seen[0], 900.0, 0.001]), *others

        def reset(self, *, seed=None, options=None):
            return np.array([super().reset(seed=seed)[0][0], 900.0, 0.001]), {}

    (note,) = world(Blind)[0].findings.notes
    assert "1 (largest 900) are 1 or -1" in note
    assert "2 (largest 0.001) never move" in note
    assert "environment.scale=running, or [3,900,3]" in note  # no scale moves a reading that is always the same


@pytest.mark.parametrize("value", [0.0, 0.5])
def test_no_scale_is_listed_where_none_helps(value):
    class Still(Sum):
        def step(self, action):
            seen, *others = super().step(action)
            return np.array([seen[0], value, value]), *others

        def reset(self, *, seed=None, options=None):
            return np.array([super().reset(seed=seed)[0][0], value, value]), {}

    (note,) = world(Still)[0].findings.notes
    assert f"1 (largest {value:g}), 2 (largest {value:g}) never move" in note
    assert "environment.scale" not in note


def test_the_scale_that_a_note_lists_lets_readings_move():
    class Wide(Sum):
        sizes = np.array([1.0, 1e6, 1e-4])

        def reset(self, *, seed=None, options=None):
            return super().reset(seed=seed)[0] * 0 + self.sizes, {}

        def step(self, action):
            super().step(action)
            return (1.5 + np.sin(self.place)) * self.sizes, 0.0, False, False, {}

    (note,) = world(Wide)[0].findings.notes
    scale = json.loads(re.search(r"(\[.*\])", note)[1])
    assert world(Wide, scale=scale)[0].findings.notes == ()


def test_a_note_on_many_readings_lists_no_scale_for_each():
    class Camera(Sum):
        observation_space = Box(-np.inf, np.inf, (1000,), np.float64)

        def reset(self, *, seed=None, options=None):
            return np.repeat(super().reset(seed=seed)[0][:1], 1000) * 0 + 1e6, {}

        def step(self, action):
            super().step(action)
            return np.full(1000, 1e6), 0.0, False, False, {}

    (note,) = world(Camera)[0].findings.notes
    assert "environment.scale" in note
    assert "[" not in note
    assert len(note) < 1000


def test_no_note_where_readings_move():
    assert world()[0].findings.notes == ()


def test_lifetimes_get_a_new_environment_where_a_reset_is_not_enough():
    for kind, is_needed in ((Sum, False), (Keeps, True), (Third, True)):
        found = world(kind)[0].findings
        assert found.needs_fresh == is_needed, kind
        assert any("new environment" in note for note in found.notes) == is_needed


def test_lifetimes_that_cannot_be_repeated_are_noted():
    found = world(Unseeded, [{"at": 5, "speed": 2.0}])[0].findings
    assert ["cannot be repeated" in note for note in found.notes] == [True, False]
    assert "cannot be tested" in found.notes[1]


def test_a_change_that_makes_no_difference_is_noted():
    changes = [{"at": 5, "speed": 3.0, "unread": 2.0}, {"at": 9, "speed": 1.0}, {"at": 9, "noisy_readings": {0: 0}}]
    notes = world(Sum, changes)[0].findings.notes
    assert len(notes) == 2
    assert "unread=2.0 at 5 changes nothing" in notes[0]
    assert "noisy_readings={0: 0} at 9 changes nothing" in notes[1]


def test_a_change_may_use_what_a_reset_makes():
    def stop(env):
        env.place *= 0.0

    here = World(
        settings=Environment(name="here", horizon=40, changes=[{"at": 5, "function": "stop"}]),
        make=lambda **_: Sum(),
        functions={"stop": stop},
    )
    here.check()
    assert here.findings.notes == ()


def test_a_change_after_which_no_step_goes_is_refused():
    class Breaks(Sum):
        frames = 1

        def step(self, action):
            for _ in range(self.frames):
                found = super().step(action)
            return found

    with pytest.raises(PartError, match=r"environment here: step 0 .*failed in line"):
        world(Breaks, [{"at": 5, "frames": 2.5}])[0].check()


@pytest.mark.parametrize("error", [SystemExit, RuntimeError])
def test_whatever_a_step_raises_names_the_step_and_the_line(error):
    class Fails(Sum):
        def step(self, action):
            if len(self.actions) == 4:
                raise error("on fire")
            return super().step(action)

    with pytest.raises(PartError, match=r"environment here: step 4 \(seed 3\) failed in line \d+: .*on fire"):
        run(Fails)


@pytest.mark.parametrize(
    ("observation", "reward", "text"),
    [
        (1.0, 1.0, "step 4 .*of 3 numbers, got 1.0"),
        (np.zeros(1), 1.0, "step 4 .*of 3 numbers"),
        (np.array([0, np.nan, 0]), 1.0, "step 4 .*of numbers, got .*nan"),
        (np.zeros(3), None, "step 4 .*a reward must be a finite number, got None"),
        (np.zeros(3), np.ones(2), "step 4 .*a reward must be a finite number"),
        (np.zeros(3), np.inf, "step 4 .*a reward must be a finite number"),
        (np.zeros(3), 1e308, "the sum of the rewards"),
    ],
)
@pytest.mark.filterwarnings("ignore:overflow")
def test_what_an_environment_may_not_give_is_refused_with_its_step(observation, reward, text):
    class Wrong(Sum):
        def step(self, action):
            found = super().step(action)
            return found if len(self.actions) < 5 else (observation, reward, False, False, {})

    with pytest.raises(PartError, match=f"environment here: .*{text}"):
        run(Wrong)


def test_a_discrete_observation_out_of_its_range_is_refused():
    read = Reader(Discrete(4, start=2))
    assert list(read(3)) == [0, 1, 0, 0]
    for wrong in (1, 6, -1):
        with pytest.raises(ValueError, match=rf"from \[2\] to \[5\], got {wrong}"):
            read(wrong)


def lived(*rewards):
    return Lived(np.array(rewards, float), 0.0, 0.0, 0.0, np.zeros(0), np.zeros(0))


def test_before_ends_at_the_first_of_the_changes():
    here, _ = world(changes=[{"at": 8, "speed": 2.0}, {"at": 3, "speed": 3.0}])
    found = here.metrics(lived(*range(10)))
    assert (found["return_before"], found["return_after"], found["reached"]) == (0 + 1 + 2, sum(range(3, 10)), 1)


@pytest.mark.parametrize(("steps", "reached"), [(7, 0), (8, 0), (9, 1)])
def test_a_lifetime_that_ended_before_the_change_has_no_return_after_it(steps, reached):
    here, _ = world(changes=[{"at": 8, "speed": 2.0}])
    found = here.metrics(lived(*[-1.0] * steps))
    assert found["reached"] == reached
    assert found["return_after"] == -1 if reached else math.isnan(found["return_after"])
    assert found["return"] == -steps
