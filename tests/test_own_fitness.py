"""A fitness of the user's own: evolved, resumed, evaluated, replayed and rerun; it scales plasticity; bad ones."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cases import SHORT, done

from epuckhebb import Fitness, Lifetime
from epuckhebb.config import plugins
from epuckhebb.controller.network import PAPER_NETWORK, Network
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.tmaze.batch import run_lifetimes
from epuckhebb.tmaze.fitness import Signal
from epuckhebb.tmaze.individual import Controller, Individual, NoAdaptation
from epuckhebb.tmaze.light import Lamp
from epuckhebb.tmaze.outcome import OutcomeOfTrials
from epuckhebb.tmaze.own_fitness import PAPER_FITNESS
from epuckhebb.tmaze.robot import STEP_S
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.session import Session
from epuckhebb.tmaze.simulator import lifetime_kernel
from epuckhebb.tmaze.tasks.reversal import Reversal

EXAMPLE = Path(__file__).parents[1] / "examples" / "own_fitness" / "my_fitness.py"


@pytest.mark.thorough
def test_in_tables_over_many_runs_the_measure_has_a_column_of_its_own(here):
    words = ["fitness=paper", "scenario=base", *SHORT]
    done("sweep", "obstacles", *words, "hydra/launcher=basic", "hydra.sweep.dir=swept")
    done("evaluate", "-m", *words, "hydra.sweep.dir=many")
    for table in ("swept/sweep.csv", "swept/summary.csv", "many/summary.csv"):
        rows = pd.read_csv(here / table)
        assert set(rows.fitness_function) == {"paper"}
        assert rows.fitness.between(0, 1).all()


def explorer():
    return plugins.class_named(f"{EXAMPLE}:Explorer", Fitness, "fitness.function")


def lived_by(fitness, genes, signal, seconds=20, **more):
    individual = Individual(
        genes=genes,
        side="left",
        controller=Controller(name="x", rule=Paper(N=0.002, signal=signal)),
        key=np.uint64(3),
        record=True,
    )
    return run_lifetimes(
        [individual], Scenario(fitness=fitness, **more), Lifetime(duration_s=seconds, gain_rad_s=4, record_every=1)
    )[0]


def test_every_step_and_the_lifetime_are_as_plain_python_has_them(genomes):
    fitness = explorer()(goal=2.0)
    outcome, samples = lived_by(fitness, genomes[0], Signal.fitness)
    state, by, values = type("State", (), {"seen": np.zeros(25)}), fitness, []
    for pose, motors, sensors in zip(samples.pose, samples.motors, samples.sensors, strict=True):
        x, y, _ = pose
        values.append(fitness.step(*motors, sensors[8:].max() > 0.8, x, y, state, by))
    assert samples.fitness.tolist() == values
    assert len(set(values)) > 100
    np.testing.assert_array_equal(samples.rate, 0.002 * np.maximum(0.2, values))
    assert outcome.fitness == sum(values) / len(values) + state.seen.mean() + 2.0 * outcome.success
    assert state.seen.sum() > 1


def test_scoring_alone_changes_nothing_in_a_lifetime(genomes):
    outcome, samples = lived_by(explorer()(goal=2.0), genomes[0], Signal.behaviour)
    usual, of_usual = lived_by(PAPER_FITNESS, genomes[0], Signal.behaviour)
    for mine, its in zip(samples, of_usual, strict=True):
        np.testing.assert_array_equal(mine, its)
    assert outcome.fitness != usual.fitness
    np.testing.assert_array_equal(outcome._replace(fitness=usual.fitness), usual)


@dataclass(frozen=True, kw_only=True)
class Judged(Fitness):
    """Only a lifetime has a value."""

    @staticmethod
    def life(paper, path_length, x, y, trials):
        return paper + path_length + math.hypot(x, y) + len(trials)


def test_a_fitness_of_a_lifetime_alone_needs_no_kernel_of_its_own(genomes):
    session = Session(
        Individual(genes=genomes[0], side="left", key=np.uint64(3)), Scenario(fitness=Judged()), Lifetime(duration_s=5)
    )
    session.step(1000)
    usual, _ = run_lifetimes([session.individual], Scenario(), session.lifetime)[0]
    x, y, _ = session.pose
    assert session.outcome().fitness == usual.fitness + usual.path_length + math.hypot(x, y)
    one, other = (
        lifetime_kernel(Paper, NoAdaptation(), PAPER_NETWORK, Scenario(fitness=own)) for own in (Judged(), Fitness())
    )
    assert one is other


@pytest.mark.thorough
def test_a_lifetime_of_many_trials_keeps_them():
    task = Reversal(trials=2, last_switch=2, time_out_s=0.5)
    world = Scenario(task=task, lamp=Lamp(intensity=0.0), fitness=Judged())
    network = Network((17, 2), True)
    individual = Individual(genes=np.zeros(network.synapses), side="left", key=np.uint64(1), network=network)
    outcome, _ = run_lifetimes([individual], world, Lifetime(duration_s=3))[0]
    assert isinstance(outcome, OutcomeOfTrials)
    assert len(outcome.trials) == 2 < outcome.fitness


def test_a_lifetime_in_pieces_is_the_same(genomes):
    individual = Individual(genes=genomes[0], side="right", key=np.uint64(3))
    world, lifetime = Scenario(fitness=explorer()(goal=2.0)), Lifetime(duration_s=4, gain_rad_s=4)
    session = Session(individual, world, lifetime)
    while session.step(7):
        pass
    assert session.steps * STEP_S == pytest.approx(4)
    np.testing.assert_array_equal(session.outcome(), run_lifetimes([individual], world, lifetime)[0][0])
    with pytest.raises(ValueError, match=r"fitness may not change .*: got paper for Explorer"):
        session.change(Scenario())
