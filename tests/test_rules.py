"""Plasticity rules from outside the program: they run, evolve, are stored, and fail with their names."""

import importlib
import pkgutil
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
import reference
from cases import evolve_in_maze

from epuckhebb.config.parts import part_class
from epuckhebb.controller.evolved import Evolved
from epuckhebb.controller.genome import make_plan
from epuckhebb.controller.network import Network, split_layers
from epuckhebb.controller.plasticity import rules
from epuckhebb.controller.plasticity.rule import Rule, coefficients
from epuckhebb.evolution.optimizer import initial
from epuckhebb.evolution.optimizers.ga import GA, next_generation
from epuckhebb.tmaze.individual import Controller
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.scenario import Scenario

SMALL = Network((16, 3, 2))


@dataclass(frozen=True, kw_only=True)
class Everything(Rule):
    """A rule with every kind of setting, state and evolved parameter."""

    synapse_state: ClassVar = {"slow": 0.5, "steps": 0.0}
    evolved: ClassVar = {
        "rate": Evolved("network", start=0.5, limit=0.75),
        "bias": Evolved("layer", start=0.1),
        "towards": Evolved("synapse", start=2.0, limit=2.0),
    }

    leak: float = 0.1

    @staticmethod
    def synapse(bias, weight, pre, by, towards, synapse_state, post, rate):
        synapse_state.slow += by.leak * (pre * post - synapse_state.slow)
        synapse_state.steps += 1.0
        return rate * (synapse_state.slow + bias) + 0.01 * (towards - weight) / synapse_state.steps


CONTROLLER = Controller(name="own", rule=Everything(N=0.01, leak=0.2))
PLAN = make_plan(SMALL, Everything)


class Oracle(reference.Robot):
    """The same rule once more."""

    def initialise(self):
        super().initialise()
        first = sum(g.size for g in self.genes)
        self.rate, self.bias = self.all_genes[first], self.all_genes[first + 1 :][: len(self.shapes)]
        self.towards = self.split_layers(self.all_genes[first + 1 + len(self.shapes) :])
        self.slow, self.steps = [np.full(shape, 0.5) for shape in self.shapes], [0.0 for _ in self.shapes]

    def everything(self, layer, pre, post, synapse_state):
        self.slow[layer] += self.rule.leak * (pre * post - self.slow[layer])
        self.steps[layer] += 1
        pull = 0.01 * (self.towards[layer] - self.weights[layer]) / self.steps[layer]
        return self.rate * (self.slow[layer] + self.bias[layer]) + pull


def test_a_rule_with_all_parts_agrees_with_the_oracle(run_lifetime):
    genes = initial(np.random.default_rng(130), 1, PLAN)[0]
    outcome, samples = run_lifetime(genes, controller=CONTROLLER, network=SMALL, gain_rad_s=4, seconds=60, key=9)
    Oracle.all_genes = genes
    oracle = Oracle(genes, Scenario(), "left", CONTROLLER, network=SMALL, gain=4, key=9)
    expected, steps = reference.live(oracle, len(samples.time))
    np.testing.assert_allclose(samples.pose, [s[:3] for s in steps], rtol=0, atol=1e-9)
    np.testing.assert_allclose(samples.weight_change, [s[9] for s in steps], rtol=1e-8, atol=1e-12)
    np.testing.assert_allclose(outcome[: len(expected)], expected, rtol=1e-8, atol=1e-9)
    assert outcome.weight_change_mean > 0.01


@pytest.mark.parametrize(
    ("name", "start", "limit", "others"),
    [
        *((f"abcd{kind}", 1.0, 2.0, {}) for kind in ("", "_neuron", "_shared", "_traces")),
        ("baldwin_n", 1.0, 1.5, {}),
        ("modulated", 0.5, 2.0, {}),
        ("discrete", 1.0, 1.0, {"eta": (1.0, 2.0), "threshold": (0.5, 1.0)}),
    ],
)
def test_evolved_parameters_of_the_programs_rules_start_and_end_where_they_should(name, start, limit, others):
    rule = part_class("rule", name, "hebbian")
    for parameter, evolved in [*rule.evolved.items(), *rule.with_reward.items()]:
        assert (evolved.start, evolved.limit) == others.get(parameter, (start, limit)), parameter


@pytest.mark.parametrize("name", [module.name for module in pkgutil.iter_modules(rules.__path__)])
def test_defaults_of_the_programs_rules_in_python_may_be_given(name):
    made = [
        kind()  # which refuses a value out of its range
        for kind in vars(importlib.import_module(f"{rules.__name__}.{name}")).values()
        if isinstance(kind, type) and issubclass(kind, Rule) and kind.__module__.endswith(f".{name}")
    ]
    assert made


def test_evolved_parameters_are_parts_of_the_genome():
    assert PLAN.text() == "57 weights, 1 rate, 2 bias, 57 towards"
    assert PLAN.genes == 57 + 1 + 2 + 57
    population = initial(np.random.default_rng(0), 400, PLAN)
    parts = PLAN.split(population)
    for name, start in (("weights", 1.0), ("rate", 0.5), ("bias", 0.1), ("towards", 2.0)):
        assert 0.95 * start < parts[name].max() <= start
        assert -start <= parts[name].min() < -0.95 * start
    ga = GA(population=400, mutation_rate=0.5, mutation_range=3.0, gene_limit=1.25)
    later = PLAN.split(next_generation(np.random.default_rng(1), population, np.arange(400.0), ga, PLAN))
    for name, limit in (("weights", 1.25), ("rate", 0.75), ("bias", 1.0), ("towards", 2.0)):
        assert (later[name].min(), later[name].max()) == (-limit, limit)  # mutated, as far as the limits
    with pytest.raises(ValueError, match="57 weights, 1 rate, 2 bias, 57 towards has 117 genes, got 57"):
        PLAN.split(np.zeros(57))


def test_evolved_parameters_are_spread_over_the_synapses():
    genes = np.arange(float(PLAN.genes))
    rate, bias, towards = coefficients(Everything, SMALL, PLAN.split(genes))
    assert set(rate) == {57.0}
    assert [set(layer.ravel()) for layer in split_layers(SMALL, bias)] == [{58.0}, {59.0}]
    np.testing.assert_array_equal(towards, genes[60:])


def test_a_rule_with_parameters_evolves():
    ga, short = GA(population=4, generations=3, elites=1, loops=1), Lifetime(duration_s=6, gain_rad_s=4)
    whole = list(evolve_in_maze(ga, Scenario(), short, seed=2, network=SMALL, controller=CONTROLLER))
    again = list(
        evolve_in_maze(ga, Scenario(), short, seed=2, threads=2, after=whole[0], network=SMALL, controller=CONTROLLER)
    )
    assert whole[-1].champion.shape == (PLAN.genes,)
    for one, other in zip(whole[1:], again, strict=True):
        assert one.log[-1].digest == other.log[-1].digest
        assert one.fitness.tobytes() == other.fitness.tobytes()
