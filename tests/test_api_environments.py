"""Environments from Python: keys and numbers of the command line, and classes, functions and rules as objects."""

import functools
import importlib.util
from contextlib import chdir
from dataclasses import dataclass, replace
from pathlib import Path

import gymnasium
import numpy as np
import pandas as pd
import pytest
from cases import done

import epuckhebb
from epuckhebb import api
from epuckhebb.config import load_any
from epuckhebb.controller.plasticity.control import Control
from epuckhebb.controller.plasticity.rule import Normalise
from epuckhebb.controller.plasticity.rules.abcd import ABCD
from epuckhebb.controller.plasticity.rules.oja import Oja
from epuckhebb.runs import make_genome, prepare_evaluation
from epuckhebb.store import load_genome

EXAMPLE = Path(__file__).parents[1] / "examples" / "any_world" / "thermostat.py"
spec = importlib.util.spec_from_file_location("thermostat_of_test", EXAMPLE)
thermostat = importlib.util.module_from_spec(spec)
spec.loader.exec_module(thermostat)
Room, turn_round = thermostat.Room, thermostat.turn_round
SMALL = {"optimizer": {"generations": 2, "population": 4, "starts": 4, "confirm": 1}, "progress": False}
CHANGES = [{"at": 20, "function": turn_round}]
TURNED = f"environment.changes=[{{at: 20, function: '{EXAMPLE}:turn_round'}}]"


@pytest.fixture(scope="module")
def champion(tmp_path_factory):
    """A champion evolved in an environment that is a class, beside a run of the same evolution."""
    with chdir(tmp_path_factory.mktemp("python")) as _:
        words = ["optimizer.generations=2", "optimizer.population=4", "optimizer.starts=4", "optimizer.confirm=1"]
        done("evolve", f"environment={EXAMPLE}:Room", "environment.horizon=40", *words, "hydra.run.dir=room")
        run = Path("room").absolute()
    evolution = epuckhebb.evolve(environment={"id": Room, "horizon": 40}, **SMALL)
    found, history = evolution.champion, evolution.history
    pd.testing.assert_frame_equal(history, pd.read_csv(run / "history.csv"))
    np.testing.assert_array_equal(found, epuckhebb.load(run))
    return found, run


def test_evaluate_gives_what_the_command_line_writes(champion, here):
    genes, run = champion
    own = {"id": Room, "horizon": 40, "changes": CHANGES}
    result = epuckhebb.evaluate(
        genes, environment=own, hebbian=Oja(N=0.002, floor=1.0), repeats=2, compare={"bcm": None}
    )
    assert list(here.iterdir()) == []
    words = [
        f"genome={run}",
        f"environment={EXAMPLE}:Room",
        "environment.horizon=40",
        TURNED,
        "repeats=2",
        "hebbian=oja",
    ]
    done("evaluate", *words, "compare=[bcm]", "figures=none", "hydra.run.dir=tested")
    result.metrics.assign(genome="room").to_csv("metrics.csv", index=False)
    written = pd.read_csv("tested/metrics.csv")
    pd.testing.assert_frame_equal(pd.read_csv("metrics.csv"), written)
    table = pd.read_csv("tested/table.csv").set_index("controller")
    pd.testing.assert_frame_equal(result.table, table, check_dtype=False)
    assert result.traces["reward"].shape == (len(written), 40)
    np.testing.assert_allclose(np.nansum(result.traces["reward"], axis=1), result.metrics["return"])
    assert result.plot().figure.axes
    assert "oja" in repr(result)
    with pytest.raises(ValueError, match="render_mode"):
        result.replay()


def test_a_run_of_an_environment_brings_its_own(champion):
    _, run = champion
    result = epuckhebb.evaluate(run, repeats=1, progress=False)
    assert result.config.environment.horizon == 80
    assert list(result.metrics.controller) == ["without plasticity"]


def test_a_sweep_has_environments_and_rules_as_objects(champion):
    genes, _ = champion

    def cool(**options):
        room = Room(**options)
        room.works = -1.0
        return room

    over = {"environment": [Room, cool], "hebbian": [Oja(N=0.002), Oja(N=0.02)]}
    words = ("environment.horizon=40",)
    rows = epuckhebb.sweep(genes, *words, over=over, repeats=2, progress=False)
    assert set(rows.environment) == {"Room", "test_a_sweep_has_environments_and_rules_as_objects.<locals>.cool"}
    counts = rows.groupby(["environment", "controller"]).size()
    assert set(counts.xs("oja", level="controller")) == {2 * 2}  # rates and repeats
    assert set(counts.xs("oja (without plasticity)", level="controller")) == {2}  # the same beside both
    alone = epuckhebb.evaluate(genes, *words, environment=Room, hebbian=Oja(N=0.02), repeats=2, progress=False)
    own = rows[(rows.environment == "Room") & (rows.N == 0.02)].reset_index(drop=True)
    pd.testing.assert_frame_equal(own[list(alone.metrics)], alone.metrics[alone.metrics.N > 0].reset_index(drop=True))


@pytest.mark.usefixtures("here")
def test_a_controller_of_a_run_has_its_network_rule_and_signs():
    words = ["environment.hidden=[3]", "environment.step_s=0.01", "hebbian=modulated", "hebbian.sign=shuffled"]
    few = ["optimizer.generations=1", "optimizer.population=4", "optimizer.starts=4", "optimizer.confirm=1"]
    done("evolve", f"environment={EXAMPLE}:Room", "environment.horizon=20", *words, *few, "hydra.run.dir=run")
    ours, genome = epuckhebb.Controller("run"), load_genome("run", "")
    rule = load_any("evolve", [f"environment={EXAMPLE}:Room", *words]).rule
    by_hand = epuckhebb.Controller(genome.genes, genome.network, rule, signs=genome.signs, step_s=0.01)
    drawn = np.random.default_rng(1).uniform(-1, 1, (50, genome.network.inputs))
    outputs = [[one.act(readings, 0.5) for readings in drawn] for one in (ours, by_hand)]
    np.testing.assert_array_equal(*outputs)
    assert ours.weight_change > 0
    other = epuckhebb.Controller("run", rule=replace(rule, N=0.0))
    assert (other.network, other.rate, other.step_s) == (genome.network, 0.0, 0.01)
    with pytest.raises(ValueError, match="nowhere"):
        epuckhebb.Controller("nowhere")


@pytest.mark.usefixtures("here")
def test_a_sweep_over_champions_has_columns_of_what_they_bring_along(champion):
    words = ["optimizer.generations=1", "optimizer.population=4", "optimizer.starts=4", "optimizer.confirm=1"]
    done("evolve", f"environment={EXAMPLE}:Room", "environment.horizon=20", *words, "hydra.run.dir=short")
    rows = epuckhebb.sweep(over={"genome": [champion[1], "short"]}, repeats=1, progress=False)
    assert dict(rows.groupby("genome")["environment.horizon"].first()) == {"room": "80", "short": "40"}


def room(target):
    """An environment of one name with every target."""

    class Made(Room):
        def step(self, action):
            observation, _, *ends = super().step(action)
            return observation, target, *ends

    return Made


def function(target):
    """A function of one name with every target."""
    kind = room(target)

    def make():
        return kind()

    return make


@pytest.mark.parametrize("made", [room, function])
def test_a_sweep_keeps_objects_of_one_name_apart(champion, made):
    over = {"environment": [made(1.0), made(5.0)]}
    rows = epuckhebb.sweep(champion[0], "environment.horizon=4", over=over, repeats=2, progress=False)
    returns = [list(one["return"]) for _, one in rows.groupby("environment", sort=False)]
    assert returns == [[4.0, 4.0], [20.0, 20.0]]
    over = {"environment.changes": [[{"at": 2, "function": lambda _, n=n: n}] for n in range(2)]}
    rows = epuckhebb.sweep(champion[0], "environment.horizon=4", over=over, environment=Room, repeats=1, progress=False)
    assert len(rows) == rows.change.nunique() == 2


def signed(c):
    """A rule of one name with every sign."""

    @dataclass(frozen=True, kw_only=True)
    class Signed(epuckhebb.Rule):
        @staticmethod
        def synapse(correlation):
            return c * correlation

    return Signed(N=0.1)


def test_rules_that_a_function_makes_are_others():
    rules, config = [signed(1.0), signed(-1.0)], load_any("evaluate", ["environment=cartpole"])
    ids = []
    for rule in rules:
        config = config.take(rule)
        ids.append(prepare_evaluation(config, make_genome(np.zeros(config.network_made.synapses), config)).lifetime_ids)
    assert ids[0]["signed"] != ids[1]["signed"]
    assert [label for _, label in api._labels("hebbian", rules)] == ["signed, N = 0.1", "signed, N = 0.1 (2)"]


@pytest.mark.parametrize(
    ("words", "name", "rule", "expected"),
    [
        (["environment=cartpole"], "abcd", ABCD(N=0.1, N_gain_rad_s=0.0, normalise=Normalise.largest), "reward"),
        ([], "paper", epuckhebb.Hebbian(N=0.1), "behaviour"),
    ],
)
@pytest.mark.parametrize("command", ["evolve", "evaluate"])
def test_a_rule_that_is_an_object_is_that_of_its_name(command, words, name, rule, expected):
    typed, made = load_any(command, [*words, f"hebbian={name}", "hebbian.N=0.1"]), load_any(command, words)
    made = made.take(rule)
    assert made.rule == typed.rule
    assert made.rule.signal == expected
    assert made.controllers == typed.controllers
    assert getattr(made, "plan", None) == getattr(typed, "plan", None)


@pytest.mark.parametrize("rule", [ABCD(N=0.05, normalise=Normalise.none, floor=0.2), Oja(N=0.05, floor=0.0)])
def test_a_default_that_is_given_stays(rule):
    config = load_any("evaluate", ["environment=cartpole"])
    config = config.take(rule)
    assert config.rule == replace(rule, signal="reward")


@dataclass(frozen=True, kw_only=True)
class Decay(epuckhebb.Rule):
    """Hebb's rule with a decay."""

    @staticmethod
    def synapse(correlation, weight):
        """D = x_j x_i - w."""
        return correlation - weight


@pytest.mark.thorough
def test_own_objects_go_into_processes(monkeypatch):
    monkeypatch.setattr("epuckhebb.runs.gymnasium._WORTH_S", 0.0)

    class Mine(Room):
        """A class that a worker cannot import."""

    given = {"environment.id": Mine, "environment.horizon": 40, "hebbian": Decay(N=0.01), **SMALL}
    one, two = (epuckhebb.evolve("environment=gym", **given, **{"environment.processes": n}) for n in (1, 2))
    np.testing.assert_array_equal(one.champion, two.champion)
    pd.testing.assert_frame_equal(one.history, two.history)


@dataclass(frozen=True, kw_only=True)
class Weighted(epuckhebb.Fitness):
    """A fitness of the user's. weight: of the return."""

    weight: float = 3.0

    @staticmethod
    def life(rewards, by):
        """The weighted return."""
        return by.weight * rewards.sum()


@pytest.mark.parametrize(("fitness", "weight"), [(Weighted, 3), (Weighted(weight=2.0), 2)], ids=["class", "object"])
def test_a_fitness_may_be_an_object(fitness, weight):
    given = {"environment": {"id": Room, "horizon": 40}, **SMALL}
    judged, usual = epuckhebb.evolve(fitness=fitness, **given), epuckhebb.evolve(**given)
    np.testing.assert_allclose(judged.history.best_fitness[0], weight * usual.history.best_fitness[0])
    assert judged.genome.fitness_function == "Weighted"


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"environment": gymnasium.Wrapper, "hebbian": "abcd"}, r"environment\.id=gymnasium"),
        ({"environment": dict}, r"environment\.id must be a subclass of Env"),
        ({"environment": functools.partial(Room)}, r"environment\.id must be a subclass of Env"),
        ({"environment": {"id": "Nope-v0"}}, r"environment\.id=Nope-v0"),
        ({"environment": lambda: 3}, "must make a gymnasium"),
        ({"environment": Room, "hebbian": Oja(N=0.1, control=Control.yoked_sign)}, "control"),
        ({"environment": Room, "hebbian": Oja()}, "N = 0"),
        ({"environment": Room, "change": "weak_leg"}, "change"),
        ({"environment": Room, "scenario": "base"}, "scenario"),
    ],
)
def test_mistakes_are_value_errors(given, text):
    with pytest.raises(ValueError, match=text):
        epuckhebb.evaluate(np.zeros(48), **given, progress=False)


@pytest.mark.parametrize(("change", "notes"), [({}, 0), ({"at": 20, "works": -1.0}, 0), ({"at": 20, "works": 1.0}, 1)])
def test_a_change_that_changes_nothing_is_noted(champion, change, notes):
    genes, _ = champion
    own = {"id": Room, "horizon": 40, "changes": [change] if change else []}
    result = epuckhebb.evaluate(genes, environment=own, repeats=2, progress=False)
    assert sum("works" in note for note in result.notes) == notes
    assert all(note in repr(result) for note in result.notes)


def test_lifetimes_that_end_before_the_change_are_noted():
    own = {"id": "CartPole-v1", "horizon": 400, "changes": [{"at": 399, "gravity": 20.0}]}
    result = epuckhebb.evaluate(np.zeros(7), environment=own, network={"layers": [4, 1, 2]}, repeats=2, progress=False)
    assert any("0 of 2 lifetimes" in note for note in result.notes)
