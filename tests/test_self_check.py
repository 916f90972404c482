"""The self-check: the calibration manoeuvre, what it finds, and what is corrected in the lifetime."""

import json
import math
import os
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import reference
from cases import call, done, first_of

from epuckhebb.adaptation.adaptation import Adaptation, Exploration
from epuckhebb.adaptation.change_signal import no_nominal
from epuckhebb.adaptation.controller import GA_ALONE, Controller
from epuckhebb.adaptation.self_check.calibration import STEPS, calibrate, check_space
from epuckhebb.adaptation.self_check.check import check, clear, unexplained
from epuckhebb.adaptation.self_check.corrections import (
    HEADINGS,
    check_corrections,
    corrected_readings,
    corrected_wheel,
    initial_correction_state,
    no_corrections,
    sunlit,
)
from epuckhebb.adaptation.self_check.memory import can_check_itself, measure_self, moments, regression
from epuckhebb.adaptation.wall_following import wall_following
from epuckhebb.analysis.evaluate import evaluate
from epuckhebb.analysis.replay import page
from epuckhebb.analysis.self_checks import findings, in_words, self_checks, text
from epuckhebb.config.compose import composed
from epuckhebb.config.schema import EvaluateConfig, typed
from epuckhebb.export.replay import sentences_of
from epuckhebb.store import genome
from epuckhebb.store.run import Run
from epuckhebb.tmaze.batch import run_lifetimes
from epuckhebb.tmaze.life import Lifetime
from epuckhebb.tmaze.maze import T_MAZE, Pose
from epuckhebb.tmaze.robot import EPUCK, STEP_S
from epuckhebb.tmaze.scenario import Scenario
from epuckhebb.tmaze.sensors import DistanceSensors, LightSensors
from epuckhebb.tmaze.session import Individual

BRIGHT = Scenario(name="highlight", experiment="light", light=1.0)
KEY = np.uint64(4)


def by(**adaptation):
    return Controller(name="x", adaptation=Adaptation(**adaptation))


CHECKS = by(self_check=True)


@pytest.fixture(scope="module")
def in_training(genomes):
    """Sensor readings of two lifetimes in the bright training world, every twentieth."""
    individuals = [Individual(genes=genomes[0], side=side, key=KEY, record=True) for side in ("left", "right")]
    recorded = run_lifetimes(individuals, BRIGHT, Lifetime(duration_s=60, gain_rad_s=4, record_every=20))
    return np.concatenate([samples.sensors for _, samples in recorded])


@pytest.fixture(scope="module")
def memory(in_training):
    return measure_self(BRIGHT, [in_training[:30], in_training[30:]])


def test_the_manoeuvre_ends_at_the_start_and_comes_near_both_walls():
    poses = calibrate(BRIGHT, "left", KEY, noise=0.0).poses
    assert len(STEPS) == 124
    np.testing.assert_allclose(poses[-1], T_MAZE.start, atol=1e-12)
    across = poses[:, 0] - T_MAZE.start.x
    assert (across.min(), across.max()) == pytest.approx((-0.01206, 0.01607), abs=1e-4)


def test_nothing_is_found_where_nothing_has_changed(memory):
    for side in ("left", "right"):
        for key in range(5):
            checked = check(memory, BRIGHT, side, np.uint64(key))
            assert (checked.corrected, unexplained(checked.found)) == ((), ())
            assert checked.found.lamp == (side == "right")
            assert checked.end == pytest.approx(T_MAZE.start)


@pytest.mark.thorough
def test_without_a_change_a_lifetime_after_a_self_check_is_bit_identical(genomes, memory):
    checked = check(memory, BRIGHT, "right", KEY)
    both = {"genes": genomes[0], "side": "right", "key": KEY, "start": checked.end, "record": True}
    pair = [Individual(**both), Individual(**both, controller=CHECKS, corrections=checked.corrections)]
    (one, alone), (other, corrected) = run_lifetimes(pair, BRIGHT, Lifetime(duration_s=8, gain_rad_s=4, record_every=1))
    assert np.array(one).tobytes() == np.array(other).tobytes()
    assert alone.sensors.tobytes() == corrected.sensors.tobytes()


@pytest.mark.parametrize(
    ("fault", "corrected"),
    [
        ({"left_wheel": 0.9}, ("left wheel",)),
        ({"right_wheel": 0.9}, ("right wheel",)),
        ({"light": 0.3}, ("light",)),
        ({"light": 1.5}, ("light",)),
        ({"dead_sensors": (3,)}, ("dead sensors",)),
        ({"left_wheel": 0.9, "light": 0.5, "dead_sensors": (6,)}, ("left wheel", "light", "dead sensors")),
    ],
)
def test_a_fault_is_found_within_three_standard_errors(memory, fault, corrected):
    for side in ("left", "right"):
        checked = check(memory, replace(BRIGHT, **fault), side, KEY)
        found = checked.found
        assert checked.corrected == corrected
        for place, wheel in enumerate(("left_wheel", "right_wheel")):
            assert abs(found.wheel_loss[place] - (1 - fault.get(wheel, 1))) < 3 * found.wheel_loss_error[place]
        assert abs(found.light_ratio - fault.get("light", 1)) < 3 * found.light_ratio_error
        assert found.dead_sensors == fault.get("dead_sensors", ())
        assert found.lamp == (side == "right")


def test_what_no_known_cause_explains_is_not_corrected(memory):
    checked = check(memory, replace(BRIGHT, left_wheel=0.5), "left", KEY)
    assert unexplained(checked.found) == ("distance", "light")
    assert checked.corrected == ()


def test_light_is_corrected_where_distances_are_unexplained(memory):
    """Infra-red sensors that read too little at every distance say nothing against what the light sensors read."""
    checked = check(memory, replace(BRIGHT, distance_gain=0.6, light=0.3), "left", KEY)
    assert unexplained(checked.found) == ("distance",)
    assert checked.corrected == ("light",)
    assert abs(checked.found.light_ratio - 0.3) < 3 * checked.found.light_ratio_error


def test_sensors_that_are_all_silent_are_not_dead(memory):
    """Infra-red sensors that all read 0 are not eight dead sensors, of which none could be told from the others."""
    checked = check(memory, replace(BRIGHT, distance_offset=-0.999), "left", KEY)
    assert checked.found.dead_sensors == ()
    assert unexplained(checked.found) == ("distance",)
    assert checked.corrected == ()


def test_what_cannot_be_finite_is_not_corrected(memory):
    found = check(memory, BRIGHT, "left", KEY).found
    dark = replace(found, light_ratio=0.0)
    stuck = replace(found, wheel_loss=np.array([1.0, math.nan]))
    assert [*clear(dark), *clear(stuck)] == []
    assert [*clear(replace(found, light_ratio=0.5)), *clear(replace(found, wheel_loss=np.array([0.1, 0.0])))] == [
        "light",
        "left wheel",
    ]


def corrected(readings, corrections, state=None):
    readings = readings.copy()
    corrected_readings(readings, corrections, initial_correction_state(EPUCK) if state is None else state)
    return readings


@pytest.mark.parametrize("ratio", [1.0, 0.3, 2.5])
def test_light_is_as_in_training(ratio):
    by = no_corrections(EPUCK)._replace(
        light_ratio=ratio, sun_now=sunlit(EPUCK, 0.3 * ratio), sun_training=sunlit(EPUCK, 0.3)
    )
    for heading in range(0, HEADINGS, 5):
        readings, nominal = (np.append(sun[:, heading], np.full(8, 0.1)) for sun in (by.sun_now, by.sun_training))
        after = corrected(readings, by)
        if ratio == 1:
            assert after.tobytes() == readings.tobytes()
        np.testing.assert_allclose(after, nominal, atol=1e-12)


def test_a_saturated_sensor_that_is_not_in_the_sun_sees_the_lamp():
    by = no_corrections(EPUCK)._replace(light_ratio=2.0, sun_now=sunlit(EPUCK, 0.6), sun_training=sunlit(EPUCK, 0.3))
    readings = np.append(by.sun_now[:, 0], np.full(8, 0.1))
    assert readings[3] == 1.0
    readings[3] = 0.0
    assert corrected(readings, by)[3] == 0.0


def test_darker_light_is_smoothed_as_much_as_it_is_magnified():
    by, state = no_corrections(EPUCK)._replace(light_ratio=0.25), initial_correction_state(EPUCK)
    first = corrected(np.full(16, 0.9), by, state)
    np.testing.assert_allclose(first[:8], 0.6)
    second = corrected(np.full(16, 0.8), by, state)
    np.testing.assert_allclose(second[:8], 1 - (0.1 + 0.25 * 0.1) / 0.25)
    assert (second[8:] == 0.8).all()


@pytest.mark.parametrize("places", [[3], [0, 5]])
def test_dead_sensors_are_predicted_from_the_others(places):
    samples = np.random.default_rng(0).random((2000, 16))
    dead = np.array([*places, *(8 + place for place in places)])
    others = np.setdiff1d(np.arange(16), dead)
    for n, number in enumerate(dead):
        samples[:, number] = 0.1 + 0.2 * n / 4 + 0.3 * samples[:, others[0]] + 0.2 * samples[:, others[1]] ** 2
    by = no_corrections(EPUCK)._replace(
        dead=dead, others=others, regression=regression(moments([samples[:900], samples[900:]]), 16, dead, others)
    )
    blind = samples[7].copy()
    blind[dead] = np.repeat([1.0, 0.0], len(places))
    np.testing.assert_allclose(corrected(blind, by), samples[7], atol=0.01)


REGRESSION = """
import hashlib
import numpy as np
from epuckhebb.adaptation.self_check.memory import moments, regression

exact = np.random.default_rng(0).integers(0, 65, (500, 16)) / 64  # no sum of products of four is rounded
dead = np.array([3, 11])
found = regression(moments([exact]), 16, dead, np.setdiff1d(np.arange(16), dead))
print(hashlib.sha256(found.tobytes()).hexdigest()[:16])
"""


def test_the_prediction_is_bit_identical_on_any_number_of_cores():
    found = {
        subprocess.run(
            [sys.executable, "-c", REGRESSION],
            env={**os.environ, "OPENBLAS_NUM_THREADS": threads},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for threads in ("1", "4")
    }
    assert found == {"9a5db5abd2836eae\n"}


def test_the_prediction_solves_its_equations():
    readings = np.random.default_rng(1).random((900, 16))
    dead = np.array([0, 8])
    others = np.setdiff1d(np.arange(16), dead)
    first, second = np.triu_indices(len(others))
    seen = readings[:, others]
    terms = np.column_stack([np.ones(len(seen)), seen, seen[:, first] * seen[:, second]])
    squares = terms.T @ terms / len(terms) + 1e-4 * np.eye(terms.shape[1])
    wanted = np.linalg.solve(squares, terms.T @ readings[:, dead] / len(terms)).T
    found = regression(moments([readings]), 16, dead, others)
    np.testing.assert_allclose(found[:, 0], wanted[:, : 1 + len(others)], atol=1e-11)
    np.testing.assert_allclose(found[:, 1 + first, 1 + second], wanted[:, 1 + len(others) :], atol=1e-11)


@pytest.mark.thorough
def test_a_wheel_that_is_known_to_be_weak_turns_as_an_intact_one(genomes, run_lifetime):
    assert corrected_wheel(6.28)(0.7, 0.0, 4.0) == 0.7
    assert corrected_wheel(6.28)(0.9, 0.5, 4.0) == 1.57  # no faster than the motor
    _, intact = run_lifetime(genomes[0], seconds=6, controller=GA_ALONE, gain_rad_s=4)
    weak = Scenario(left_wheel=0.9)
    loss = no_corrections(EPUCK)._replace(left_loss=0.1)
    _, samples = run_lifetime(genomes[0], seconds=6, controller=CHECKS, gain_rad_s=4, scenario=weak, corrections=loss)
    np.testing.assert_allclose(samples.pose, intact.pose, atol=1e-9)


@pytest.mark.parametrize(
    ("fault", "adaptation"),
    first_of(
        [
            ({"left_wheel": 0.9, "light": 0.3, "dead_sensors": (2,)}, {"self_check": True}),
            ({"light": 2.0, "dead_sensors": (0,)}, {"self_check": True}),
            (
                {"right_wheel": 0.9},
                {"self_check": True, "change_signal": "novelty", "threshold": 0.1, "active_s": 2, "rest_s": 1}
                | {"exploration": Exploration.wall_following},
            ),
        ],
        2,
    ),
)
def test_agrees_with_the_oracle(genomes, memory, in_training, fault, adaptation):
    world, controller = replace(BRIGHT, **fault), by(**adaptation)
    checked = check(memory, world, "right", KEY)
    nominal = no_nominal(16) if controller.adaptation.needs_nominal else None
    individual = Individual(
        genes=genomes[0],
        side="right",
        key=KEY,
        controller=controller,
        corrections=checked.corrections,
        start=checked.end,
        nominal=nominal,
        record=True,
    )
    [(outcome, samples)] = run_lifetimes([individual], world, Lifetime(duration_s=10, gain_rad_s=4, record_every=1))
    robot = reference.Robot(
        genomes[0], world, "right", controller, gain=4, key=KEY, nominal=nominal, in_training=(memory, in_training)
    )
    np.testing.assert_allclose(robot.loss, [checked.corrections.left_loss, checked.corrections.right_loss], atol=1e-9)
    assert robot.ratio == pytest.approx(checked.corrections.light_ratio, abs=1e-9)
    expected, steps = reference.live(robot, len(samples.time))
    np.testing.assert_allclose(samples.sensors, [s[3] for s in steps], rtol=0, atol=1e-6)
    np.testing.assert_allclose(samples.pose, [s[:3] for s in steps], rtol=0, atol=1e-7)
    np.testing.assert_allclose(outcome[: len(expected)], expected, rtol=1e-6, atol=1e-7)


@pytest.mark.thorough
def test_a_late_robot_follows_the_nearer_wall_and_others_do_not(genomes, run_lifetime):
    never_late = no_nominal(16)
    late = never_late._replace(time_to_goal_s=0.5)
    follows = by(change_signal="late", threshold=1.0, exploration=Exploration.wall_following)
    both = {"seconds": 8, "gain_rad_s": 4, "controller": follows}
    _, alone = run_lifetime(genomes[0], seconds=8, gain_rad_s=4, controller=GA_ALONE)
    assert run_lifetime(genomes[0], **both, nominal=never_late)[1].pose.tobytes() == alone.pose.tobytes()
    _, samples = run_lifetime(genomes[0], **both, nominal=late)
    parts = np.flatnonzero((samples.pose != alone.pose).any(axis=1))[0]
    assert parts * STEP_S == pytest.approx(0.5, abs=0.1)
    nearest = samples.sensors[parts + 60 :, 8:].max(axis=1)
    assert 0.15 < np.median(nearest) < 0.6  # it keeps a wall at 0.3


def test_walls_are_followed_on_the_side_that_is_nearer():
    follow, hand = wall_following(EPUCK), np.zeros(1)
    near = np.zeros(16)
    near[8 + 2] = 0.5
    assert follow(near, hand) == pytest.approx((5 * 0.6, 5.0))  # too near a wall on the right: away from it
    assert hand[0] == -1
    near[8 + 5] = 0.9
    assert follow(near, hand) == pytest.approx((5.0, 5 * 0.8))  # a narrow way: to its middle
    near[8] = 0.4
    assert follow(near, hand) == pytest.approx((-5.0, 5.0))  # something ahead: turn on the spot
    few = EPUCK.distance.places[:2]
    blind = replace(EPUCK, sensors=(LightSensors(places=few), DistanceSensors(places=few)))
    with pytest.raises(ValueError, match="robot epuck"):
        wall_following(blind)


def test_a_calibration_that_counts_is_the_beginning_of_the_lifetime(genomes, memory):
    lifetime = Lifetime(duration_s=10, gain_rad_s=4, record_every=4)
    checks = self_checks(memory, BRIGHT, 1.0, repeats=1, seed=1)
    after, counted = by(self_check=True), replace(by(self_check=True, calibration_counts=True), name="y")
    metrics, traces = evaluate(genomes[0], BRIGHT, [after, counted], lifetime, repeats=1, seed=1, checks=checks)
    one, other = (traces.samples.pose[[name == wanted for name in traces.controller]] for wanted in "xy")
    manoeuvres = [checks[False, side, 0].calibration.poses[:-1:4] for side in ("left", "right")]
    np.testing.assert_array_equal(other[:, : len(STEPS) // 4], manoeuvres)
    np.testing.assert_allclose(other[:, len(STEPS) // 4], one[:, 0], atol=1e-9)
    assert all(row["path_length_m"] > 0 for row in metrics if row["controller"] == "y")
    with pytest.raises(ValueError, match="needs those of"):
        evaluate(genomes[0], BRIGHT, [after], lifetime, repeats=1, seed=1)


def test_a_careful_robot_turns_back_and_corrects_dead_sensors_alone_where_readings_are_unexplained(memory):
    def checked(world, careful, key):
        return check(memory, world, "left", np.uint64(key), careful=careful)

    def turned(world, careful):
        ends = [checked(world, careful, key).end.heading for key in range(8)]
        return np.abs(np.degrees(np.array(ends) - T_MAZE.start.heading)).mean()

    slipping = replace(BRIGHT, left_slip=0.4)
    assert turned(slipping, careful=True) < 5 < turned(slipping, careful=False)
    usual, careful = (checked(BRIGHT, kind, 4) for kind in (False, True))
    assert (usual.end, usual.corrected) == (careful.end, careful.corrected)
    assert not careful.turned_back
    unlike = replace(BRIGHT, light=0.5, dead_sensors=(6,), distance_gain=1.3)
    usual, careful = (checked(unlike, kind, 4) for kind in (False, True))
    assert unexplained(careful.found) == ("distance",)
    assert usual.corrected == ("light", "dead sensors")
    assert careful.corrected == ("dead sensors",)


def test_a_world_without_space_for_the_manoeuvre_is_refused(memory, lidar):
    narrow = replace(T_MAZE, start=Pose(-0.003, -0.35, math.pi / 2))
    with pytest.raises(ValueError, match=r"7\.1 mm into a wall"):
        check_space(Scenario(maze=narrow))
    assert can_check_itself(BRIGHT)
    assert not can_check_itself(Scenario(maze=narrow))
    assert not can_check_itself(Scenario(robot=lidar))
    with pytest.raises(ValueError, match="robot epuck_lidar"):
        check(memory, Scenario(robot=lidar), "left", KEY)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"light_ratio": math.inf}, "light_ratio = inf"),
        ({"left_loss": math.nan}, "left_loss = nan"),
        ({"light_ratio": 0.0}, "above 0, got 0"),
        ({"right_loss": 1.0}, "right_loss = 1"),
        ({"others": np.arange(12)}, "robot epuck"),
    ],
)
def test_invalid_corrections_are_refused(wrong, message):
    corrections = no_corrections(EPUCK)._replace(**wrong)
    with pytest.raises(ValueError, match=message):
        check_corrections(corrections, EPUCK)


def test_findings_are_a_table_and_words(memory):
    world = replace(BRIGHT, left_wheel=0.9, light=0.5, dead_sensors=(6,))
    table = findings(self_checks(memory, world, 1.0, repeats=2, seed=1))
    assert [[row["side"], row["repeat"], row["lamp"]] for row in table] == [
        ["left", 0, "off"],
        ["left", 1, "off"],
        ["right", 0, "on"],
        ["right", 1, "on"],
    ]
    words = "left wheel 10 % slow, light 0.5 times that in training, sensor 6 dead"
    assert in_words(table) == {"left": [(words, 2)], "right": [(words, 2)]}
    nothing = {"corrected": "", "unexplained": "", "dead_sensors": ""}
    assert text(nothing) == "no change"
    assert text({**nothing, "unexplained": "light"}) == "light readings unexplained"


@pytest.mark.thorough
def test_as_a_user_meets_it(here):
    brief = ["lifetime.duration_s=3", "lifetime.record_every=0", "repeats=1"]
    run = done("evaluate", "adaptation=best", "scenario=lowlight", *brief, "hydra.run.dir=run")
    assert "it runs 10 lifetimes a side in highlight first" in run.stderr
    assert (here / "run" / "findings.csv").read_text().count(",light,") == 2
    shown = call("show", "run").stdout
    assert "light 0.1 times that in training" in " ".join(shown.split())


def test_the_file_of_a_champion_holds_the_memory(memory, tmp_path, genomes):
    champion = genome.Genome(genes=genomes[0], name="x", self_memory=memory)
    (tmp_path / "champion.npz").write_bytes(genome.champion_file(champion, 0.5, "light", 1, 3))
    again = genome.load_genome(str(tmp_path), "light")
    assert again.self_memory_sha256 == champion.self_memory_sha256 != ""
    for name, value in vars(memory).items():
        np.testing.assert_array_equal(value, getattr(again.self_memory, name))


def test_the_page_of_a_replay_says_what_was_found(genomes, memory, tmp_path):
    weak = replace(BRIGHT, left_wheel=0.9)
    checks = self_checks(memory, weak, 1.0, repeats=1, seed=1)
    pd.DataFrame(findings(checks)).to_csv(tmp_path / "findings.csv", index=False)
    config = typed(composed("evaluate", ["adaptation=self_check", "scenario=highlight_weak"]), EvaluateConfig)
    found = sentences_of(Run(tmp_path), config)
    sentence = "Before its life, the robot with “self_check” found: left wheel 10 % slow."
    assert found == {"left": sentence, "right": sentence}
    lifetime = Lifetime(duration_s=1, gain_rad_s=4, record_every=8)
    _, traces = evaluate(genomes[0], weak, config.controllers, lifetime, repeats=1, seed=1, checks=checks)
    shown = page(traces, genomes[0], weak, "title", gain_rad_s=4, found=found)
    content = json.loads(re.search(r'<script type="application/json" id="data">(.*?)</script>', shown, re.DOTALL)[1])
    assert content["outcomes"]["left"].endswith(sentence)
    assert {one["note"] for one in content["controllers"]} == {"its weights stay at their initial values"}
