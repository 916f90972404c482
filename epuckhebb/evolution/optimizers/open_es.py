"""An evolution strategy with antithetic pairs: the mean moves towards the fitter half of a cloud of genomes.

    theta_i = theta + sigma e_i and theta - sigma e_i    e_i ~ N(0, 1): a pair
    theta   = theta + alpha / (n sigma) sum_i u_i e_i    u_i: rank of the fitness among all n, from -.5 to .5

Individuals of equal fitness share the mean of their ranks, so a pair that is equal moves nothing. alpha is
`learning_rate` times `learning_rate_decay` to the power of the generations so far.

Source: Salimans, Ho, Chen, Sidor & Sutskever, Evolution strategies as a scalable alternative to reinforcement learning,
2017, with the constants of Najarro & Risi, NeurIPS 2020. Theirs has a population of 200 and 300 generations; here the
population is smaller, and the robot-steps are those of every optimizer.

Evolve and merge: if every synapse has its own rule, the rules are clustered from time to time into half as many
(k-means), and the synapses of a cluster get its centre as their rule. Source: Pedersen & Risi, Evolving and merging
Hebbian learning rules, GECCO 2021; five merges leave one rule of 32, as theirs did.
"""

import warnings
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from epuckhebb.controller import random
from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.genome import GenomePlan
from epuckhebb.controller.random import Stream
from epuckhebb.controller.ranges import within
from epuckhebb.evolution.optimizer import EvolutionStrategy, ties


@dataclass(kw_only=True)
class OpenEs(EvolutionStrategy):
    """An evolution strategy with antithetic pairs.

    learning_rate: alpha. learning_rate_decay: factor on it after each generation. merges: how often the rules of
    synapses are merged into half as many, each time after `merge_every` generations. The other settings are
    those of `EvolutionStrategy`; population is even, and sigma is constant. `_rule_of`: for each synapse the
    first that has the same rule.
    """

    population: int = within(2, default=40)
    sigma: float = within(0, above=True, default=0.1)
    learning_rate: float = within(0, above=True, default=0.2)
    learning_rate_decay: float = within(0, 1, above=True, default=0.995)
    merges: int = within(0, default=0)
    merge_every: int = within(1, default=10)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.population % 2:
            raise ValueError(f"optimizer.population must be even, as individuals come in pairs, got {self.population}")

    def check(self, plan: GenomePlan) -> None:
        """Check that each synapse has a rule, if rules are to be merged; else a ValueError."""
        if self.merges:
            _rules(plan)

    def start(self, plan: GenomePlan, seed: int) -> None:
        """Begin a search for the genes of a plan."""
        super().start(plan, seed)
        self._rules = _rules(plan) if self.merges else np.empty((0, 0), np.int64)
        self._rule_of = np.arange(self._rules.shape[1])

    def _sample(self, rng: np.random.Generator) -> Floats:
        """Pairs on both sides of the mean."""
        noise = rng.standard_normal((self.population // 2, self._plan.genes))
        noise[:, self._rules] = noise[:, self._rules[:, self._rule_of]]
        self._noise = np.concatenate([noise, -noise])
        population: Floats = np.clip(self._mean + self.sigma * self._noise, -self._bound, self._bound)
        return population

    def _move(self, fitness: Floats) -> Floats:
        """Move the mean by ranks, and merge rules when it is time."""
        order = np.argsort(-fitness, kind="stable")
        rate = self.learning_rate * self.learning_rate_decay ** (self._generations - 1)
        first, last = ties(-fitness[order])
        ranks = np.linspace(0.5, -0.5, len(order))
        ranks = (ranks[first] + ranks[last]) / 2.0
        towards = (ranks[:, None] * self._noise[order]).sum(axis=0)  # genes that are alike stay bit-identical
        mean: Floats = np.clip(self._mean + rate / (len(order) * self.sigma) * towards, -self._bound, self._bound)
        if self._generations % self.merge_every == 0 and self._generations <= self.merges * self.merge_every:
            self._merge(mean)
        return mean

    def _merge(self, mean: Floats) -> None:
        """Cluster the rules into half as many; the synapses of a cluster then have its centre as their rule."""
        from scipy.cluster.vq import kmeans2

        firsts, number = np.unique(self._rule_of, return_inverse=True)
        rules = mean[self._rules[:, firsts]].T
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a cluster may be empty
            centres, cluster = kmeans2(
                rules, -(-len(rules) // 2), minit="++", rng=random.rng(self._seed, Stream.merging, self._generations)
            )
        mean[self._rules] = centres[cluster[number]].T
        _, first, cluster_of = np.unique(cluster[number], return_index=True, return_inverse=True)
        self._rule_of = first[cluster_of]


def _rules(plan: GenomePlan) -> NDArray[np.int64]:
    """Where the genes of the synapses' rules stand, (parameters, synapses)."""
    parts = plan.rule_parts.parts
    sizes = {part.size for part in parts}
    if len(sizes) != 1 or sizes == {1}:
        raise ValueError(f"optimizer.merges needs parameters per synapse, as hebbian=abcd has, got {plan.text()}")
    places = plan.split(np.arange(float(plan.genes)))
    return np.array([places[part.name] for part in parts], np.int64)
