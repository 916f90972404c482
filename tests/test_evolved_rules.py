"""Rules that evolve with the weights: three steps by hand, beside the oracle, and from `evolve` to `show`."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from cases import done, evolve_in_maze, first_of, refused

import epuckhebb
from epuckhebb.analysis.evaluate import make_individuals
from epuckhebb.controller import random
from epuckhebb.controller.genome import make_plan
from epuckhebb.controller.genotype import Genotype
from epuckhebb.controller.network import PAPER_NETWORK, Network, split_layers
from epuckhebb.controller.plasticity.control import Sign
from epuckhebb.controller.plasticity.rule import InitialWeights, NoRule, coefficients, make_schedule, modulatory_weights
from epuckhebb.controller.plasticity.rules.abcd import ABCD
from epuckhebb.controller.plasticity.rules.abcd_neuron import ABCDNeuron
from epuckhebb.controller.plasticity.rules.abcd_shared import ABCDShared
from epuckhebb.controller.plasticity.rules.baldwin_n import BaldwinN
from epuckhebb.controller.plasticity.rules.discrete import Discrete
from epuckhebb.controller.plasticity.rules.modulated import Modulated
from epuckhebb.controller.plasticity.rules.online import Online
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.controller.plasticity.update import (
    StepContext,
    initial_lengths,
    make_modulation,
    make_update,
    make_workspace,
)
from epuckhebb.evolution.optimizer import initial
from epuckhebb.evolution.optimizers import ga as ga_module
from epuckhebb.evolution.optimizers.ga import GA
from epuckhebb.store.genome import load_genome
from epuckhebb.tmaze.individual import Controller
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.scenario import Scenario

SIZES = {
    ABCD: "234 weights, 234 A, 234 B, 234 C, 234 D, 234 eta",
    ABCDShared: "234 weights, 5 A, 5 B, 5 C, 5 D, 5 eta",
    ABCDNeuron: "234 weights, 43 A, 43 B, 43 C, 43 D, 43 eta",
    Modulated: "234 weights, 5 v, 1 A, 1 B, 1 C, 1 D, 1 eta",
    BaldwinN: "234 weights, 1 theta",
    Discrete: "234 weights, 4 when_better, 4 when_worse, 1 eta, 1 threshold, 1 high, 1 low",
}
LIVED = {
    Modulated: Modulated(N=0.003),
    ABCD: ABCD(N=0.003, leak=0.5),
    ABCDShared: ABCDShared(N=0.0003),
    ABCDNeuron: ABCDNeuron(N=0.002, leak=1.0),
    BaldwinN: BaldwinN(N=0.01),
    Discrete: Discrete(N=0.001),
    Online: Online(window_s=4.0, sigma=0.05),
}
TINY = ["optimizer=sep_cma_es", "optimizer.population=4", "optimizer.starts=3", "optimizer.confirm=2"]
TINY += ["optimizer.generations=2", "lifetime.duration_s=3", "scenario.paper_duration_s=10", "threads=1", "-q"]
BRIEF = ["lifetime.duration_s=3", "repeats=1", "threads=1"]


# The equations


@pytest.mark.parametrize("rule", SIZES)
def test_what_a_rule_evolves(rule):
    assert make_plan(PAPER_NETWORK, rule).text() == SIZES[rule]


def coefficients_of(rule, network=PAPER_NETWORK, **genes):
    return coefficients(rule, network, {name: np.array(values, float) for name, values in genes.items()})


@pytest.mark.parametrize("rule", [ABCD, ABCDShared, ABCDNeuron])
def test_three_steps_of_the_rules_with_four_terms(rule):
    by, terms = SimpleNamespace(leak=0.1), (0.5, -1.0, 2.0, 0.25)
    assert rule.synapse(0.5, 0.8, 1.0, 1.0, *terms, by) == pytest.approx(0.5 * 0.4 - 0.5 + 1.6 + 0.25)
    assert rule.synapse(-1.0, 0.5, 1.5, 1.0, *terms, by) == pytest.approx(-0.25 + 1.0 + 1.0 + 0.25 - 0.05)
    assert rule.synapse(0.0, 0.0, -1.0, 1.0, *terms, by) == pytest.approx(0.25 + 0.2)  # what neither neuron has to do


def test_three_steps_of_the_modulated_rule():
    network = Network((3, 2, 2))
    modulate, v = make_modulation(Modulated, network), np.array([1.0, -2.0, 0.5])
    activation = np.zeros(network.neurons)
    for hidden, output in (((0.0, 0.0), 0.25), ((1.0, 0.5), 0.25), ((-1.0, 0.75), -1.0)):
        activation[4:6] = hidden
        assert modulate(v, activation) == pytest.approx(np.tanh(output), rel=1e-14)
    assert Modulated.synapse(0.5, 0.8, 0.5, -1.0, 2.0, 0.25) == pytest.approx(0.2 - 0.5 + 1.6 + 0.25)
    genes = {"v": v, "A": [1], "B": [2], "C": [3], "D": [4], "eta": [-0.5]}
    np.testing.assert_array_equal(modulatory_weights(Modulated, genes), v)
    assert coefficients_of(Modulated, **genes)[:, 7].tolist() == [-0.5, -1.0, -1.5, -2.0]


def test_three_steps_of_the_papers_rule_with_an_evolved_rate():
    (factor,) = coefficients_of(BaldwinN, theta=[0.5])
    state, by = SimpleNamespace(trace=0.0), SimpleNamespace(trace_decay=0.95, trace_update=0.05)
    for correlation, trace in ((0.4, 0.02), (-1.0, -0.031), (0.0, -0.02945)):
        assert BaldwinN.synapse(correlation, state, factor[0], by) == pytest.approx(np.sqrt(10) * trace)


def test_three_steps_of_the_discrete_rule():
    genes = {"when_better": [0.2, -0.6, 0.9, 0.6], "when_worse": [1, -1, 0.4, -0.5]}  # 0 -1 1 1, 1 -1 0 0
    values = coefficients_of(Discrete, **genes, eta=[2], threshold=[0.1], high=[0.5], low=[-0.5])[:, 0]
    for fitness, expected in ((0.91, (0, -2, 2, 2)), (0.7, (0, 0, 0, 0)), (0.49, (2, -2, 0, 0))):
        states = ((0.1, -0.5), (0.0, 0.2), (0.3, 0.05), (0.8, 0.9))
        assert tuple(Discrete.synapse(*x, fitness, *values) for x in states) == pytest.approx(expected)


def test_the_incoming_weights_of_each_neuron_keep_their_length():
    network = Network((3, 2, 2))
    genes = np.random.default_rng(0).uniform(-1, 1, network.synapses)
    weights, values = genes.copy(), dict.fromkeys(Discrete.evolved, np.ones(1))
    values |= {"when_better": np.ones(4), "when_worse": np.ones(4)}
    numbers, activation = Discrete(N=1.0).numbers(), np.ones(network.neurons)
    workspace = make_workspace(network)
    spread, lengths = coefficients(Discrete, network, values), initial_lengths(Discrete, network, genes)
    genotype = Genotype(genes, np.empty(0), spread, np.empty(0), lengths, np.ones_like(genes))
    now = StepContext(0.1, np.uint64(1), 0, 0.032)
    learn = make_update(Discrete, network, make_schedule(Discrete()))
    total = learn(weights, np.empty(0), genotype, activation, 0.1, now, numbers, workspace)
    assert total == pytest.approx(np.abs(weights - genes).sum()) != 0
    for now, before in zip(split_layers(network, weights), split_layers(network, genes), strict=True):
        np.testing.assert_allclose(np.linalg.norm(now, axis=0), np.linalg.norm(before, axis=0))
        grown = before + 0.1
        np.testing.assert_allclose(now, grown / np.linalg.norm(grown, axis=0) * np.linalg.norm(before, axis=0))


@pytest.mark.filterwarnings("ignore:overflow")  # which random bits are made of
def test_three_windows_of_online_evolution():
    by, state, key = SimpleNamespace(window_s=0.064, sigma=0.5), SimpleNamespace(**Online.synapse_state), np.uint64(3)

    def after(weight, step, *fitness):
        """A window of two steps; the weight that is tried next."""
        for k, live in enumerate(fitness):
            towards = Online.synapse(weight, live, key, step + k, 0.032, 7, state, by)
        return weight + towards

    def drawn(step):
        return 0.5 * random.normal(key, 2**52 + step * 2**17 + 7)

    first = after(1.0, 0, 0.4, 0.6)
    assert first == pytest.approx(1.0 + drawn(1))
    second = after(first, 2, 0.5, 0.7)  # better: it is the parent now
    assert second == pytest.approx(first + drawn(3))
    assert after(second, 4, 0.5, 0.6) == pytest.approx(first + drawn(5))  # worse: back to the parent, and another child


def test_what_a_synapse_of_the_neuron_centric_rule_does_follows_from_its_two_neurons():
    network = Network((2, 2))  # neurons: two sensors, the bias, two wheels
    p = {name: np.arange(5.0) + 10 * k for k, name in enumerate(("A", "B", "C", "D", "eta"))}
    pre, post = 1, 4  # the second sensor and the right wheel: the fourth synapse
    eta = (41 + 44) / 2
    expected = [eta * 21 * 24, eta * p["A"][pre], eta * p["B"][post], eta * 31 * 34]
    assert coefficients_of(ABCDNeuron, network, **p)[:, 3].tolist() == expected


@pytest.mark.parametrize("rule", first_of(LIVED))
def test_a_rule_agrees_with_the_oracle(rule, beside_the_oracle, genomes):
    """At a gain of 1, as walls that a robot bumps into make much of the last bit."""
    genes = initial(np.random.default_rng(130), 1, make_plan(PAPER_NETWORK, rule))[0]
    genes[:234] = genomes[0]
    if rule is Discrete:  # a table of which all is used
        genes[234:] = [0.0, 1.0, -1.0, 1.0, -1.0, 0.0, 1.0, 0.7, 0.8, 0.2, -0.6, 0.2]
    controller = Controller(name="own", rule=LIVED[rule])
    outcome, samples, robot = beside_the_oracle(genes, "right", controller=controller, seconds=100.0, gain=1.0)
    for k, weights in enumerate(robot.weights):
        first = PAPER_NETWORK.first_synapse[k]
        np.testing.assert_allclose(samples.weights[-1][first : first + weights.size], weights.ravel(), atol=1e-6)
    assert outcome.weight_change_mean > 0.1
    assert np.ptp(samples.rate) > 0 or (LIVED[rule].floor == 1 and rule is not Modulated)


# Wheel gain and initial weights


@pytest.mark.thorough
def test_initial_weights_can_be_drawn_for_each_lifetime(run_lifetime):
    genes = np.concatenate([np.full(234, 2.0), np.zeros(5 * 234)])  # nothing is learnt

    def initial_weights_for(key, initial_weights):
        controller = Controller(name="own", rule=ABCD(N=0.01, initial_weights=initial_weights))
        return run_lifetime(genes, seconds=0.032, key=key, controller=controller)[1].weights[0]

    assert (initial_weights_for(1, InitialWeights.evolved) == 2).all()
    one, again, other = (initial_weights_for(key, InitialWeights.random) for key in (1, 1, 2))
    assert np.abs(one).max() <= 0.1
    assert np.ptp(one) > 0.19
    assert (one == again).all()
    assert (one != other).any()


# What evolves


def evolvable_parameters(ga, rule, **more):
    short, controller = Lifetime(duration_s=2, gain_rad_s=4), Controller(name="own", rule=rule)
    return list(evolve_in_maze(ga, Scenario(), short, seed=2, controller=controller, **more))


def test_learners_get_the_same_noise_and_their_champion_is_confirmed(monkeypatch):
    def alike(rng, count, plan):
        return np.tile(initial(rng, 1, plan), (count, 1))

    monkeypatch.setattr(ga_module, "initial", alike)
    ga = GA(population=5, generations=1, loops=1, elites=0, start_noise=1.0)
    last = evolvable_parameters(ga, Modulated(N=0.003))[-1]
    assert np.ptp(last.fitness) == 0
    assert last.champion_fitness != last.fitness[0]  # in lifetimes that are new
    last = evolvable_parameters(ga, NoRule())[-1]
    assert np.ptp(last.fitness) > 0
    assert last.champion_fitness == last.fitness.max()


# From `evolve` to `show`


@pytest.fixture(scope="module")
def champions(tmp_path_factory):
    """A folder with evolutions with two rules; not to be changed."""
    folder = tmp_path_factory.mktemp("champions")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        done("evolve", "hebbian=modulated", "training=varied", *TINY, "hydra.run.dir=modulated")
    return folder


def test_a_champion_keeps_what_its_rule_evolved(champions, monkeypatch, tmp_path):
    monkeypatch.chdir(champions)
    genome = load_genome("modulated", "obstacles")
    assert (genome.rule, genome.plan.text()) == ("modulated", SIZES[Modulated])
    shown = done("show", "modulated").stdout
    assert "Evolved: optimizer sep_cma_es, training varied, rule modulated" in shown
    assert SIZES[Modulated] in shown
    run = str(tmp_path / "run")
    done("evaluate", "genome=modulated", "hebbian=modulated", *BRIEF, f"hydra.run.dir={run}")
    rows = pd.read_csv(f"{run}/metrics.csv")
    assert list(rows.controller.unique()) == ["GA", "modulated"]
    assert (rows.weight_change_mean[rows.controller == "modulated"] > 0).all()
    with np.load(f"{run}/traces.npz") as traces:
        assert np.ptp(traces["rate"][traces["controller"] == "modulated"]) > 0  # the modulatory neuron at work
    done("replay", run, f"--output={tmp_path / 'page.html'}")
    monkeypatch.chdir(tmp_path)
    own = [f"genome={champions / 'modulated'}", "hebbian=modulated", *BRIEF, "hydra.run.dir=again"]
    done("evaluate", *own)
    done("rerun", "again", "-q")


@pytest.mark.usefixtures("here")
def test_a_champion_keeps_the_shuffled_signs_with_which_it_evolved():
    words = ["hebbian=baldwin", "hebbian.sign=shuffled"]
    done("evolve", *words, *TINY, "optimizer.generations=1", "seed=5", "threads=1", "hydra.run.dir=evolved")
    genome, other = load_genome("evolved", ""), load_genome("reference", "light")
    controllers, left = [Controller(name="own", rule=Paper(N=0.1, sign=Sign.shuffled))], [(0, "left", 0)]
    rest = (None, genome.plan, genome.network, 1)
    (own,) = make_individuals(genome.genes, controllers, left, *rest, genome.signs)
    np.testing.assert_array_equal(own.signs, random.rng(5, random.Stream.shuffled_signs).choice([-1.0, 1.0], 234))
    (drawn,) = make_individuals(genome.genes, controllers, left, *rest, other.signs)
    assert (own.signs != drawn.signs).any()


@pytest.mark.usefixtures("here")
def test_a_rule_evolves_for_a_given_champion(champions):
    own = [f"genome={champions / 'modulated'}", "hebbian=abcd_shared", *TINY]
    done("evolve", *own, "optimizer.generations=1", "hydra.run.dir=run")
    done("evolve", "resume=run", "optimizer.generations=2", "-q")
    genome, given = load_genome("run", ""), load_genome(str(champions / "modulated"), "")
    assert (genome.rule, genome.plan.text()) == ("abcd_shared", SIZES[ABCDShared])
    np.testing.assert_array_equal(genome.weights, given.weights)
    np.testing.assert_array_equal(epuckhebb.evolve(*own[:-1]).champion, genome.genes)
    done("rerun", "run", "-q")
    refused("evolve", f"genome={champions / 'modulated'}", "hebbian=abcd_shared", "network.layers=[16,3,2]")
    for words in (["genome=nowhere", "hebbian=modulated"], ["resume=run", "genome=reference"]):
        refused("evolve", *words)
    assert f"genome: {champions / 'modulated'}" in Path("run/.hydra/config.yaml").read_text()


@pytest.mark.parametrize(
    ("words", "named"),
    [
        ("genome=modulated", "of rule modulated"),
        ("genome=modulated hebbian=abcd_shared", "has rule abcd_shared"),
        ("genome=modulated hebbian=modulated hebbian.initial_weights=random", "hebbian.initial_weights=evolved"),
        ("genome=reference hebbian=modulated", "rule modulated"),
    ],
)
def test_a_champion_of_another_rule_is_refused(words, named, champions, monkeypatch):
    monkeypatch.chdir(champions)
    assert named in refused("evaluate", *words.split(), *BRIEF)


def test_the_weights_of_a_champion_may_run_without_its_rule(champions, monkeypatch):
    monkeypatch.chdir(champions)
    genome = load_genome("modulated", "obstacles")
    alone = epuckhebb.evaluate(genome.weights, "hebbian=none", *BRIEF).metrics
    beside = epuckhebb.evaluate(genome.genes, "hebbian=modulated", *BRIEF).metrics
    measured = ["side", "path_length_m", "fitness"]
    pd.testing.assert_frame_equal(alone[measured], beside[beside.controller == "GA"][measured])
