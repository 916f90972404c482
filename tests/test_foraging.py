"""Foraging: what a robot senses and eats, the seasons, the scripted foragers, and each change."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from epuckhebb.config import load
from epuckhebb.config.environments import EvaluateEnvironment
from epuckhebb.worlds.foragers import FORAGERS, earned, season_sums
from epuckhebb.worlds.foraging import COLUMN, HEADING, ID, ROW, SEASON, Foraging, put

LEFT, AHEAD, RIGHT = range(3)
WALL, GREEN, BLUE, NOTHING = [1.0, 1.0], [1.0, 0.0], [0.0, 1.0], [0.0, 0.0]


def empty(size=5, **options):
    """A field without items, the robot in the middle, looking up; the first item is green and the second blue."""
    world = Foraging(size=size, items=1, slip=0.0, summer_first=1.0, **options)
    world.reset(seed=1)
    world.state.cells[:] = 0
    world.state.places[:] = 0
    return world


def test_it_is_an_environment_of_gymnasium():
    env = gymnasium.make(ID, render_mode="rgb_array")
    check_env(env.unwrapped)
    assert env.reset(seed=1)[0].shape == (6,)
    assert env.render().shape == (640, 640, 3)


def test_a_robot_senses_three_cells_and_eats_what_it_enters():
    world = empty()
    put(world.state, 1, 1, 2)  # green, two cells ahead
    put(world.state, 2, 2, 1)  # blue, to the left
    assert world.step(LEFT)[1] == -1.0
    assert world.state.robot[[ROW, COLUMN, HEADING]].tolist() == [2, 1, 3]
    world.state.cells[:] = 0
    put(world.state, 1, 2, 0)
    assert world.step(RIGHT)[0].tolist() == NOTHING * 3  # the green item is behind to the left
    readings, reward, *_ = world.step(LEFT)
    assert (readings.tolist(), reward) == ([*GREEN, *WALL, *NOTHING], 0.0)
    assert world.step(AHEAD)[0].tolist() == [*GREEN, *WALL, *NOTHING]  # there is the wall
    assert world.step(LEFT)[1] == 1.0
    put(world.state, 2, 3, 1)
    assert world.step(AHEAD)[0].tolist()[:2] == BLUE


def test_an_eaten_item_appears_elsewhere():
    world = Foraging(size=6, items=4, slip=0.3, moving=0.2)
    world.reset(seed=2)
    for step in range(300):
        world.step(step % 3)
        cells, places = world.state.cells, world.state.places
        assert sorted(cells[cells > 0]) == list(range(1, 9))
        assert [cells[row, column] for row, column in places] == list(range(1, 9))
        assert cells[world.state.robot[ROW], world.state.robot[COLUMN]] == 0


def test_what_is_food_changes_with_the_season_alone():
    """Without the reward as a reading, an action earns in one season what it loses in the other."""
    drawn = np.random.default_rng(3).integers(0, 3, 400)
    rewards = []
    for summer_first, winter in ((1.0, True), (0.0, True), (1.0, False)):
        world = Foraging(size=8, items=10, season=100, summer_first=summer_first, winter=winter)
        world.reset(seed=5)
        rewards.append(np.array([world.step(int(action))[1] for action in drawn]))
    summer, winter, always = rewards
    assert np.abs(summer).sum() > 50
    np.testing.assert_array_equal(summer, -winter)
    np.testing.assert_array_equal(summer, always * np.repeat([1, -1, 1, -1], 100))


def test_the_first_season_is_drawn_for_each_lifetime():
    world = Foraging()
    first = []
    for seed in range(200):
        world.reset(seed=seed)
        first.append(int(world.state.robot[SEASON]))
    assert 70 < sum(first) < 130


def test_win_stay_lose_shift_earns_half_of_what_one_earns_who_knows():
    """In every season, so that the world is a positive control. The seeds are those on which it was set."""
    world = Foraging()
    earnings = {
        name: season_sums(np.array([earned(world, name, seed, 2000) for seed in range(901, 906)]), 500).mean(axis=0)
        for name in FORAGERS
    }
    np.testing.assert_allclose(earnings["knows"], KNOWS)
    np.testing.assert_allclose(earnings["win-stay lose-shift"], SHIFTS)
    assert (earnings["win-stay lose-shift"] > earnings["knows"] / 2).all()


KNOWS, SHIFTS = [68.6, 58.2, 58.8, 70.6], [67.4, 64.4, 75.4, 67.4]


@pytest.mark.parametrize("change", ["no_winter", "restless", "blind"])
def test_each_named_change_makes_a_difference(change):
    config = load(EvaluateEnvironment, ["environment=foraging", f"change={change}"])
    assert config.world.findings.notes == ()


@pytest.mark.parametrize("option", ["size=20.5", "items=101", "season=0", "slip=2", "winter=3"])
def test_an_option_that_cannot_be_is_refused(option):
    with pytest.raises(ValueError, match=f"environment.options.{option.split('=')[0]}"):
        load(EvaluateEnvironment, ["environment=foraging", f"environment.options.{option}"])
