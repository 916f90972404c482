"""A fitness of the user's own: evolved, resumed, evaluated, replayed and rerun; it scales plasticity; bad ones."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cases import SHORT, SMALL_GA, check_resumed, done, refused, refused_before, runs_of

import epuckhebb
from epuckhebb import Fitness, Lifetime
from epuckhebb.adaptation.adaptation import Parts
from epuckhebb.adaptation.controller import Controller
from epuckhebb.config import plugins
from epuckhebb.controller.network import PAPER_NETWORK, Network
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.store.genome import load_genome
from epuckhebb.store.run import Run
from epuckhebb.tmaze.batch import run_lifetimes
from epuckhebb.tmaze.fitness import Signal
from epuckhebb.tmaze.lifetime_kernel import kernel_of
from epuckhebb.tmaze.light import Lamp
from epuckhebb.tmaze.outcome import OutcomeOfTrials
from epuckhebb.tmaze.own_fitness import PAPER_FITNESS
from epuckhebb.tmaze.robot import EPUCK, STEP_S
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.session import Individual, Session
from epuckhebb.tmaze.tasks.reversal import Reversal

EXAMPLE = Path(__file__).parents[1] / "examples" / "own_fitness" / "my_fitness.py"
OWN = "fitness.function=my_fitness.py:Explorer"


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    own = [OWN, "fitness.goal=2"]
    return runs_of(
        tmp_path_factory.mktemp("fitness"),
        EXAMPLE.parent,
        ["evolve", *own, *SMALL_GA, "ga.generations=2", "hydra.run.dir=evolved"],
        ["evaluate", "genome=evolved", *own, "hebbian.signal=fitness", *SHORT, "hydra.run.dir=evaluated"],
    )


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


@pytest.mark.thorough
def test_an_evolution_by_it_is_resumed_to_the_same_champion(copy):
    check_resumed([OWN, "fitness.goal=2", *SMALL_GA], ("ga.generations=1", "ga.generations=2"))
    (copy / "my_fitness.py").write_text(EXAMPLE.read_text() + "\n# another\n")
    assert "my_fitness.py, or a file that it imports, is not" in refused("evolve", "resume=again", "ga.generations=3")


def test_runs_by_it_are_shown_replayed_and_rerun_without_the_file(copy):
    (copy / "my_fitness.py").unlink()
    assert "for fitness Explorer" in done("show", "evolved").stdout
    assert "fitness=Explorer, fitness.goal=2" in done("show", "evaluated").stdout.replace("\n", " ")
    done("replay", "evaluated")
    assert "cannot be taken to Webots" in refused("export", "evaluated", "--webots", "-o", "c")
    for run in ("evaluated", "evolved"):
        assert "bit-identical" in done("rerun", run).stdout


def test_the_champion_names_it_and_a_run_has_its_values(runs):
    assert load_genome(str(runs / "evolved"), "obstacles").fitness_function == "Explorer"
    rows = Run(runs / "evaluated").table("metrics.csv")
    assert set(rows.changed) == {"fitness=Explorer, fitness.goal=2, lifetime.duration_s=2"}
    (file,) = Run(runs / "evaluated").provenance["own_code"]
    assert file.endswith("my_fitness.py")
    settings = (runs / "evaluated" / ".hydra" / "config.yaml").read_text()
    assert "contact_cost: 0.5" in settings  # what the user left as it is in the class


@pytest.mark.usefixtures("copy")
@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["genome=evolved"], "evolved for fitness Explorer; the fitness shown here is paper"),
        (["genome=evolved", OWN], ""),
        ([OWN], "evolved for fitness paper; the fitness shown here is Explorer"),
    ],
)
def test_a_mismatch_between_training_and_evaluation_is_said(words, text):
    said = done("evaluate", *words, *SHORT, "lifetime.record_every=0", "hydra.run.dir=out").stdout
    assert text in " ".join(said.split())
    assert ("evolved for fitness" in " ".join(said.split())) == bool(text)


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
    parts = (Paper, Parts(), PAPER_NETWORK, EPUCK)
    assert kernel_of(*parts, fitness=Judged()) is kernel_of(*parts)


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
    with pytest.raises(ValueError, match="its fitness may not: got paper for Explorer"):
        session.change(Scenario())


BAD = """\
from dataclasses import dataclass
from typing import ClassVar
import random
from epuckhebb import Fitness

class NotOne: pass
class Nothing(Fitness): pass
class Curious(Fitness):
    step = staticmethod(lambda weather: weather)
class Greedy(Fitness):
    life = staticmethod(lambda mean: mean)
class Forgetful(Fitness):
    state: ClassVar = {"seen": 0.0}
    @staticmethod
    def step(state):
        return state.sen
class Lucky(Fitness):
    step = staticmethod(lambda left: left * random.random())
class Bare(Fitness):
    goal: float = 1.0
    step = staticmethod(lambda left: left)
class Muddled(Fitness):
    @staticmethod
    def step(left):
        return left.times(2)
class Infinite(Fitness):
    step = staticmethod(lambda left: 1.0 / 0.0 if left < 2 else left)
class Failing(Fitness):
    life = staticmethod(lambda success: [][1])
class Wordy(Fitness):
    life = staticmethod(lambda success: "good")
class Undefined(Fitness):
    life = staticmethod(lambda time_to_goal: time_to_goal)
@dataclass(frozen=True, kw_only=True)
class Fine(Fitness):
    goal: float = 1.0
    step = staticmethod(lambda left: left)
"""


@pytest.mark.usefixtures("here")
@pytest.mark.parametrize(
    ("words", "texts"),
    [
        (["fitness=papr"], ["fitness", "paper"]),
        (["fitness.function=explorer"], ["fitness.function", "paper", "FILE.py:NAME"]),
        (["fitness.function=nowhere.py:Fine"], ["fitness.function=", "nowhere.py:Fine: there is no file"]),
        (["fitness.function=bad.py:Fin"], ["has no fitness Fin", "Did you mean Fine?"]),
        (["fitness.function=bad.py:NotOne"], ["has no fitness NotOne", "subclass of epuckhebb.Fitness"]),
        (["fitness.function=bad.py:Nothing"], ["Nothing has no static method `step`"]),
        (["fitness.function=bad.py:Curious"], ["unknown arguments weather", "goal_distance"]),
        (["fitness.function=bad.py:Greedy"], ["unknown arguments mean"]),
        (["fitness.function=bad.py:Forgetful"], ["`state` has no sen; it has seen"]),
        (["fitness.function=bad.py:Lucky"], ["draws from random"]),
        (["fitness.function=bad.py:Bare"], ["goal is not a setting; write @dataclass"]),
        (["fitness.function=bad.py:Muddled"], ["fitness Muddled of", "does not compile", "times"]),
        pytest.param(
            ["fitness.function=bad.py:Infinite"],
            ["fitness Infinite: `step` gave infinite or nan"],
            marks=pytest.mark.thorough,  # it compiles
        ),
        (["fitness.function=bad.py:Failing"], ["fitness Failing: `life` failed: IndexError"]),
        (["fitness.function=bad.py:Wordy"], ["fitness Wordy: `life` must return a finite number", "'good'"]),
        (["fitness.function=bad.py:Undefined"], ["fitness Undefined: `life` must return a finite number", "nan"]),
        (["fitness.function=bad.py:Fine", "fitness.gaol=1"], ["fitness.gaol is no key of", "Did you mean goal?"]),
        (["fitness.function=bad.py:Fine", "fitness.goal=far"], ["fitness.goal must be a finite number"]),
        (["fitness.goal=1"], ["fitness.goal", "fitness paper"]),
        (["hebbian.signal=fitness"], ["hebbian.signal=fitness needs a fitness with a method `step`"]),
        (
            ["fitness.function=bad.py:Fine", "hebbian.signal=fitness", "adaptation=shortfall", "hebbian=paper"],
            ["hebbian.signal=fitness does not go with adaptation=shortfall", "nominal statistics"],
        ),
    ],
)
def test_what_cannot_be_a_fitness_is_refused_before_anything_runs(words, texts):
    Path("bad.py").write_text(BAD)
    refused_before("out", ["evaluate", *words, *SHORT, "hydra.run.dir=out"], texts)


def test_an_object_from_python_is_refused_with_the_way_to_name_it():
    with pytest.raises(ValueError, match=r"fitness=\{'function': 'FILE.py:Explorer'\}"):
        epuckhebb.evaluate(fitness=explorer()())
