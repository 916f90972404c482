"""Optimizers behind one interface: each can be stopped and continued, and keeps within limits."""

from pathlib import Path

import numpy as np
import pytest
from cases import call, done, evolve_in_maze, refused

import epuckhebb
from epuckhebb.config.build import make_optimizer
from epuckhebb.config.parts import KINDS
from epuckhebb.controller.genome import GenomePlan, Part
from epuckhebb.evolution.optimizers.ga import GA
from epuckhebb.evolution.optimizers.open_es import OpenEs
from epuckhebb.evolution.optimizers.sep_cma_es import SepCmaEs
from epuckhebb.evolution.search import Search
from epuckhebb.evolution.training import UNVARIED, Training
from epuckhebb.runtime.errors import ConfigError
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.scenario import Scenario

PLAN = GenomePlan((Part("weights", 20), Part("rate", 3, start=0.5, limit=0.75), Part("fixed", 1, start=0.0)))
SMALL = {
    "ga": GA(population=6, elites=2, loops=2, generations=4),
    "sep_cma_es": SepCmaEs(population=4, starts=5, generations=4, confirm=2),
    "open_es": OpenEs(population=4, starts=5, generations=4, confirm=2),
}
TINY = ["optimizer=sep_cma_es", "optimizer.population=4", "optimizer.starts=3", "optimizer.confirm=2"]
TINY += ["lifetime.duration_s=3", "scenario.paper_duration_s=10", "threads=1", "-q"]
HERE = Path(__file__).parent
RESULTS = ("history.csv", "champion.npz", "checkpoint.npz")


def same(one, other):
    return all((Path(one) / name).read_bytes() == (Path(other) / name).read_bytes() for name in RESULTS)


def sphere(population):
    """How near genomes are to 0.6 everywhere."""
    return -((population - 0.6) ** 2).sum(axis=1)


def generations(search, count):
    for _ in range(count):
        population = search.ask()
        search.tell(sphere(population), {})
    return population


def test_every_optimizer_of_the_program_is_tested_here():
    assert KINDS["optimizer"].names == sorted(SMALL)


@pytest.mark.parametrize("name", SMALL)
def test_a_search_goes_on_from_its_log_to_the_same_bits(name):
    whole = Search(SMALL[name], PLAN, 5)
    last = generations(whole, 7)
    for number in (1, 2, 4):
        begun = Search(SMALL[name], PLAN, 5)
        generations(begun, number)
        log = begun.log
        generations(begun, 2)  # what goes on must not change what was stored
        again = Search(SMALL[name], PLAN, 5, log)
        assert generations(again, 7 - number).tobytes() == last.tobytes()
        assert again.candidates().tobytes() == whole.candidates().tobytes()
        assert [results.digest for results in again.log] == [results.digest for results in whole.log]


@pytest.mark.parametrize("name", SMALL)
def test_another_seed_is_another_search(name):
    one, other = (generations(Search(SMALL[name], PLAN, seed), 2) for seed in (1, 2))
    assert (one != other).any()


@pytest.mark.parametrize("name", SMALL)
def test_genes_stay_within_the_limits_of_their_parts(name):
    wide = {
        "ga": GA(mutation_range=9.0, mutation_rate=0.5),
        "sep_cma_es": SepCmaEs(sigma=4.0),
        "open_es": OpenEs(sigma=4.0, learning_rate=9.0),
    }[name]
    search = Search(wide, PLAN, 1)
    limit = np.repeat([wide.gene_limit, 0.75, wide.gene_limit], [20, 3, 1])
    for _ in range(5):
        population = search.ask()
        search.tell(sphere(population), {})
        assert (np.abs(population) <= limit).all()
        assert (np.abs(search.candidates()) <= limit).all()
    assert np.abs(population[:, 20:23]).max() == 0.75


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_the_mean_of_open_es_stops_at_the_limits(sign):
    search = Search(OpenEs(learning_rate=9.0), PLAN, 1)
    for _ in range(20):
        search.tell(sign * search.ask().sum(axis=1), {})
    mean, wide = sign * search._optimizer._mean, search._optimizer.gene_limit
    limit = np.repeat([wide, 0.75 / 0.5, wide], [20, 3, 1])  # of the mean, in units of where the genes start
    assert (np.abs(mean) <= limit).all()
    assert (mean == limit).sum() > 15


def test_a_log_of_another_search_is_refused():
    search = Search(SMALL["ga"], PLAN, 5)
    generations(search, 2)
    with pytest.raises(ValueError, match="optimizer ga asks for other genomes than before in generation 0"):
        Search(SMALL["ga"], PLAN, 6, search.log)


@pytest.mark.parametrize("name", ["sep_cma_es", "open_es"])
def test_a_strategy_begins_around_the_fittest_of_its_first_generation(name):
    search = Search(SMALL[name], PLAN, 5)
    population = search.ask()
    assert population.shape == (5, 24)
    fitness = np.array([0.0, 1.0, 3.0, 2.0, 0.0])
    search.tell(fitness, {})
    np.testing.assert_array_equal(search.candidates(), population[[2, 2, 3]])
    assert search.ask().shape == (4, 24)


@pytest.mark.parametrize(("strategy", "near"), [(SepCmaEs(population=12), 0.02), (OpenEs(), 0.1)])
def test_a_strategy_finds_what_there_is_to_find(strategy, near):
    search = Search(strategy, PLAN, 5)
    generations(search, 150)
    np.testing.assert_allclose(search.candidates()[0], 0.6, atol=near)


def test_a_step_of_open_es_goes_by_ranks_of_antithetic_pairs():
    search = Search(OpenEs(population=4, starts=2, sigma=0.1, learning_rate=0.2), PLAN, 5)
    search.ask()
    search.tell(np.array([1.0, 0.0]), {})
    (mean, *_), population = search.candidates(), search.ask()
    one, other = (population[:2] - mean) / 0.1  # e of both pairs
    np.testing.assert_allclose(population[2:], [mean - 0.1 * one, mean - 0.1 * other], atol=1e-12)
    search.tell(np.array([3.0, -1.0, 0.5, 2.0]), {})  # ranks .5, -.5, -1/6, 1/6
    expected = mean + 0.2 / (4 * 0.1) * (0.5 * one - 0.5 * other + one / 6 - other / 6)
    weights = slice(0, 20)  # in units of 1
    np.testing.assert_allclose(search.candidates()[0][weights], expected[weights], atol=1e-12)


def test_equal_fitness_moves_the_mean_of_open_es_nowhere():
    search = Search(OpenEs(population=40), PLAN, 5)
    search.ask()
    search.tell(np.zeros(50), {})
    before = search.candidates()[0]
    for _ in range(3):
        search.ask()
        search.tell(np.full(40, 500.0), {})
    assert search.candidates()[0].tobytes() == before.tobytes()


def test_individuals_of_equal_fitness_share_the_mean_of_their_ranks_in_open_es():
    search = Search(OpenEs(population=6, starts=2, sigma=0.1, learning_rate=0.2), PLAN, 5)
    search.ask()
    search.tell(np.zeros(2), {})
    mean, population = search.candidates()[0], search.ask()
    search.tell(np.array([1.0, 7.0, 4.0, 1.0, 4.0, 4.0]), {})  # the first pair is equal: its ranks 5 and 6 are shared
    noise, ranks = (population[:3] - mean) / 0.1, [-0.4, 0.5, 0.1, -0.4, 0.1, 0.1]
    moved = sum((ranks[k] - ranks[k + 3]) * noise[k] for k in range(3))
    weights = slice(0, 20)
    np.testing.assert_allclose(
        search.candidates()[0][weights], (mean + 0.2 / (6 * 0.1) * moved)[weights], rtol=0, atol=1e-12
    )


@pytest.mark.parametrize("fitness", [[3, 1, 1, 1, 0, 0], [1, 1, 1, 1, 1, 1], [2, 0, 3, 2, 1, 0], [5, 4, 3, 3, 2, 1]])
def test_individuals_of_equal_fitness_share_the_mean_of_their_weights_in_sep_cma_es(fitness):
    """The mean and the deviations are those of the published update (Ros & Hansen 2008), with these weights."""
    search, values = Search(SepCmaEs(population=6, starts=2), PLAN, 5), np.array(fitness, float)
    search.ask()
    search.tell(np.array([1.0, 0.0]), {})
    mean, samples = search._optimizer._mean.copy(), search.ask() / search._optimizer._unit
    cma = search._optimizer._cma
    sigma, c1, c_mu, c_c = cma._sigma, cma._c1, cma._cmu, cma._cc
    by_rank = np.append(cma._weights, np.zeros(3))[np.argsort(np.argsort(-values, kind="stable"))]
    weights = np.array([by_rank[values == value].mean() for value in values])
    steps = (samples - mean) / sigma
    expected = mean + sigma * weights @ steps
    path = np.sqrt(c_c * (2 - c_c) * cma._mu_eff) * (weights @ steps)
    variances = 1 - c1 - c_mu + c1 * path**2 + c_mu * weights @ steps**2
    search.tell(values, {})
    np.testing.assert_allclose(search._optimizer._mean, expected, rtol=0, atol=1e-12)
    np.testing.assert_allclose(cma._C, variances, rtol=0, atol=1e-12)


RULES = GenomePlan((Part("weights", 3), Part("A", 16, limit=2.0), Part("eta", 16, limit=2.0)))


def test_rules_of_synapses_are_merged_into_half_as_many():
    merging = OpenEs(population=4, starts=3, merges=3, merge_every=2)
    search = Search(merging, RULES, 5)
    counts = []
    for _ in range(10):
        population = search.ask()
        rules = [np.unique(np.stack([one[3:19], one[19:]], axis=1), axis=0) for one in population]
        counts.append(max(map(len, rules)))
        search.tell(sphere(population), {})
    assert counts[:3] == [16, 16, 16]
    assert counts[3] <= 8
    assert counts[5] <= 4
    assert 1 <= counts[7] == counts[9] <= 2
    again = Search(merging, RULES, 5, search.log[:4])
    assert generations(again, 6).tobytes() == population.tobytes()


@pytest.mark.parametrize(
    "plan", [PLAN, GenomePlan((Part("weights", 20),)), GenomePlan((Part("weights", 4), Part("N", 1)))]
)
def test_where_synapses_have_no_rules_there_is_nothing_to_merge(plan):
    with pytest.raises(ValueError, match=r"optimizer\.merges"):
        OpenEs(merges=1).check(plan)


@pytest.mark.parametrize(
    ("training", "generations"),
    [(UNVARIED, 148), (Training(light_share=0.5), 74), (Training(gain_rad_s=[1.5, 6.0]), 102)],
)
def test_sep_cma_es_takes_as_many_robot_steps_as_the_paper(training, generations):
    life, paper, es = Lifetime(duration_s=60, gain_rad_s=4), GA(), SepCmaEs()
    assert OpenEs(population=30).schedule(training, life) == es.schedule(training, life)
    assert OpenEs().schedule(UNVARIED, life).generations == 111
    schedule = es.schedule(training, life)
    assert schedule == (generations, training.loops)
    lifetimes = (es.starts + (generations - 1) * es.population) * schedule.loops * 2 + 3 * es.confirm
    share = lifetimes * training.stretch(life) / (paper.population * paper.generations * paper.loops * 2)
    assert 0.985 < share <= 1
    assert SepCmaEs(generations=7, loops=3).schedule(training, life) == (7, 3)


@pytest.mark.parametrize("name", SMALL)
def test_an_evolution_can_be_stopped_anywhere(name):
    settings = {"training": Training(gain_rad_s=[3.0, 6.0], start_noise=1.0), "seed": 5}
    life = Lifetime(duration_s=3, gain_rad_s=4)
    whole = list(evolve_in_maze(SMALL[name], Scenario(), life, **settings))
    resumed = list(evolve_in_maze(SMALL[name], Scenario(), life, after=whole[1], threads=2, **settings))
    assert [one.fitness.size for one in whole] == ([6, 6, 6, 6] if name == "ga" else [5, 4, 4, 4])
    for one, other in zip(whole[2:], resumed, strict=True):
        assert one.fitness.tobytes() == other.fitness.tobytes()
        assert one.champion.tobytes() == other.champion.tobytes()
        assert one.champion_fitness == other.champion_fitness
        assert [results.digest for results in one.log] == [results.digest for results in other.log]


@pytest.mark.thorough
@pytest.mark.usefixtures("here")
def test_a_run_of_sep_cma_es_is_resumed_repeated_and_shown():
    done("evolve", *TINY, "optimizer.generations=3", "hydra.run.dir=whole")
    done("evolve", *TINY, "optimizer.generations=2", "hydra.run.dir=run")
    assert "only optimizer.generations, threads" in refused("evolve", "resume=run", "ga.generations=3")
    assert "optimizer.generations must be 2 or more" in call("evolve", "resume=run", "optimizer.generations=1").stderr
    done("evolve", "resume=run", "optimizer.generations=3", "-q")
    assert same("run", "whole")
    done("rerun", "run", "-q")
    assert "Evolved: optimizer sep_cma_es, training unvaried" in call("show", "run").stdout
    with np.load("run/champion.npz") as champion, np.load("run/checkpoint.npz") as checkpoint:
        assert (str(champion["optimizer"]), str(champion["training"])) == ("sep_cma_es", "unvaried")
        assert champion["fitness"] == checkpoint["champion_fitness"]
    evolution = epuckhebb.evolve(*TINY[:-1], "optimizer.generations=3")
    np.testing.assert_array_equal(evolution.champion, epuckhebb.load("run"))
    assert evolution.history.to_csv(index=False) == Path("run/history.csv").read_text()
    Path("run/checkpoint.npz").write_bytes(Path("whole/checkpoint.npz").read_bytes()[:3000])
    assert "checkpoint.npz" in call("evolve", "resume=run", "optimizer.generations=4").stderr


def test_the_genetic_algorithm_needs_its_settings():
    with pytest.raises(ConfigError, match="with optimizer=ga"):
        make_optimizer({"algorithm": "ga"}, None)
