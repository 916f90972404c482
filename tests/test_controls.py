"""Controls of equal size: yoked lifetimes beside their masters and the oracle, draws, random and other genomes."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cases import SHORT, done, first_of, refused
from test_ode import needs_ode
from test_reversal import REWARDED, drawn, switching
from test_session import assert_bit_identical, run_in_pieces

from epuckhebb.analysis.evaluate import make_individuals
from epuckhebb.config import EvaluateConfig, load
from epuckhebb.controller.genome import make_plan
from epuckhebb.controller.network import PAPER_NETWORK, Network
from epuckhebb.controller.plasticity.control import Control, Track, Yoking, make_tracking, yoking
from epuckhebb.controller.plasticity.rules.oja import Oja
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.runs import prepare_evaluation
from epuckhebb.store.genome import load_genome
from epuckhebb.tmaze.batch import run_lifetimes
from epuckhebb.tmaze.individual import Controller, Individual
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.session import Session

YOKED = (Control.yoked_sign, Control.yoked_place)
SAME = Yoking(np.arange(234), np.ones(234))
DIM = Scenario(light=0.1)
RESET = ({"at_s": 2.0, "reset": True, "rate": 3.0}, {"at_s": 4.0, "obstacles": 4})


def controller(control=Control.none, rule=Paper, **settings):
    return Controller(name="x", rule=rule(**{"N": 0.002, "control": control, **settings}))


def pair(genes, control, drawn, **settings):
    """A master and the one that is yoked to it."""
    alone = Individual(genes=genes, side="right", key=np.uint64(3), controller=controller(**settings), record=True)
    return alone, replace(alone, controller=controller(control, **settings), yoking=drawn)


@pytest.mark.parametrize("control", first_of(YOKED))
@pytest.mark.parametrize("settings", first_of([{"w_max": 1.05}, {"rule": Oja, "every": 3}, {"normalise": "length"}]))
def test_a_yoked_lifetime_agrees_with_the_oracle_step_by_step(genomes, beside_the_oracle, control, settings):
    drawn, world = yoking(control, PAPER_NETWORK, 1, 5), Scenario(light=0.1, changes=({"at_s": 3.0, "obstacles": 4},))
    outcome, samples, robot = beside_the_oracle(
        genomes[4], "right", world, controller(control, **settings), seconds=30.0, yoking=drawn
    )
    assert outcome.weight_path == pytest.approx(robot.path, rel=1e-9)
    assert outcome.weight_path >= outcome.weight_change_final * (1 - 1e-9) > 0
    assert (samples.rate == 0).all()
    assert not (samples.weights[-1] == genomes[4].astype(np.float32)).all()


@pytest.mark.parametrize("world", [replace(DIM, changes=RESET), pytest.param("ode", marks=needs_ode)])
def test_with_the_masters_own_changes_it_is_the_master_to_the_bit(genomes, world):
    world = load(EvaluateConfig, ["scenario=lowlight", "physics=ode"]).world if world == "ode" else world
    alone, same = pair(genomes[4], Control.yoked_sign, SAME, w_max=1.2)
    lifetime = Lifetime(duration_s=8.0, gain_rad_s=4.0, record_every=1)
    ((by_itself, without),) = run_lifetimes([alone], world, lifetime)
    (outcome, samples), (yoked, those) = run_lifetimes([alone, same], world, lifetime)
    for name in ("weights", "pose", "sensors", "motors", "weight_change"):
        assert getattr(samples, name).tobytes() == getattr(without, name).tobytes() == getattr(those, name).tobytes()
    assert np.isnan(by_itself.weight_path)
    assert outcome.weight_path == yoked.weight_path > 0
    same_but_path = [np.array(one._replace(weight_path=0.0)).tobytes() for one in (outcome, by_itself, yoked)]
    assert len(set(same_but_path)) == 1


@pytest.mark.parametrize("control", YOKED)
def test_changes_that_meet_no_bound_are_of_equal_size(genomes, control):
    alone, yoked = pair(genomes[0], control, yoking(control, PAPER_NETWORK, 0, 5), N=1e-5)
    (master, _), (own, samples) = run_lifetimes([alone, yoked], Scenario(), Lifetime(duration_s=8.0, record_every=1))
    assert np.abs(samples.weights).max() < 2
    assert own.weight_path == pytest.approx(master.weight_path, rel=1e-9)


@pytest.mark.parametrize("pieces", [(1, 7, 60), (249,)])
def test_a_yoked_lifetime_in_pieces_is_the_whole(genomes, pieces):
    _, yoked = pair(genomes[4], Control.yoked_place, yoking(Control.yoked_place, PAPER_NETWORK, 2, 5))
    lifetime, world = Lifetime(duration_s=8.0, gain_rad_s=4.0, record_every=1), replace(DIM, changes=RESET)
    whole = run_lifetimes([yoked], world, lifetime)[0]
    assert_bit_identical(run_in_pieces(Session(yoked, world, lifetime), pieces), whole)


def test_the_weights_of_one_that_lives_longer_than_its_master_rest():
    lifetime = Lifetime(duration_s=60, gain_rad_s=4.0, record_every=1)
    genes = drawn(2547)[: REWARDED.synapses]
    draws = [yoking(control, REWARDED, draw, 5) for control in YOKED for draw in range(5)]
    both = [replace(one, network=REWARDED) for each in draws for one in pair(genes, Control.yoked_sign, each, N=0.0005)]
    (master, _), *others = run_lifetimes(both, switching(3, trials=3), lifetime)
    longer = [samples.weights for own, samples in others if own.steps > master.steps]
    assert longer
    for weights in longer:
        assert not (weights[master.steps - 2] == weights[master.steps - 1]).all()
        assert (weights[master.steps - 1 :] == weights[-1]).all()


def test_a_step_by_hand():
    network = Network((1, 1))  # two weights, of the input and the bias
    begin, end = make_tracking(network)
    kept, change, genes = np.array([[[1.0, 0.5], [1.25, 0.5]]]), np.zeros(16), np.array([1.5, -0.5])
    for places, signs, expected in (
        ([0, 1], [1.0, 1.0], [1.75, -0.5]),
        ([0, 1], [-1.0, 1.0], [1.25, -0.5]),
        ([1, 0], [1.0, 1.0], [1.5, -0.25]),
    ):
        weights, track = genes.copy(), Track(True, kept, Yoking(np.array(places), np.array(signs)), 2.0, np.zeros(1))
        begin(weights, track, 0)
        assert end(weights, genes, track, 0, change, 9.0) == track.path[0] == 0.25
        assert weights.tolist() == expected
    bound = Track(True, kept, SAME._replace(places=np.array([0, 1]), signs=np.array([1.0, 1.0])), 1.0, np.zeros(1))
    weights = genes.copy()
    end(weights, genes, bound, 0, change, 0.0)
    assert weights.tolist() == [1.0, -0.5]


def wanted(seed, genes, *controllers):
    some = [(number, "left", 0) for number in range(len(controllers))]
    return make_individuals(genes, controllers, some, None, make_plan(PAPER_NETWORK), PAPER_NETWORK, seed, None)


@pytest.mark.parametrize("control", YOKED)
def test_five_draws_differ_and_no_seed_changes_one(genomes, control):
    draws = [controller(control, sign="shuffled", sign_draw=draw) for draw in range(5)]
    drawn, again = (wanted(seed, genomes[0], *draws) for seed in (1, 2))
    assert [one.key for one in drawn] != [one.key for one in again]
    for which in (lambda one: one.signs, lambda one: np.concatenate(one.yoking)):
        assert [which(one).tobytes() for one in drawn] == [which(one).tobytes() for one in again]
        assert len({which(one).tobytes() for one in drawn}) == 5
    others = wanted(1, genomes[1], *draws)
    assert not any((one.signs == other.signs).all() for one, other in zip(drawn, others, strict=True))
    for one in drawn:
        places, signs = one.yoking
        if control is Control.yoked_sign:
            assert (places == np.arange(234)).all()
            assert (signs == one.signs).all()
        else:
            assert (signs == 1).all()
            for first, count in zip((0, 119, 154, 194, 226), (119, 35, 40, 32, 8), strict=True):
                layer = places[first : first + count]
                assert sorted(layer) == list(range(first, first + count))
                assert (layer != np.arange(first, first + count)).any()


@pytest.mark.usefixtures("here")
def test_tables_have_the_controls_and_the_total_change():
    words = ["hebbian.control=yoked_sign", "compare.rule={control: none}", "compare.shuffled={sign: shuffled}"]
    words += ["compare.places={control: yoked_place, sign_draw: 4}", "scenario=lowlight", *SHORT, "figures=none"]
    done("evaluate", *words, "hydra.run.dir=run")
    rows = pd.read_csv("run/metrics.csv")
    path = rows.groupby("controller").weight_path.sum()
    assert set(path.index) == {"GA", "yoked, signs", "rule", "shuffled", "places"}
    assert path["GA"] == 0
    assert (path.drop("GA") > 0).all()
    done("rerun", "run")
    done("evaluate", *SHORT, "figures=none", "hydra.run.dir=alone")
    alone = pd.read_csv("alone/metrics.csv").set_index("controller").weight_path
    assert alone["Hebbian"].isna().all()
    assert (alone["GA"] == 0).all()


@pytest.mark.parametrize(
    ("words", "key"),
    [
        ("evaluate/hebbian.sign_draw=5/hebbian.sign=shuffled", "hebbian.sign_draw"),
        ("evaluate/hebbian.sign_draw=1", "hebbian.sign_draw"),
        ("evaluate/compare.x={sign_draw:1}", "hebbian.sign_draw"),
        ("evaluate/hebbian.control=other", "hebbian.control"),
        ("evaluate/hebbian=none/hebbian.control=yoked_sign", "hebbian.control"),
        ("evaluate/hebbian.control=yoked_sign/adaptation=late", "hebbian.control"),
        ("evaluate/hebbian.control=yoked_place/network.wiring=elman", "hebbian.control"),
        ("evaluate/hebbian.control=yoked_sign/lifetime.duration_s=5000", "lifetime.duration_s"),
        ("evolve/hebbian=baldwin/hebbian.control=yoked_sign", "hebbian.control"),
        ("evolve/hebbian=baldwin/hebbian.sign=shuffled/hebbian.sign_draw=1", "hebbian.sign_draw"),
        ("evaluate/genome=random_1/network.wiring=elman/hebbian=none", "genome=random_1"),
        ("evaluate/genome=random_1/network.layers=[12,2]/hebbian=none", "network.layers"),
        ("evaluate/genome=random_1/hebbian=abcd", "genome=random_1"),
    ],
)
def test_what_cannot_be_is_refused(here, words, key):
    assert key in refused(*words.replace(":", ": ").split("/"), "hydra.run.dir=run")
    assert not (here / "run").exists()


def test_draws_are_refused_for_a_genome_that_has_signs_of_its_own():
    own = replace(load_genome("reference", "obstacles"), signs=np.ones(234))
    for words, fits in ((["hebbian.sign_draw=0"], True), (["hebbian.sign_draw=1"], False)):
        config = load(EvaluateConfig, ["hebbian.sign=shuffled", *words])
        if fits:
            assert prepare_evaluation(config, own).genome is own
        else:
            with pytest.raises(ValueError, match=r"hebbian\.sign_draw .*got 1"):
                prepare_evaluation(config, own)


@pytest.mark.usefixtures("here")
def test_random_genomes_are_those_of_their_numbers():
    first, other = (load_genome(name, "light") for name in ("random_1", "random_2"))
    assert first.genes.shape == (234,)
    assert first.sha256 == load_genome("random_1", "obstacles").sha256 != other.sha256
    assert -1 <= first.genes.min() < -0.95 < 0.95 < first.genes.max() <= 1
    small = load_genome("random_1", "light", (24, 5, 2))
    assert (str(small.network), small.genes.shape) == (str(Network((24, 5, 2))), (135,))
    done("evaluate", "-m", "genome=random_1,...,random_3", *SHORT, "figures=none", "hydra.sweep.dir=many")
    rows = pd.read_csv("many/summary.csv")
    assert list(rows.genome.unique()) == ["random_1", "random_2", "random_3"]
    assert not Path("many/figures").exists()
    done("figure", "many", "ends")
    assert [file.name for file in Path("many/figures").iterdir()] == ["ends.png"]
    done("evaluate", "-m", "genome=random_1,random_2", *SHORT, "figures=svg", "hydra.sweep.dir=drawn")
    assert [file.name for file in Path("drawn/figures").iterdir()] == ["ends.svg"]
