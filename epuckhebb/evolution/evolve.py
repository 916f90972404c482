"""The generation loop: the optimizer proposes genomes, lifetimes give their fitness.

`evolve` yields after each generation all that is needed to resume. A resumed evolution is bit-identical to one that was
never stopped.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, product
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np

from epuckhebb.controller import random
from epuckhebb.controller.arrays import Floats
from epuckhebb.controller.genome import GenomePlan, make_plan
from epuckhebb.controller.network import Network
from epuckhebb.controller.own_class import class_name
from epuckhebb.controller.plasticity.control import signs
from epuckhebb.controller.plasticity.rule import NO_RULE, InitialWeights, NoRule, Rule
from epuckhebb.controller.random import Stream
from epuckhebb.evolution.optimizer import CANDIDATES, CONFIRM, Algorithm
from epuckhebb.evolution.search import LEARNT, Results, Search
from epuckhebb.evolution.training import Training, World
from epuckhebb.tmaze.batch import run_lifetimes
from epuckhebb.tmaze.individual import GA_ALONE, Controller, Individual
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.maze import SIDES, Pose
from epuckhebb.tmaze.scenario import Scenario

if TYPE_CHECKING:
    import pandas as pd

_START_SPREAD = np.array([0.005, 0.010, 0.1])  # m, m, rad at a start noise of 1
MOMENTS = "moments"  # among the measures: for the next generation, and for no optimizer
_NEVER = 1_000_000  # generations; more than any evolution has
_TRIALS = tuple(reversed(SIDES))  # lamp on (right) first, as in the published program


@dataclass(frozen=True, kw_only=True)
class Generation:
    """One generation, and what is needed to resume after it.

    number: from 0. fitness: (individuals,). success: (individuals,) share of each one's lifetimes that ended at the
    goal. champion: (genes,) the fittest; after the last generation, the best of the optimizer's candidates.
    champion_fitness: by which it was chosen. remeasured: fitness of the fittest in fresh lifetimes, with plasticity and
    without; None if it was not measured. log: all results so far, for the optimizer. tables: what it has to show, by
    name. robot_steps: cost. moments: of what was read in training before this generation, by which it reads, and up to
    its end, (2, 3, readings); None if nothing is kept of it.
    """

    number: int
    fitness: Floats
    success: Floats
    champion: Floats
    champion_fitness: float
    log: tuple[Results, ...]
    tables: dict[str, "pd.DataFrame"]
    robot_steps: int
    remeasured: tuple[float, float] | None = None
    moments: Floats | None = None


class Evaluator(Protocol):
    """What runs the lifetimes of a population."""

    @property
    def lifetimes(self) -> int:
        """How many lifetimes each individual runs in a generation."""

    def evaluate(
        self, population: Floats, generation: int, measures: Sequence[str] = (), moments: Floats | None = None
    ) -> tuple[Floats, Floats, dict[str, Floats], int]:
        """Mean fitness and success of each individual, measures by name, and the steps that were run.

        moments: of what was read in the generations before, (3, readings); None in the first one. Those of a
        `Generation` are then among the measures, as `MOMENTS`.
        """

    def remeasure(self, genes: Floats, generation: int) -> tuple[float, float] | None:  # noqa: ARG002  # the maze needs them
        """Fitness of an individual in fresh lifetimes, with plasticity and without; None if not asked for."""
        return None


def evolve(
    optimizer: Algorithm,
    evaluator: Evaluator,
    generations: int,
    seed: int,
    last: Generation | None = None,
    *,
    network: Network,
    rule: Rule = NO_RULE,
    network_genes: Floats | None = None,
    start: Floats | None = None,
) -> Iterator[Generation]:
    """Evolve controllers in any world; yields one record a generation.

    evaluator: runs the lifetimes. last: the last record of an unfinished evolution with the same arguments, to resume.
    rule: with one, individuals learn during evolution, and evolved parameters of the rule are part of the genome. Then
    all individuals of a generation have the same starts and noise, and the champion is the best of three in fresh
    lifetimes, with any optimizer. network_genes: those of a champion's network, if only the rule is evolved. start: the
    evolved genes with which evolution begins; None for random ones.

    Raises:
        PartError: the optimizer failed, or asked for what is no genome.
        LostRobotError: a pose or a weight stopped being finite.
    """
    learns = not isinstance(rule, NoRule)
    plan = evolved_plan(network, rule, has_network=network_genes is not None)
    search = Search(optimizer, plan, seed, () if last is None else last.log, start)

    def whole(genes: Floats) -> Floats:
        return complete_genomes(genes, network, rule, network_genes)

    moments = None if last is None else last.moments
    for number in range(0 if last is None else last.number + 1, generations):
        population = whole(search.ask())
        past = None if moments is None else moments[1]
        fitness, success, measures, robot_steps = evaluator.evaluate(population, number, search.measures, past)
        moments = measures.pop(MOMENTS, None)
        search.tell(fitness, measures)
        best = int(np.argmax(fitness))
        champion, champion_fitness = population[best], float(fitness[best])
        remeasured = evaluator.remeasure(champion, number)
        candidates = whole(search.candidates())
        if learns and not optimizer.confirm:
            candidates = population[np.argsort(-fitness, kind="stable")[:CANDIDATES]]
        if number == generations - 1 and (optimizer.confirm or len(candidates) > 1):
            # Generation numbers after the last give fresh noise. These steps are in no row of the history: a row must
            # not depend on whether it is the last.
            rounds = confirmation(optimizer, rule, evaluator.lifetimes) // evaluator.lifetimes
            fresh = [evaluator.evaluate(candidates, generations + k, (), past)[0] for k in range(rounds)]
            confirmed = np.mean(fresh, axis=0)
            champion, champion_fitness = candidates[np.argmax(confirmed)], float(confirmed.max())
        yield Generation(
            number=number,
            fitness=fitness,
            success=success,
            champion=champion.copy(),
            champion_fitness=champion_fitness,
            log=search.log,
            tables=search.tables(),
            robot_steps=robot_steps,
            remeasured=remeasured,
            moments=moments,
        )


def confirmation(optimizer: Algorithm, rule: Rule, lifetimes: int) -> int:
    """How many fresh lifetimes each candidate for the champion runs at the end: whole rounds of so many lifetimes."""
    least = optimizer.confirm if isinstance(rule, NoRule) else max(optimizer.confirm, CONFIRM)
    return -(-least // lifetimes) * lifetimes


def complete_genomes(evolved: Floats, network: Network, rule: Rule, network_genes: Floats | None) -> Floats:
    """Genomes of their evolved parts, (genomes, genes), and of the weights that are given, or begin at random."""
    if network_genes is None:
        if rule.initial_weights is not InitialWeights.random:
            return evolved
        network_genes = np.zeros(network.synapses)
    return np.hstack([np.tile(network_genes, (len(evolved), 1)), evolved])


def evolved_plan(network: Network, rule: Rule, *, has_network: bool = False) -> GenomePlan:
    """The parts of the genome that are evolved: all, or those of the rule if the network is given or begins random."""
    plan = make_plan(network, type(rule))
    if not has_network and rule.initial_weights is InitialWeights.evolved:
        return plan
    evolved = plan.rule_parts if has_network else GenomePlan(plan.parts[1:])
    if not evolved.parts:
        why = "the weights are given" if has_network else "the initial weights are random"
        has = "there is no rule" if isinstance(rule, NoRule) else f"rule {class_name(type(rule))} has nothing to evolve"
        raise ValueError(f"nothing would be evolved: {why}, and {has}; choose another rule, as hebbian=modulated")
    return evolved


def training_signs(rule: Rule, network: Network, seed: int) -> Floats:
    """The signs of updates in an evolution, (synapses,); shuffled ones are the same for all individuals."""
    return signs(rule.sign, network.synapses, random.rng(seed, Stream.shuffled_signs))


class MazeEvaluator(NamedTuple):
    """Runs the lifetimes of individuals in the maze, on both sides, and measures their fitness.

    origin: the training world of the experiment, if training comes back to it.
    """

    optimizer: Algorithm
    scenario: Scenario
    lifetime: Lifetime
    training: Training
    seed: int
    network: Network
    controller: Controller
    threads: int
    origin: Scenario | None = None

    @property
    def loops(self) -> int:
        """How many lifetimes each individual runs on either side in a generation."""
        return self.optimizer.schedule(self.training, self.lifetime).loops

    @property
    def shared(self) -> bool:
        """Whether all individuals have the same starts and noise."""
        return self.optimizer.common_random_numbers or not isinstance(self.controller.rule, NoRule)

    @property
    def lifetimes(self) -> int:
        """How many lifetimes each individual runs in a generation."""
        return self.loops * len(_TRIALS)

    def evaluate(
        self,
        population: Floats,
        generation: int,
        measures: Sequence[str] = (),
        moments: Floats | None = None,  # noqa: ARG002  # environments have some
    ) -> tuple[Floats, Floats, dict[str, Floats], int]:
        """Mean fitness and success over each individual's lifetimes, (individuals,) each; measures; the robot-steps.

        measures: fields of an outcome. Their values have the shape (individuals, loops, sides).
        """
        worlds = self.training.worlds(self.scenario, self.lifetime, self.loops, self.seed, generation, self.origin)
        names = ("success", *measures)
        results = np.empty((1 + len(names), len(population), self.loops, len(_TRIALS)))
        robot_steps, learnt = 0, np.zeros((len(population), self.network.synapses))
        for world, together in groupby(range(self.loops), key=worlds.__getitem__):
            loops = list(together)
            individuals = list(self._individuals(population, generation, loops, world))
            length = world.lifetime
            if self.training.lamarckian:
                length = replace(length, record_every=max(1, length.steps - 1))  # the first step and the last
            lifetimes = run_lifetimes(individuals, world.scenario, length, self.threads)
            if self.training.lamarckian:
                last = np.array([samples.weights[-1] for _, samples in lifetimes], np.float64)
                learnt += last.reshape(len(population), -1, self.network.synapses).sum(axis=1)
            outcomes = [outcome for outcome, _ in lifetimes]
            bonus = self.training.success_bonus
            rows = [
                (life.fitness + bonus * life.success, *(getattr(life, name) for name in names)) for life in outcomes
            ]
            results[:, :, loops] = np.array(rows).T.reshape(-1, len(population), len(loops), len(_TRIALS))
            robot_steps += sum(outcome.steps for outcome in outcomes)
        fitness, success = results[:2].reshape(2, len(population), -1).mean(axis=2)
        measured = dict(zip(measures, results[2:], strict=True))
        if self.training.lamarckian:
            measured[LEARNT] = learnt / (self.loops * len(_TRIALS))
        return fitness, success, measured, robot_steps

    def remeasure(self, genes: Floats, generation: int) -> tuple[float, float] | None:
        """Fitness in fresh lifetimes, with plasticity and without; None if not asked for.

        They are fresh, since in those of its generation the fittest was lucky.
        """
        if not self.training.rule_off:
            return None
        plan = make_plan(self.network, type(self.controller.rule))
        evaluator = self._replace(training=replace(self.training, lamarckian=False))
        pairs = (evaluator, genes), (evaluator._replace(controller=GA_ALONE), plan.pick(genes, plan.network_parts))
        fresh = generation + 2 * (self.training.season or 1) * _NEVER  # is in the same season
        with_rule, without = (float(measure.evaluate(some[None], fresh)[0][0]) for measure, some in pairs)
        return with_rule, without

    def _individuals(self, population: Floats, generation: int, loops: list[int], world: World) -> Iterator[Individual]:
        """The individuals of these loops of a generation, which share one world: each genome, on either side."""
        of_updates = training_signs(self.controller.rule, self.network, self.seed)
        noise = max(self.optimizer.start_noise, world.start_noise)
        task_keys = {loop: int(random.key(self.seed, Stream.training_task, generation, loop)) for loop in loops}
        lifetimes = list(product(range(len(population)), loops, _TRIALS))
        places = [(generation, 0 if self.shared else who, loop, SIDES.index(side)) for who, loop, side in lifetimes]
        keys = random.keys(self.seed, Stream.training_noise, places)
        for (who, loop, side), path, key in zip(lifetimes, places, keys, strict=True):
            start = world.scenario.maze.start
            if noise:
                moved = random.rng(self.seed, Stream.training_start, *path).uniform(-1, 1, 3)
                start = Pose(*(np.array(start) + noise * _START_SPREAD * moved).tolist())
            yield Individual(
                genes=population[who],
                network=self.network,
                side=side,
                controller=self.controller,
                signs=of_updates,
                key=key,
                task_key=task_keys[loop],
                start=start,
                record=self.training.lamarckian,
            )


def history_row(generation: Generation) -> dict[str, Any]:
    """The row of `history.csv` for a generation."""
    best = int(np.argmax(generation.fitness))
    successes = {"best_success": generation.success[best], "mean_success": generation.success.mean()}
    return {
        "generation": generation.number,
        "best_fitness": generation.fitness.max(),
        "mean_fitness": generation.fitness.mean(),
        "worst_fitness": generation.fitness.min(),
        **({} if np.isnan(generation.success).any() else successes),  # an environment knows no success
        "robot_steps": generation.robot_steps,
    } | dict(zip(("best_fitness_again", "best_fitness_rule_off"), generation.remeasured or (), strict=False))
