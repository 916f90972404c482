"""What can be wrong with a robot and its world: against the oracle, and against what each fault is meant to do."""

import math
from dataclasses import replace

import numba
import numpy as np
import pytest
import reference

from epuckhebb.controller.random import Stream, key
from epuckhebb.tmaze.faults import FAR, SLIPPING, SPELL, Faults, grip, initial_past, sensor_faults
from epuckhebb.tmaze.individual import GA_ALONE
from epuckhebb.tmaze.robot import EPUCK, STEP_S
from epuckhebb.tmaze.scenario import Scenario

FAULTS = {
    "two dead sensors": {"dead_sensors": (7, 2)},
    "infra-red": {"distance_gain": 1.4, "distance_offset": -0.05},
    "slip": {"left_slip": 0.3, "right_slip": 0.6},
    "mass": {"mass_ratio": 5.0},
    "friction": {"wall_friction": 0.3},
    "readings": {"left_distance_gain": 0.6, "crosstalk": 0.2, "sensor_levels": 16, "sensor_delay_steps": 3},
    "late wheels": {"wheel_delay_steps": 3},
    "lights": {"sun_turn_deg": 50.0, "second_lamp": (-0.3, 0.55, 0.2), "light": 0.3},
    "all": {
        "dead_sensors": (0,),
        "distance_gain": 0.7,
        "distance_offset": 0.04,
        "left_wheel": 0.9,
        "right_slip": 0.4,
        "mass_ratio": 3.0,
        "wall_friction": 0.1,
    },
}
SLIPS = numba.njit(grip)  # whole numbers wrap around


@pytest.mark.parametrize("fault", FAULTS)
def test_agrees_with_the_oracle(genomes, run_lifetime, beside_the_oracle, fault):
    settings = {"controller": GA_ALONE, "seconds": 30.0, "key": 9}
    outcome, *_ = beside_the_oracle(genomes[3], "left", Scenario(obstacles=4, **FAULTS[fault]), **settings)
    whole, _ = run_lifetime(genomes[3], "left", scenario=Scenario(obstacles=4), gain_rad_s=4.0, **settings)
    assert outcome != whole


@pytest.mark.parametrize(("gain", "offset"), [(0.5, 0.0), (1.0, 0.3), (1.0, -0.2), (9.0, -0.1)])
def test_gain_and_offset_are_of_distance_readings_alone(gain, offset):
    readings = np.linspace(0.0, 1.0, 16)
    expected = np.append(readings[:8], np.clip(gain * readings[8:] + offset, 0, 1))
    wrong = Faults(np.empty(0, int), distance_gain=gain, distance_offset=offset)
    sensor_faults(EPUCK)(readings, wrong, initial_past(EPUCK), 0)
    np.testing.assert_allclose(readings, expected, rtol=1e-12)


def test_a_heavy_robot_is_slow_to_follow(run_lifetime, constant):
    """What is left of the way to the commanded speed shrinks by the same share at every step."""
    poses = [
        run_lifetime(constant(0.9, 0.9), scenario=Scenario(mass_ratio=ratio), seconds=3.2, noise=0)[1].pose
        for ratio in (1, 4)
    ]
    (full, *_), speeds = np.diff(poses[0][:, 1])[1:], np.diff(poses[1][:, 1])[1:] / STEP_S
    left = 1 - speeds / (full / STEP_S)
    np.testing.assert_allclose(left, 0.75 ** np.arange(1, len(left) + 1), rtol=0, atol=1e-9)


def test_mass_by_itself_changes_nothing(genomes):
    """So a heavier robot needs its slow drive to be distinguished from a light one; the plain oracle agrees."""
    heavy = replace(EPUCK, mass_kg=3 * EPUCK.mass_kg, inertia_kg_m2=3 * EPUCK.inertia_kg_m2)
    for friction in (0.0, 0.3):
        pair = [
            reference.Robot(genomes[1], Scenario(robot=kind, wall_friction=friction), "left", GA_ALONE, gain=4.0)
            for kind in (EPUCK, heavy)
        ]
        (ours, one), (theirs, other) = (reference.live(robot, 400) for robot in pair)
        assert ours[7] > 0  # it has touched a wall
        np.testing.assert_allclose([s[:3] for s in one], [s[:3] for s in other], rtol=0, atol=1e-9)
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-9)


def test_a_wheel_slips_in_spells_for_its_share_of_the_time():
    keys = [key(seed, Stream.evaluation_noise) for seed in (1, 2)]
    spells = [[SLIPS(0.2, key_, SPELL * k, wheel) for k in range(5000)] for key_ in keys for wheel in (0, 1)]
    assert set(spells[0]) == {1.0, SLIPPING}
    for one in spells:
        assert np.mean(np.array(one) == SLIPPING) == pytest.approx(0.2, abs=0.02)
    assert np.abs(np.corrcoef(spells) - np.eye(4)).max() < 0.05
    for k in range(20):
        assert {SLIPS(0.2, keys[0], step, 0) for step in range(SPELL * k, SPELL * (k + 1))} == {spells[0][k]}
    assert {SLIPS(0.0, keys[0], SPELL * k, 0) for k in range(100)} == {1.0}


def test_slips_are_drawn_where_no_other_noise_is():
    """Sensor noise takes a number or a few a step, exploration four a step from 2^40 on; see `controller.random`."""
    longest = 1e6 / STEP_S
    assert 1000 * longest < 4 * 2**40 < 4 * (2**40 + longest) < FAR
    assert FAR + 2 * longest < 2**63


def test_noise_of_sensors_does_not_depend_on_slips(run_lifetime, constant):
    plain, slipping = (
        run_lifetime(constant(0.0, 0.0), scenario=Scenario(left_slip=slip, right_slip=slip))[1] for slip in (0.0, 0.5)
    )
    assert plain.sensors.tobytes() == slipping.sensors.tobytes()
    assert math.isclose(float(np.ptp(plain.pose)), float(np.ptp(slipping.pose)))
