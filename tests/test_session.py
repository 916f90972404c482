"""A lifetime in progress: run in pieces, in worlds that change by hand, beside others, always bit-identical."""

from dataclasses import replace
from typing import get_type_hints

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from epuckhebb.adaptation.adaptation import Adaptation
from epuckhebb.adaptation.change_signal import no_nominal
from epuckhebb.controller.genome import make_plan
from epuckhebb.controller.network import Network
from epuckhebb.controller.plasticity.rule import NoRule
from epuckhebb.controller.plasticity.rules.bcm import BCM
from epuckhebb.controller.plasticity.rules.differential import Differential
from epuckhebb.controller.plasticity.rules.modulated import Modulated
from epuckhebb.controller.plasticity.rules.oja import Oja
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.evolution.optimizer import initial
from epuckhebb.tmaze.batch import run_lifetimes
from epuckhebb.tmaze.individual import GA_ALONE, Controller, Individual
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.light import Lamp
from epuckhebb.tmaze.maze import SIDES, T_MAZE, Place, Pose
from epuckhebb.tmaze.robot import Robot
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.session import Session
from epuckhebb.tmaze.tasks.reversal import Reversal

HEBBIAN = Controller(name="Hebbian", rule=Paper(N=0.002))
NOVEL = Controller(
    name="x",
    rule=Paper(N=0.002),
    adaptation=Adaptation(change_signal="late", threshold=0.2, active_s=1, rest_s=1, motor_noise=1),
)
CHANGES = (
    {"at_s": 1.0, "light": 1.0, "left_wheel": 0.5, "dead_sensors": [0, 3]},
    {"at_s": 3.0, "obstacles": 4},
    {"at_s": 5.008, "obstacles": 0, "lamp": {"intensity": 0.0}},
)
SHORT = Lifetime(duration_s=8.0, gain_rad_s=4.0, record_every=1)
PIECES = st.lists(st.integers(0, 250), max_size=6)


def individual_of(genes, side="left", **more):
    return Individual(genes=genes, side=side, key=np.uint64(1), record=True, **more)


def run_in_pieces(session, pieces=()):
    """The outcome and the samples of a lifetime that is run in pieces of so many steps, then to its end."""
    for count in [*pieces, session.lifetime.steps]:
        before = session.steps
        assert session.step(count) == session.steps - before
    assert session.is_over
    assert session.step() == 0
    return session.outcome(), session.samples


def assert_bit_identical(one, other):
    (outcome, samples), (same, those) = one, other
    assert np.array(outcome).tobytes() == np.array(same).tobytes()
    assert outcome.trials.tobytes() == same.trials.tobytes()
    for name in set(samples._fields) - {"phase_began"}:  # of which a world that is changed by hand has one
        assert getattr(samples, name).tobytes() == getattr(those, name).tobytes(), name


def assert_pieces_are_the_whole(individual, scenario, lifetime, pieces):
    whole = run_lifetimes([individual], scenario, lifetime)[0]
    assert_bit_identical(run_in_pieces(Session(individual, scenario, lifetime), pieces), whole)


@given(
    controller=st.sampled_from([GA_ALONE, HEBBIAN, NOVEL]),
    changes=st.sampled_from([(), CHANGES]),
    pieces=PIECES,
    side=st.sampled_from(SIDES),
    every=st.sampled_from([1, 3]),
)
def test_stepping_in_pieces_is_bit_identical(genomes, controller, changes, pieces, side, every):
    individual = individual_of(
        genomes[0], side, controller=controller, nominal=no_nominal(16, 8)._replace(time_to_goal_s=8.0)
    )
    assert_pieces_are_the_whole(individual, Scenario(changes=changes), replace(SHORT, record_every=every), pieces)


@pytest.mark.thorough
@given(rule=st.sampled_from([Oja, BCM, Differential]), pieces=PIECES, side=st.sampled_from(SIDES))
def test_stepping_in_pieces_is_bit_identical_with_other_rules(genomes, rule, pieces, side):
    individual = individual_of(genomes[0], side, controller=Controller(name="x", rule=rule(N=0.0005)))
    assert_pieces_are_the_whole(individual, Scenario(), SHORT, pieces)


@given(pieces=st.lists(st.integers(0, 900), max_size=6), every=st.sampled_from([1, 7]))
def test_stepping_through_trials_is_bit_identical(pieces, every):
    """The task ends before the time: the samples after that are padded once."""
    network = Network((17, 7, 5, 8, 4, 2), rewarded=True)
    genes = initial(np.random.default_rng(897), 1, make_plan(network, Modulated))[0]
    task = Reversal(trials=3, first_switch=2, last_switch=2, never=0.0, time_out_s=16.0)
    individual = individual_of(genes, network=network, controller=Controller(name="modulated", rule=Modulated(N=0.003)))
    lifetime = Lifetime(duration_s=55.0, gain_rad_s=4.0, record_every=every)
    scenario = Scenario(task=task, lamp=Lamp(intensity=0.0))
    assert_pieces_are_the_whole(individual, scenario, lifetime, pieces)


@pytest.mark.parametrize("controller", [GA_ALONE, HEBBIAN], ids=["fixed", "plastic"])
def test_a_change_by_hand_is_bit_identical_to_one_that_was_planned(genomes, controller):
    planned = Scenario(changes=CHANGES)
    individual = individual_of(genomes[1], controller=controller)
    session = Session(individual, Scenario(), SHORT)
    for first, world in planned.phases[1:]:
        session.step(first - session.steps)
        session.change(world)
        session.change(world)  # a second time changes nothing
    assert_bit_identical(run_in_pieces(session), run_lifetimes([individual], planned, SHORT)[0])


@pytest.mark.thorough
def test_a_fault_that_comes_by_hand_is_bit_identical_to_one_that_was_planned(genomes):
    """The kernel of a world without it goes on in the kernel that knows it, in the midst of a turn."""
    fault = {"at_s": 2.0, "mass_ratio": 8.0, "left_slip": 0.5, "distance_gain": 0.7}
    planned = Scenario(changes=[fault])
    individual = individual_of(genomes[1])
    session = Session(individual, Scenario(), SHORT)
    session.step(planned.phases[1][0])
    session.change(planned.phases[1][1])
    assert_bit_identical(run_in_pieces(session), run_lifetimes([individual], planned, SHORT)[0])


def test_a_world_that_is_changed_keeps_its_own_plan(genomes):
    """Changes of the past hold already, those ahead come in their time."""
    planned, individual = Scenario(changes=CHANGES), individual_of(genomes[1])
    session = Session(individual, planned, SHORT)
    for count in (10, 60, 40, 100):
        session.step(count)
        session.change(planned)
    assert_bit_identical(run_in_pieces(session), run_lifetimes([individual], planned, SHORT)[0])
    with pytest.raises(ValueError, match=r"robot may not change .*: got other for epuck"):
        session.change(Scenario(robot=Robot(name="other")))


def test_sessions_at_once_do_not_disturb_each_other(genomes):
    individuals = [individual_of(genome, controller=HEBBIAN) for genome in genomes[:3]]
    sessions = [Session(one, Scenario(), SHORT) for one in individuals]
    while not all(session.is_over for session in sessions):
        for number, session in enumerate(sessions):
            session.step(number + 5)
    together = run_lifetimes(individuals, Scenario(), SHORT)
    for session, whole in zip(sessions, together, strict=True):
        assert_bit_identical((session.outcome(), session.samples), whole)


@pytest.mark.parametrize("controller", [GA_ALONE, HEBBIAN, NOVEL], ids=["fixed", "plastic", "adaptive"])
def test_a_block_of_lifetimes_is_each_of_them_alone(genomes, controller):
    """They take turns in one space, bump into walls and obstacles, and start elsewhere; sides are mixed."""
    starts, nominal = [None, Pose(0.0, -0.3, 1.2)], no_nominal(16, 8)._replace(time_to_goal_s=8.0)
    individuals = [
        Individual(
            genes=genes, side=side, key=np.uint64(key), controller=controller, start=starts[key % 2], nominal=nominal
        )
        for key, genes in enumerate(genomes[:6])
        for side in SIDES
    ]
    world, length = Scenario(obstacles=4), replace(SHORT, duration_s=30.0)
    for one, whole in zip(individuals, run_lifetimes(individuals, world, length, threads=2), strict=True):
        assert_bit_identical(run_in_pieces(Session(one, world, length)), whole)


@pytest.mark.thorough
def test_a_block_of_lifetimes_of_many_trials_is_each_of_them_alone():
    network = Network((17, 7, 5, 8, 4, 2), rewarded=True)
    population = initial(np.random.default_rng(897), 4, make_plan(network, Modulated))
    modulated = Controller(name="modulated", rule=Modulated(N=0.003))
    individuals = [
        Individual(genes=genes, side="left", key=np.uint64(1), network=network, controller=modulated, task_key=key)
        for key, genes in enumerate(population)
    ]
    world = Scenario(task=Reversal(trials=3, time_out_s=16.0), lamp=Lamp(intensity=0.0))
    length = Lifetime(duration_s=55.0, gain_rad_s=4.0)
    for one, whole in zip(individuals, run_lifetimes(individuals, world, length), strict=True):
        assert_bit_identical(run_in_pieces(Session(one, world, length)), whole)


def numbers_of(record):
    """The declared and the present type of each number that machine code is given in a record, by its place."""
    for name, declared in get_type_hints(type(record)).items():
        value = getattr(record, name)
        if declared in (int, float):
            yield name, declared, type(value)
        elif declared == tuple[float, ...]:
            yield from ((name, float, type(number)) for number in value)
        elif hasattr(value, "_fields"):
            yield from ((f"{name}.{place}", *types) for place, *types in numbers_of(value))


WHOLE = Scenario(
    light=1,
    second_lamp=[0, 1, 1],
    lamp=Lamp(x_m=0, y_m=0, towards_x=1, towards_y=0, beam_rad=1, intensity=3),
    **dict.fromkeys(["distance_gain", "left_wheel", "right_wheel", "mass_ratio", "rate"], 1),
    **dict.fromkeys(["distance_offset", "left_slip", "right_slip", "wall_friction", "crosstalk", "sun_turn_deg"], 0),
    maze=replace(T_MAZE, arena_m=2, goal_radius_m=1, start=Pose(0, 0, 0), goals={side: Place(1, 0) for side in SIDES}),
)
WHOLE_LIFETIME = Lifetime(duration_s=2, gain_rad_s=4, noise=1)


@pytest.mark.parametrize("side", SIDES)
@pytest.mark.parametrize("rule", [Paper(N=1, floor=0, w_max=2), NoRule()])
def test_machine_code_gets_fractions_where_whole_numbers_are_given(genomes, rule, side):
    """It is called without a look at types (`SameTypes`), and would cut a fraction where it expects a whole number."""
    individual = individual_of(genomes[0], side, controller=Controller(name="x", rule=rule))
    setup = Session(individual, WHOLE, WHOLE_LIFETIME).block.setup
    numbers = list(numbers_of(setup))
    assert {name for name, *_ in numbers} >= {"gain", "goal_x", "faults.left_slip", "lit.lamp_x"}
    assert [number for number in numbers if number[1] is not number[2]] == []


def test_genes_and_signs_in_any_form_are_the_same_lifetime(genomes):
    """Those of the second and the third are apart in memory, or of another type; the first call fixes the types."""
    genes, signs = genomes[0].astype(np.float32).astype(float), np.ones(genomes.shape[1])
    forms = [np.array, lambda values: np.stack([values, -values], axis=1)[:, 0], np.float32]
    same = [individual_of(form(genes), controller=HEBBIAN, signs=form(signs)) for form in forms]
    first, *others = run_lifetimes(same, Scenario(), SHORT)
    for other in others:
        assert_bit_identical(first, other)
