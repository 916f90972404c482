"""The genetic algorithm and its loop."""

import numpy as np
import pandas as pd
import pytest
from cases import evolve_in_maze
from hypothesis import given
from hypothesis import strategies as st

from epuckhebb.controller.genome import make_plan
from epuckhebb.controller.network import PAPER_NETWORK, Network
from epuckhebb.controller.plasticity.control import Sign
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.evolution.evolve import history_row
from epuckhebb.evolution.optimizer import initial
from epuckhebb.evolution.optimizers.ga import GA, Crossover, Selection, crossover, mutate, next_generation, select
from epuckhebb.tmaze.individual import GA_ALONE, Controller
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.scenario import Scenario

AS_CODED = {
    "selection": Selection.best_or_worst,
    "crossover": Crossover.middle,
    "crossover_rate": 0.7,
    "mutation_rate": 0.01,
}
SHORT = Lifetime(duration_s=6, gain_rad_s=4)
PLAN = make_plan(PAPER_NETWORK)
LIMIT = np.ones(PLAN.genes)
TINY = GA(population=6, generations=6, elites=2, loops=1)


def rng(seed=0):
    return np.random.default_rng(seed)


@given(seed=st.integers(0, 2**32 - 1), elites=st.integers(0, 12), coded=st.booleans())
def test_elites_survive_and_genes_stay_within_their_limit(seed, elites, coded):
    ga = GA(population=12, elites=elites, **(AS_CODED if coded else {}))
    population, fitness = initial(rng(seed), 12, PLAN), rng(seed + 1).random(12)
    offspring = next_generation(rng(seed), population, fitness, ga, PLAN)
    best = population[np.argsort(-fitness)][:elites]
    np.testing.assert_array_equal(offspring[:elites], best)
    assert offspring.shape == population.shape
    assert np.abs(offspring).max() <= ga.gene_limit


def test_uniform_crossover_takes_every_gene_from_a_parent_about_half_from_each():
    child = crossover(rng(), np.zeros(234), np.ones(234), GA())
    assert set(child) == {0, 1}
    assert 90 < child.sum() < 144


def test_middle_crossover_joins_two_halves():
    child = crossover(rng(), np.zeros(234), np.ones(234), GA(crossover=Crossover.middle))
    np.testing.assert_array_equal(child, np.repeat([0, 1], 117))


@pytest.mark.parametrize(("rate", "expected"), [(0.05, 11.7), (0.01, 2.34), (0.0, 0.0)])
def test_mutation_changes_the_stated_share_of_genes(rate, expected):
    generator = rng()
    changed = [np.count_nonzero(mutate(generator, np.zeros(234), GA(mutation_rate=rate), LIMIT)) for _ in range(2000)]
    assert np.mean(changed) == pytest.approx(expected, abs=0.3)


def test_mutation_is_uniform_within_its_range():
    changes = np.concatenate([mutate(rng(k), np.zeros(234), GA(mutation_rate=1.0), LIMIT) for k in range(100)])
    assert np.abs(changes).max() <= 1
    assert np.abs(changes).mean() == pytest.approx(0.5, abs=0.01)


@pytest.mark.parametrize(
    ("selection", "best"), [(Selection.everyone, 1 - (49 / 50) ** 4), (Selection.best_or_worst, 15 / 16)]
)
def test_tournaments_favour_the_best(selection, best):
    ranked, generator = np.arange(50)[:, None] * np.ones(234), rng()
    drawn = np.array([select(generator, ranked, GA(selection=selection))[0] for _ in range(20_000)])
    assert (drawn == 0).mean() == pytest.approx(best, abs=0.01)
    if selection is Selection.best_or_worst:
        assert set(drawn) == {0, 49}


def test_as_coded_clones_three_slots_in_ten():
    population, fitness = initial(rng(), 1000, PLAN), np.arange(1000.0)
    offspring = next_generation(rng(1), population, fitness, GA(population=1000, elites=0, **AS_CODED), PLAN)
    unchanged = (offspring == population[::-1]).all(axis=1).mean()
    assert unchanged == pytest.approx(0.3, abs=0.05)


def test_best_fitness_never_falls_without_noise():
    quiet = Lifetime(duration_s=6, gain_rad_s=4, noise=0)
    best = [generation.fitness.max() for generation in evolve_in_maze(TINY, Scenario(), quiet, seed=3)]
    assert best == sorted(best)
    assert best[-1] > best[0]


@pytest.mark.thorough
def test_controllers_that_learn_and_other_networks_evolve_too():
    network = Network((16, 10, 6, 2))
    learning = Controller(name="x", rule=Paper(N=0.01, sign=Sign.shuffled))
    plain, learnt = (
        list(evolve_in_maze(TINY, Scenario(), SHORT, seed=5, network=network, controller=controller))
        for controller in (GA_ALONE, learning)
    )
    assert plain[-1].champion.shape == (network.synapses,)
    np.testing.assert_array_equal(plain[0].champion.shape, learnt[0].champion.shape)
    assert (plain[0].fitness != learnt[0].fitness).any()
    with pytest.raises(ValueError, match=r"network\.layers must begin with 16"):
        next(evolve_in_maze(TINY, Scenario(), SHORT, seed=5, network=Network((4, 2))))


def test_starts_vary_only_when_asked_to():
    one = GA(population=1, generations=1, elites=0, loops=1)
    noisy = GA(population=1, generations=1, elites=0, loops=1, start_noise=1.0)
    quiet = Lifetime(duration_s=6, gain_rad_s=4, noise=0)
    still, moved = (next(evolve_in_maze(ga, Scenario(), quiet, seed=1)).fitness[0] for ga in (one, noisy))
    assert still != moved
    assert still == next(evolve_in_maze(one, Scenario(), quiet, seed=1)).fitness[0]


def test_history_of_a_tiny_evolution(golden):
    history = [history_row(g) for g in evolve_in_maze(TINY, Scenario(), SHORT, seed=7)]
    golden("evolution.csv", pd.DataFrame(history).round(9).to_csv(index=False))


IMPOSSIBLE = {"population": 0, "generations": 0, "elites": 51, "loops": 0, "tournament": 0, "crossover_rate": 1.5}
IMPOSSIBLE |= {"mutation_rate": -0.1, "mutation_range": 0.0, "gene_limit": float("inf"), "start_noise": -1.0}


@pytest.mark.parametrize(("key", "value"), IMPOSSIBLE.items())
def test_impossible_algorithms_are_refused_by_name(key, value):
    with pytest.raises(ValueError, match=rf"ga\.{key} must .*{value}"):
        GA(**{key: value})
