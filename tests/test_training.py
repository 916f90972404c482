"""The worlds of training: what is drawn, what never is, and what counts as fitness in them."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from cases import evolve_in_maze

from epuckhebb.config.compose import composed
from epuckhebb.config.schema import EvolveConfig, typed
from epuckhebb.evolution.optimizer import Algorithm, Schedule
from epuckhebb.evolution.training import UNVARIED, Training
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.scenario import Scenario

FAST = Lifetime(duration_s=60, gain_rad_s=4)


def training(name):
    return typed(composed("evolve", [f"training={name}", "ga.loops=3"]), EvolveConfig).training


@pytest.fixture(scope="module")
def varied():
    """The varied worlds of a hundred generations with two loops each, as (generations, loops)."""
    kind = training("varied")
    return [kind.worlds(Scenario(), FAST, 2, 1, generation) for generation in range(100)]


@dataclass(kw_only=True)
class Unmoved(Algorithm):
    """An optimizer that asks for the same genomes in each generation, and has no preference in the end."""

    genomes: np.ndarray
    confirm: int = 1
    population: int = 2

    def schedule(self, training, lifetime):
        return Schedule(1, training.loops)

    def start(self, plan, seed):
        pass

    def ask(self):
        return self.genomes

    def tell(self):
        pass

    def candidates(self):
        return self.genomes


class Alike(Unmoved):
    """The same with common random numbers."""

    common_random_numbers = True


def evolved(optimizer, lifetime=FAST, **more):
    return next(evolve_in_maze(optimizer, Scenario(), lifetime, seed=1, **more))


def test_at_home_all_is_as_it_is():
    assert UNVARIED.worlds(Scenario(), FAST, 2, 1, 7) == [(Scenario(), FAST, 0.0)] * 2
    assert training("unvaried") == UNVARIED


def test_worlds_of_training_are_never_those_of_tests(varied):
    away = [loops[1].scenario for loops in varied]
    assert all(loops[0] == (Scenario(), FAST, 0.0) for loops in varied)
    assert {world.start_noise for _, world in varied} == {1.0}
    assert {world.layout for world in away if world.obstacles} <= set(range(10, 60))
    assert {world.obstacles for world in away} == {0, 2, 4}
    assert {world.dead_sensors for world in away} == {(), *((k,) for k in range(1, 8))}
    changed = {
        "light": np.mean([world.light != 0.1 for world in away]),
        "obstacles": np.mean([world.obstacles > 0 for world in away]),
        "dead": np.mean([bool(world.dead_sensors) for world in away]),
        "wheel": np.mean([world.left_wheel < 1 or world.right_wheel < 1 for world in away]),
    }
    assert changed == pytest.approx({"light": 0.7, "obstacles": 0.5, "dead": 0.25, "wheel": 0.3}, abs=0.12)
    assert all(0.05 <= world.light <= 1.2 and min(world.left_wheel, world.right_wheel) >= 0.8 for world in away)
    assert all(max(world.left_wheel, world.right_wheel) == 1 for world in away)


def test_every_training_layout_is_drawn_the_first_and_the_last_too():
    kind = replace(training("varied"), obstacles_share=1.0, layouts=[10, 12])
    drawn = {kind.worlds(Scenario(), FAST, 2, 1, generation)[-1].scenario.layout for generation in range(60)}
    assert drawn == {10, 11, 12}


def test_worlds_depend_on_seed_generation_and_loop_alone(varied):
    kind = training("varied")
    assert kind.worlds(Scenario(), FAST, 3, 1, 5)[:2] == varied[5]
    assert kind.worlds(Scenario(), FAST, 2, 2, 5)[1] != varied[5][1]
    without_light = replace(kind, light_share=0.0).worlds(Scenario(), FAST, 2, 1, 5)[1].scenario
    assert without_light == replace(varied[5][1].scenario, light=0.1)


def test_at_another_gain_a_lifetime_drives_as_far():
    kind = training("gain_varied")
    drawn = [kind.worlds(Scenario(), FAST, 1, 1, generation)[0].lifetime for generation in range(400)]
    gains = np.array([one.gain_rad_s for one in drawn])
    assert gains.min() >= 1.5
    assert gains.max() <= 6.0
    assert np.log(gains).mean() == pytest.approx(np.log(3), abs=0.05)
    np.testing.assert_allclose([one.duration_s * one.gain_rad_s for one in drawn], 240)
    assert kind.stretch(FAST) == pytest.approx(np.mean([one.duration_s for one in drawn]) / 60, rel=0.05)
    assert kind.worlds(Scenario(), FAST, 3, 1, 5)[2].lifetime == drawn[5]


def test_starts_vary_only_in_varied_loops():
    still, moved = np.zeros((1, 234)), Lifetime(duration_s=0.032, noise=0)
    in_training = evolved(Unmoved(genomes=still), moved)
    away = evolved(Unmoved(genomes=still), moved, training=Training(start_noise=1.0, unvaried_loops=1))
    only_away = evolved(Unmoved(genomes=still), moved, training=Training(start_noise=1.0, unvaried_loops=0))
    assert in_training.robot_steps == only_away.robot_steps == 2
    assert away.robot_steps == 4
    assert away.fitness[0] == pytest.approx((in_training.fitness[0] + only_away.fitness[0]) / 2, abs=0.02)
    assert in_training.fitness[0] != only_away.fitness[0]


def test_a_bonus_is_paid_for_success_at_the_last_step(genomes):
    both = Unmoved(genomes=np.stack([genomes[0], np.zeros(234)]))
    plain, paid = evolved(both), evolved(both, training=Training(success_bonus=0.25))
    assert plain.success.tolist() == [1.0, 0.0]
    np.testing.assert_allclose(paid.fitness - plain.fitness, [0.25, 0.0], atol=1e-12)


def test_with_common_random_numbers_only_genes_tell_individuals_apart(genomes):
    twice = np.stack([genomes[0], genomes[0]])
    short = Lifetime(duration_s=3, gain_rad_s=4)
    for kind, count in ((Alike, 1), (Unmoved, 2)):
        last = evolved(kind(genomes=twice), short, training=Training(start_noise=1.0))
        assert len(set(last.fitness.tolist())) == count


def test_the_champion_is_who_does_best_in_fresh_lifetimes(genomes):
    candidates = np.stack([np.zeros(234), genomes[0]])
    last = evolved(Alike(genomes=candidates))
    np.testing.assert_array_equal(last.champion, genomes[0])
    assert last.champion_fitness != last.fitness[1]
    assert last.champion_fitness == pytest.approx(last.fitness[1], abs=0.1)
    assert last.robot_steps == 2 * 2 * FAST.steps


def test_training_whose_values_are_not_its_files_says_so():
    names = [
        composed("evolve", ["ga.loops=2", *overrides]).training.name
        for overrides in ([], ["training=varied"], ["training=varied", "training.light_share=0.1"])
    ]
    assert names == ["unvaried", "varied", "varied changed"]
