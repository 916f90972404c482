"""The environment of Gymnasium: its checker, the same bits as `evaluate`, rewards, and policies as genomes."""

import copy
import warnings

import gymnasium
import numpy as np
import pytest
from cases import first_of
from gymnasium.utils.env_checker import check_env

import epuckhebb
from epuckhebb import Lifetime
from epuckhebb.controller.network import PAPER_NETWORK, split_layers
from epuckhebb.gym import ID, TMaze, evaluation_key, genome_from_policy
from epuckhebb.tmaze.batch import run_lifetimes
from epuckhebb.tmaze.individual import Individual
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.session import Session

SHORT = ("lifetime.duration_s=5",)


def driven(env, policy, **options):
    """Drive an episode; the poses, the rewards and the last information."""
    observation, _ = env.reset(seed=1, options=options)
    poses, rewards, is_over, info = [], [], False, {}
    while not is_over:
        assert env.observation_space.contains(observation)
        poses.append(env.unwrapped.session.pose)
        observation, reward, is_over, is_cut, info = env.step(policy(observation))
        assert not is_cut
        rewards.append(reward)
    return np.array(poses), rewards, info


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("words", first_of([(), (("scenario.distance_gain=0.5",),), (("task=reversal",),)]))
def test_the_checker_of_gymnasium_has_nothing_to_say(words):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        env = gymnasium.make(ID, scenario="4obstacles" if not words else "base", overrides=words)
        check_env(env.unwrapped)


@pytest.mark.parametrize(("side", "wheel"), first_of([("left", "left_wheel: 0.8"), ("right", "left_slip: 0.3")]))
def test_the_bundled_champion_runs_as_in_evaluate(side, wheel):
    """To the bit, with a change of light, new obstacles and a weak or slipping wheel on the way."""
    changes = f"[{{at_s: 5, light: 1.0}}, {{at_s: 9, obstacles: 2, {wheel}}}]"
    words = ["scenario=4obstacles", f"scenario.changes={changes}"]
    words += ["lifetime.duration_s=20", "lifetime.gain_rad_s=4"]
    result = epuckhebb.evaluate(
        "reference", *words, "hebbian=none", "lifetime.record_every=1", repeats=2, seed=7, progress=False
    )
    row = result.metrics[(result.metrics.side == side) & (result.metrics.repeat == 0)].iloc[0]
    number = result.recorded.side.index(side)
    policy = epuckhebb.Controller(epuckhebb.load()).act
    env = gymnasium.make(ID, overrides=words)
    poses, rewards, info = driven(env, policy, side=side, key=evaluation_key(7, 0, side))
    np.testing.assert_array_equal(poses, result.recorded.samples.pose[number])
    assert (info["outcome"].fitness, info["outcome"].path_length) == (row.fitness, row.path_length_m)
    assert info["goal_distance"] == row.final_position_error_m
    assert sum(rewards) == pytest.approx(row.fitness, abs=1e-12)
    assert np.ptp(rewards[:-1]) > 0  # dense


@pytest.mark.parametrize("scenario", first_of([Scenario(), Scenario(distance_gain=0.6, dead_sensors=(2,))]))
def test_a_look_is_what_the_next_step_senses(genomes, scenario):
    individual = Individual(genes=genomes[0], side="left", key=np.uint64(5), record=True)
    lifetime = Lifetime(duration_s=4, gain_rad_s=4, record_every=1)
    session, seen = Session(individual, scenario, lifetime), []
    while not session.is_over:
        seen.append(session.look())
        session.step()
    np.testing.assert_array_equal(seen, session.samples.sensors)
    np.testing.assert_array_equal(seen, run_lifetimes([individual], scenario, lifetime)[0][1].sensors)


FITNESS = """\
import numpy as np
from epuckhebb import Fitness


class Fast(Fitness):
    step = staticmethod(lambda left, right: (left + right) / 2)
class Far(Fitness):
    life = staticmethod(lambda path_length: path_length)
class Drawn(Fitness):
    life = staticmethod(lambda: np.random.random())
class Both(Fast):
    life = staticmethod(lambda mean, success: mean + success)
"""


@pytest.mark.thorough
@pytest.mark.parametrize("name", first_of(["Both", "Fast", "Far"]))
def test_the_rewards_of_an_own_fitness_add_up_to_it(here, name):
    (here / "mine.py").write_text(FITNESS)
    env = gymnasium.make(ID, overrides=[*SHORT, f"fitness.function=mine.py:{name}"])
    _, rewards, info = driven(env, lambda _: np.array([0.5, 0.7]))
    assert sum(rewards) == pytest.approx(info["outcome"].fitness, abs=1e-12)
    assert (rewards[0] == 0) == (name == "Far")


def test_other_rewards():
    def drive(_):
        return np.array([0.9, 0.9])

    poses, rewards, info = driven(TMaze(reward="progress", overrides=SHORT), drive, side="left")
    goal = Scenario().goals_now["left"]
    start = np.hypot(poses[0, 0] - goal.x, poses[0, 1] - goal.y)
    assert sum(rewards) == pytest.approx(start - info["goal_distance"], abs=1e-12)
    assert abs(sum(rewards)) > 0.01
    _, rewards, info = driven(TMaze(reward="success", overrides=SHORT), drive, side="left")
    assert set(rewards) == {0.0}
    assert not info["success"]


def test_a_vector_of_environments_runs_as_single_ones():
    many = gymnasium.make_vec(ID, num_envs=3, overrides=SHORT)
    seen, _ = many.reset(seed=[4, 5, 6])
    rows = [seen]
    for _ in range(5):
        seen, *_ = many.step(np.full((3, 2), 0.5))
        rows.append(seen)
    one = gymnasium.make(ID, overrides=SHORT)
    alone = [one.reset(seed=5)[0], *(one.step(np.full(2, 0.5))[0] for _ in range(5))]
    np.testing.assert_array_equal([row[1] for row in rows], alone)
    many.close()


def test_a_policy_as_a_genome_and_back():
    genes = np.clip(epuckhebb.load(), -2, 2)
    layers = split_layers(PAPER_NETWORK, genes)
    weights = [layers[0][:-1].T, *(layer.T for layer in layers[1:])]
    np.testing.assert_array_equal(genome_from_policy(weights, layers[0][-1]), genes)
    observation = np.linspace(0, 1, 16)
    values = np.append(observation, 1.0)
    for layer in layers:
        values = np.tanh(values @ layer)
    np.testing.assert_allclose(epuckhebb.Controller(genes).act(observation), values, rtol=1e-13)
    with pytest.raises(ValueError, match=r"needs \(7, 16\), .* got"):
        genome_from_policy(weights[1:], layers[0][-1])
    with pytest.raises(ValueError, match=r"weights must lie in \[-2, 2\], got 4"):
        genome_from_policy([2 * np.sign(weight) * 2 for weight in weights], layers[0][-1])


def test_bad_input_is_refused(here):
    (here / "mine.py").write_text(FITNESS)
    for settings, text in (
        ({"reward": "gold"}, "reward must be one of fitness, success, progress, got 'gold'"),
        ({"side": "up"}, "side must be left or right"),
        ({"scenario": "nowhere"}, "nowhere"),
        ({"overrides": ["lifetime.duration_s=-1"]}, "lifetime.duration_s"),
        ({"overrides": ["hebbian=oja"]}, "hebbian does nothing here"),
        ({"overrides": ["training=varied"]}, "training does nothing here"),
        ({"overrides": ["optimizer.algorithm=ga"]}, "optimizer.algorithm does nothing here"),
        ({"config_dir": "/nowhere"}, "config-dir=/nowhere is no folder"),
        ({"overrides": ["fitness.function=mine.py:Drawn"]}, "run again"),
    ):
        with pytest.raises(ValueError, match=text):
            TMaze(**settings).reset()
    env = TMaze(overrides=["lifetime.duration_s=0.032"])
    with pytest.raises(ValueError, match="side must be left or right"):
        env.reset(options={"side": "up"})
    env.reset(seed=1)
    for action in ([2.0, 0.0], [np.nan, 0.0], [0.0]):
        with pytest.raises(ValueError, match="an action must be two numbers from -1 to 1"):
            env.step(np.array(action))
    assert env.step(np.zeros(2))[2]


def test_what_gymnasium_refuses_is_refused_in_its_way():
    env = TMaze(overrides=SHORT)
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.zeros(2))
    with pytest.raises(TypeError, match="make another one"):
        copy.deepcopy(env)
    for settings, text in (({"render_mode": "human"}, "render_mode"), ({"scenario": 3}, "scenario='3'")):
        with pytest.raises(ValueError, match=text):
            TMaze(**settings)
