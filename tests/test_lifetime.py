"""A lifetime against its oracle, against an independent prototype, and against itself."""

import csv
import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from cases import first_of
from hypothesis import given
from hypothesis import strategies as st

from epuckhebb.controller.network import Network
from epuckhebb.controller.plasticity.control import Sign, signs
from epuckhebb.controller.plasticity.rule import NoRule
from epuckhebb.controller.plasticity.rules.bcm import BCM
from epuckhebb.controller.plasticity.rules.differential import Differential
from epuckhebb.controller.plasticity.rules.oja import Oja
from epuckhebb.controller.plasticity.rules.paper import Paper
from epuckhebb.tmaze import simulator
from epuckhebb.tmaze.batch import run_lifetimes
from epuckhebb.tmaze.block import LostRobotError
from epuckhebb.tmaze.fitness import Signal
from epuckhebb.tmaze.individual import GA_ALONE, Controller, Individual
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.light import Lamp
from epuckhebb.tmaze.maze import SIDES, Pose
from epuckhebb.tmaze.robot import Robot
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.simulator import lifetime_kernel

DATA = Path(__file__).parent / "data"
LAMPS = {"wide": Lamp(), "narrow": Lamp(y_m=-0.3, beam_rad=0.8)}
RULES = {rule: rule(N=0.0005) for rule in (Paper, Oja, BCM, Differential)}


def learning(N=0.002, **settings):
    return Controller(name="Hebbian", rule=Paper(N=N, **settings))


@pytest.mark.parametrize("signal", [one for one in Signal if one is not Signal.fitness])
@pytest.mark.parametrize("side", SIDES)
def test_agrees_with_the_oracle_step_by_step(genomes, beside_the_oracle, side, signal):
    beside_the_oracle(genomes[1], side, Scenario(obstacles=4), learning(signal=signal))


@pytest.mark.parametrize("sign", list(Sign))
@pytest.mark.parametrize("rule", first_of(RULES))
def test_every_rule_and_sign_agrees_with_the_oracle(genomes, beside_the_oracle, rule, sign):
    of_updates = signs(sign, 234, np.random.default_rng(4))
    controller = Controller(name="x", rule=RULES[rule])
    outcome, *_ = beside_the_oracle(genomes[2], "right", None, controller, seconds=60, signs=of_updates)
    assert outcome.weight_change_mean > 0.01


@pytest.mark.thorough
@pytest.mark.parametrize("side", SIDES)
def test_a_small_network_agrees_with_the_oracle(beside_the_oracle, side):
    network = Network((16, 10, 6, 2))
    genes = np.random.default_rng(130).uniform(-1, 1, network.synapses)
    scenario = Scenario(obstacles=4, layout=7, left_wheel=0.9, light=1.0)
    beside_the_oracle(genes, side, scenario, learning(), network, 100)


@pytest.mark.parametrize("side", SIDES)
def test_agrees_with_the_prototype_step_by_step(genomes, run_lifetime, side):
    with (DATA / "trace.csv").open() as file:
        rows = [row for row in csv.DictReader(file) if row["side"] == side]
    _, samples = run_lifetime(genomes[0], side, N=0.002, seconds=20, noise=0)
    for row in rows:
        k = int(row["step"])
        mine = [*samples.pose[k], *samples.sensors[k], *samples.motors[k], samples.fitness[k], samples.weight_change[k]]
        assert mine == pytest.approx([float(value) for value in list(row.values())[2:]], abs=1e-6)


def test_agrees_with_the_prototype_over_whole_lifetimes(genomes):
    expected = pd.read_csv(DATA / "expected.csv", keep_default_na=False)
    differences = []
    for (name, duration), group in expected.groupby(["scenario", "duration_s"]):
        first = group.iloc[0]
        scenario = Scenario(name=name, light=float(first.light), obstacles=int(first.obstacles), lamp=LAMPS[first.lamp])
        individuals = [
            Individual(
                genes=genomes[row.genome],
                side=row.side,
                controller=learning(row.N, signal=Signal[row.signal or "behaviour"]),
                key=np.uint64(0),
            )
            for row in group.itertuples()
        ]
        outcomes = run_lifetimes(individuals, scenario, Lifetime(duration_s=float(duration), noise=0), threads=2)
        differences += [
            (
                outcome.success != bool(row.success),
                abs(outcome.path_length - row.path_length_m),
                abs(outcome.final_distance - row.final_position_error_m),
                abs(outcome.weight_change_mean - row.weight_change_mean) / max(row.weight_change_mean, 1.0),
                abs(outcome.fitness - row.fitness),
            )
            for row, (outcome, _) in zip(group.itertuples(), outcomes, strict=True)
        ]
    differences = np.array(differences, float)
    assert len(differences) == 180
    assert (np.median(differences, axis=0) < 1e-5).all()
    within = (differences < [0.5, 1e-3, 1e-3, 0.03, 1e-3]).mean(axis=0)
    assert (within > 0.88).all(), within


def test_who_has_no_rule_lives_in_the_kernel_of_the_others_on_any_threads(genomes, monkeypatch):
    asked = set()
    monkeypatch.setattr(
        simulator,
        "lifetime_kernel",
        lambda rule, *args, **more: asked.add(rule) or lifetime_kernel(rule, *args, **more),
    )
    individuals = [
        Individual(genes=genomes[0], side="left", controller=controller, key=np.uint64(1))
        for controller in (GA_ALONE, GA_ALONE, learning(0.002), learning(0.002))
    ]
    run_lifetimes(individuals, Scenario(), Lifetime(duration_s=1.0), threads=4)
    assert asked == {Paper}


def test_alone_in_a_block_and_on_any_threads_the_bits_are_the_same(genomes):
    controllers = [GA_ALONE, learning(1.5e-5), learning(0.002)]
    individuals = [
        Individual(genes=genome, side=side, controller=controller, key=np.uint64(k))
        for k, genome in enumerate(genomes)
        for side in SIDES
        for controller in controllers
    ]
    scenario, lifetime = Scenario(obstacles=4), Lifetime(duration_s=40, gain_rad_s=4)
    together = [outcome for outcome, _ in run_lifetimes(individuals, scenario, lifetime)]
    for threads in (2, 3, 16):
        assert _bits([o for o, _ in run_lifetimes(individuals, scenario, lifetime, threads)]) == _bits(together)
    alone = [run_lifetimes([individual], scenario, lifetime)[0][0] for individual in individuals]
    assert _bits(alone) == _bits(together)
    backwards = [outcome for outcome, _ in run_lifetimes(individuals[::-1], scenario, lifetime)][::-1]
    assert _bits(backwards) == _bits(together)


@pytest.mark.parametrize("rule", first_of([*RULES, NoRule]))
def test_a_robot_that_does_not_learn_is_bit_identical_with_every_rule(genomes, run_lifetime, rule):
    outcome, samples = run_lifetime(genomes[2], controller=Controller(name="x", rule=rule()))
    alone, of_alone = run_lifetime(genomes[2], controller=GA_ALONE)
    assert _bits(outcome) == _bits(alone)
    assert _bits(samples.pose) == _bits(of_alone.pose)
    assert (samples.weights == genomes[2].astype(np.float32)).all()


def test_no_rule_learns_nothing_whatever_its_rate_and_whoever_lives_beside_it(genomes):
    idle = Controller(rule=NoRule(N=0.5))
    individuals = [
        Individual(genes=genomes[0], side="left", controller=controller, key=np.uint64(1))
        for controller in (idle, learning(), GA_ALONE)
    ]
    (nothing, _), _, (alone, _) = run_lifetimes(individuals, Scenario(), Lifetime(duration_s=8))
    assert nothing.weight_change_mean == 0
    assert _bits(nothing) == _bits(alone)


def test_the_opposite_of_the_opposite_sign_is_the_rules_own(genomes, run_lifetime):
    once = signs(Sign.anti, 234, np.random.default_rng(0))
    plain, anti, back = (run_lifetime(genomes[0], N=0.002, signs=of) for of in (None, once, -once))
    assert _bits(plain[0]) == _bits(back[0]) != _bits(anti[0])
    assert _bits(plain[1].weights) == _bits(back[1].weights)


def _bits(outcomes):
    return np.array(outcomes).tobytes()


@given(
    seed=st.integers(0, 2**32 - 1),
    side=st.sampled_from(SIDES),
    N=st.sampled_from([0.0, 1e-5, 0.002, 1.0, 1e6]),
    w_max=st.sampled_from([2.0, 1.0, 5.0]),
)
def test_weights_stay_in_bounds_and_the_genome_survives(run_lifetime, seed, side, N, w_max):
    genome = np.random.default_rng(seed).uniform(-1, 1, 234)
    before = genome.copy()
    outcome, samples = run_lifetime(genome, side, N=N, seconds=3, w_max=w_max)
    assert (genome == before).all()
    assert np.abs(samples.weights).max() <= w_max
    assert np.isfinite(samples.pose).all()
    if N == 0:
        assert (samples.weights == before.astype(np.float32)).all()
        assert outcome.weight_change_mean == outcome.weight_change_final == 0
    else:
        assert outcome.weight_change_final > 0


def test_a_robot_that_does_not_move_has_known_metrics(run_lifetime):
    outcome, samples = run_lifetime(np.zeros(234), seconds=8, noise=0)
    assert outcome.path_length == 0
    assert math.isnan(outcome.time_to_goal)
    assert not outcome.success
    assert outcome.final_distance == pytest.approx(math.hypot(0.367, 0.505))
    nearest = samples.sensors[0, 8:].max()
    assert outcome.behaviour == pytest.approx((0 + 2 * (1 - nearest**3) + 1 + 0) / 5)
    assert outcome.fitness == pytest.approx(outcome.behaviour / 2)  # no reward farther than 0.59 m from the goal


def test_what_is_learnt_is_reset_at_the_end(genomes, run_lifetime):
    first, again = (run_lifetime(genomes[0], N=0.002)[0] for _ in range(2))
    assert _bits(first) == _bits(again)


def test_noise_matters_and_depends_on_the_key(genomes, run_lifetime):
    quiet = run_lifetime(genomes[0], noise=0)[0]
    assert run_lifetime(genomes[0], noise=0, key=2)[0] == pytest.approx(quiet, nan_ok=True)
    assert run_lifetime(genomes[0], key=1)[0].path_length != run_lifetime(genomes[0], key=2)[0].path_length


def test_samples_are_every_so_many_steps(genomes, run_lifetime):
    _, every = run_lifetime(genomes[0], N=0.002)
    _, third = run_lifetime(genomes[0], N=0.002, record_every=3)
    for name in every._fields:
        np.testing.assert_array_equal(getattr(third, name), getattr(every, name)[::3])


def test_a_robot_that_is_lost_fails_loudly(genomes):
    for start in (Pose(math.nan, 0.0, 0.0), Pose(0.0, 0.0, math.inf), Pose(0.6, 0.0, 0.0)):
        individual = Individual(genes=genomes[0], side="left", key=np.uint64(0), start=start)
        with pytest.raises(LostRobotError, match=r"left trial of scenario base, controller GA, .* at step 0 of 250"):
            run_lifetimes([individual], Scenario(), Lifetime(duration_s=8))


def refused(message, genes=234, scenario=None, error=ValueError, **more):
    individual = Individual(genes=np.zeros(genes), side="left", key=np.uint64(0), **more)
    with pytest.raises(error, match=message):
        run_lifetimes([individual], scenario or Scenario(), Lifetime(duration_s=8))


def test_sizes_that_do_not_fit_are_refused_with_their_numbers(lidar):
    refused(r"234 genes, got 238", 238)
    refused(r"234 genes, got 0", 0)
    refused(r"234 signs .* got 233", signs=np.ones(233))
    refused(r"network\.layers must begin with 16", 26, network=Network((12, 2)))
    refused(r"network\.layers must begin with 32", scenario=Scenario(robot=lidar))
    refused(r"network\.layers must end with 2", 85, network=Network((16, 5)))


@pytest.mark.parametrize("layers", [(16,), (16, 0, 2), (16, 3.5, 2), (), (16, 90000, 2)])
def test_invalid_networks_are_refused(layers):
    with pytest.raises(ValueError, match=r"network\.layers"):
        Network(layers)


def test_a_gain_that_the_motors_do_not_reach_is_refused():
    slow = Robot(name="slow", motor_limit_rad_s=0.5)
    with pytest.raises(ValueError, match=r"lifetime.gain_rad_s must .* robot.motor_limit_rad_s, 0.5"):
        Scenario(robot=slow).check_lifetime(Lifetime())
    with pytest.raises(ValueError, match=r"lifetime.gain_rad_s must .* 6.28, got"):
        Scenario().check_lifetime(Lifetime(gain_rad_s=6.3))


INVALID = {"duration_s": (0.0, math.inf), "gain_rad_s": (0.0, math.nan), "noise": (-1.0,), "record_every": (-1,)}


@pytest.mark.parametrize(("key", "value"), [(key, value) for key, values in INVALID.items() for value in values])
def test_invalid_lifetimes_are_refused_by_name(key, value):
    with pytest.raises(ValueError, match=rf"lifetime\.{key} must"):
        Lifetime(**{key: value})


@pytest.mark.parametrize(
    ("key", "value", "allowed"),
    [
        ("obstacles", 3, "0, 2, 4"),
        ("dead_sensors", (8,), "0 to 7"),
        ("dead_sensors", (True,), "0 to 7"),
        ("dead_sensors", 1, "whole numbers"),
        ("dead_sensors", (0, 3, 0), "different"),
        ("layout", -1, "0"),
        ("left_wheel", 1.1, "0, 1"),
        ("right_slip", 1.0, r"\[0, 1\)"),
        ("distance_gain", 0.0, "more than 0"),
        ("distance_offset", 1.0, "-1, 1"),
        ("mass_ratio", 0.0, "1"),
        ("wall_friction", -0.1, "0 or more"),
        ("light", math.nan, "0, "),
        ("experiment", "x", "light, obstacles"),
    ],
)
def test_invalid_scenarios_are_refused_by_name(key, value, allowed):
    with pytest.raises(ValueError, match=rf"scenario\.{key} must .*{allowed}"):
        Scenario(**{key: value})
