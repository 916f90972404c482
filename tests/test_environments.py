"""Environments of Gymnasium: evolve, evaluate, changes, bit-identical reruns and processes, sweeps, and bad input."""

import itertools
import json
import math
import re
import shutil
import sys
import zlib
from contextlib import chdir
from functools import partial
from pathlib import Path

import gymnasium
import numpy as np
import pandas as pd
import pytest
from cases import call, check_resumed, described_columns, done, refused
from PIL import Image, ImageSequence

import epuckhebb
from epuckhebb.analysis import charts
from epuckhebb.analysis.environments import (
    effects,
    lifetime_course,
    readable,
    readable_effects,
    table,
    tables,
    unreached,
)
from epuckhebb.config import load_any
from epuckhebb.controller.controller import Controller
from epuckhebb.controller.genome import make_plan
from epuckhebb.controller.plasticity.rule import Normalise, NoRule
from epuckhebb.controller.plasticity.rules.abcd import ABCD
from epuckhebb.controller.random import Stream, rng
from epuckhebb.runs import prepare_evaluation, prepare_evolution
from epuckhebb.runs.gymnasium import environment_seed, run_lifetimes
from epuckhebb.runs.world import make_world
from epuckhebb.runtime import ConfigError
from epuckhebb.store import Run, load_genome
from epuckhebb.worlds.changes import CHANGES, Faults, apply
from epuckhebb.worlds.environment import Environment, Lived, World
from epuckhebb.worlds.lives import Work

REFERENCE = Path(__file__).parents[1] / "runs" / "reference"
EXAMPLE = Path(__file__).parents[1] / "examples" / "any_world" / "thermostat.py"
CLIMBER = f"{EXAMPLE.parents[1] / 'own_optimizer' / 'hill_climber.py'}:HillClimber"
SMALL = ["optimizer.generations=2", "optimizer.population=4", "optimizer.starts=4", "optimizer.confirm=1"]
CARTPOLE = ["environment=cartpole", "environment.hidden=[4]", "environment.horizon=60", *SMALL]
MIDDLE = "environment.changes=[{at: 60, length: 2.0, action_delay: 1}]"
TURNED = f"environment.changes=[{{at: 20, function: '{EXAMPLE}:turn_round'}}]"
ROOM = [f"environment={EXAMPLE}:Room", "environment.horizon=40", "hebbian=abcd", *SMALL]


def raises(error):
    raise error


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A folder with evolutions in two environments, one with a rule, and an evaluation of each with a change."""
    with chdir(tmp_path_factory.mktemp("environments")):
        done("evolve", *CARTPOLE, "hydra.run.dir=plain")
        done("evolve", *CARTPOLE, "hebbian=abcd", "hydra.run.dir=abcd")
        done("evaluate", "genome=plain", MIDDLE, "repeats=3", "hydra.run.dir=tested_plain")
        done("evaluate", "genome=abcd", MIDDLE, "repeats=3", "hydra.run.dir=tested")
        yield Path.cwd()


@pytest.fixture(autouse=True)
def _here(request):
    if "runs" not in request.fixturenames:
        yield
        return
    with chdir(request.getfixturevalue("runs")):
        yield


@pytest.mark.usefixtures("runs")
def test_metrics_have_the_columns_of_an_environment_and_the_controls_of_a_rule():
    rows = pd.read_csv("tested/metrics.csv")
    assert list(rows) == described_columns("metrics.csv in an environment")
    names = ["abcd (without plasticity)", "abcd", "abcd (anti)", "abcd (shuffled)", "abcd (frozen at the change)"]
    assert list(rows.controller.unique()) == names
    assert list(pd.read_csv("tested/lifetime.csv")) == described_columns("lifetime.csv")
    assert list(pd.read_csv("tested/table.csv")) == described_columns("table.csv in an environment")
    assert (rows["return_before"] + rows["return_after"].fillna(0) == rows["return"]).all()
    assert (rows.reached == (rows.steps > 60)).all()
    assert (rows.return_after.isna() == (rows.reached == 0)).all()
    assert list(pd.read_csv("tested/table.csv").reached) == list(rows.groupby("controller", sort=False).reached.sum())
    assert set(rows.change) == {"length=2.0 action_delay=1 at 60"}
    assert (rows.weight_change_mean[rows.controller == names[0]] == 0).all()
    own, frozen = (rows[rows.controller == name].reset_index() for name in (names[1], names[-1]))
    assert (own.return_before == frozen.return_before).all()


def drawn_signs(stream, count):
    return stream.choice([-1.0, 1.0], count)


@pytest.mark.usefixtures("here")
def test_the_seed_draws_the_shuffled_signs_of_an_evolution_and_its_champion_keeps_them():
    words = [*CARTPOLE, "hebbian=abcd", "hebbian.sign=shuffled", "seed=5", "environment.processes=1", "figures=none"]
    config = load_any("evolve", words)
    count = config.network_made.synapses
    signs = drawn_signs(rng(5, Stream.shuffled_signs), count)
    population = np.random.default_rng(1).uniform(-1, 1, (4, make_plan(config.network_made, ABCD).genes))
    found = make_world(config).evaluator(config.network_made, 1).evaluate(population, 0)[0]
    seeds = [environment_seed(5, Stream.training_noise, 0, loop) for loop in range(config.schedule.loops)]
    lives = run_lifetimes(config, [Work(0, genes, seeds, signs) for genes in population], 1)
    assert list(found) == [np.mean([lived.fitness for lived in one]) for one in lives]
    done("evolve", *words, "hydra.run.dir=evolved")
    genome = load_genome("evolved", "")
    np.testing.assert_array_equal(genome.signs, signs)
    works = prepare_evaluation(load_any("evaluate", ["environment=cartpole", "genome=evolved"])).world.works(
        genome, [0]
    )
    shown = {1: signs, 2: np.ones(count), 3: -np.ones(count)}  # the rule, and its controls
    for number, expected in shown.items():
        np.testing.assert_array_equal(works[number].signs, expected)
    assert "hebbian.sign_draw" in refused("evaluate", "genome=evolved", "hebbian.sign_draw=1")


@pytest.mark.usefixtures("runs")
def test_each_controller_has_the_draw_of_signs_that_it_names():
    draws = [f"compare.draw_{draw}={{sign: shuffled, sign_draw: {draw}}}" for draw in (0, 1, 4)]
    config = load_any("evaluate", ["environment=cartpole", "genome=abcd", "hebbian.sign_draw=4", *draws])
    genome = load_genome("abcd", "")
    place = zlib.crc32(genome.genes.tobytes())
    names = [controller.name for controller in config.controllers]
    signs = dict(zip(names, (work.signs for work in make_world(config).works(genome, [0])), strict=True))
    for name, draw in (("abcd (shuffled)", 4), ("draw_0", 0), ("draw_1", 1), ("draw_4", 4)):
        expected = drawn_signs(rng(1 + draw, Stream.shuffled_signs, place), config.network_made.synapses)
        np.testing.assert_array_equal(signs[name], expected)
    assert "compare.x.sign_draw" in refused("evaluate", "genome=abcd", "compare.x={sign_draw: 1}")


@pytest.mark.usefixtures("runs")
@pytest.mark.parametrize("words", [["hebbian=none"], ["compare.off={rule: none}"]])
def test_a_champion_whose_rule_draws_its_weights_has_none_without_the_rule(words):
    """A network of zeros is no control: N = 0 draws the same weights, which stay as they are."""
    assert "genome=abcd" in (text := refused("evaluate", "genome=abcd", *words))
    assert "hebbian.N=0" in text


@pytest.mark.usefixtures("runs")
@pytest.mark.parametrize("run", ["plain", "tested"])
def test_a_rerun_is_bit_identical(run):
    assert "bit-identical" in done("rerun", run).stdout


@pytest.mark.parametrize("own", [[], [f"optimizer.algorithm={CLIMBER}"]], ids=["sep_cma_es", "own"])
def test_a_resumed_evolution_is_bit_identical(own, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    words = [word for word in CARTPOLE if not re.search("generations|starts" if own else "generations", word)] + own
    done("evolve", *words, "optimizer.generations=3", "hydra.run.dir=evolved")
    check_resumed(words, ("optimizer.generations=2", "optimizer.generations=3"))


@pytest.mark.thorough
def test_lifetimes_are_bit_identical_in_processes_and_in_a_used_environment(monkeypatch):
    monkeypatch.setattr("epuckhebb.runs.gymnasium._WORTH_S", 0.0)
    config = load_any(
        "evolve", [*ROOM, "environment.changes=[{at: 20, function: 'FILE:turn_round'}]".replace("FILE", str(EXAMPLE))]
    )
    genes = np.random.default_rng(1).uniform(-1, 1, (5, config.plan.genes))
    genes = np.hstack([np.zeros((5, config.network_made.synapses)), genes])
    works = [Work(0, one, (3, 4)) for one in genes]
    one, two, again = (run_lifetimes(config, works, processes) for processes in (1, 2, 1))
    for lives in (two, again):
        for own, other in zip(itertools.chain(*one), itertools.chain(*lives), strict=True):
            np.testing.assert_array_equal(own.rewards, other.rewards)
            assert own.weight_change_final == other.weight_change_final
    assert one[0][0].rewards[21:].sum() != one[0][1].rewards[21:].sum()


KEEPS = """
from .thermostat import Room


class Keeps(Room):
    carried = 0.0

    def step(self, action):
        seen, reward, *others = super().step(action)
        self.carried += 0.1
        return seen, reward + self.carried, *others
"""


@pytest.mark.thorough
def test_lifetimes_do_not_depend_on_those_before_them(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("epuckhebb.runs.gymnasium._WORTH_S", 0.0)
    Path("thermostat.py").write_text(EXAMPLE.read_text())
    Path("own.py").write_text(KEEPS)
    config = load_any("evolve", ["environment=own.py:Keeps", *ROOM[1:]])
    genes = np.random.default_rng(1).uniform(-1, 1, (5, config.plan.genes))
    genes = np.hstack([np.zeros((5, config.network_made.synapses)), genes])
    works = [Work(0, one, (3, 4)) for one in genes]
    found = [run_lifetimes(config, list(own), count) for own, count in ((works, 1), (works, 2), (works[::-1], 1))]
    returns = [[[lived.rewards.sum() for lived in lives] for lives in each] for each in found]
    assert returns[0] == returns[1] == returns[2][::-1]
    assert config.world.findings.needs_fresh


@pytest.mark.usefixtures("runs")
def test_show_figure_and_replay_know_an_environment():
    assert "weak_leg" in done("keys", "environment").stdout
    assert "environment cartpole" in done("show", "plain").stdout
    assert "without plasticity" in done("show", "tested").stdout
    done("evolve", *CARTPOLE, "hebbian=modulated", "hydra.run.dir=modulated")
    alone = ["genome=modulated", "environment=cartpole", "hebbian=none", "repeats=1", "hydra.run.dir=rule_off"]
    assert "evolved with the rule modulated, which is off" in done("evaluate", *alone).stdout
    assert done("figure", "tested").stdout.split() == ["lifetime"]
    done("figure", "tested", "lifetime", "--format", "svg")
    done("figure", "plain", "learning")
    pytest.importorskip("pygame")
    done("evaluate", "genome=plain", "environment.changes=[{at: 3, length: 2.0}]", "repeats=1", "hydra.run.dir=early")
    done("replay", "early", "--gif", "film.gif")
    with Image.open("film.gif") as film:
        frames = [film.copy().convert("RGB").getpixel((0, 0)) for _ in ImageSequence.Iterator(film)]
    assert frames[0] == (255, 255, 255)
    assert frames[-1] == pytest.approx((213, 94, 0), abs=2)  # after the change
    refused("replay", "tested", "--output", "page.html")


@pytest.mark.usefixtures("runs")
def test_compared_controllers_run_the_lifetimes_of_a_run_of_their_own():
    few = ["repeats=2", "figures=none"]
    slow = "compare.slow={N: 0.01, sign: anti}"
    done("evaluate", "genome=abcd", *few, slow, "hydra.run.dir=compared")
    done("evaluate", "genome=plain", *few, "compare=[oja]", "hydra.run.dir=by_name")
    done("evaluate", "genome=abcd", *few, "hebbian.N=0.01", "hebbian.sign=anti", "hydra.run.dir=slow")
    done("evaluate", "genome=plain", *few, "hebbian=oja", "hydra.run.dir=oja")
    for compared, name, alone, own in (("compared", "slow", "slow", "abcd"), ("by_name", "oja", "oja", "oja")):
        ours, theirs = pd.read_csv(f"{compared}/metrics.csv"), pd.read_csv(f"{alone}/metrics.csv")
        ours, theirs = ours[ours.controller == name], theirs[theirs.controller == own]
        assert len(ours) == 2
        assert (ours.weight_change_mean > 0).all()
        columns = [column for column in ours if column != "controller"]
        pd.testing.assert_frame_equal(ours[columns].reset_index(drop=True), theirs[columns].reset_index(drop=True))
    for words in (["compare=[late]"], ["compare.x={rule: oja, signal: behaviour}"], ["compare.abcd={N: 0.01}"]):
        refused("evaluate", "genome=abcd", *words)


@pytest.mark.usefixtures("runs")
def test_an_evolution_begins_at_a_champion_or_evolves_a_rule_for_its_weights():
    done("evolve", *CARTPOLE, "start=plain", "optimizer.sigma=1e-9", "hydra.run.dir=begun")
    plain, begun = load_genome("plain", ""), load_genome("begun", "")
    assert plain.sha256 in begun.start
    np.testing.assert_allclose(begun.genes, plain.genes, atol=1e-6)
    done("evolve", *CARTPOLE, "genome=plain", "hebbian=modulated", "hydra.run.dir=given")
    given = load_genome("given", "")
    np.testing.assert_array_equal(given.network_genes, plain.genes)
    assert len(given.genes) > len(plain.genes)
    assert "bit-identical" in done("rerun", "given").stdout
    refused("evolve", "environment=acrobot", "start=plain")


@pytest.mark.usefixtures("runs")
def test_many_runs_get_one_table_over_champions():
    done("evolve", *CARTPOLE)
    evolved = Path("runs/evolve")
    for number, name in enumerate(("cartpole", "cartpole", "acrobot")):  # the latest is of another environment
        copied = evolved / f"2999010{number + 1}-000000-0000000{number}_{name}_seed1"
        shutil.copytree(next(evolved.glob("*cartpole*")), copied)
        settings = copied / ".hydra" / "config.yaml"
        settings.write_text(settings.read_text().replace("name: cartpole", f"name: {name}"))
    done("evaluate", "environment=cartpole", "repeats=1", "hydra.run.dir=of_latest")
    assert Run(Path("of_latest")).provenance["genome"].startswith("29990102")
    shutil.rmtree(copied)
    done("evaluate", "-m", "genome=plain,abcd", "repeats=2", "hydra.sweep.dir=many")
    table = pd.read_csv("many/summary.csv")
    assert list(table.controller[:2]) == ["without plasticity", "abcd (without plasticity)"]
    assert (table.champions == 1).all()
    done("evaluate", "-m", "genome=abcd", "hebbian.N=0.01,0.1", "repeats=2", "hydra.sweep.dir=rates")
    rates = pd.read_csv("rates/summary.csv").set_index("controller")
    assert rates.lifetimes["abcd (without plasticity)"] == 2  # it is the same beside both rates
    assert list(rates.N["abcd"]) == [0.01, 0.1]


def test_a_loss_that_comes_late_is_no_recovery_at_once():
    changes = [{"at": 100, "length": 1.0}]
    world = World(settings=Environment(name="x", horizon=400, changes=changes), make=None)

    def recovery(rewards):
        lived = Lived(np.array(rewards), 0.0, 0.0, 0.0, np.zeros(0), np.zeros(0))
        return world.metrics(lived)["recovery_steps"]

    assert recovery([1.0] * 400) == 0
    assert recovery([1.0] * 150 + [0.0] * 50 + [1.0] * 200) == 95  # of 50 steps from there on, 45 are of 1
    assert np.isnan(recovery([1.0] * 150 + [0.0] * 250))
    assert np.isnan(recovery([1.0] * 300))  # it ended early


def by_hand(config, genes, seed, *, frozen):
    """A lifetime of an evaluation with noise from step 5 and dead readings from step 9 on, as a loop of one's own."""
    env, rule = gymnasium.make("CartPole-v1", max_episode_steps=config.environment.horizon), config.rule
    controller = Controller(genes, config.network_made, rule, step_s=config.environment.step_s)
    observation, _ = env.reset(seed=seed)
    controller.reset(seed)
    noise, weights, is_over, step, reward = rng(seed, Stream.reading_noise), [], False, 0, 0.0
    while not is_over:
        readings = np.tanh(observation.astype(float) * (1 / np.array([2.4, 2.0, 0.21, 2.0])))
        if step >= 9:
            readings[3] = 0.0
        if step >= 5:
            readings[1] += 0.5 * noise.standard_normal()
        if frozen and step >= 5:
            controller.rate = 0.0
        outputs = controller.act(readings, reward)
        weights.append(controller.weights.copy())
        observation, reward, ended, cut, _ = env.step(int(outputs.argmax()))
        is_over, step = ended or cut, step + 1
    return np.array(weights)


@pytest.mark.usefixtures("runs")
def test_lifetimes_are_those_of_a_loop_by_hand():
    changes = "environment.changes=[{at: 9, dead_readings: [3]}, {at: 5, noisy_readings: {1: 0.5}}]"
    config = load_any("evaluate", ["genome=abcd", "environment=cartpole", changes])
    genes = np.random.default_rng(2).uniform(-1, 1, make_plan(config.network_made, ABCD).genes)
    own, frozen = 1, len(config.controllers) - 1
    seeds = tuple(range(20, 28))
    found = {number: run_lifetimes(config, [Work(number, genes, seeds, record=True)], 1)[0] for number in (own, frozen)}
    for number, lives in found.items():
        for seed, lived in zip(seeds, lives, strict=True):
            weights = by_hand(config, genes, seed, frozen=number == frozen)
            assert len(lived.rewards) == len(weights)
            moved = np.abs(np.diff(weights, axis=0)).sum(axis=1)
            np.testing.assert_array_equal(lived.weight_steps[1:], moved)
            assert (moved[5:] > 0).any() == (number == own)
            assert moved[:4].all()
    assert len({lived.weight_change_final for lived in found[own]}) == len(seeds)


def test_a_lifetime_that_has_ended_earns_nothing():
    lives = [Lived(np.ones(steps), 0.0, 0.0, 0.0, np.zeros(steps), np.zeros(steps)) for steps in (100, 55)]
    rows = pd.DataFrame(lifetime_course(["one", "one"], lives, 100))
    assert list(rows.step) == list(range(2, 101, 2))
    assert list(rows.reward[26:29]) == [1.0, 0.75, 0.5]
    assert (rows.reward * 2).sum() * 2 == sum(len(one.rewards) for one in lives)  # the return of both


def test_effects_are_those_of_scipy_on_means_of_champions():
    rng, names = np.random.default_rng(1), {"plain": 0.0, "abcd": 0.1, "abcd (frozen at the change)": 0.1}
    rows = [
        {"environment": "x", "change": "c", "controller": name, "N": rate, "genome": f"{name[:4]}{genome}"}
        | {"return_after": rng.normal(5 * (name == "abcd"))}
        for name, rate in names.items()
        for genome in range(7)
        for _ in range(3)
    ]
    found = effects(pd.DataFrame(rows), ["environment", "change"]).set_index("against")
    assert list(found) == [name for name in described_columns("effects.csv") if name != "against"]
    means = pd.DataFrame(rows).groupby(["controller", "genome"], sort=False).return_after.mean()
    ours, plain, frozen = means["abcd"], means["plain"], means["abcd (frozen at the change)"]
    assert found.effect["plain"] == pytest.approx(ours.mean() - plain.mean())
    assert found.p["plain"] == pytest.approx(2 / math.comb(14, 7))
    paired = ours - frozen
    signs = np.array(list(itertools.product((1, -1), repeat=7))) @ paired.to_numpy() / 7
    assert found.p["abcd (frozen at the change)"] == pytest.approx((abs(signs) >= abs(paired.mean()) - 1e-12).mean())
    assert (found.p_holm >= found.p).all()


def after_a_change(controller, rate, returns, genomes="abcdef", **more):
    """A lifetime of each of some champions."""
    same = {"environment": "x", "change": "c", "controller": controller, "N": rate, **more}
    return pd.DataFrame(
        [same | {"genome": g, "return_after": value} for g, value in zip(genomes, returns, strict=True)]
    )


def test_each_rate_of_a_rule_has_its_effect():
    rows = [after_a_change("zero", 0.0, [1.0] * 6)]
    for rate in (0.01, 0.1):
        rows.append(after_a_change("abcd", rate, [1 + rate] * 6))
        rows.append(after_a_change("abcd (frozen at the change)", rate, [1 + 3 * rate] * 6))
    found = effects(pd.concat(rows), ["environment", "change"])
    assert found.N.tolist() == [0.01, 0.01, 0.1, 0.1]
    assert found.effect.tolist() == pytest.approx([-0.02, 0.01, -0.2, 0.1])
    assert readable_effects(found).headings[:3] == ["controller", "N", "against"]


def test_each_setting_of_a_rule_has_its_effect_against_champions_without_a_rule():
    rows = [after_a_change("plain", 0.0, [1.0] * 6, "uvwxyz", **{"hebbian.leak": ""})]
    rows += [after_a_change("abcd", 0.1, [value] * 6, **{"hebbian.leak": leak}) for leak, value in (("0", 3), ("1", 5))]
    found = effects(pd.concat(rows), ["hebbian.leak", "environment", "change"])
    assert found[["hebbian.leak", "effect", "is_paired"]].to_numpy().tolist() == [["0", 2.0, False], ["1", 4.0, False]]


def test_controllers_of_the_same_champions_are_paired():
    """Five differences of +1 and one of -1: of 64 choices of signs, 14 give a sum at least as far from 0."""
    ours, zero = [1.0, 102.0, 203.0, 304.0, 405.0, 506.0], [0.0, 101.0, 202.0, 303.0, 404.0, 507.0]
    (row,) = effects(
        pd.concat([after_a_change("abcd", 0.1, ours), after_a_change("zero", 0.0, zero)]), ["environment", "change"]
    ).itertuples()
    assert (row.is_paired, row.effect, row.p) == (True, pytest.approx(4 / 6), 14 / 64)


def test_a_table_names_rates_and_what_is_missing():
    rows = [lifetimes(one=[1.0]).assign(N=rate, change=change) for rate in (0.1, 0.2) for change in (None, "c")]
    shown = readable(table(pd.concat(rows), ["change", "controller", "N"]))
    assert shown.headings[:3] == ["change", "controller", "N"]
    assert [row[:3] for row in shown.rows][:2] == [["none", "abcd", "0.1"], ["c", "abcd", "0.1"]]


def test_a_figure_of_returns_has_a_panel_for_each_world_and_a_row_for_each_rate():
    rows = [lifetimes(one=[1.0]).assign(N=rate, task=task, change="c") for rate in (0.1, 0.2) for task in "xy"]
    drawn = charts.returns(table(pd.concat(rows), ["task", "change", "controller", "N"]))
    assert len(drawn.axes) == 2
    assert [label.get_text() for label in drawn.axes[0].get_yticklabels()] == ["abcd, N = 0.1", "abcd, N = 0.2"]


@pytest.mark.parametrize("budget", ["legs", "legs_300", "legs_fresh"])
def test_effects_of_the_committed_champions_are_the_committed_ones(budget):
    read = partial(pd.read_csv, keep_default_na=False, na_values=["nan"])
    champions = read(REFERENCE / budget / "champions.csv").assign(environment="halfcheetah")
    pd.testing.assert_frame_equal(
        effects(champions, ["environment", "change"]), read(REFERENCE / budget / "effects.csv"), rtol=1e-12
    )


def lifetimes(**after):
    """Lifetimes of champions with their returns after a change, nan for those that ended before it."""
    rows = [
        {"genome": genome, "controller": "abcd", "N": 0.1, "return": 1.0, "return_before": 1.0, "steps": 5}
        | {"return_after": value, "reached": int(np.isfinite(value)), "recovery_steps": value if value > 5 else np.nan}
        | {"weight_change_mean": 0.0, "saturated_fraction": 0.0}
        for genome, values in after.items()
        for value in values
    ]
    return pd.DataFrame(rows)


@pytest.mark.parametrize(
    ("after", "mean", "reached", "recovered"),
    [
        ({"one": [4.0, np.nan, 8.0, np.nan]}, 6.0, 2, 1),
        ({"one": [4.0, np.nan], "two": [10.0, 20.0], "three": [np.nan, np.nan]}, 9.5, 3, 2),
        ({"one": [6.0, 7.0, 8.0]}, 7.0, 3, 3),
        ({"one": [np.nan, np.nan]}, np.nan, 0, 0),
    ],
)
def test_means_after_a_change_are_over_the_lifetimes_that_reached_it(after, mean, reached, recovered):
    rows = table(lifetimes(**after))
    row = rows.iloc[0]
    assert row.return_after == pytest.approx(mean, nan_ok=True)
    assert (row.reached, row.recovered, row.lifetimes) == (reached, recovered, sum(map(len, after.values())))
    assert len(unreached(rows)) == (reached < 0.9 * row.lifetimes)
    cell = readable(rows).rows[0][3]
    assert (f"({reached} of {row.lifetimes})" in cell) == (0 < reached < row.lifetimes)


def test_tables_over_texts_are_those_over_numbers():
    """A sweep keeps the numbers of its lifetimes as they stand in their files."""
    rows = lifetimes(one=[4.0, np.nan, 8.0, 6.0], two=[1.0] * 4).assign(environment="cartpole", change="x")
    texts = rows.map(lambda value: "" if pd.isna(value) else str(value)).astype(str)
    told, expected = (tables(some, ["environment"]) for some in (texts, rows))
    assert list(expected["summary"].reached) == [7]
    for name, frame in expected.items():
        pd.testing.assert_frame_equal(told[name], frame)


def test_effects_leave_out_champions_that_did_not_reach_the_change():
    every = {f"c{n}": [float(n), np.nan if n % 2 else n + 2.0] for n in range(8)}
    own = lifetimes(**every).assign(environment="x", change="y")
    frozen = lifetimes(**{**every, "c0": [np.nan, np.nan]}).assign(
        environment="x", change="y", controller="abcd (frozen at the change)"
    )
    frozen.return_after -= 1.5
    (row,) = effects(pd.concat([own, frozen]), ["environment", "change"]).itertuples()
    assert (row.champions, row.others, row.effect) == (7, 7, pytest.approx(1.5))


@pytest.mark.usefixtures("runs")
def test_a_change_that_few_lifetimes_reach_is_noted():
    late = "environment.changes=[{at: 119, length: 2.0}]"
    shown = done("evaluate", "genome=abcd", late, "repeats=2", "hydra.run.dir=late").stdout
    assert "Reached the change: 0 of 2 lifetimes" in shown
    assert "Reached the change: 0 of 2 lifetimes" in Path("late/table.md").read_text()
    assert pd.read_csv("late/metrics.csv").return_after.isna().any()


@pytest.mark.usefixtures("runs")
def test_a_sweep_of_ones_own_takes_rule_and_network_from_each_champion():
    Path("own/experiment").mkdir(parents=True, exist_ok=True)
    sweep = "# @package _global_\nhydra:\n  sweeper:\n    params:\n      genome: plain,abcd\n"
    Path("own/experiment/mine.yaml").write_text(sweep)
    words = ("sweep", "mine", "environment=cartpole", "repeats=2", "--config-dir", "own")
    assert "plasticity" in done(*words).stdout
    assert "2 done before" in done(*words).stderr


def test_the_example_of_rules_by_seeds_has_rows_of_its_own(monkeypatch):
    monkeypatch.chdir(EXAMPLE.parents[2])
    words = ["environment=wind", "change=turned"]
    for rule, name in (("none", "without plasticity"), ("decay", "decay")):
        config = load_any("evolve", [*words, f"hebbian={rule}"], "examples/rules_by_seeds")
        assert [one.name for one in config.controllers] == [name]
        assert (config.world.inputs, config.world.outputs, config.world.split) == (6, 1, 200)


@pytest.mark.thorough
def test_an_example_has_a_function_as_a_change(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done("evolve", *ROOM, TURNED, "hydra.run.dir=room")
    result = done("evaluate", "genome=room", "environment.horizon=40", TURNED, "repeats=2", "hydra.run.dir=tested")
    assert "frozen" in result.stdout
    assert list(Path("tested/own_code").rglob("thermostat.py"))
    assert "bit-identical" in done("rerun", "tested").stdout


JUDGES = """
from dataclasses import dataclass
from epuckhebb import Fitness


@dataclass(frozen=True, kw_only=True)
class Calm(Fitness):
    weight: float = 0.0

    @staticmethod
    def life(rewards, observations, infos, terminated, steps, by):
        assert len(observations) == len(infos) == len(rewards) == steps <= 40
        assert not terminated
        assert abs(observations[0][1]) <= 1 and (observations[0] != observations[-1]).any()
        return by.weight * rewards.sum() + 1000


class Stepwise(Fitness):
    @staticmethod
    def step(left):
        return left


class Arrived(Fitness):
    @staticmethod
    def life(success):
        return success


class Wrong(Fitness):
    @staticmethod
    def life(infos):
        return infos[0]["speed"]


class Episodic(Fitness):
    @staticmethod
    def life(rewards):
        return 0.0
"""


@pytest.mark.usefixtures("here")
def test_evolution_maximises_an_own_fitness():
    Path("own.py").write_text(JUDGES)
    few = [*ROOM, "figures=none"]
    done("evolve", *few, "fitness.function=own.py:Calm", "fitness.weight=0", "hydra.run.dir=flat")
    assert (pd.read_csv("flat/history.csv").best_fitness == 1000).all()
    done("evolve", *few, "fitness.function=own.py:Calm", "fitness.weight=2", "hydra.run.dir=own")
    done("evolve", *few, "hydra.run.dir=usual")
    own, usual = (pd.read_csv(f"{run}/history.csv").best_fitness for run in ("own", "usual"))
    np.testing.assert_allclose(own[0], 2 * usual[0] + 1000)
    assert load_genome("own", "").fitness_function == "Calm"
    assert list(Path("own/own_code").rglob("own.py"))
    assert "bit-identical" in done("rerun", "own").stdout


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["evolve", *ROOM, "fitness.function=own.py:Stepwise"], "Stepwise"),
        (["evolve", *ROOM, "fitness.function=own.py:Arrived"], "success"),
        (["evolve", *ROOM, "fitness.function=own.py:Wrong"], "speed"),
        (["evolve", *ROOM, "fitness.function=paper"], "fitness"),
        (["evolve", *ROOM, "fitness=paper"], "fitness"),
        (["evolve", *ROOM, "+fitness.weight=1"], "fitness"),
        (["evaluate", "genome=none.npy", *ROOM[:2], "fitness.function=own.py:Calm"], "fitness.function"),
        (["evaluate", "genome=none.npy", *ROOM[:2], "+fitness.function=own.py:Calm"], "fitness.function"),
        (["evolve", "fitness.function=own.py:Episodic"], "rewards"),
    ],
)
@pytest.mark.usefixtures("here")
def test_a_fitness_that_does_not_fit_is_refused(words, text):
    Path("own.py").write_text(JUDGES)
    assert text in refused(*words)
    assert not Path("runs").exists()


FAR = """
import gymnasium
import numpy as np


class Far(gymnasium.Env):
    observation_space = gymnasium.spaces.Dict(
        {"far": gymnasium.spaces.Box(-np.inf, np.inf, (2,)), "kind": gymnasium.spaces.Discrete(2)}
    )
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,))

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.numbers = self.np_random.normal(100.0, 5.0, 200)
        self.at = 0
        return self._look(), {}

    def step(self, action):
        self.at += 1
        return self._look(), float(action[0]) * (self.numbers[self.at] - 100), self.at == 25, False, {}

    def _look(self):
        return {"far": np.array([self.numbers[self.at], 0.1]), "kind": self.at % 2}
"""
RUNNING = ["environment=far.py:Far", "environment.scale=running", "environment.hidden=[3]", "optimizer.population=4"]
RUNNING += ["optimizer.starts=4", "optimizer.loops=2", "optimizer.confirm=1", "figures=none"]


@pytest.mark.usefixtures("here")
def test_a_running_scale_is_that_of_a_plain_loop_and_is_frozen_in_the_champion(monkeypatch):
    """The second reading never moves, so that it keeps the scale of readings without bounds."""
    Path("far.py").write_text(FAR)
    words = [*RUNNING, "optimizer.generations=3"]
    done("evolve", *words, "environment.processes=1", "hydra.run.dir=evolved")
    seeds = [environment_seed(1, Stream.training_noise, generation, loop) for generation in (0, 1) for loop in (0, 1)]
    seen = np.concatenate([np.random.default_rng(seed).normal(100.0, 5.0, 200)[:25] for seed in seeds])
    settings = json.loads(load_genome("evolved", "").environment_settings)
    mean, scale = settings["scale"]
    np.testing.assert_allclose(mean, [seen.mean(), 0.1, 0, 0], rtol=1e-12)
    np.testing.assert_allclose(scale, [seen.std(), 3, 1, 1], rtol=1e-12)

    check_resumed(RUNNING, ("optimizer.generations=1", "optimizer.generations=3"))
    monkeypatch.setattr("epuckhebb.runs.gymnasium._WORTH_S", 0.0)
    done("evolve", *words, "environment.processes=2", "hydra.run.dir=two")
    assert Path("two/history.csv").read_bytes() == Path("evolved/history.csv").read_bytes()
    assert load_genome("two", "").environment_settings == load_genome("evolved", "").environment_settings


@pytest.mark.usefixtures("here")
def test_a_champion_reads_by_the_scale_of_its_training():
    Path("far.py").write_text(FAR)
    done("evolve", *RUNNING, "optimizer.generations=2", "hydra.run.dir=evolved")
    shutil.copy("evolved/champion.npz", "moved.npz")
    world = ["environment=far.py:Far", "repeats=2", "figures=none"]
    scale = json.loads(load_genome("evolved", "").environment_settings)["scale"]
    numbers = f"environment.scale={scale}"
    ways = (["genome=evolved"], ["genome=moved.npz", "environment.scale=running"], ["genome=moved.npz", numbers])
    for number, words in enumerate(ways):
        done("evaluate", *words, *world, "environment.hidden=[3]", f"hydra.run.dir=tested_{number}")
    returns = [pd.read_csv(f"tested_{number}/metrics.csv")["return"].tolist() for number in range(len(ways))]
    assert returns[0] == returns[1] == returns[2]
    assert "environment.scale" not in " ".join(Run(Path("tested_0")).provenance["notes"])
    prepared = prepare_evaluation(load_any("evaluate", ["genome=evolved", *world]))
    read, usual = prepared.config.world.read, World(settings=Environment(), make=prepared.config.world.make).read
    far = {"far": np.array([103.0, 0.1]), "kind": 1}
    assert abs(read(far)[0]) < 0.9
    assert usual(far)[0] == 1
    genes, settings = load_genome("evolved", "").genes, {"id": "far.py:Far", "hidden": [3], "scale": "running"}
    with pytest.raises(ValueError, match=r"environment\.scale"):
        epuckhebb.evaluate(genes, environment=settings)


def test_a_running_scale_needs_numbers_to_scale():
    assert "environment.scale" in refused("evolve", "environment=foraging", "environment.scale=running")


def test_a_function_makes_an_environment(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(EXAMPLE, "thermostat.py")
    text = "from .thermostat import Room\n\n\ndef make(error=0):\n    return Room() if error == 0 else error\n"
    Path("own.py").write_text(text)
    for name, place in (("made", "own.py:make"), ("room", "thermostat.py:Room")):
        done("evolve", f"environment={place}", *ROOM[1:], f"hydra.run.dir={name}")
    assert Path("made/history.csv").read_bytes() == Path("room/history.csv").read_bytes()
    assert len(list(Path("made/own_code").rglob("*.py"))) == 2
    done("evaluate", "genome=made", "repeats=1", "figures=none", "hydra.run.dir=tested")
    assert "render_mode" in refused("replay", "tested")
    assert "environment.id" in refused("evolve", "environment=own.py:make", "environment.options={error: 1}")


def test_what_is_run_beside_the_budget_is_said(tmp_path, monkeypatch):
    """The Room ends no episode: each lifetime has 40 steps."""
    monkeypatch.chdir(tmp_path)
    few = ["optimizer.population=8", "optimizer.generations=2", "optimizer.starts=12", "environment.loops=5"]
    notes = done("evolve", *ROOM[:2], *few, "hydra.run.dir=run").stderr
    assert "2 generations" in notes
    note = notes.partition("Budget")[2]
    assert list(map(int, re.findall(r"\d+", note.partition("\n")[0]))) == [12, 8, 15]
    assert list(pd.read_csv("run/history.csv").robot_steps) == [40 * 5 * 12, 40 * 5 * 8]

    def added(*words):
        return re.findall(r"\d+", "".join(prepare_evolution(load_any("evolve", [*words])).added))

    assert added("environment=cartpole", "environment.population=16") == ["50", "16", "12"]
    assert not added()
    assert added("hebbian=baldwin") == ["12"]
    assert not added("optimizer=sep_cma_es")  # chosen to fit the robot-steps of the paper
    assert added("optimizer=sep_cma_es", "optimizer.generations=9", "start=reference") == ["12"]


DRAWN = """
import numpy as np
from .thermostat import Room


class Mute(Room):
    def __init__(self, gives="nothing"):
        pass


class Drawn(Room):
    def __init__(self, gives="nothing", render_mode=None):
        self.gives = gives

    def render(self):
        return {"nothing": None, "text": "a room", "picture": np.zeros((8, 8, 3), np.uint8)}[self.gives]


class Blank(Room):
    def __init__(self, gives="nothing", **options):
        pass
"""


def test_a_film_says_what_a_class_lacks(tmp_path, monkeypatch):
    """A picture is enough: `metadata` need not name its kind."""
    monkeypatch.chdir(tmp_path)
    shutil.copy(EXAMPLE, "thermostat.py")
    Path("drawn.py").write_text(DRAWN)
    for name in ("Mute", "Blank", "Drawn"):
        done("evolve", f"environment=drawn.py:{name}", *ROOM[1:], f"hydra.run.dir={name}")
    for name, gives in (("Mute", "nothing"), ("Blank", "nothing"), ("Drawn", "nothing"), ("Drawn", "text")):
        words = [f"genome={name}", f"environment.options={{gives: {gives}}}", "repeats=1", "figures=none"]
        done("evaluate", *words, f"hydra.run.dir={name}_{gives}")
        message = refused("replay", f"{name}_{gives}")
        assert f"drawn.py:{name}" in message
        assert "render_mode" in message
        assert not list(Path(f"{name}_{gives}").glob("*.gif"))
    picture = ["environment.options={gives: picture}", "repeats=1", "figures=none", "hydra.run.dir=tested"]
    done("evaluate", "genome=Drawn", *picture)
    done("replay", "tested")


@pytest.mark.thorough
def test_cartpole_is_solved():
    """No plasticity, separable CMA-ES: 500 steps upright."""
    evolution = epuckhebb.evolve("environment=cartpole", "environment.processes=1", progress=False)
    assert evolution.history.best_fitness.max() == 500
    assert len(evolution.champion) == 56


@pytest.mark.parametrize(
    ("change", "look", "expected"),
    [
        ({"gravity": 3.0}, lambda env, _: env.model.opt.gravity[2], -3.0),
        ({"friction": 0.5}, lambda env, _: env.model.geom_friction[0, 0], 0.2),
        ({"mass": {"torso": 2.0}}, lambda env, _: env.model.body_mass[1], 2 * 6.25020921),
        ({"joint_strength": {"bshin": 0}}, lambda env, _: env.model.actuator_gear[1, 0], 0.0),
        ({"dead_readings": [1, 3]}, lambda _, faults: faults.dead, [1, 3]),
        ({"noisy_readings": {2: 0.5}}, lambda _, faults: faults.noise, {2: 0.5}),
        ({"action_delay": 2}, lambda _, faults: faults.delay, 2),
    ],
)
def test_named_changes_do_what_they_say(change, look, expected):
    env, faults = gymnasium.make("HalfCheetah-v5").unwrapped, Faults(readings=[*map(str, range(17))])
    apply({"at": 1, **change}, env, faults, {})
    assert look(env, faults) == pytest.approx(expected)
    assert set(change) <= set(CHANGES)


@pytest.mark.usefixtures("runs")
@pytest.mark.parametrize(
    ("change", "same"), [("dead_readings: [2, 3]", False), ("action_delay: 12", False), ("gravity: 9.8", True)]
)
def test_a_change_acts_from_its_step_on(change, same):
    before, after = (
        load_any("evaluate", ["environment=cartpole", "genome=plain", "environment.horizon=60", *words])
        for words in ([], [f"environment.changes=[{{at: 8, {change}}}]"])
    )
    genes = np.zeros(28)  # of a controller that pushes towards the side to which the pole falls
    genes[[8, 12]], genes[[20, 21]] = 2.0, (-2.0, 2.0)
    lives = [run_lifetimes(config, [Work(0, genes, (1, 2, 3, 4))], 1)[0] for config in (before, after)]
    steps = [[len(lived.rewards) for lived in one] for one in lives]
    assert (steps[0] == steps[1]) == same


@pytest.mark.thorough
def test_averaging_and_a_slow_update_calm_the_weights():
    """The signature of Hebbian attractor networks: the change of a step falls with both, and goes on without."""
    words = ["environment=cartpole", "environment.hidden=[4]", "hebbian=abcd", "environment.horizon=200"]
    network = load_any("evolve", words).network_made
    genes = np.random.default_rng(5).uniform(-1, 1, 28 * 6)

    def last_changes(**settings):
        controller = Controller(genes, network, ABCD(N=0.05, floor=1.0, normalise=Normalise.largest, **settings))
        rng, steps = np.random.default_rng(0), []
        for _ in range(200):
            before = controller.weights.copy()
            controller.act(np.tanh(rng.normal(size=4)))
            steps.append(np.abs(controller.weights - before).sum())
        return np.mean(steps[-100:])

    assert last_changes(average=10, every=5) < 0.5 * last_changes()


@pytest.mark.parametrize(
    ("words", "texts"),
    [
        (["environment=gym", "environment.id=Nope-v0"], ["environment.id=Nope-v0"]),
        (["environment=gym", "environment.id=CartPole-v99"], ["v99", "v1"]),
        (["environment=gym"], ["environment.id"]),
        (["environment=nope"], ["environment", "halfcheetah"]),
        (["environment=gym", "environment.id=nowhere:Nope-v0"], ["environment.id", "nowhere"]),
        (["environment=gym", "environment.id=Ant-v5", "environment.options={nonsense: 1}"], ["Ant-v5"]),
        (["environment=halfcheetah", "environment.changes=[{at: 5, joint_strength: {knee: 0}}]"], ["knee", "bthigh"]),
        (["environment=cartpole", "environment.changes=[{at: 5, joint_strength: {knee: 0}}]"], ["MuJoCo"]),
        (["environment=cartpole", "environment.changes=[{at: 5, nonsense: 1}]"], ["nonsense", "masspole"]),
        (
            ["environment=cartpole", "environment.changes=[{at: 500, length: 1}]"],
            ["changes", "horizon=500"],
        ),
        (["environment=cartpole", "environment.changes=[{length: 1}]"], ["{at: STEP"]),
        (["environment=cartpole", "environment.changes=[{at: 5, dead_readings: [9]}]"], ["dead_readings", "0 to 3"]),
        (["environment=cartpole", "environment.changes=[{at: 5, function: nope.py:ice}]"], ["nope.py"]),
        (["environment=cartpole", "environment.scale=[1, 2]"], ["environment.scale", "4"]),
        (["environment=cartpole", "change=nope"], ["change", "heavy"]),
        (["environment=cartpole", "network.layers=[5, 2]"], ["network.layers", "4"]),
        (["environment=cartpole", "hebbian=abcd", "hebbian.signal=behaviour"], ["hebbian.signal", "reward"]),
        (["environment=cartpole", "+task.trials=3"], ["no key task.trials"]),
        (["environment=cartpole", "+physics.friction=3"], ["no key physics.friction"]),
        (["environment=cartpole", "environment.changes=[{at: true, length: 1}]"], ["{at: STEP"]),
        (["environment=acrobot", "environment.changes=[{at: 5, LINK_LENGTH_2: 2}]"], ["LINK_LENGTH_2", "LINK_MASS_2"]),
        (["environment=cartpole", "environment.scale=x"], ["environment.scale", "4"]),
        (["environment=cartpole", "scenario=base"], ["scenario", "in an environment"]),
        (["environment=cartpole", "robot.solid=null"], ["robot"]),
        (["environment=cartpole,tmaze"], ["tmaze"]),
        (["environment.horizon=5"], ["environment.horizon", "environment=NAME"]),
        (["hebbian.signal=reward", "hebbian=paper"], ["hebbian.signal", "behaviour"]),
        (["environment=nope.py:Mine"], ["nope.py"]),
        ([f"environment={EXAMPLE}:Nope"], ["subclass Nope of Env", "Room"]),
    ],
)
def test_bad_input_gets_one_message(words, texts):
    with pytest.raises(ConfigError) as refusal:
        load_any("evolve", words)
    assert [text for text in texts if text not in str(refusal.value)] == []


@pytest.mark.parametrize(
    "words", [["environment=gym", "environment.id=Nope-v0"], ["environment=cartpole", "maze=t_maze"]]
)
def test_bad_input_ends_with_exit_code_2_and_leaves_nothing(words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    refused("evolve", *words)
    assert not Path("runs").exists()


@pytest.mark.parametrize(
    ("space", "step", "text"),
    [
        ("spaces.Dict(x=spaces.Discrete(2))", "0, 1.0, False, False, {}", "must have x"),
        ("spaces.Box(-1, 1, (3,))", "raises()", "failed in line"),
        ("spaces.Box(-1, 1, (3,))", "np.zeros(5), 1.0, False, False, {}", "failed"),
        ("spaces.Box(-1, 1, (3,))", "np.zeros(3), 1.0, False, {}", "failed"),
        ("spaces.Box(-1, 1, (3,))", "np.zeros(3), np.nan, False, False, {}", "nan"),
    ],
)
def test_an_environment_of_ones_own_that_fails_is_refused_before_a_run(space, step, text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("own.py").write_text(
        "import gymnasium, numpy as np\nfrom gymnasium import spaces\n\n\nclass Mine(gymnasium.Env):\n"
        f"    observation_space = {space}\n    action_space = spaces.Discrete(2)\n"
        "    def reset(self, seed=None, options=None):\n        return np.zeros(3), {}\n"
        f"    def step(self, action):\n        return {step}\n"
    )
    assert text in refused("evolve", "environment=own.py:Mine")
    assert not Path("runs").exists()


def test_an_environment_that_cannot_be_made_says_why(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("own.py").write_text(
        "import gymnasium\n\n\nclass Mine(gymnasium.Env):\n    def __init__(self):\n        assert 1 > 2\n"
    )
    assert "assert 1 > 2 (own.py, line 6)" in refused("evolve", "environment=own.py:Mine")
    assert not Path("runs").exists()


def test_missing_libraries_are_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    missing = gymnasium.error.DependencyNotInstalled("MuJoCo is not installed")
    monkeypatch.setattr(gymnasium, "make", lambda *_, **__: raises(missing))
    assert "epuckhebb[gym]" in refused("evolve", "environment=ant")
    monkeypatch.setitem(sys.modules, "gymnasium", None)
    assert "epuckhebb[gym]" in refused("evolve", "environment=cartpole")


@pytest.mark.usefixtures("runs")
def test_a_champion_of_an_environment_is_refused_elsewhere():
    for words in (
        ["evaluate", "genome=plain", "environment=acrobot"],
        ["evaluate", "genome=plain", "environment=tmaze"],
        ["evaluate", "genome=reference", "environment=cartpole"],
        ["evaluate", "genome=plain", "environment.changes=[{at: 60, joint_strength: {a: 0}}]"],
        ["play", "environment=cartpole"],
        ["export", "tested_plain", "--webots"],
        ["export", "plain", "--webots"],
    ):
        refused(*words)
    for words in (
        ["environment=cartpole", "genome=plain"],
        ["genome=plain"],
        ["environment=own.py:Own", "genome=plain"],
    ):
        assert "environment=" in (message := refused("play", *words, "genome=plain"))
        assert "duration_s" not in message
    assert call("evolve", "environment=tmaze", "--cfg", "job").stdout == call("evolve", "--cfg", "job").stdout


TWINS = """
import gymnasium
import numpy as np


class One(gymnasium.Env):
    observation_space = gymnasium.spaces.Box(-1, 1, (2,), np.float64)
    action_space = gymnasium.spaces.Box(-1, 1, (1,), np.float64)

    def __init__(self, gain=1.0):
        self.gain = gain

    def reset(self, *, seed=None, options=None):
        return np.zeros(2), {}

    def step(self, action):
        return np.full(2, 0.5), self.gain, False, False, {}


class Two(One):
    pass
"""


@pytest.mark.usefixtures("here")
def test_settings_of_an_environment_are_taken_over_by_the_same_one_alone():
    Path("envs.py").write_text(TWINS)
    evolved = ["environment.options={gain: 3}", "environment.scale=0.5", "environment.step_s=0.2", "seed=4"]
    few = ["optimizer.population=4", "optimizer.generations=1", "environment.processes=1", "figures=none"]
    done("evolve", "environment=envs.py:One", *evolved, *few)
    (run,) = Path("runs/evolve").iterdir()
    assert run.name.endswith("_One_seed4")
    shutil.copy(run / "champion.npz", "moved.npz")

    def settings(*words):
        its = load_any("evaluate", ["environment=envs.py:One", *words]).environment
        return its.options, its.scale, its.step_s

    assert settings(f"genome={run}") == ({"gain": 3}, 0.5, 0.2)
    assert settings(f"genome={run}", "environment=envs.py:Two") == ({}, None, 0.05)
    few = ["repeats=1", "figures=none", "environment.processes=1"]
    for genome, different in ((run, set()), ("moved.npz", {"options", "scale", "step_s"})):
        done("evaluate", f"genome={genome}", "environment=envs.py:One", *few, f"hydra.run.dir=of_{Path(genome).stem}")
        notes = " ".join(Run(Path(f"of_{Path(genome).stem}")).provenance.get("notes", []))
        assert set(re.findall(r"environment\.(\w+)=", notes)) == different
        assert pd.read_csv(f"of_{Path(genome).stem}/metrics.csv")["return"][0] == (1000 if different else 3000)


@pytest.mark.usefixtures("here")
def test_what_has_no_id_and_no_genome_names_both_keys():
    said = refused("evaluate", "genome=runs/evolve/missing", "environment=gym")
    assert "genome=runs/evolve/missing" in said
    assert "environment.id" in said
    assert "Malformed" not in refused("evolve", "environment=gym")


def test_what_is_compared_has_the_name_and_the_settings_of_a_run_of_its_own():
    words = ["environment=cartpole", "genome=x", "hebbian=oja"]

    def controllers(*more):
        return load_any("evaluate", [*words, *more]).controllers

    (alone,) = (one.rule for one in controllers("hebbian=paper") if one.name == "paper")
    assert [one.rule for one in controllers("compare=[paper]") if one.name == "paper"] == [alone]
    assert controllers("compare=[none]") == controllers()
    plain = controllers("compare.plain={rule: none}")[-1]
    assert (plain.name, type(plain.rule)) == ("plain", NoRule)
    with pytest.raises(ConfigError, match=r"compare\.x"):
        controllers("compare.x=3")


@pytest.mark.parametrize(
    ("words", "text"),
    [
        (["environment.population=3"], "environment.population"),
        (["environment.loops=3"], "environment.loops"),
        (["environment.changes=[{at: 5, length: 2, length: 3}]"], "environment.changes"),
        (["compare.x={rule: oja, N: 1e-3, N: 1e-2}"], "compare.x"),
    ],
)
@pytest.mark.usefixtures("here")
def test_what_would_do_nothing_is_refused(words, text):
    said = refused("evaluate", "environment=cartpole", "genome=x.npz", *words)
    assert text in said
    assert f"mean {text}" not in said


@pytest.mark.usefixtures("here")
def test_a_named_change_is_a_list_of_changes():
    assert "environment.named" in refused("evolve", "environment=cartpole", "environment.named.foo=3")


def test_an_environment_that_goes_elsewhere_takes_no_result_along(here):
    (here / "mine.py").write_text(
        "import os\nimport gymnasium\nimport numpy as np\n\n\nclass Away(gymnasium.Env):\n"
        "    observation_space = gymnasium.spaces.Box(-1, 1, (2,), np.float64)\n"
        "    action_space = gymnasium.spaces.Box(-1, 1, (1,), np.float64)\n\n"
        "    def __init__(self):\n        os.chdir('/')\n\n"
        "    def reset(self, *, seed=None, options=None):\n        os.chdir('/')\n        return np.zeros(2), {}\n\n"
        "    def step(self, action):\n        return np.zeros(2), 1.0, True, False, {}\n"
    )
    words = ["environment=mine.py:Away", "optimizer.population=4", "optimizer.generations=1", "figures=none"]
    done("evolve", *words, "environment.processes=1", "hydra.run.dir=one")
    done("evolve", *words, "environment.processes=1", "-m", "seed=1,2", "hydra.sweep.dir=many")
    assert all((here / run / "champion.npz").is_file() for run in ("one", "many/0", "many/1"))
    assert Path.cwd() == here
